//! `annotated.mcap`: what was found, in Foxglove's schemas (protobuf), to be shown over the source log by Foxglove and Rerun.
//!
//! | topic | schema | what |
//! |---|---|---|
//! | `/netpose/annotations` | `foxglove.ImageAnnotations` | junctions and twines coloured by state, a line of text |
//! | `/netpose/pose` | `foxglove.PoseInFrame` | the net in the camera frame |
//! | `/netpose/transform` | `foxglove.FrameTransform` | the same, as a child frame `net` of the camera's |
//! | `/netpose/calibration` | `foxglove.CameraCalibration` | the camera, once |
//! | `/netpose/estimate` | `netpose.Estimate` | numbers to plot |
//!
//! Log time is the frame's time, so that messages meet their image. Frames without a time are left out.

mod knots;
mod messages;

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use net_geometry::nalgebra::{UnitQuaternion, Vector2};
use net_geometry::{Camera, Junction, JunctionState, Lens, Twine, TwineState};
use prost::Message;
use prost_types::Timestamp;

use crate::error::{Error, Result};
use crate::sink::poses::PoseRow;
pub use knots::Knots;
use messages::{
    CameraCalibration, Color, Estimate, FrameTransform, ImageAnnotations, LINE_LIST, POINTS, Point2, PointsAnnotation,
    Pose, PoseInFrame, Quaternion, TextAnnotation, Vector3,
};

/// Name of the camera frame where the source log's is not known.
pub const DEFAULT_CAMERA_FRAME: &str = "camera";
/// Name of the net frame.
const NET_FRAME: &str = "net";

/// Writes `annotated.mcap`.
pub struct AnnotatedMcap {
    path: PathBuf,
    writer: mcap::Writer<BufWriter<File>>,
    channels: BTreeMap<&'static str, u16>,
    camera_frame: String,
    camera: Option<Camera>,
    sequence: u32,
}

impl std::fmt::Debug for AnnotatedMcap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("AnnotatedMcap").field("path", &self.path).finish_non_exhaustive()
    }
}

impl AnnotatedMcap {
    /// Starts a new file for frames of `camera`, whose frame of reference is called `camera_frame`.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn create(path: &Path, camera: &Camera, camera_frame: &str) -> Result<Self> {
        let file = File::create(path).map_err(Error::io("create", path))?;
        let options = mcap::WriteOptions::new().library(concat!("netpose ", env!("CARGO_PKG_VERSION")));
        let writer = options.create(BufWriter::new(file)).map_err(failed(path))?;
        let mut this = Self {
            path: path.to_owned(),
            writer,
            channels: BTreeMap::new(),
            camera_frame: camera_frame.to_owned(),
            camera: Some(*camera),
            sequence: 0,
        };
        let descriptors = messages::descriptors();
        for (topic, schema) in [
            ("/netpose/annotations", "foxglove.ImageAnnotations"),
            ("/netpose/pose", "foxglove.PoseInFrame"),
            ("/netpose/transform", "foxglove.FrameTransform"),
            ("/netpose/calibration", "foxglove.CameraCalibration"),
            ("/netpose/estimate", "netpose.Estimate"),
        ] {
            let schema = this.writer.add_schema(schema, "protobuf", &descriptors).map_err(failed(path))?;
            let channel = this.writer.add_channel(schema, topic, "protobuf", &BTreeMap::new()).map_err(failed(path))?;
            this.channels.insert(topic, channel);
        }
        Ok(this)
    }

    /// Adds a frame. Without `twines`, of which not every method tells, neighbouring junctions are joined.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn write(&mut self, row: &PoseRow, junctions: &[Junction], twines: &[Twine]) -> Result<()> {
        let Some(ns) = row.timestamp_ns.filter(|&ns| ns >= 0) else { return Ok(()) };
        let timestamp = Timestamp { seconds: ns / 1_000_000_000, nanos: (ns % 1_000_000_000) as i32 };
        if let Some(camera) = self.camera.take() {
            let calibration = calibration(&camera, timestamp, &self.camera_frame);
            self.send("/netpose/calibration", ns, &calibration)?;
        }
        self.send("/netpose/annotations", ns, &annotations(row, junctions, twines, timestamp))?;
        self.send("/netpose/estimate", ns, &estimate(row, timestamp))?;
        let Some(net) = &row.net else { return Ok(()) };
        let (t, q) = (net.pose.translation, net.pose.quaternion());
        let translation = Vector3 { x: t.x, y: t.y, z: t.z };
        let rotation = quaternion(&q);
        let pose = Pose { position: Some(translation.clone()), orientation: Some(rotation.clone()) };
        let (timestamp, frame_id) = (Some(timestamp), self.camera_frame.clone());
        let pose = PoseInFrame { timestamp, frame_id: frame_id.clone(), pose: Some(pose) };
        self.send("/netpose/pose", ns, &pose)?;
        let transform = FrameTransform {
            timestamp,
            parent_frame_id: frame_id,
            child_frame_id: NET_FRAME.to_owned(),
            translation: Some(translation),
            rotation: Some(rotation),
        };
        self.send("/netpose/transform", ns, &transform)
    }

    /// Writes index and footer.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn finish(mut self) -> Result<()> {
        self.writer.finish().map(drop).map_err(failed(&self.path))
    }

    fn send(&mut self, topic: &'static str, timestamp_ns: i64, message: &impl Message) -> Result<()> {
        let time = timestamp_ns.unsigned_abs();
        let channel_id = self.channels[topic];
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time: time, publish_time: time };
        self.sequence = self.sequence.wrapping_add(1);
        self.writer.write_to_known_channel(&header, &message.encode_to_vec()).map_err(failed(&self.path))
    }
}

