//! Kalibr's camchain YAML: `cam0`, `cam1`, ... each with its own intrinsics.

use std::collections::BTreeMap;

use net_geometry::Camera;
use serde::Deserialize;

use crate::calibration::{Calibration, wrong, yaml};
use crate::error::Result;

/// The fields that are used of each camera.
#[derive(Deserialize)]
struct Cam {
    camera_model: Option<String>,
    distortion_model: Option<String>,
    #[serde(default)]
    distortion_coeffs: Vec<f64>,
    intrinsics: Option<Vec<f64>>,
    resolution: Option<Vec<u32>>,
    rostopic: Option<String>,
}

pub(super) fn parse(place: &str, text: &str, topic: Option<&str>) -> Result<Camera> {
    let cams: BTreeMap<String, Cam> = yaml::read(place, text, "a Kalibr camchain file")?;
    let (name, cam) = choose(place, &cams, topic)?;
    let field = |f: &str| format!("{name}.{f}");
    let missing = |f: &str| wrong(place, &field(f), "missing", "the fields of a Kalibr camchain file");
    let model = cam.camera_model.as_deref().ok_or_else(|| missing("camera_model"))?;
    if model != "pinhole" {
        return Err(wrong(place, &field("camera_model"), format!("{model:?}"), "pinhole"));
    }
    let intrinsics = cam.intrinsics.as_ref().ok_or_else(|| missing("intrinsics"))?;
    let &[fx, fy, cx, cy] = intrinsics.as_slice() else {
        return Err(wrong(place, &field("intrinsics"), format!("{intrinsics:?}"), "[fx, fy, cx, cy]"));
    };
    let resolution = cam.resolution.as_ref().ok_or_else(|| missing("resolution"))?;
    let &[width, height] = resolution.as_slice() else {
        return Err(wrong(place, &field("resolution"), format!("{resolution:?}"), "[width, height]"));
    };
    Calibration {
        place,
        width,
        height,
        intrinsics: [fx, fy, cx, cy],
        model: cam.distortion_model.as_deref().unwrap_or("none"),
        fields: [&field("distortion_model"), &field("distortion_coeffs")],
        coefficients: &cam.distortion_coeffs,
    }
    .camera()
}

/// The only camera, or the one for `topic`. Taking just any would give poses of another camera.
fn choose<'a>(place: &str, cams: &'a BTreeMap<String, Cam>, topic: Option<&str>) -> Result<(&'a String, &'a Cam)> {
    if let Some(found) = cams.iter().find(|(_, cam)| topic.is_some() && cam.rostopic.as_deref() == topic) {
        return Ok(found);
    }
    match cams.iter().next() {
        Some(only) if cams.len() == 1 => Ok(only),
        _ => {
            let topics: Vec<&str> = cams.values().filter_map(|cam| cam.rostopic.as_deref()).collect();
            let expected = format!("one camera, or one whose rostopic is the topic read; the file is for {topics:?}");
            Err(wrong(place, "cameras", cams.len(), &expected))
        }
    }
}
