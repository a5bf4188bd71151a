//! Density-based clustering (Ester et al. 1996).

use nalgebra::Vector2;

/// DBSCAN on points of the plane, with its buffers kept between calls.
#[derive(Debug, Clone, Default)]
pub struct Dbscan {
    stack: Vec<usize>,
}

impl Dbscan {
    /// Cluster label of each point into `labels` (cleared first): `None` is noise. Clusters are numbered in the order of their
    /// first core point. Two points are neighbours when at most `radius(index of the first)` apart; a point counts itself.
    /// Returns the number of clusters.
    pub fn cluster(
        &mut self,
        points: &[Vector2<f64>],
        radius: impl Fn(usize) -> f64,
        min_points: usize,
        labels: &mut Vec<Option<u32>>,
    ) -> u32 {
        let near = |i: usize, j: usize| (points[i] - points[j]).norm() <= radius(i);
        labels.clear();
        labels.resize(points.len(), None);
        let mut clusters = 0;
        for seed in 0..points.len() {
            let core = |i: usize| (0..points.len()).filter(|&j| near(i, j)).count() >= min_points;
            if labels[seed].is_some() || !core(seed) {
                continue;
            }
            self.stack.clear();
            self.stack.push(seed);
            while let Some(i) = self.stack.pop() {
                labels[i] = Some(clusters);
                if core(i) {
                    self.stack.extend((0..points.len()).filter(|&j| labels[j].is_none() && near(i, j)));
                }
            }
            clusters += 1;
        }
        clusters
    }
}
