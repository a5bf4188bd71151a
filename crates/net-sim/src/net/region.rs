//! Which part of the net plane the camera can see.

use nalgebra::{Matrix2, Vector2, Vector3};
use net_geometry::{Camera, Mesh, Pose};

/// Nets are drawn to this far beyond the picture, px: what blurs or moves into it starts there.
pub(crate) const MARGIN_PX: f64 = 48.0;
/// Spacing of the rays that probe the view, px.
const PROBE_PX: f64 = 16.0;

/// A convex piece of the net plane in lattice coordinates (cells along both mesh directions), and the net's own end.
#[derive(Debug, Default)]
pub(crate) struct Region {
    /// Corners, cells, in order.
    hull: Vec<Vector2<f64>>,
    /// Where the optical axis meets the plane, cells.
    foot: Vector2<f64>,
    scratch: Vec<Vector2<f64>>,
}

impl Region {
    /// Finds what the camera sees of the plane `Z = 0` no farther away than `far_m`.
    pub(crate) fn look(&mut self, camera: &Camera, pose: &Pose, mesh: &Mesh, far_m: f64) {
        self.scratch.clear();
        let plane = pose.plane();
        let cells_from_net = Matrix2::from_columns(&[mesh.a1(), mesh.a2()]).try_inverse().unwrap_or_default();
        let foot = plane.range().map(|range_m| pose.inverse_transform(Vector3::z() * range_m).xy());
        self.foot = cells_from_net * foot.unwrap_or_default();
        let steps = |size: u32| ((f64::from(size) + 2.0 * MARGIN_PX) / PROBE_PX).ceil() as usize;
        for row in 0..=steps(camera.height()) {
            for column in 0..=steps(camera.width()) {
                let pixel = Vector2::new(column as f64, row as f64) * PROBE_PX - Vector2::repeat(MARGIN_PX);
                let Some(ray) = camera.ray_from_pixel(pixel) else { continue };
                // Depth along z, and the ray has z = 1.
                let Some(depth) = plane.depth_along(ray).filter(|&d| d * ray.norm() <= far_m) else { continue };
                let point: Vector3<f64> = pose.inverse_transform(ray * depth);
                self.scratch.push(cells_from_net * point.xy());
            }
        }
        convex_hull(&mut self.scratch, &mut self.hull);
    }

    /// Columns and rows that hold the view and a tenth more, for nets that leave their plane.
    pub(crate) fn bounds(&self) -> Option<([i32; 2], [i32; 2])> {
        let ends = |of: fn(&Vector2<f64>) -> f64| {
            let low = self.hull.iter().map(of).fold(f64::INFINITY, f64::min);
            let high = self.hull.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
            let more = 0.1 * (high - low) + 2.0;
            clip((low - more).floor(), (high + more).ceil(), None, of(&self.foot)).map(|(low, high)| [low, high])
        };
        Some((ends(|p| p.x)?, ends(|p| p.y)?))
    }

    /// First and last row of knots in view, `None` if there is none.
    pub(crate) fn rows(&self, ends: Option<[i32; 2]>) -> Option<(i32, i32)> {
        let low = self.hull.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
        let high = self.hull.iter().map(|p| p.y).fold(f64::NEG_INFINITY, f64::max);
        clip(low.floor(), high.ceil(), ends, self.foot.y)
    }

    /// First and last knot in view of row `j`, one more than the view at each end.
    pub(crate) fn columns(&self, j: i32, ends: Option<[i32; 2]>) -> Option<(i32, i32)> {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        // The band between the neighbouring rows: a row that only touches a corner of the view counts too.
        for y in [f64::from(j) - 1.0, f64::from(j), f64::from(j) + 1.0] {
            for k in 0..self.hull.len() {
                let (a, b) = (self.hull[k], self.hull[(k + 1) % self.hull.len()]);
                if (a.y - f64::from(j)).abs() <= 1.0 {
                    low = low.min(a.x);
                    high = high.max(a.x);
                }
                if (a.y - y) * (b.y - y) < 0.0 {
                    let x = a.x + (b.x - a.x) * (y - a.y) / (b.y - a.y);
                    low = low.min(x);
                    high = high.max(x);
                }
            }
        }
        clip(low.floor() - 1.0, high.ceil() + 1.0, ends, self.foot.x)
    }
}

/// At most so many knots along a direction: of a net seen edge-on or from very far there would be no end.
const MOST_KNOTS: i32 = 1000;

/// Whole numbers from `low` to `high`, within `limits`, and no more than [`MOST_KNOTS`] around `middle`.
fn clip(low: f64, high: f64, limits: Option<[i32; 2]>, middle: f64) -> Option<(i32, i32)> {
    if !(low.is_finite() && high.is_finite()) {
        return None;
    }
    let [first, last] = limits.unwrap_or([i32::MIN / 4, i32::MAX / 4]);
    // The casts saturate; a quarter of the whole range leaves room to add.
    let end = i32::MAX / 4;
    let (low, high) = ((low as i32).clamp(-end, end).max(first), (high as i32).clamp(-end, end).min(last));
    let middle = (middle as i32).clamp(-end, end);
    let (low, high) = (low.max(middle - MOST_KNOTS / 2), high.min(middle + MOST_KNOTS / 2));
    (low <= high).then_some((low, high))
}

/// Convex hull by monotone chains (Andrew 1979); sorts `points`.
fn convex_hull(points: &mut [Vector2<f64>], hull: &mut Vec<Vector2<f64>>) {
    hull.clear();
    points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let turn = |a: Vector2<f64>, b: Vector2<f64>, c: Vector2<f64>| (b - a).perp(&(c - a));
    let mut chain = |points: &mut dyn Iterator<Item = Vector2<f64>>| {
        let base = hull.len();
        for p in points {
            while hull.len() >= base + 2 && turn(hull[hull.len() - 2], hull[hull.len() - 1], p) <= 0.0 {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
    };
    chain(&mut points.iter().copied());
    chain(&mut points.iter().rev().copied());
}
