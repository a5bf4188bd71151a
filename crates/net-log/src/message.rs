//! Messages of images and cameras, by message type and encoding.
//!
//! | type | encodings |
//! |---|---|
//! | `sensor_msgs/Image`, `sensor_msgs/CompressedImage`, `sensor_msgs/CameraInfo` | ROS 2 (`cdr`), ROS 1 (`ros1`) |
//! | `foxglove.RawImage`, `foxglove.CompressedImage`, `foxglove.CameraCalibration` | `protobuf`, `json` |

mod camera_info;
mod compressed_image;
mod fields;
mod foxglove;
mod image;
pub(crate) mod raw;

use std::borrow::Cow;

use net_geometry::Camera;
use net_image::Image;

use crate::error::Result;
use crate::frame::FrameError;
use crate::picture;
pub(crate) use camera_info::CameraInfo;
use fields::{Cdr, Fields, Ros1};
use raw::RawImage;

/// How a message's fields are laid out in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// Common data representation, as ROS 2 has it.
    Cdr,
    /// ROS 1 serialisation.
    Ros1,
    /// Protocol buffers, by Foxglove's definitions.
    Protobuf,
    /// JSON, by Foxglove's definitions.
    Json,
}

/// A message type that holds an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ImageType {
    encoding: Encoding,
    compressed: bool,
}

/// A message type that holds a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct CameraType {
    encoding: Encoding,
}

/// An image as its message has it.
pub(crate) struct ImageMessage<'a> {
    /// Time of exposure, ns; zero where the header has none.
    pub stamp_ns: i64,
    pub pixels: Pixels<'a>,
}

/// The picture in a message.
pub(crate) enum Pixels<'a> {
    /// As the sensor gave it.
    Raw(RawImage<'a>),
    /// A picture file. Its format is told by its bytes: the messages' `format` is not to be relied on.
    File(Cow<'a, [u8]>),
}

/// Namespace and name of a type, whichever way it is written: `sensor_msgs/msg/Image`, `sensor_msgs/Image`, `foxglove.RawImage`.
fn type_of(encoding: &str, schema: &str) -> Option<(Encoding, &'static str)> {
    let (package, name) = schema.rsplit_once(['/', '.'])?;
    let ros = matches!(package, "sensor_msgs" | "sensor_msgs/msg");
    let foxglove = package == "foxglove";
    let encoding = match encoding {
        "cdr" if ros => Encoding::Cdr,
        "ros1" if ros => Encoding::Ros1,
        "protobuf" if foxglove => Encoding::Protobuf,
        "json" if foxglove => Encoding::Json,
        _ => return None,
    };
    let names = ["Image", "RawImage", "CompressedImage", "CameraInfo", "CameraCalibration"];
    Some((encoding, names.into_iter().find(|n| *n == name)?))
}

impl ImageType {
    pub(crate) fn of(encoding: &str, schema: &str) -> Option<Self> {
        let (encoding, name) = type_of(encoding, schema)?;
        match name {
            "Image" | "RawImage" => Some(Self { encoding, compressed: false }),
            "CompressedImage" => Some(Self { encoding, compressed: true }),
            _ => None,
        }
    }

    /// Time of exposure, ns; zero where the header has none.
    pub(crate) fn stamp(self, data: &[u8]) -> std::result::Result<i64, FrameError> {
        let data = unpacked(data)?;
        match self.encoding {
            Encoding::Cdr => fields::stamp(&mut Cdr::new(&data)?),
            Encoding::Ros1 => fields::stamp(&mut Ros1::new(&data)),
            Encoding::Protobuf | Encoding::Json => self.parse(&data).map(|m| m.stamp_ns),
        }
    }

    /// The picture as grey.
    pub(crate) fn decode(self, data: &[u8]) -> std::result::Result<Image<u8>, FrameError> {
        match self.parse(&unpacked(data)?)?.pixels {
            Pixels::Raw(raw) => raw.decode(),
            Pixels::File(bytes) => picture::decode(&bytes),
        }
    }

    fn parse(self, data: &[u8]) -> std::result::Result<ImageMessage<'_>, FrameError> {
        fn ros<'a>(compressed: bool, fields: impl Fields<'a>) -> std::result::Result<ImageMessage<'a>, FrameError> {
            if compressed { compressed_image::read(fields) } else { image::read(fields) }
        }
        match (self.encoding, self.compressed) {
            (Encoding::Cdr, compressed) => ros(compressed, Cdr::new(data)?),
            (Encoding::Ros1, compressed) => ros(compressed, Ros1::new(data)),
            (Encoding::Protobuf, false) => foxglove::raw_image_protobuf(data),
            (Encoding::Protobuf, true) => foxglove::compressed_image_protobuf(data),
            (Encoding::Json, false) => foxglove::raw_image_json(data),
            (Encoding::Json, true) => foxglove::compressed_image_json(data),
        }
    }
}

impl CameraType {
    pub(crate) fn of(encoding: &str, schema: &str) -> Option<Self> {
        let (encoding, name) = type_of(encoding, schema)?;
        matches!(name, "CameraInfo" | "CameraCalibration").then_some(Self { encoding })
    }

    /// The camera of the message `data` of topic `name`, for the images of `image_topic`.
    pub(crate) fn camera(self, name: &str, data: &[u8], image_topic: Option<&str>) -> Result<Camera> {
        let parse = || {
            let data = unpacked(data)?;
            match self.encoding {
                Encoding::Cdr => camera_info::read(Cdr::new(&data)?),
                Encoding::Ros1 => camera_info::read(Ros1::new(&data)),
                Encoding::Protobuf => foxglove::camera_protobuf(&data),
                Encoding::Json => foxglove::camera_json(&data),
            }
        };
        let info: CameraInfo = parse()
            .map_err(|e| crate::calibration::wrong(name, "message", "unreadable", &format!("a camera's: {e}")))?;
        info.camera(name, image_topic.is_some_and(is_rectified))
    }
}

/// The part of a topic's name that an image and its camera share: `/front` of `/front/image_raw/compressed` and `/front/camera_info`.
pub(crate) fn namespace(topic: &str) -> &str {
    let topic = topic.strip_suffix("/compressed").unwrap_or(topic);
    topic.rsplit_once('/').map_or("", |(namespace, _)| namespace)
}

/// Whether a topic's images have had their lens distortion removed, as `image_proc` names them: `image_rect`, `image_rect_color`.
fn is_rectified(topic: &str) -> bool {
    let topic = topic.strip_suffix("/compressed").unwrap_or(topic);
    topic.rsplit('/').next().is_some_and(|name| name.starts_with("image_rect"))
}

/// Takes off the zstd that rosbag2 can put around each message. No other message begins with these bytes.
fn unpacked(data: &[u8]) -> std::result::Result<Cow<'_, [u8]>, FrameError> {
    if !data.starts_with(&[0x28, 0xB5, 0x2F, 0xFD]) {
        return Ok(Cow::Borrowed(data));
    }
    let mut unpacked = Vec::new();
    let limit = picture::MAX_BYTES;
    let read = zstd::Decoder::new(data)
        .and_then(|d| std::io::Read::read_to_end(&mut std::io::Read::take(d, limit), &mut unpacked));
    match read {
        Ok(size) if (size as u64) < limit => Ok(Cow::Owned(unpacked)),
        Ok(_) => Err(FrameError::Message { schema: "zstd".to_owned(), why: format!("more than {limit} bytes") }),
        Err(e) => Err(FrameError::Message { schema: "zstd".to_owned(), why: e.to_string() }),
    }
}
