//! Planes in the camera frame.

use nalgebra::Vector3;

/// All points `P` with `normal · P = distance`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Unit normal in the camera frame, pointing away from the camera (positive z).
    pub normal: Vector3<f64>,
    /// Perpendicular distance from the camera centre, m.
    pub distance: f64,
}

impl Plane {
    /// Depth z, m, at which the ray `(x, y, 1)` meets the plane. `None` if it does not, in front of the camera.
    #[inline]
    pub fn depth_along(&self, ray: Vector3<f64>) -> Option<f64> {
        let depth = self.distance / self.normal.dot(&ray);
        (depth.is_finite() && depth > 0.0).then_some(depth)
    }

    /// Depth on the optical axis, m: the contract's `range_m`. `None` if the axis does not meet the plane.
    pub fn range(&self) -> Option<f64> {
        self.depth_along(Vector3::z())
    }

    /// Angle between the normal and the optical axis, rad.
    pub fn tilt(&self) -> f64 {
        self.normal.xy().norm().atan2(self.normal.z)
    }
}
