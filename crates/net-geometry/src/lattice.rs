//! The net's nodes in space and in the picture, and their names.

use nalgebra::{Vector2, Vector3};

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::junction::Junction;
use crate::lens::Lens;
use crate::mesh::Mesh;
use crate::pose::Pose;

/// A mesh where it hangs: node `(i, j)` lies at `i a1 + j a2` in the plane of the pose.
///
/// One and the same net can be given many ways: any node may be its origin, either family of twines its first. [`Lattice::canonical`] picks the one
/// that a single picture starts with, [`Lattice::following`] the one that continues a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    /// Net to camera.
    pub pose: Pose,
    /// The two lattice vectors.
    pub mesh: Mesh,
}

/// A node of the net as a camera sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VisibleNode {
    /// Lattice indices `(i, j)`.
    pub index: (i32, i32),
    /// Pixel `(u, v)` of the image as it was read, lens distortion included.
    pub pixel: Vector2<f64>,
    /// Depth z in the camera frame, m.
    pub depth: f64,
}

/// Nodes whose depth is not above this, m, are not looked at.
const NEAREST_DEPTH: f64 = 1e-3;

impl Lattice {
    /// Node `(i, j)` in the camera frame, m.
    #[inline]
    pub fn node_in_camera(&self, (i, j): (i32, i32)) -> Vector3<f64> {
        self.pose.transform(self.mesh.node(f64::from(i), f64::from(j)).push(0.0))
    }

    /// Pixel of node `(i, j)`, also outside the image. `None` behind the camera or beyond the lens model's range.
    #[inline]
    pub fn pixel_of_node(&self, camera: &Camera, index: (i32, i32)) -> Option<Vector2<f64>> {
        camera.pixel_from_point(self.node_in_camera(index))
    }

    /// Lattice coordinates, whole at the nodes, of the net's point seen at `pixel`. `None` if the net is not seen there.
    #[inline]
    pub fn coordinates_at(&self, camera: &Camera, pixel: Vector2<f64>) -> Option<Vector2<f64>> {
        let ray = camera.ray_from_pixel(pixel)?;
        self.pose.net_from_ray(ray).map(|point| self.mesh.coordinates(point))
    }

    /// Gives each junction the name of the node nearest to it in the net's plane, if it lies within `tolerance` of it (as a share of the shorter
    /// side); the others lose theirs. Of several near one node only the nearest gets the name. `taken` is scratch, kept between calls.
    pub fn name_junctions(
        &self,
        camera: &Camera,
        junctions: &mut [Junction],
        tolerance: f64,
        taken: &mut Vec<((i32, i32), f64, usize)>,
    ) {
        let limit = tolerance * self.mesh.side1().min(self.mesh.side2());
        taken.clear();
        for (k, junction) in junctions.iter_mut().enumerate() {
            junction.index = None;
            let Some(point) = camera.ray_from_pixel(junction.pixel).and_then(|ray| self.pose.net_from_ray(ray)) else {
                continue;
            };
            let Some(index) = self.mesh.nearest_node(point) else { continue };
            let offset = (self.mesh.node(f64::from(index.0), f64::from(index.1)) - point).norm();
            if offset <= limit {
                taken.push((index, offset, k));
            }
        }
        // By node, then by distance, then by order: the first of each node gets it.
        taken.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        let mut last = None;
        for &(index, _, k) in taken.iter() {
            if last != Some(index) {
                junctions[k].index = Some(index);
                last = Some(index);
            }
        }
    }

    /// The nodes that `camera` sees where a cell is at least `min_cell_px` high (its area in pixels over its longer side; at least 1 is taken), into
    /// `nodes` (cleared first), by rows of j, then i. Beyond, a receding net has no end.
    pub fn nodes_in_view(&self, camera: &Camera, min_cell_px: f64, nodes: &mut Vec<VisibleNode>) {
        nodes.clear();
        // NaN becomes 1 too.
        let min_cell_px = min_cell_px.max(1.0);
        let Some(region) = Region::new(self, camera, min_cell_px) else { return };
        for j in region.rows() {
            for i in region.columns(j) {
                let point = self.node_in_camera((i, j));
                let Some((pixel, jacobian)) = camera.pixel_from_point_with_jacobian(point) else { continue };
                if !camera.contains(pixel) {
                    continue;
                }
                let rotation = self.pose.rotation;
                let b1 = jacobian * (rotation * self.mesh.a1().push(0.0));
                let b2 = jacobian * (rotation * self.mesh.a2().push(0.0));
                if b1.perp(&b2).abs() >= min_cell_px * b1.norm().max(b2.norm()) {
                    nodes.push(VisibleNode { index: (i, j), pixel, depth: point.z });
                }
            }
        }
    }

