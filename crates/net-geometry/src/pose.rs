//! Where the net is.

use nalgebra::{Matrix4, Rotation3, UnitQuaternion, Vector2, Vector3};

use crate::error::{Error, Result};
use crate::plane::Plane;

/// Net to camera: `X_cam = rotation * X_net + translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Rotation from the net frame to the camera frame; its columns are the net's axes in the camera frame.
    pub rotation: Rotation3<f64>,
    /// The net's origin in the camera frame, m.
    pub translation: Vector3<f64>,
}

impl Pose {
    /// The pose of a net in `plane`, its origin where the optical axis meets it, that has, at the principal point, a
    /// line of the net along `direction` in the picture (thesis eq. 4.26 to 4.29, mended: the direction is lifted to
    /// the plane, and the axes are the *columns* of the rotation). `direction` is on the plane `z = 1`: of a picture in
    /// pixels it is `(du / fx, dv / fy)`. `angle` is the line's angle from the net's X axis, rad: 0 for the first
    /// lattice vector, the mesh's angle for the second.
    ///
    /// # Errors
    /// [`Error::Degenerate`] if the optical axis does not meet the plane, or the direction has no length.
    pub fn from_plane(plane: &Plane, direction: Vector2<f64>, angle: f64) -> Result<Self> {
        let degenerate = |why| Error::Degenerate { what: "pose from a plane", why };
        let translation =
            plane.point_along(Vector3::z()).ok_or_else(|| degenerate("the optical axis does not meet the plane"))?;
        let unit = direction.try_normalize(0.0).filter(|d| d.x.is_finite() && d.y.is_finite() && angle.is_finite());
        let line = unit
            .and_then(|d| plane.lift(Vector3::z(), d.push(0.0)))
            .and_then(|line| line.try_normalize(0.0))
            .ok_or_else(|| degenerate("the direction has no length, or a number is not finite"))?;
        let across = plane.normal.cross(&line);
        let (sin, cos) = angle.sin_cos();
        let (x, y) = (line * cos - across * sin, across * cos + line * sin);
        Ok(Self { rotation: Rotation3::from_basis_unchecked(&[x, y, plane.normal]), translation })
    }

    /// A net's point, m, in the camera frame.
    #[inline]
    pub fn transform(&self, point_in_net: Vector3<f64>) -> Vector3<f64> {
        self.rotation * point_in_net + self.translation
    }

    /// A camera-frame point, m, in the net frame.
    #[inline]
    pub fn inverse_transform(&self, point_in_camera: Vector3<f64>) -> Vector3<f64> {
        self.rotation.inverse() * (point_in_camera - self.translation)
    }

    /// Centre of the camera in the net frame, m.
    pub fn camera_in_net(&self) -> Vector3<f64> {
        self.inverse_transform(Vector3::zeros())
    }

    /// The net's X axis in the camera frame: the first column of the rotation.
    pub fn x_axis(&self) -> Vector3<f64> {
        self.rotation.matrix().column(0).into_owned()
    }

    /// The net's Y axis in the camera frame: the second column of the rotation.
    pub fn y_axis(&self) -> Vector3<f64> {
        self.rotation.matrix().column(1).into_owned()
    }

    /// The net's unit normal in the camera frame: the third column of the rotation.
    pub fn normal(&self) -> Vector3<f64> {
        self.rotation.matrix().column(2).into_owned()
    }

    /// The net's plane in the camera frame.
    pub fn plane(&self) -> Plane {
        let normal = self.normal();
        Plane { normal, distance: normal.dot(&self.translation) }
    }

    /// Point `(X, Y)` of the net's plane, m, that the ray `(x, y, 1)` meets. `None` if it meets none in front of the
    /// camera.
    #[inline]
    pub fn net_from_ray(&self, ray: Vector3<f64>) -> Option<Vector2<f64>> {
        self.plane().point_along(ray).map(|point| self.inverse_transform(point).xy())
    }

    /// In-plane rotation, rad, in (-pi, pi]: the angle in the net's plane from the image's u axis, lifted to the plane
    /// where the optical axis meets it, to the net's X axis. Positive turns X from u towards v.
    pub fn in_plane_rotation(&self) -> f64 {
        let (n, x) = (self.normal(), self.x_axis());
        // u lifted to the plane, times n.z, which is positive.
        let u = Vector3::new(n.z, 0.0, -n.x);
        n.dot(&u.cross(&x)).atan2(u.dot(&x))
    }

    /// The pose with a small motion added in the camera frame: `exp(turn) R`, `t + shift`. `turn` is a rotation vector,
    /// rad; `shift` is in m. It turns about the net's origin, not the camera's.
    pub fn perturbed(&self, turn: Vector3<f64>, shift: Vector3<f64>) -> Self {
        Self { rotation: Rotation3::new(turn) * self.rotation, translation: self.translation + shift }
    }

    /// The `turn` and `shift` that [`Pose::perturbed`] needs to get from here to `other`.
    pub fn perturbation_to(&self, other: &Self) -> (Vector3<f64>, Vector3<f64>) {
        // By way of the quaternion: the angle of a rotation matrix is an arc cosine, blind near zero.
        let turn = UnitQuaternion::from_rotation_matrix(&(other.rotation * self.rotation.inverse()));
        (turn.scaled_axis(), other.translation - self.translation)
    }

    /// Homogeneous 4 x 4 matrix.
    pub fn matrix(&self) -> Matrix4<f64> {
        let mut matrix = self.rotation.to_homogeneous();
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.translation);
        matrix
    }

    /// Rotation as a unit quaternion with positive scalar part.
    pub fn quaternion(&self) -> UnitQuaternion<f64> {
        let q = UnitQuaternion::from_rotation_matrix(&self.rotation);
        if q.w < 0.0 { UnitQuaternion::new_unchecked(-q.into_inner()) } else { q }
    }
}
