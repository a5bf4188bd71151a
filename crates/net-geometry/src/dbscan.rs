//! Density-based clustering (Ester et al. 1996).

use nalgebra::Vector2;

use crate::nearest::NearestPoints;

/// DBSCAN on points of the plane, with its buffers kept between calls: it allocates nothing once it has met as many
/// points.
#[derive(Debug, Clone, Default)]
pub struct Dbscan {
    neighbours: NearestPoints,
    /// Points of the cluster at hand whose neighbours are still to be visited.
    stack: Vec<u32>,
    /// Neighbours of one of them.
    near: Vec<usize>,
}

impl Dbscan {
    /// Cluster label of each point into `labels` (cleared first): `None` is noise. Clusters are numbered in the order
    /// of their first core point. Two points are neighbours when at most `radius(index of the first)` apart; a point
    /// counts itself. Returns the number of clusters.
    ///
    /// A core point has at least `min_points` neighbours. With a radius of each point's own, its circle decides whom it
    /// takes along: a point with a large circle may take one with a small circle that would not take it. Points that
    /// are not finite, and points whose radius is negative or NaN, take nobody along; the former are always noise.
    pub fn cluster(
        &mut self,
        points: &[Vector2<f64>],
        radius: impl Fn(usize) -> f64,
        min_points: usize,
        labels: &mut Vec<Option<u32>>,
    ) -> u32 {
        let Self { neighbours, stack, near } = self;
        neighbours.fill(points);
        labels.clear();
        labels.resize(points.len(), None);
        let mut clusters = 0;
        for seed in 0..points.len() {
            if labels[seed].is_some() || !points[seed].x.is_finite() || !points[seed].y.is_finite() {
                continue;
            }
            stack.clear();
            stack.push(seed as u32);
            while let Some(i) = stack.pop() {
                let i = i as usize;
                near.clear();
                near.extend(neighbours.within(points[i], radius(i)));
                if near.len() < min_points {
                    continue;
                }
                labels[i] = Some(clusters);
                for &j in &*near {
                    if labels[j].is_none() {
                        labels[j] = Some(clusters);
                        stack.push(j as u32);
                    }
                }
            }
            // Only a core point has labelled itself.
            clusters += u32::from(labels[seed].is_some());
        }
        clusters
    }
}
