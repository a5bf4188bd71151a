//! The YAML that ROS `camera_calibration` writes.

use net_geometry::Camera;
use serde::Deserialize;

use crate::calibration::{Calibration, intrinsics_of, wrong, yaml};
use crate::error::Result;

/// The fields that are used; the file's others (name, rectification, projection) are not.
#[derive(Deserialize)]
struct CameraInfo {
    image_width: Option<u32>,
    image_height: Option<u32>,
    camera_matrix: Option<Matrix>,
    distortion_model: Option<String>,
    distortion_coefficients: Option<Matrix>,
}

#[derive(Deserialize)]
struct Matrix {
    data: Vec<f64>,
}

pub(super) fn parse(place: &str, text: &str) -> Result<Camera> {
    let info: CameraInfo = yaml::read(place, text, "a camera_info file")?;
    let missing = |field: &str| wrong(place, field, "missing", "the fields of a camera_info or Kalibr camchain file");
    let matrix = info.camera_matrix.ok_or_else(|| missing("camera_matrix"))?;
    let coefficients = info.distortion_coefficients.ok_or_else(|| missing("distortion_coefficients"))?;
    Calibration {
        place,
        width: info.image_width.ok_or_else(|| missing("image_width"))?,
        height: info.image_height.ok_or_else(|| missing("image_height"))?,
        intrinsics: intrinsics_of(place, "camera_matrix", &matrix.data)?,
        model: &info.distortion_model.ok_or_else(|| missing("distortion_model"))?,
        fields: ["distortion_model", "distortion_coefficients"],
        coefficients: &coefficients.data,
    }
    .camera()
}
