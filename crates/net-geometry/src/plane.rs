//! Planes in the camera frame.

use nalgebra::{Matrix3, Vector3};

use crate::error::{Error, Result};

/// All points `P` with `normal · P = distance`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Unit normal in the camera frame, pointing away from the camera (positive z).
    pub normal: Vector3<f64>,
    /// Perpendicular distance from the camera centre, m.
    pub distance: f64,
}

/// Ratio of lengths below which points count as lying on a line, or a normal as perpendicular to the optical axis.
const DEGENERATE: f64 = 1e-9;

fn degenerate(why: &'static str) -> Error {
    Error::Degenerate { what: "plane", why }
}

impl Plane {
    /// The plane `normal · P = distance`; the normal may be of any length and either sign.
    ///
    /// # Errors
    /// [`Error::Degenerate`] for a normal of no length or not finite, or perpendicular to the optical axis: such a
    /// plane has no side that faces the camera.
    pub fn new(normal: Vector3<f64>, distance: f64) -> Result<Self> {
        let scale = normal.norm() * normal.z.signum();
        if !(scale.is_finite() && scale != 0.0 && distance.is_finite()) {
            return Err(degenerate("the normal has no direction, or a number is not finite"));
        }
        let (normal, distance) = (normal / scale, distance / scale);
        // A distance that overflowed is no distance.
        if normal.z < DEGENERATE || !distance.is_finite() {
            return Err(degenerate("it is parallel to the optical axis"));
        }
        Ok(Self { normal, distance })
    }

    /// The plane through three points, m (thesis eq. 4.24).
    ///
    /// # Errors
    /// [`Error::Degenerate`] for points on a line or not finite, or a plane parallel to the optical axis.
    pub fn through_points([a, b, c]: [Vector3<f64>; 3]) -> Result<Self> {
        let (ab, ac) = (b - a, c - a);
        let normal = ab.cross(&ac);
        // Also refuses NaN.
        if normal.norm() > DEGENERATE * ab.norm() * ac.norm() {
            Self::new(normal, normal.dot(&((a + b + c) / 3.0)))
        } else {
            Err(degenerate("the three points lie on a line, or a number is not finite"))
        }
    }

    /// The plane with the least sum of squared perpendicular distances from all points, m (thesis eq. 4.30 to 4.35,
    /// mended: the normal is the *last right* singular vector of the *centred* points, and the distance follows from
    /// their mean). Allocates nothing.
    ///
    /// # Errors
    /// As [`Plane::fit_weighted`].
    pub fn fit(points: impl Iterator<Item = Vector3<f64>> + Clone) -> Result<Self> {
        Self::fit_weighted(points.map(|p| (p, 1.0)))
    }

    /// As [`Plane::fit`], each point with a weight of its own (the inverse square of its sigma).
    ///
    /// # Errors
    /// [`Error::Degenerate`] for fewer than three points, points on a line, numbers that are not finite, negative
    /// weights, or a plane parallel to the optical axis.
    pub fn fit_weighted(points: impl Iterator<Item = (Vector3<f64>, f64)> + Clone) -> Result<Self> {
        let (mut total, mut count) = (0.0, 0);
        let mut mean = Vector3::zeros();
        for (p, weight) in points.clone() {
            if weight.is_nan() || weight < 0.0 {
                return Err(degenerate("a weight is negative or not a number"));
            }
            mean += p * weight;
            total += weight;
            count += usize::from(weight > 0.0);
        }
        if count < 3 {
            return Err(degenerate("it takes three points or more"));
        }
        mean /= total;
        // The right singular vectors of the centred points are the eigenvectors of their scatter.
        let mut scatter = Matrix3::zeros();
        for (p, weight) in points {
            scatter += (p - mean) * (p - mean).transpose() * (weight / total);
        }
        if !scatter.iter().all(|x| x.is_finite()) {
            return Err(degenerate("a number is not finite"));
        }
        let eigen = scatter.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let [least, middle, most] = order.map(|k| eigen.eigenvalues[k].max(0.0).sqrt());
        if middle <= DEGENERATE * most.max(mean.amax()) {
            return Err(degenerate("the points lie on a line"));
        }
        if least >= (1.0 - DEGENERATE) * middle {
            return Err(degenerate("the points are as thick as they are wide"));
        }
        let normal = eigen.eigenvectors.column(order[0]).into_owned();
        Self::new(normal, normal.dot(&mean))
    }

    /// How far the plane lies beyond `point`, m, along the normal: negative for points behind it.
    pub fn distance_beyond(&self, point: Vector3<f64>) -> f64 {
        self.distance - self.normal.dot(&point)
    }

    /// Depth z, m, at which the ray `(x, y, 1)` meets the plane. `None` if it does not, in front of the camera.
    #[inline]
    pub fn depth_along(&self, ray: Vector3<f64>) -> Option<f64> {
        let depth = self.distance / self.normal.dot(&ray);
        (depth.is_finite() && depth > 0.0).then_some(depth)
    }

    /// Point, m, at which the ray `(x, y, 1)` meets the plane. `None` if it does not, in front of the camera.
    #[inline]
    pub fn point_along(&self, ray: Vector3<f64>) -> Option<Vector3<f64>> {
        self.depth_along(ray).map(|depth| ray * depth)
    }

    /// How the point on the plane moves, m, while the ray `(x, y, 1)` moves by `step` (its z is zero): the step lifted
    /// to the plane (eq. 4.27, mended: `B - z (n·B) / n_z` at the principal point, and its like elsewhere). `None` if
    /// the ray does not meet the plane.
    #[inline]
    pub fn lift(&self, ray: Vector3<f64>, step: Vector3<f64>) -> Option<Vector3<f64>> {
        let depth = self.depth_along(ray)?;
        Some((step - ray * (self.normal.dot(&step) / self.normal.dot(&ray))) * depth)
    }

    /// Depth on the optical axis, m (thesis eq. 4.25): the `range_m` of every file. `None` if the axis does not meet
    /// the plane.
    pub fn range(&self) -> Option<f64> {
        self.depth_along(Vector3::z())
    }

    /// Angle between the normal and the optical axis, rad.
    pub fn tilt(&self) -> f64 {
        self.normal.xy().norm().atan2(self.normal.z)
    }
}
