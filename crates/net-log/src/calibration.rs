//! Camera calibrations from files.

use std::path::Path;

use net_geometry::Camera;

use crate::error::{Error, Result};

/// Reads the camera of a ROS `camera_info` YAML or a Kalibr camchain YAML (its first camera).
///
/// # Errors
/// [`Error::Calibration`] names file, field and value; [`Error::Io`] the path.
pub fn read_camera(path: &Path) -> Result<Camera> {
    let _text = std::fs::read_to_string(path).map_err(Error::io("read", path))?;
    Err(Error::Calibration {
        place: path.display().to_string(),
        field: "file".to_owned(),
        value: "unread".to_owned(),
        expected: "a reader, which is the next thing to be built".to_owned(),
    })
}
