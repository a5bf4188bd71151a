//! Logs and cameras in words and in JSON.

use net_log::{LogInfo, TimeSource};
use netpose::{Camera, Lens};
use serde_json::{Value, json};

/// A log in a line.
pub fn log(info: &LogInfo) -> String {
    let topic = info.topic.as_ref().map_or_else(String::new, |t| format!(", topic {t}"));
    let frames = info.frames.map_or_else(String::new, |n| format!(", {n} frames"));
    format!("{}: {}{topic}{frames}, times {}", info.path.display(), info.kind.as_str(), times(info))
}

/// Where a log's times come from.
pub fn times(info: &LogInfo) -> String {
    match info.times {
        TimeSource::TimestampsCsv => "from timestamps.csv".into(),
        TimeSource::FileNames => "from the file names".into(),
        TimeSource::MadeUp { fps } => format!("made up, the log has none: frame number at {fps} Hz"),
        TimeSource::Messages => "from the messages".into(),
    }
}

/// Intrinsics in a line.
pub fn camera(camera: &Camera) -> String {
    let (fx, fy, cx, cy) = (camera.fx(), camera.fy(), camera.cx(), camera.cy());
    let lens = lens(camera.lens()).0;
    format!("{}x{} px, fx {fx:.1} fy {fy:.1} cx {cx:.1} cy {cy:.1}, lens {lens}", camera.width(), camera.height())
}

/// A camera and where it was found.
pub fn camera_json(camera: &Camera, origin: &str) -> Value {
    let (model, coefficients) = lens(camera.lens());
    json!({
        "from": origin, "width": camera.width(), "height": camera.height(),
        "fx": camera.fx(), "fy": camera.fy(), "cx": camera.cx(), "cy": camera.cy(),
        "distortion_model": model, "distortion_coefficients": coefficients,
    })
}

/// The lens model's name as ROS has it, and its coefficients.
fn lens(lens: &Lens) -> (&'static str, &[f64]) {
    match lens {
        Lens::None => ("none", &[]),
        Lens::PlumbBob(k) => ("plumb_bob", k),
        Lens::Rational(k) => ("rational_polynomial", k),
        Lens::KannalaBrandt(k) => ("equidistant", k),
    }
}
