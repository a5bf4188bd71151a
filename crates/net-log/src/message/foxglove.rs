//! `foxglove.RawImage`, `foxglove.CompressedImage`, `foxglove.CameraCalibration`, as protocol buffers and as JSON.
//!
//! One definition serves both. Field numbers are those of Foxglove's published schemas.

use std::borrow::Cow;

use base64::Engine;
use prost::Message;
use serde::{Deserialize, Deserializer};

use crate::frame::FrameError;
use crate::message::raw::RawImage;
use crate::message::{CameraInfo, ImageMessage, Pixels};

type Result<T> = std::result::Result<T, FrameError>;

/// `google.protobuf.Timestamp`; in JSON `{"sec", "nsec"}`.
#[derive(Clone, Copy, PartialEq, Message, Deserialize)]
pub(crate) struct Time {
    #[prost(int64, tag = "1")]
    #[serde(alias = "sec")]
    pub seconds: i64,
    #[prost(int32, tag = "2")]
    #[serde(alias = "nsec")]
    pub nanos: i32,
}

impl Time {
    fn ns(time: Option<&Self>) -> Result<i64> {
        let Some(Self { seconds, nanos }) = time else { return Ok(0) };
        let ns = seconds.checked_mul(1_000_000_000).and_then(|s| s.checked_add(i64::from(*nanos)));
        ns.ok_or_else(|| bad("timestamp", format!("{seconds} s")))
    }
}

#[derive(Clone, PartialEq, Message, Deserialize)]
#[serde(default)]
struct Raw {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<Time>,
    #[prost(fixed32, tag = "2")]
    width: u32,
    #[prost(fixed32, tag = "3")]
    height: u32,
    #[prost(string, tag = "4")]
    encoding: String,
    #[prost(fixed32, tag = "5")]
    step: u32,
    #[prost(bytes = "vec", tag = "6")]
    #[serde(deserialize_with = "base64_bytes")]
    data: Vec<u8>,
}

#[derive(Clone, PartialEq, Message, Deserialize)]
#[serde(default)]
struct Compressed {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<Time>,
    #[prost(bytes = "vec", tag = "2")]
    #[serde(deserialize_with = "base64_bytes")]
    data: Vec<u8>,
}

#[derive(Clone, PartialEq, Message, Deserialize)]
#[serde(default)]
struct Calibration {
    #[prost(fixed32, tag = "2")]
    width: u32,
    #[prost(fixed32, tag = "3")]
    height: u32,
    #[prost(string, tag = "4")]
    distortion_model: String,
    #[prost(double, repeated, tag = "5")]
    #[serde(rename = "D")]
    d: Vec<f64>,
    #[prost(double, repeated, tag = "6")]
    #[serde(rename = "K")]
    k: Vec<f64>,
    #[prost(double, repeated, tag = "8")]
    #[serde(rename = "P")]
    p: Vec<f64>,
}

fn base64_bytes<'de, D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Vec<u8>, D::Error> {
    let text = Cow::<str>::deserialize(deserializer)?;
    base64::engine::general_purpose::STANDARD.decode(text.as_bytes()).map_err(serde::de::Error::custom)
}

fn bad(schema: &str, why: impl ToString) -> FrameError {
    FrameError::Message { schema: format!("foxglove.{schema}"), why: why.to_string() }
}

fn raw_image(raw: Raw) -> Result<ImageMessage<'static>> {
    let Raw { timestamp, width, height, encoding, step, data } = raw;
    let stamp_ns = Time::ns(timestamp.as_ref())?;
    // Words are little-endian by definition of the schema.
    let raw = RawImage { width, height, encoding: encoding.into(), big_endian: false, step, data: data.into() };
    Ok(ImageMessage { stamp_ns, pixels: Pixels::Raw(raw) })
}

pub(super) fn raw_image_protobuf(data: &[u8]) -> Result<ImageMessage<'static>> {
    raw_image(Raw::decode(data).map_err(|e| bad("RawImage", e))?)
}

pub(super) fn raw_image_json(data: &[u8]) -> Result<ImageMessage<'static>> {
    raw_image(serde_json::from_slice(data).map_err(|e| bad("RawImage", e))?)
}

fn compressed_image(image: Compressed) -> Result<ImageMessage<'static>> {
    Ok(ImageMessage { stamp_ns: Time::ns(image.timestamp.as_ref())?, pixels: Pixels::File(image.data.into()) })
}

pub(super) fn compressed_image_protobuf(data: &[u8]) -> Result<ImageMessage<'static>> {
    compressed_image(Compressed::decode(data).map_err(|e| bad("CompressedImage", e))?)
}

pub(super) fn compressed_image_json(data: &[u8]) -> Result<ImageMessage<'static>> {
    compressed_image(serde_json::from_slice(data).map_err(|e| bad("CompressedImage", e))?)
}

fn camera(c: Calibration) -> CameraInfo {
    let Calibration { width, height, distortion_model, d, k, p } = c;
    CameraInfo { width, height, distortion_model, d, k, p, ..CameraInfo::default() }
}

pub(super) fn camera_protobuf(data: &[u8]) -> Result<CameraInfo> {
    Calibration::decode(data).map(camera).map_err(|e| bad("CameraCalibration", e))
}

pub(super) fn camera_json(data: &[u8]) -> Result<CameraInfo> {
    serde_json::from_slice(data).map(camera).map_err(|e| bad("CameraCalibration", e))
}
