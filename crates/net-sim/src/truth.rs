//! What the picture shows, exactly.

use nalgebra::{Vector2, Vector3};
use net_geometry::{Mesh, Plane, Pose};

/// The truth of one picture. Empty `layers`: no net.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Truth {
    /// The nets, in the scene's order, nearest first.
    pub layers: Vec<LayerTruth>,
}

/// The truth of one net.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerTruth {
    /// Net to camera, in the scene's net frame (`X` along `a1`, origin at node `(0, 0)`).
    pub pose: Pose,
    /// The mesh as made.
    pub mesh: Mesh,
    /// The net where the optical axis meets it. `None` if the axis passes it by.
    pub axis: Option<AxisTruth>,
    /// Every knot whose centre is in the picture, row by row.
    pub nodes: Vec<NodeTruth>,
}

/// The net where the optical axis meets it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisTruth {
    /// Camera centre to net along the axis, m.
    pub range_m: f64,
    /// Camera centre to the tangent plane, m.
    pub distance_m: f64,
    /// Unit normal in the camera frame, `z > 0`.
    pub normal: Vector3<f64>,
    /// Lattice coordinates of the point, cells; the whole part is the node.
    pub cells: Vector2<f64>,
    /// Angle from the first to the second mesh direction there, rad.
    pub crossing_angle: f64,
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
    /// Whether it can be seen.
    pub visibility: Visibility,
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
