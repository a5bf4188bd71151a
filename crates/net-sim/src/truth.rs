//! What the picture shows, exactly.

use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};
use net_geometry::{Lattice, Mesh, Plane, Pose};

/// The truth of one picture. Empty `layers`: no net.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Truth {
    /// The nets, in the scene's order, nearest first.
    pub layers: Vec<LayerTruth>,
    /// Outlines of fish and other objects in the picture, px: closed polygons.
    pub outlines: Vec<Vec<Vector2<f64>>>,
    /// Standard deviation of the noise on open water, grey levels.
    pub noise_grey: f64,
}

/// The truth of one net.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerTruth {
    /// Net to camera, in the scene's net frame: `X` along the first mesh direction at the net's origin, which is node `(0, 0)`.
    pub pose: Pose,
    /// The mesh as made.
    pub mesh: Mesh,
    /// The net where the optical axis meets it. `None` if the axis passes it by.
    pub axis: Option<AxisTruth>,
    /// Every knot whose centre is in the picture, row by row.
    pub nodes: Vec<NodeTruth>,
    /// Every broken piece of twine with an end in the picture.
    pub missing_edges: Vec<MissingEdge>,
    /// How much brighter the twine is than what is behind it, in the middle of the picture and were it wide: grey levels, negative
    /// for a dark net.
    pub contrast_grey: f64,
}

impl LayerTruth {
    /// Share of the knots in the picture that are in plain view, in [0, 1]; 0 if no knot is in the picture. A net with a share of 0.4 and
    /// contrast above half the noise, where the axis meets it, is one that an estimator should find.
    pub fn visible_share(&self) -> f64 {
        let visible = self.nodes.iter().filter(|n| n.visibility == Visibility::Visible).count();
        visible as f64 / self.nodes.len().max(1) as f64
    }

    /// The flat lattice that touches the net where the optical axis meets it: the tangent plane, X along the first mesh direction
    /// there, the crossing angle there, and as its node `(0, 0)` the net's own, as if the net were spread flat on that plane.
    /// [`Lattice::canonical`] turns it into the form that an estimator's first picture has. `None` if the axis passes the net by.
    pub fn lattice_at_axis(&self) -> Option<Lattice> {
        let axis = self.axis?;
        let [x, second] = axis.directions;
        let rotation =
            Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, axis.normal.cross(&x), axis.normal]));
        let mesh = Mesh::oblique(self.mesh.side1(), self.mesh.side2(), axis.crossing_angle).ok()?;
        let to_node = x * (mesh.side1() * axis.cells.x) + second * (mesh.side2() * axis.cells.y);
        let translation = Vector3::z() * axis.range_m - to_node;
        Some(Lattice { pose: Pose { rotation, translation }, mesh })
    }
}

/// The net where the optical axis meets it, jitter left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisTruth {
    /// Camera centre to net along the axis, m.
    pub range_m: f64,
    /// Camera centre to the tangent plane, m.
    pub distance_m: f64,
    /// Unit normal in the camera frame, `z > 0`.
    pub normal: Vector3<f64>,
    /// Lattice coordinates of the point, cells.
    pub cells: Vector2<f64>,
    /// First and second mesh direction there in the camera frame, unit vectors.
    pub directions: [Vector3<f64>; 2],
    /// Angle from the first to the second mesh direction there, rad.
    pub crossing_angle: f64,
    /// Principal curvatures there, 1/m, the larger magnitude first; positive bends away from the camera at the sides.
    pub curvatures_per_m: [f64; 2],
}

impl AxisTruth {
    /// The tangent plane in the camera frame.
    pub fn plane(&self) -> Plane {
        Plane { normal: self.normal, distance: self.distance_m }
    }
}

/// A knot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodeTruth {
    /// Lattice indices `(i, j)` in the scene's net frame.
    pub index: (i32, i32),
    /// Pixel, lens distortion included.
    pub pixel: Vector2<f64>,
    /// Depth along the optical axis (camera-frame z), m.
    pub depth_m: f64,
    /// In the camera frame, m.
    pub point: Vector3<f64>,
    /// Whether it can be seen.
    pub visibility: Visibility,
}

/// A broken piece of twine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MissingEdge {
    /// The neighbouring knots it joined.
    pub nodes: [(i32, i32); 2],
    /// Their pixels.
    pub pixels: [Vector2<f64>; 2],
    /// What is left of it at either end, m; 0 for nothing.
    pub stubs_m: [f64; 2],
}

/// Whether a knot can be seen. Geometric: water, blur and noise are not counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Visibility {
    /// In plain view.
    #[default]
    Visible,
    /// Behind a fish or another object.
    Occluded,
    /// Behind the twine of a nearer net.
    BehindNet,
    /// Under growth.
    Fouled,
    /// All its twines are gone.
    Missing,
}

impl Visibility {
    /// The word used in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Visible => "visible",
            Self::Occluded => "occluded",
            Self::BehindNet => "behind_net",
            Self::Fouled => "fouled",
            Self::Missing => "missing",
        }
    }
}
