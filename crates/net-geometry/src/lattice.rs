//! The net's nodes in space and in the picture, and their names.

use nalgebra::{Vector2, Vector3};

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::junction::Junction;
use crate::mesh::Mesh;
use crate::pose::Pose;
use crate::region::Region;

/// A mesh where it hangs: node `(i, j)` lies at `i a1 + j a2` in the plane of the pose.
///
/// One and the same net can be given many ways: any node may be its origin, either family of twines its first.
/// [`Lattice::canonical`] picks the one that a single picture starts with, [`Lattice::following`] the one that
/// continues a track.
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

    /// Lattice coordinates, whole at the nodes, of the net's point seen at `pixel`. `None` if the net is not seen
    /// there.
    #[inline]
    pub fn coordinates_at(&self, camera: &Camera, pixel: Vector2<f64>) -> Option<Vector2<f64>> {
        let ray = camera.ray_from_pixel(pixel)?;
        self.pose.net_from_ray(ray).map(|point| self.mesh.coordinates(point))
    }

    /// Gives each junction the name of the node nearest to it in the net's plane, if it lies within `tolerance` of it
    /// (as a share of the shorter side); the others lose theirs. Of several near one node only the nearest gets the
    /// name. `taken` is scratch, kept between calls.
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

    /// The nodes that `camera` sees where a cell is at least `min_cell_px` high (its area in pixels over its longer
    /// side; at least 1 is taken), into `nodes` (cleared first), by rows of j, then i. Beyond, a receding net has no
    /// end.
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

    /// The same net with its origin at the node nearest to `point` (in the camera frame, m), and that node's old name:
    /// the new name of a node is its old one less that.
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

    /// The same net with its origin at the node nearest to where the optical axis meets it; see
    /// [`Lattice::anchored_at`].
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

    /// The same net with its second lattice vector for the first, and the opposite of its first for the second: a
    /// quarter turn of a square. Origin and normal stay; node `(i, j)` becomes `(j, -i)`; sides change places, and the
    /// angle becomes its supplement.
    pub fn turned(&self) -> Self {
        let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), self.mesh.angle());
        let pose = Pose { rotation: self.pose.rotation * turn, ..self.pose };
        Self { pose, mesh: self.mesh.turned() }
    }

    /// How a single picture, and a track's first, gives the net: X runs along the mesh direction nearest to the image's
    /// u axis (for square and rectangular meshes that is an in-plane rotation in (-45, 45] degrees), and the origin is
    /// the node nearest to the optical axis.
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

    /// The same net with that family of twines first whose axes are nearest to those of `previous`: what continues a
    /// track. The origin stays.
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
