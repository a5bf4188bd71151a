//! Corners of openings to junctions.

use net_geometry::Dbscan;
use net_geometry::nalgebra::Vector2;

use crate::contour::config::Config;
use crate::contour::shape::CellBox;

/// A group of corners that belong to one junction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Knot {
    /// Where the junction is, px.
    pub pixel: Vector2<f64>,
    /// Its standard deviation, px, each axis.
    pub sigma: f64,
    /// Number of openings that have a corner here, 1 to 4.
    pub corners: usize,
    /// Least distance to the neighbouring junctions, px.
    pub spacing: f64,
}

/// Buffers of this stage, and what it found.
#[derive(Debug, Default)]
pub(crate) struct Clusterer {
    dbscan: Dbscan,
    /// Corner `k` of box `b` is point `4 b + k`.
    points: Vec<Vector2<f64>>,
    labels: Vec<Option<u32>>,
    /// Corners in the order of their clusters, and where each cluster begins.
    members: Vec<u32>,
    starts: Vec<u32>,
    /// How far to move each box's corners out along its first and second side, parts of half a side.
    outward: Vec<Vector2<f64>>,
    /// Corners that took part in `outward`, for each box.
    corner_counts: Vec<u32>,
    ratios: [Vec<f64>; 2],
    knots: Vec<Knot>,
    /// The knot of each corner.
    knot_of_corner: Vec<Option<u32>>,
}

/// Corner errors that a junction's own few corners are pooled with count as this many of them.
const POOLED_CORNERS: f64 = 6.0;
/// No junction is claimed to be known better than this, px.
const SIGMA_MIN_PX: f64 = 0.02;

impl Clusterer {
    /// The junctions, in the order of their first corner's box.
    pub fn knots(&self) -> &[Knot] {
        &self.knots
    }

    /// The junction of corner `k` of box `b` at `4 b + k`.
    pub fn knot_of_corner(&self) -> &[Option<u32>] {
        &self.knot_of_corner
    }

    /// Groups the corners of accepted boxes.
    ///
    /// An opening's corners lie half a twine inside the junctions. With `config.move_corners` they are first moved out along both sides, by
    /// the part of a side that brings neighbours' corners together; this part is measured, for each opening and direction, at its
    /// junctions that have all four corners. A junction at the net's border, seen from one side only, is then not biased.
    pub fn cluster(&mut self, boxes: &[CellBox], config: &Config) {
        let guess = if config.move_corners { self.outward_by_area(boxes) } else { 0.0 };
        self.outward.clear();
        self.outward.resize(boxes.len(), Vector2::repeat(guess));
        self.group(boxes, config);
        if config.move_corners
            && let Some(measured) = self.measure_outward(boxes)
        {
            // Half a twine off is enough to part corners of small cells.
            if (measured - Vector2::repeat(guess)).amax() > 0.03 {
                self.group(boxes, config);
            } else {
                self.move_points(boxes);
            }
        }
        self.place(boxes, config);
    }

    fn move_points(&mut self, boxes: &[CellBox]) {
        self.points.clear();
        for (found, outward) in boxes.iter().zip(&self.outward) {
            let (half1, half2) = half_sides(&found.corners);
            let moves = [half1 * outward.x, half2 * outward.y];
            let signs = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            self.points.extend(found.corners.iter().zip(signs).map(|(c, (x, y))| c + moves[0] * x + moves[1] * y));
        }
    }

    /// DBSCAN, then at most one corner of each box and four in all per cluster.
    fn group(&mut self, boxes: &[CellBox], config: &Config) {
        self.move_points(boxes);
        let radius = |k: usize| config.eps_px.unwrap_or(config.eps_cells * boxes[k / 4].spacing);
        // One corner alone makes a cluster too when a single one is asked for.
        let least = config.min_corners.max(1);
        let clusters = self.dbscan.cluster(&self.points, radius, least, &mut self.labels) as usize;
        self.starts.clear();
        self.starts.resize(clusters + 1, 0);
        for label in self.labels.iter().flatten() {
            self.starts[*label as usize + 1] += 1;
        }
        for c in 0..clusters {
            self.starts[c + 1] += self.starts[c];
        }
        self.members.clear();
        self.members.resize(self.starts[clusters] as usize, 0);
        // `starts` serves as the cursor and is moved back afterwards.
        for (k, label) in self.labels.iter().enumerate() {
            if let Some(c) = label {
                let cursor = &mut self.starts[*c as usize];
                self.members[*cursor as usize] = k as u32;
                *cursor += 1;
            }
        }
        for c in (1..=clusters).rev() {
            self.starts[c] = self.starts[c - 1];
        }
        self.starts[0] = 0;
        for c in 0..clusters {
            let range = self.starts[c] as usize..self.starts[c + 1] as usize;
            let kept = thin_out(&mut self.members[range.clone()], &self.points);
            for &dropped in &self.members[range.start + kept..range.end] {
                self.labels[dropped as usize] = None;
            }
        }
    }

