use nalgebra::{Rotation3, Vector3};
use net_geometry::Pose;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, within};

/// Where a net is, in words that a person can write down: how far along the optical axis, how turned, and which of its points
/// the axis meets. Six degrees of freedom: any pose whose plane the axis meets.
///
/// The rotation is `R = Rx(tilt_x) Ry(tilt_y) Rz(roll)`: the net is rolled in its own plane, then tilted about the camera's y
/// axis, then about its x axis. `tilt_x_deg > 0` takes the lower side farther away, `tilt_y_deg > 0` brings the right side nearer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NetPose {
    /// Camera centre to net along the optical axis, m, above 0. Default 1.2.
    pub range_m: f64,
    /// Tilt about the camera's x axis, degrees. Default 0.
    pub tilt_x_deg: f64,
    /// Tilt about the camera's y axis, degrees. Default 0.
    pub tilt_y_deg: f64,
    /// Turn in the net's own plane, degrees. Default 0.
    pub roll_deg: f64,
    /// Net coordinate X of the point that the optical axis meets, m. Default 0: a knot is in the centre.
    pub x_m: f64,
    /// Net coordinate Y of the point that the optical axis meets, m. Default 0.
    pub y_m: f64,
}

impl Default for NetPose {
    fn default() -> Self {
        Self { range_m: 1.2, tilt_x_deg: 0.0, tilt_y_deg: 0.0, roll_deg: 0.0, x_m: 0.0, y_m: 0.0 }
    }
}

impl NetPose {
    /// Straight ahead at `range_m`.
    pub fn at(range_m: f64) -> Self {
        Self { range_m, ..Self::default() }
    }

    /// Net to camera.
    pub fn pose(&self) -> Pose {
        let x = Rotation3::from_axis_angle(&Vector3::x_axis(), self.tilt_x_deg.to_radians());
        let y = Rotation3::from_axis_angle(&Vector3::y_axis(), self.tilt_y_deg.to_radians());
        let z = Rotation3::from_axis_angle(&Vector3::z_axis(), self.roll_deg.to_radians());
        let rotation = x * y * z;
        let translation = Vector3::z() * self.range_m - rotation * Vector3::new(self.x_m, self.y_m, 0.0);
        Pose { rotation, translation }
    }

    /// The words for a pose. `None` if the optical axis does not meet the plane in front of the camera.
    pub fn from_pose(pose: &Pose) -> Option<Self> {
        let range_m = pose.plane().range()?;
        let foot = pose.inverse_transform(Vector3::z() * range_m);
        // R = Rx(a) Ry(b) Rz(c): its third column is (sin b, -sin a cos b, cos a cos b), its first row cos b (cos c, -sin c).
        let m = pose.rotation.matrix();
        Some(Self {
            range_m,
            tilt_x_deg: (-m[(1, 2)]).atan2(m[(2, 2)]).to_degrees(),
            tilt_y_deg: m[(0, 2)].clamp(-1.0, 1.0).asin().to_degrees(),
            roll_deg: (-m[(0, 1)]).atan2(m[(0, 0)]).to_degrees(),
            x_m: foot.x,
            y_m: foot.y,
        })
    }

    /// Refuses poses that show no front of the net.
    ///
    /// # Errors
    /// [`Error::Value`] names the field.
    pub fn validate(&self) -> Result<()> {
        within("pose.range_m", self.range_m, 0.02, 1e3, "metres between 0.02 and 1000")?;
        within("pose.tilt_x_deg", self.tilt_x_deg, -89.0, 89.0, "degrees between -89 and 89")?;
        within("pose.tilt_y_deg", self.tilt_y_deg, -89.0, 89.0, "degrees between -89 and 89")?;
        within("pose.roll_deg", self.roll_deg, -360.0, 360.0, "degrees between -360 and 360")?;
        for (field, value) in [("pose.x_m", self.x_m), ("pose.y_m", self.y_m)] {
            within(field, value, -1e4, 1e4, "metres between -10000 and 10000")?;
        }
        let tilt_cos = self.tilt_x_deg.to_radians().cos() * self.tilt_y_deg.to_radians().cos();
        if tilt_cos < 0.02 {
            let value = tilt_cos.acos().to_degrees();
            return Err(Error::Value { field: "pose tilt in all, degrees", value, expected: "below 88 degrees" });
        }
        Ok(())
    }
}