/// For `map_err`.
pub(crate) fn failed(path: &Path) -> impl FnOnce(mcap::McapError) -> Error + use<> {
    let path = path.to_owned();
    move |error| match error {
        mcap::McapError::Io(source) => Error::Io { action: "write", path, source },
        other => Error::Damaged { path, why: other.to_string() },
    }
}

fn quaternion(q: &UnitQuaternion<f64>) -> Quaternion {
    Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }
}

fn calibration(camera: &Camera, timestamp: Timestamp, frame: &str) -> CameraCalibration {
    let (fx, fy, cx, cy) = (camera.fx(), camera.fy(), camera.cx(), camera.cy());
    let (model, coefficients): (&str, &[f64]) = match camera.lens() {
        Lens::None => ("", &[]),
        Lens::PlumbBob(k) => ("plumb_bob", k),
        Lens::Rational(k) => ("rational_polynomial", k),
        Lens::KannalaBrandt(k) => ("kannala_brandt", k),
    };
    CameraCalibration {
        timestamp: Some(timestamp),
        frame_id: frame.to_owned(),
        width: camera.width(),
        height: camera.height(),
        distortion_model: model.to_owned(),
        D: coefficients.to_vec(),
        K: vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        R: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P: vec![fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    }
}

fn estimate(row: &PoseRow, timestamp: Timestamp) -> Estimate {
    let net = row.net.as_ref();
    let of = |value: fn(&crate::NetColumns) -> f64| net.map_or(f64::NAN, value);
    Estimate {
        timestamp: Some(timestamp),
        frame: row.frame,
        status: row.status.as_str().to_owned(),
        probability: row.probability.unwrap_or(f64::NAN),
        range_m: of(|n| n.range_m),
        distance_m: of(|n| n.distance_m),
        tilt_deg: of(|n| n.pose.plane().tilt().to_degrees()),
        sigma_range_m: of(|n| n.sigma_range_m),
        sigma_tilt_deg: of(|n| n.sigma_tilt_deg),
        sigma_xy_m: of(|n| n.sigma_xy_m),
        junctions: row.junctions.unwrap_or(0),
        latency_ms: row.latency_ms.unwrap_or(f64::NAN),
    }
}

/// Foxglove counts pixels from the corner of the image, not from the centre of its first pixel.
fn point(pixel: Vector2<f64>) -> Point2 {
    Point2 { x: pixel.x + 0.5, y: pixel.y + 0.5 }
}

fn color(r: f64, g: f64, b: f64, a: f64) -> Color {
    Color { r, g, b, a }
}

fn annotations(row: &PoseRow, junctions: &[Junction], twines: &[Twine], timestamp: Timestamp) -> ImageAnnotations {
    let timestamp = Some(timestamp);
    let mut points = Vec::new();
    if !junctions.is_empty() {
        let state = |j: &Junction| match j.state {
            JunctionState::Seen => color(0.1, 0.9, 0.2, 1.0),
            JunctionState::Hidden => color(0.5, 0.5, 0.5, 1.0),
            JunctionState::Fouled => color(0.9, 0.7, 0.1, 1.0),
            JunctionState::Missing => color(1.0, 0.1, 0.1, 1.0),
            JunctionState::Inferred => color(0.1, 0.9, 0.2, 0.4),
        };
        points.push(PointsAnnotation {
            timestamp,
            r#type: POINTS,
            points: junctions.iter().map(|j| point(j.pixel)).collect(),
            outline_colors: junctions.iter().map(state).collect(),
            outline_color: Some(color(0.1, 0.9, 0.2, 1.0)),
            fill_color: None,
            thickness: 4.0,
        });
        let mut by_state = lines(junctions, twines);
        points.extend(STROKES.iter().filter_map(|&(state, [r, g, b, a], thickness)| {
            Some(PointsAnnotation {
                timestamp,
                r#type: LINE_LIST,
                points: by_state.remove(state.as_str())?,
                outline_color: Some(color(r, g, b, a)),
                outline_colors: Vec::new(),
                fill_color: None,
                thickness,
            })
        }));
    }
    let net = row.net.as_ref().map_or_else(String::new, |n| {
        format!("   range {:.3} m   tilt {:.1}°", n.range_m, n.pose.plane().tilt().to_degrees())
    });
    let probability = row.probability.map_or_else(String::new, |p| format!(" {p:.2}"));
    let text = TextAnnotation {
        timestamp,
        position: Some(Point2 { x: 8.0, y: 24.0 }),
        text: format!("{}{probability}{net}", row.status.as_str()),
        font_size: 16.0,
        text_color: Some(color(1.0, 1.0, 1.0, 1.0)),
        background_color: Some(color(0.0, 0.0, 0.0, 0.6)),
    };
    ImageAnnotations { circles: Vec::new(), points, texts: vec![text] }
}

/// How twines of each state are drawn, as in the overlays: red, green, blue, opacity, and width.
const STROKES: [(TwineState, [f64; 4], f64); 6] = [
    (TwineState::Unknown, [0.24, 0.86, 1.0, 0.25], 1.0),
    (TwineState::Present, [0.24, 0.86, 1.0, 0.6], 1.0),
    (TwineState::Hidden, [0.6, 0.6, 0.63, 0.7], 1.0),
    (TwineState::Fouled, [0.27, 0.82, 0.27, 0.7], 2.0),
    (TwineState::Doubtful, [1.0, 0.16, 0.16, 0.9], 2.0),
    (TwineState::Missing, [1.0, 0.16, 0.16, 0.9], 2.0),
];
/// Dashes of twine that looks gone but may not be.
const DASHES: u32 = 3;

/// Ends of the strokes, two points each, by the state of their twine.
fn lines(junctions: &[Junction], twines: &[Twine]) -> HashMap<&'static str, Vec<Point2>> {
    let knots = Knots::new(junctions);
    let mut by_state: HashMap<&'static str, Vec<Point2>> = HashMap::new();
    let mut line = |twine: &Twine| {
        let Some([from, to]) = knots.ends(twine) else { return };
        let dashes = if twine.state == TwineState::Doubtful { DASHES } else { 1 };
        let part = (to - from) / f64::from(2 * dashes - 1);
        let ends = by_state.entry(twine.state.as_str()).or_default();
        for dash in 0..dashes {
            let start = from + part * f64::from(2 * dash);
            ends.extend([point(start), point(start + part)]);
        }
    };
    if twines.is_empty() {
        let state = TwineState::Present;
        for index in junctions.iter().filter_map(|j| j.index) {
            (0..2).for_each(|direction| {
                line(&Twine { index, direction, state, llr: 0.0, contrast: 0.0, width_px: None })
            });
        }
    } else {
        twines.iter().for_each(line);
    }
    by_state
}

