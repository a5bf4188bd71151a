//! Pose of a plane from points on it (IPPE, Collins and Bartoli 2014).

use nalgebra::{Vector2, Vector3};

use crate::error::{Error, Result};
use crate::pose::Pose;

/// One of the two poses that a plane's picture allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarPose {
    /// Plane to camera.
    pub pose: Pose,
    /// Root mean square reprojection error on the plane `z = 1`; times the focal length it is pixels.
    pub rms: f64,
}

/// Both poses of a plane from at least four of its points, better one first.
///
/// `points_in_plane`: coordinates in the plane, m. `rays`: `(x, y, 1)` of the same points in the camera frame.
///
/// # Errors
/// [`Error::Degenerate`] for fewer than four points, points on a line, or unequal lengths.
pub fn planar_pnp(points_in_plane: &[Vector2<f64>], rays: &[Vector3<f64>]) -> Result<[PlanarPose; 2]> {
    if points_in_plane.len() < 4 || points_in_plane.len() != rays.len() {
        return Err(Error::Degenerate { what: "planar pose", why: "it takes four points or more, and a ray for each" });
    }
    todo!("IPPE")
}