    /// The same net with its origin at the node nearest to `point` (in the camera frame, m), and that node's old name: the new name of a node is its old
    /// one less that.
    ///
    /// # Errors
    /// [`Error::Degenerate`] if the point is not finite or too many cells away to count.
    pub fn anchored_at(&self, point: Vector3<f64>) -> Result<(Self, (i32, i32))> {
        let in_net = self.pose.inverse_transform(point).xy();
        let index = self
            .mesh
            .nearest_node(in_net)
            .ok_or(Error::Degenerate { what: "origin of the net", why: "it is not finite, or too many cells away" })?;
        let pose = Pose { translation: self.node_in_camera(index), ..self.pose };
        Ok((Self { pose, ..*self }, index))
    }

    /// The same net with its origin at the node nearest to where the optical axis meets it; see [`Lattice::anchored_at`].
    ///
    /// # Errors
    /// [`Error::Degenerate`] if the axis does not meet the net.
    pub fn anchored(&self) -> Result<(Self, (i32, i32))> {
        let point = self.pose.plane().point_along(Vector3::z());
        self.anchored_at(
            point.ok_or(Error::Degenerate {
                what: "origin of the net",
                why: "the optical axis does not meet the net",
            })?,
        )
    }

    /// The same net with its second lattice vector for the first, and the opposite of its first for the second: a quarter turn of a square. Origin and
    /// normal stay; node `(i, j)` becomes `(j, -i)`; sides change places, and the angle becomes its supplement.
    pub fn turned(&self) -> Self {
        let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), self.mesh.angle());
        let pose = Pose { rotation: self.pose.rotation * turn, ..self.pose };
        Self { pose, mesh: self.mesh.turned() }
    }

    /// How a single picture, and a track's first, gives the net: X runs along the mesh direction nearest to the image's u axis (for square and
    /// rectangular meshes that is an in-plane rotation in (-45, 45] degrees), and the origin is the node nearest to the optical axis.
    ///
    /// # Errors
    /// [`Error::Degenerate`] if the optical axis does not meet the net.
    pub fn canonical(&self) -> Result<Self> {
        let mut best = *self;
        for lattice in self.turns() {
            let (rotation, least) = (lattice.pose.in_plane_rotation(), best.pose.in_plane_rotation());
            // At 45 degrees the positive one.
            if rotation.abs() < least.abs() - TIE || (rotation.abs() < least.abs() + TIE && rotation > least) {
                best = lattice;
            }
        }
        Ok(best.anchored()?.0)
    }

    /// The same net with that family of twines first whose axes are nearest to those of `previous`: what continues a track. The origin stays.
    pub fn following(&self, previous: &Pose) -> Self {
        let distance = |lattice: &Self| (lattice.pose.rotation.matrix() - previous.rotation.matrix()).norm_squared();
        let mut best = *self;
        for lattice in self.turns() {
            if distance(&lattice) < distance(&best) {
                best = lattice;
            }
        }
        best
    }

    /// The three other ways to choose the first lattice vector.
    fn turns(&self) -> [Self; 3] {
        let once = self.turned();
        let twice = once.turned();
        [once, twice, twice.turned()]
    }
}

/// In-plane rotations closer than this, rad, are one: rounding must not decide between 45 and -45 degrees.
const TIE: f64 = 1e-9;

/// Planes around what is looked at: the four sides of the view, depth, and how far to the side.
const PLANES: usize = 10;

/// Half-planes `c0 + c1 i + c2 j >= 0` of lattice coordinates that hold all nodes in view (and some more).
struct Region {
    bounds: [Vector3<f64>; PLANES],
    /// Least and greatest j of the polygon that they enclose.
    rows: (f64, f64),
}

impl Region {
    /// `None` if nothing of the net lies in view where its cells are large enough.
    fn new(lattice: &Lattice, camera: &Camera, min_cell_px: f64) -> Option<Self> {
        let rotation = lattice.pose.rotation;
        let (a1, a2) = (rotation * lattice.mesh.a1().push(0.0), rotation * lattice.mesh.a2().push(0.0));
        let origin = lattice.pose.translation;
        let [x0, x1, y0, y1] = camera.view_box();
        let corner = Vector3::new(x0.abs().max(x1.abs()), y0.abs().max(y1.abs()), 1.0).norm();
        // A side at depth z is at most so many focal lengths over z long in the picture: of a pinhole, when it points at the camera in the corner
        // of the view; of a fisheye, when it lies across at 90 degrees off the axis; twice that for what a lens may add.
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

    fn rows(&self) -> std::ops::RangeInclusive<i32> {
        (self.rows.0 - SLACK).ceil() as i32..=(self.rows.1 + SLACK).floor() as i32
    }

    /// The i of row `j`.
    fn columns(&self, j: i32) -> std::ops::RangeInclusive<i32> {
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