#[cfg(test)]
mod tests {
    use super::*;

    /// No line through a gap looks like twine.
    #[test]
    fn twines_have_the_colour_of_their_state() {
        let knot = |i: i32, j: i32| Junction {
            pixel: Vector2::new(f64::from(10 * i), f64::from(10 * j)),
            index: Some((i, j)),
            sigma_px: 0.1,
            state: JunctionState::Seen,
        };
        let junctions = [knot(0, 0), knot(1, 0), knot(2, 0), knot(0, 1), knot(1, 1)];
        let twine =
            |index, direction, state| Twine { index, direction, state, llr: 0.0, contrast: 5.0, width_px: None };
        let twines = [
            twine((0, 0), 0, TwineState::Missing),
            twine((1, 0), 0, TwineState::Doubtful),
            twine((0, 0), 1, TwineState::Present),
            // One of its ends is not in the list.
            twine((2, 0), 0, TwineState::Present),
        ];
        let of = |state: TwineState, twines: &[Twine]| -> Vec<(f64, f64)> {
            let ends = lines(&junctions, twines).remove(state.as_str()).unwrap_or_default();
            ends.iter().map(|p| (p.x, p.y)).collect()
        };
        assert_eq!(of(TwineState::Missing, &twines), [(0.5, 0.5), (10.5, 0.5)]);
        assert_eq!(of(TwineState::Present, &twines), [(0.5, 0.5), (0.5, 10.5)]);
        let dashes = of(TwineState::Doubtful, &twines).iter().map(|p| p.0).collect::<Vec<_>>();
        assert_eq!(dashes, [10.5, 12.5, 14.5, 16.5, 18.5, 20.5]);
        // A method that does not tell of twines.
        assert_eq!(of(TwineState::Present, &[]).len(), 10);
        // Every state has a stroke of its own, and each stands in the message once.
        assert!(TwineState::ALL.iter().all(|s| STROKES.iter().filter(|(of, ..)| of == s).count() == 1));
        let row = PoseRow::unreadable(0, "f.png", Some(1));
        let message = annotations(&row, &junctions, &twines, Timestamp { seconds: 0, nanos: 1 });
        assert_eq!(message.points.len(), 4);
    }
}
