use net_geometry::{Camera, Lens};
use serde::{Deserialize, Serialize};

use crate::error::Result;

/// A camera as a file has it; names as in ROS's `camera_info`. Default the thesis's (eq. 4.3).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraModel {
    /// Image width, px. Default 848.
    pub image_width: u32,
    /// Image height, px. Default 480.
    pub image_height: u32,
    /// Focal length along u, px. Default 600.
    pub fx: f64,
    /// Focal length along v, px. Default 600.
    pub fy: f64,
    /// Principal point, u, px. Default 424.
    pub cx: f64,
    /// Principal point, v, px. Default 240.
    pub cy: f64,
    /// Lens model, `plumb_bob`, `rational_polynomial`, `equidistant` or `none`. Default none.
    pub distortion_model: String,
    /// Its coefficients, in OpenCV's order. Default none.
    pub distortion_coefficients: Vec<f64>,
}

impl Default for CameraModel {
    fn default() -> Self {
        Self {
            image_width: 848,
            image_height: 480,
            fx: 600.0,
            fy: 600.0,
            cx: 424.0,
            cy: 240.0,
            distortion_model: "none".to_owned(),
            distortion_coefficients: Vec::new(),
        }
    }
}

impl CameraModel {
    /// The camera.
    ///
    /// # Errors
    /// [`crate::Error::Geometry`] names the field that is out of range, or a lens model that is not known.
    pub fn camera(&self) -> Result<Camera> {
        let lens = Lens::from_model(&self.distortion_model, &self.distortion_coefficients)?;
        Ok(Camera::new(self.fx, self.fy, self.cx, self.cy, self.image_width, self.image_height, lens)?)
    }
}
