//! Yaw, pitch and roll (thesis eq. 4.2).

use nalgebra::Rotation3;

/// ZYX angles, rad: `R = Rz(yaw) Ry(pitch) Rx(roll)` (thesis eq. 4.2, Fossen). Of a net's pose the axes are those of
/// the camera frame, so roll tilts the net about the image's u axis, pitch about its v axis, and yaw turns it in the
/// image.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ZyxAngles {
    /// About z, rad, in (-pi, pi].
    pub yaw: f64,
    /// About y, rad, in [-pi/2, pi/2].
    pub pitch: f64,
    /// About x, rad, in (-pi, pi].
    pub roll: f64,
}

impl ZyxAngles {
    /// The rotation matrix (eq. 4.2).
    pub fn rotation(&self) -> Rotation3<f64> {
        Rotation3::from_euler_angles(self.roll, self.pitch, self.yaw)
    }

    /// The angles of a rotation. At a pitch of ±90 degrees only yaw ∓ roll is determined: roll is then 0.
    pub fn from_rotation(rotation: &Rotation3<f64>) -> Self {
        let r = rotation.matrix();
        let cos_pitch = r[(0, 0)].hypot(r[(1, 0)]);
        let pitch = (-r[(2, 0)]).atan2(cos_pitch);
        // Below this, yaw and roll are quotients of rounding errors.
        if cos_pitch < 1e-12 {
            return Self { yaw: (-r[(0, 1)]).atan2(r[(1, 1)]), pitch, roll: 0.0 };
        }
        Self { yaw: r[(1, 0)].atan2(r[(0, 0)]), pitch, roll: r[(2, 1)].atan2(r[(2, 2)]) }
    }
}