    /// Corners of cluster `c` that stayed.
    fn corners_of(&self, c: usize) -> impl Iterator<Item = usize> + Clone {
        let range = self.starts[c] as usize..self.starts[c + 1] as usize;
        let labels = &self.labels;
        self.members[range].iter().map(|&k| k as usize).filter(move |&k| labels[k] == Some(c as u32))
    }

    /// First guess from the areas: the expected cell's side over the opening's.
    fn outward_by_area(&mut self, boxes: &[CellBox]) -> f64 {
        let ratios = &mut self.ratios[0];
        ratios.clear();
        ratios.extend(boxes.iter().filter(|b| b.area > 0.0).map(|b| (b.expected_area / quad_area(b)).sqrt() - 1.0));
        median(ratios).unwrap_or(0.0).clamp(0.0, 1.0)
    }

    /// From junctions with four corners: how far beyond an opening's corner, in parts of its half sides, the junction lies. Openings
    /// without such a junction get the median, which is returned.
    fn measure_outward(&mut self, boxes: &[CellBox]) -> Option<Vector2<f64>> {
        let mut outward = std::mem::take(&mut self.outward);
        let mut ratios = std::mem::take(&mut self.ratios);
        outward.fill(Vector2::zeros());
        let mut counts = std::mem::take(&mut self.corner_counts);
        counts.clear();
        counts.resize(boxes.len(), 0_u32);
        ratios.iter_mut().for_each(Vec::clear);
        for c in 0..self.starts.len() - 1 {
            let corners = self.corners_of(c);
            if corners.clone().count() < 4 {
                continue;
            }
            let node = corners.clone().map(|k| boxes[k / 4].corners[k % 4]).sum::<Vector2<f64>>() * 0.25;
            for k in corners {
                let found = &boxes[k / 4];
                let (half1, half2) = half_sides(&found.corners);
                let (cross, d) = (half1.perp(&half2), node - found.corners[k % 4]);
                let sign = |plus: bool| if plus { 1.0 } else { -1.0 };
                let beyond = Vector2::new(
                    d.perp(&half2) / cross * sign(k % 4 == 1 || k % 4 == 2),
                    half1.perp(&d) / cross * sign(k % 4 > 1),
                );
                outward[k / 4] += beyond;
                counts[k / 4] += 1;
                ratios[0].push(beyond.x);
                ratios[1].push(beyond.y);
            }
        }
        let [x, y] = &mut ratios;
        let middle = median(x).zip(median(y)).map(|(x, y)| Vector2::new(x, y).map(|o| o.clamp(0.0, 1.0)));
        if let Some(middle) = middle {
            for (sum, &count) in outward.iter_mut().zip(&counts) {
                // The median counts as one corner more: one junction's error does not become another's bias.
                *sum = (*sum + middle) / f64::from(count + 1);
            }
        }
        (self.outward, self.ratios, self.corner_counts) = (outward, ratios, counts);
        middle
    }

    /// Means and their standard deviations.
    fn place(&mut self, boxes: &[CellBox], config: &Config) {
        self.knots.clear();
        let mut knot_of_corner = std::mem::take(&mut self.knot_of_corner);
        knot_of_corner.clear();
        knot_of_corner.resize(self.points.len(), None);
        let clusters = self.starts.len() - 1;
        let (mut squares, mut freedom) = (0.0, 0.0);
        for c in 0..clusters {
            let corners = self.corners_of(c);
            let n = corners.clone().count();
            if n >= 2 {
                let mean = corners.clone().map(|k| self.points[k]).sum::<Vector2<f64>>() / n as f64;
                squares += corners.map(|k| (self.points[k] - mean).norm_squared()).sum::<f64>();
                freedom += 2.0 * (n - 1) as f64;
            }
        }
        // Variance of one corner, each axis, over the whole picture.
        let pooled = if freedom > 0.0 { squares / freedom } else { 1.0 };
        for c in 0..clusters {
            let corners = self.corners_of(c);
            let n = corners.clone().count();
            if n < config.min_corners.max(1) {
                continue;
            }
            let mean = corners.clone().map(|k| self.points[k]).sum::<Vector2<f64>>() / n as f64;
            let own: f64 = corners.clone().map(|k| (self.points[k] - mean).norm_squared()).sum();
            let prior = 2.0 * POOLED_CORNERS;
            let variance = (own + prior * pooled) / (2.0 * (n - 1) as f64 + prior);
            let spacing = corners.clone().map(|k| boxes[k / 4].spacing).sum::<f64>() / n as f64;
            for k in corners {
                knot_of_corner[k] = Some(self.knots.len() as u32);
            }
            let sigma = (variance / n as f64).sqrt().max(SIGMA_MIN_PX);
            self.knots.push(Knot { pixel: mean, sigma, corners: n, spacing });
        }
        self.knot_of_corner = knot_of_corner;
    }
}

