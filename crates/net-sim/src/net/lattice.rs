//! The knots in view, row by row.

use nalgebra::{Vector2, Vector3};
use net_geometry::{Camera, Mesh, Pose};

use super::region::Region;
use crate::scene::Net;

/// Knots nearer than this are not drawn, m: the twine would fill the view.
const NEAR_M: f64 = 0.02;

/// A knot.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    /// In the camera frame, m.
    pub(crate) point: Vector3<f64>,
    /// In the picture; NaN behind the camera or beyond the lens.
    pub(crate) pixel: Vector2<f64>,
}

/// Knots `first..first + len` of row `j`, at `start` in the list.
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
    /// Lays out the knots of a flat net and projects them.
    pub(crate) fn lay_out(&mut self, net: &Net, mesh: &Mesh, pose: &Pose, camera: &Camera, region: &Region) {
        self.rows.clear();
        self.nodes.clear();
        let Some((first_row, last_row)) = region.rows(&net.extent) else { return };
        self.first_row = first_row;
        for j in first_row..=last_row {
            let (first, last) = region.columns(j, &net.extent).unwrap_or((0, -1));
            self.rows.push(Row { first, len: (last - first + 1) as usize, start: self.nodes.len() });
            for i in first..=last {
                let flat = mesh.node(f64::from(i), f64::from(j));
                let point = pose.transform(Vector3::new(flat.x, flat.y, 0.0));
                let pixel = (point.z >= NEAR_M).then(|| camera.pixel_from_point(point)).flatten();
                self.nodes.push(Node { point, pixel: pixel.unwrap_or(Vector2::repeat(f64::NAN)) });
            }
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
