//! The knots in view, row by row.

use nalgebra::{Vector2, Vector3};
use net_geometry::{Camera, Pose};

use super::fabric::Fabric;
use super::region::{MARGIN_PX, Region};
use crate::random::{Addressed, Stream};
use crate::scene::Net;

/// Knots nearer than this are not drawn, m: the twine would fill the view.
const NEAR_M: f64 = 0.02;
/// Bent nets are laid out from their origin, and no farther from it than so many knots.
const MOST_KNOTS: i32 = 1000;

/// A knot.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    /// In the camera frame, m.
    pub(crate) point: Vector3<f64>,
    /// In the picture; NaN where there is no knot, behind the camera, or beyond the lens.
    pub(crate) pixel: Vector2<f64>,
}

/// Knots `first..first + len` of a row, at `start` in the list.
#[derive(Debug, Clone, Copy)]
struct Row {
    first: i32,
    len: usize,
    start: usize,
}

/// The knots of one net that are in view or near it.
#[derive(Debug, Default)]
pub(crate) struct Lattice {
    first_row: i32,
    rows: Vec<Row>,
    nodes: Vec<Node>,
}

impl Lattice {
    /// Lays out the knots of `net` and projects them.
    pub(crate) fn lay_out(
        &mut self,
        net: &Net,
        fabric: &mut Fabric,
        pose: &Pose,
        camera: &Camera,
        region: &mut Region,
        far_m: f64,
    ) {
        self.rows.clear();
        self.nodes.clear();
        region.look(camera, pose, fabric.mesh(), far_m);
        if net.surface.is_flat() {
            self.lay_out_flat(net, fabric, pose, camera, region);
        } else {
            self.lay_out_bent(net, fabric, pose, camera, region, far_m);
        }
    }

    /// Row by row as far as the view goes.
    fn lay_out_flat(&mut self, net: &Net, fabric: &Fabric, pose: &Pose, camera: &Camera, region: &Region) {
        let Some((first_row, last_row)) = region.rows(net.extent.rows()) else { return };
        self.first_row = first_row;
        for j in first_row..=last_row {
            let (first, last) = region.columns(j, net.extent.columns()).unwrap_or((0, -1));
            self.push_row(net, fabric, pose, camera, j, [first, last], f64::INFINITY);
        }
    }

    /// A rectangle of knots, widened until its border is out of sight.
    fn lay_out_bent(
        &mut self,
        net: &Net,
        fabric: &mut Fabric,
        pose: &Pose,
        camera: &Camera,
        region: &Region,
        far_m: f64,
    ) {
        let Some((mut columns, mut rows)) = region.bounds() else { return };
        let limit = |[low, high]: [i32; 2], ends: Option<[i32; 2]>| {
            let [first, last] = ends.unwrap_or([-MOST_KNOTS, MOST_KNOTS]);
            [low.max(first).max(-MOST_KNOTS), high.min(last).min(MOST_KNOTS)]
        };
        for _ in 0..5 {
            columns = limit(columns, net.extent.columns());
            rows = limit(rows, net.extent.rows());
            if columns[0] > columns[1] || rows[0] > rows[1] {
                return;
            }
            // Three knots more for those who interpolate near the border.
            fabric.lay(net, [columns[0] - 3, columns[1] + 3], [rows[0] - 3, rows[1] + 3]);
            self.rows.clear();
            self.nodes.clear();
            self.first_row = rows[0];
            for j in rows[0]..=rows[1] {
                self.push_row(net, fabric, pose, camera, j, columns, far_m);
            }
            let seen = |i: i32, j: i32| self.node(i, j).is_some_and(|n| near_picture(n.pixel, camera));
            let more = |span: [i32; 2]| (span[1] - span[0]) / 6 + 6;
            let (left, right) =
                ((rows[0]..=rows[1]).any(|j| seen(columns[0], j)), (rows[0]..=rows[1]).any(|j| seen(columns[1], j)));
            let (top, bottom) = (
                (columns[0]..=columns[1]).any(|i| seen(i, rows[0])),
                (columns[0]..=columns[1]).any(|i| seen(i, rows[1])),
            );
            if !(left || right || top || bottom) {
                break;
            }
            let (wide, high) = (more(columns), more(rows));
            let grown = |[low, high]: [i32; 2], at_low: bool, at_high: bool, by: i32| {
                [low - i32::from(at_low) * by, high + i32::from(at_high) * by]
            };
            let (wider, higher) = (grown(columns, left, right, wide), grown(rows, top, bottom, high));
            if limit(wider, net.extent.columns()) == columns && limit(higher, net.extent.rows()) == rows {
                break;
            }
            (columns, rows) = (wider, higher);
        }
    }

