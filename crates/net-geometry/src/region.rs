//! Which part of an endless net a camera can see.

use std::ops::RangeInclusive;

use nalgebra::{Vector2, Vector3};

use crate::camera::Camera;
use crate::lattice::Lattice;
use crate::lens::Lens;

/// Nodes whose depth is not above this, m, are not looked at.
const NEAREST_DEPTH: f64 = 1e-3;

/// Planes around what is looked at: the four sides of the view, depth, and how far to the side.
const PLANES: usize = 10;

/// Half-planes `c0 + c1 i + c2 j >= 0` of lattice coordinates that hold all nodes in view (and some more).
pub(crate) struct Region {
    bounds: [Vector3<f64>; PLANES],
    /// Least and greatest j of the polygon that they enclose.
    rows: (f64, f64),
}

impl Region {
    /// `None` if nothing of the net lies in view where its cells are large enough.
    pub(crate) fn new(lattice: &Lattice, camera: &Camera, min_cell_px: f64) -> Option<Self> {
        let rotation = lattice.pose.rotation;
        let (a1, a2) = (rotation * lattice.mesh.a1().push(0.0), rotation * lattice.mesh.a2().push(0.0));
        let origin = lattice.pose.translation;
        let [x0, x1, y0, y1] = camera.view_box();
        let corner = Vector3::new(x0.abs().max(x1.abs()), y0.abs().max(y1.abs()), 1.0).norm();
        // A side at depth z is at most so many focal lengths over z long in the picture: of a pinhole, when it points
        // at the camera in the corner of the view; of a fisheye, when it lies across at 90 degrees off the axis; twice
        // that for what a lens may add.
        let (stretch, to_the_side) = match camera.lens() {
            Lens::None => (corner, 1e9),
            _ => (corner.min(2.0) * 2.0, 1.0),
        };
        let side = lattice.mesh.side1().max(lattice.mesh.side2());
        let farthest = stretch * camera.fx().max(camera.fy()) * side / min_cell_px;
        let aside = farthest * to_the_side;
        // Planes of the camera frame, inward: n·P + d >= 0.
        let frustum: [_; PLANES] = [
            (Vector3::new(1.0, 0.0, -x0), 0.0),
            (Vector3::new(-1.0, 0.0, x1), 0.0),
            (Vector3::new(0.0, 1.0, -y0), 0.0),
            (Vector3::new(0.0, -1.0, y1), 0.0),
            (Vector3::z(), -NEAREST_DEPTH),
            (-Vector3::z(), farthest),
            (Vector3::x(), aside),
            (-Vector3::x(), aside),
            (Vector3::y(), aside),
            (-Vector3::y(), aside),
        ];
        let bounds = frustum.map(|(n, d)| Vector3::new(n.dot(&origin) + d, n.dot(&a1), n.dot(&a2)));
        if !bounds.iter().all(|b| b.iter().all(|x| x.is_finite())) {
            return None;
        }
        // Clip a square too large to matter.
        let far = f64::from(MAX_INDEX);
        let mut polygon = Polygon::square(far);
        for bound in &bounds {
            polygon = polygon.clipped(*bound);
        }
        let rows = polygon.vertices().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p.y), b.max(p.y)));
        (rows.0 <= rows.1).then_some(Self { bounds, rows })
    }

    /// The j of all rows with nodes in view.
    pub(crate) fn rows(&self) -> RangeInclusive<i32> {
        (self.rows.0 - SLACK).ceil() as i32..=(self.rows.1 + SLACK).floor() as i32
    }

    /// The i of row `j`.
    pub(crate) fn columns(&self, j: i32) -> RangeInclusive<i32> {
        let far = f64::from(MAX_INDEX);
        let (mut low, mut high) = (-far, far);
        for bound in &self.bounds {
            let rest = bound.x + bound.z * f64::from(j);
            if bound.y > 0.0 {
                low = low.max(-rest / bound.y);
            } else if bound.y < 0.0 {
                high = high.min(-rest / bound.y);
            } else if rest < 0.0 {
                high = f64::NEG_INFINITY;
            }
        }
        (low - SLACK).ceil().max(-far) as i32..=(high + SLACK).floor().max(-far - 1.0) as i32
    }
}

/// Widening of the region, cells, against rounding: what is not in view is dropped later.
const SLACK: f64 = 1e-6;

/// Nodes further from the origin are not looked at.
const MAX_INDEX: i32 = 1_000_000;

/// A convex polygon: a square, cut once by each plane.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [Vector2<f64>; 4 + PLANES],
    count: usize,
}

impl Polygon {
    fn square(half: f64) -> Self {
        let mut corners = [Vector2::zeros(); 4 + PLANES];
        for (corner, (x, y)) in corners.iter_mut().zip([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) {
            *corner = Vector2::new(x, y) * half;
        }
        Self { corners, count: 4 }
    }

    fn vertices(&self) -> impl Iterator<Item = &Vector2<f64>> {
        self.corners[..self.count].iter()
    }

    /// The part where `bound.x + bound.y x + bound.z y >= 0` (Sutherland and Hodgman 1974).
    fn clipped(&self, bound: Vector3<f64>) -> Self {
        let side = |p: &Vector2<f64>| bound.x + bound.y * p.x + bound.z * p.y;
        let mut out = Self { corners: [Vector2::zeros(); 4 + PLANES], count: 0 };
        for (k, here) in self.vertices().enumerate() {
            let next = &self.corners[(k + 1) % self.count];
            let (a, b) = (side(here), side(next));
            if a >= 0.0 {
                out.push(*here);
            }
            if (a >= 0.0) != (b >= 0.0) {
                out.push(here + (next - here) * (a / (a - b)));
            }
        }
        out
    }

    fn push(&mut self, corner: Vector2<f64>) {
        // A cut of a convex polygon adds one corner at most; where rounding makes it two, the last is left out.
        if self.count < self.corners.len() {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }
}