/// Puts the corners to keep first and returns their number: of each box the one nearest to the cluster's middle, and four at most.
fn thin_out(members: &mut [u32], points: &[Vector2<f64>]) -> usize {
    let mut kept = members.len();
    // They come in their order: those of one box side by side.
    if kept <= 4 && members.windows(2).all(|pair| pair[0] / 4 != pair[1] / 4) {
        return kept;
    }
    loop {
        let middle = members[..kept].iter().map(|&k| points[k as usize]).sum::<Vector2<f64>>() / kept.max(1) as f64;
        let distance = |k: u32| (points[k as usize] - middle).norm_squared();
        // Those of one box are side by side and stay so.
        let shares = |m: usize| {
            let same = |o: usize| members[o] / 4 == members[m] / 4;
            (m > 0 && same(m - 1)) || (m + 1 < kept && same(m + 1))
        };
        // The farthest among those that share their box; if none does, among all.
        let worst = |shared: bool| {
            (0..kept)
                .filter(|&m| !shared || shares(m))
                .max_by(|&a, &b| distance(members[a]).total_cmp(&distance(members[b])))
        };
        match worst(true).or_else(|| if kept > 4 { worst(false) } else { None }) {
            Some(m) => {
                // Order among the kept ones is not changed: rotate the dropped one behind them.
                members[m..kept].rotate_left(1);
                kept -= 1;
            }
            None => return kept,
        }
    }
}

/// From the middle of a box to the middles of its second and third edge.
fn half_sides(corners: &[Vector2<f64>; 4]) -> (Vector2<f64>, Vector2<f64>) {
    let [a, b, c, d] = corners;
    ((b - a + c - d) * 0.25, (d - a + c - b) * 0.25)
}

fn quad_area(found: &CellBox) -> f64 {
    let [a, b, c, d] = found.corners;
    0.5 * (c - a).perp(&(d - b)).abs().max(1e-9)
}

/// Upper median; reorders.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contour::rectangle::parallelogram_corners;
    use crate::contour::shape::Verdict;

    /// Openings of a grid of `n` x `n` cells of `cell` px, node (0, 0) at (10, 20), twine `twine` px wide.
    fn openings(n: usize, cell: f64, twine: f64) -> Vec<CellBox> {
        let half = 0.5 * (cell - twine);
        (0..n * n)
            .map(|k| {
                let centre = Vector2::new(10.0, 20.0) + Vector2::new((k % n) as f64 + 0.5, (k / n) as f64 + 0.5) * cell;
                CellBox {
                    corners: parallelogram_corners(centre, Vector2::x() * half, Vector2::y() * half),
                    area: (cell - twine).powi(2),
                    expected_area: cell * cell,
                    spacing: cell,
                    rms_px: 0.1,
                    light: true,
                    verdict: Verdict::Accepted,
                    outline: (0, 0),
                }
            })
            .collect()
    }

    #[test]
    fn junctions_lie_in_the_middle_of_the_twine_also_at_the_border() {
        for (cell, twine) in [(8.0, 3.0), (20.0, 3.0), (80.0, 4.0)] {
            let boxes = openings(5, cell, twine);
            let mut clusterer = Clusterer::default();
            let config = Config { min_corners: 1, ..Config::default() };
            clusterer.cluster(&boxes, &config);
            assert_eq!(clusterer.knots().len(), 36, "cell {cell}");
            for knot in clusterer.knots() {
                let at = (knot.pixel - Vector2::new(10.0, 20.0)) / cell;
                // Exact openings: rounding only.
                assert!((at - at.map(f64::round)).norm() * cell < 1e-9, "{at}");
            }
            clusterer.cluster(&boxes, &Config { min_corners: 3, ..config });
            assert_eq!(clusterer.knots().len(), 16);
        }
    }

    #[test]
    fn a_box_gives_a_junction_one_corner_only() {
        let mut boxes = openings(2, 20.0, 2.0);
        // An eps of two thirds of a cell chains everything together; the four corners about the middle are kept.
        let config = Config { eps_px: Some(18.5), move_corners: false, ..Config::default() };
        let mut clusterer = Clusterer::default();
        clusterer.cluster(&boxes, &config);
        assert_eq!(clusterer.knots().len(), 1);
        assert_eq!(clusterer.knots()[0].corners, 4);
        assert!((clusterer.knots()[0].pixel - Vector2::new(30.0, 40.0)).norm() < 1e-9);
        boxes.clear();
        clusterer.cluster(&boxes, &config);
        assert!(clusterer.knots().is_empty());
    }
}