    fn push_row(
        &mut self,
        net: &Net,
        fabric: &Fabric,
        pose: &Pose,
        camera: &Camera,
        j: i32,
        [first, last]: [i32; 2],
        far_m: f64,
    ) {
        self.rows.push(Row { first, len: (last - first + 1) as usize, start: self.nodes.len() });
        let (a1, a2) = (fabric.mesh().a1(), fabric.mesh().a2());
        let along = [Addressed::new(net.seed, Stream::JitterX), Addressed::new(net.seed, Stream::JitterY)];
        for i in first..=last {
            let knot = fabric.knot(i, j).map(|ideal| {
                if net.jitter == 0.0 {
                    return ideal;
                }
                let [x, y] = along.map(|a| net.jitter * a.normal(i64::from(i), i64::from(j), 0));
                let off = a1 * x + a2 * y;
                ideal + Vector3::new(off.x, off.y, fabric.sheet().height(ideal.xy()).1.dot(&off))
            });
            let point = knot.map_or(Vector3::repeat(f64::NAN), |k| pose.transform(k));
            let visible = point.z >= NEAR_M && point.norm() <= far_m;
            let pixel = if visible { camera.pixel_from_point(point) } else { None };
            self.nodes.push(Node { point, pixel: pixel.unwrap_or(Vector2::repeat(f64::NAN)) });
        }
    }

    /// Knot `(i, j)`, `None` where there is no net or no view of it.
    #[inline]
    pub(crate) fn node(&self, i: i32, j: i32) -> Option<&Node> {
        let row = self.rows.get(usize::try_from(j.checked_sub(self.first_row)?).ok()?)?;
        let k = usize::try_from(i.checked_sub(row.first)?).ok()?;
        if k >= row.len {
            return None;
        }
        self.nodes.get(row.start + k).filter(|n| n.pixel.x.is_finite())
    }

    /// All knots that have a pixel, with their indices, row by row.
    pub(crate) fn iter(&self) -> impl Iterator<Item = ((i32, i32), &Node)> {
        self.rows.iter().zip(self.first_row..).flat_map(move |(row, j)| {
            let nodes = &self.nodes[row.start..row.start + row.len];
            nodes.iter().zip(row.first..).map(move |(node, i)| ((i, j), node)).filter(|(_, n)| n.pixel.x.is_finite())
        })
    }

    /// First and last row.
    pub(crate) fn row_range(&self) -> (i32, i32) {
        (self.first_row, self.first_row + self.rows.len() as i32 - 1)
    }

    /// First and last column of any row.
    pub(crate) fn column_range(&self) -> (i32, i32) {
        let rows = self.rows.iter().filter(|r| r.len > 0);
        let first = rows.clone().map(|r| r.first).min().unwrap_or(0);
        let last = rows.map(|r| r.first + r.len as i32 - 1).max().unwrap_or(-1);
        (first, last)
    }
}

/// Whether something there can reach into the picture.
fn near_picture(p: Vector2<f64>, camera: &Camera) -> bool {
    let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
    p.x > -MARGIN_PX && p.y > -MARGIN_PX && p.x < width + MARGIN_PX && p.y < height + MARGIN_PX
}
