//! Where the net is.

use nalgebra::{Matrix4, Rotation3, UnitQuaternion, Vector3};

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
    /// A net's point, m, in the camera frame.
    pub fn transform(&self, point_in_net: Vector3<f64>) -> Vector3<f64> {
        self.rotation * point_in_net + self.translation
    }

    /// A camera-frame point, m, in the net frame.
    pub fn inverse_transform(&self, point_in_camera: Vector3<f64>) -> Vector3<f64> {
        self.rotation.inverse() * (point_in_camera - self.translation)
    }

    /// Centre of the camera in the net frame, m.
    pub fn camera_in_net(&self) -> Vector3<f64> {
        self.inverse_transform(Vector3::zeros())
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

    /// Homogeneous 4 x 4 matrix.
    pub fn matrix(&self) -> Matrix4<f64> {
        nalgebra::Isometry3::from_parts(self.translation.into(), UnitQuaternion::from_rotation_matrix(&self.rotation))
            .to_homogeneous()
    }

    /// Rotation as a unit quaternion with positive scalar part.
    pub fn quaternion(&self) -> UnitQuaternion<f64> {
        let q = UnitQuaternion::from_rotation_matrix(&self.rotation);
        if q.w < 0.0 { UnitQuaternion::new_unchecked(-q.into_inner()) } else { q }
    }
}
