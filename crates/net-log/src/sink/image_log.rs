//! Logs of images: the folder and the MCAP that `open` reads back.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use image::ImageEncoder;
use mcap::records::MessageHeader;
use net_geometry::{Camera, Lens};
use net_image::GrayView;
use re_cdr::{CdrWriter, LittleEndian};

use crate::calibration::CAMERA_YAML;
use crate::error::{Error, Result};
use crate::sink::annotated::failed;
use crate::source::TIMESTAMPS_CSV;

/// Writes a folder of PNG images with `timestamps.csv` and `camera.yaml`.
#[derive(Debug)]
pub struct ImageFolderWriter {
    dir: PathBuf,
    table_path: PathBuf,
    table: csv::Writer<File>,
}

impl ImageFolderWriter {
    /// Makes the folder, if it is not there, and writes the camera.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn create(dir: &Path, camera: &Camera) -> Result<Self> {
        std::fs::create_dir_all(dir).map_err(Error::io("create", dir))?;
        write_camera_yaml(&dir.join(CAMERA_YAML), camera)?;
        let table_path = dir.join(TIMESTAMPS_CSV);
        let file = File::create(&table_path).map_err(Error::io("create", &table_path))?;
        let mut this = Self { dir: dir.to_owned(), table_path, table: csv::Writer::from_writer(file) };
        this.row(["file", "timestamp_ns"])?;
        Ok(this)
    }

    /// Adds an image as a PNG file called `name`.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn write(&mut self, name: &str, timestamp_ns: i64, image: GrayView<'_>) -> Result<()> {
        self.write_encoded(name, timestamp_ns, &png(image))
    }

    /// Adds an image file as it is.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn write_encoded(&mut self, name: &str, timestamp_ns: i64, file: &[u8]) -> Result<()> {
        let path = self.dir.join(name);
        std::fs::write(&path, file).map_err(Error::io("write", &path))?;
        self.row([name, &timestamp_ns.to_string()])
    }

    fn row(&mut self, cells: [&str; 2]) -> Result<()> {
        let written = self.table.write_record(cells).map_err(std::io::Error::from).and_then(|()| self.table.flush());
        written.map_err(Error::io("write", &self.table_path))
    }
}

/// The image as a PNG file.
pub fn png(image: GrayView<'_>) -> Vec<u8> {
    let pixels: Vec<u8> = image.rows().flatten().copied().collect();
    let mut file = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut file);
    let (width, height) = (image.width() as u32, image.height() as u32);
    let written = encoder.write_image(&pixels, width, height, image::ExtendedColorType::L8);
    // The buffer has one value for each pixel, and memory takes all that is written to it.
    written.expect("an image that fits its size");
    file
}

/// Writes the camera as ROS `camera_calibration` does.
///
/// # Errors
/// [`Error::Io`] names the path.
pub fn write_camera_yaml(path: &Path, camera: &Camera) -> Result<()> {
    let (fx, fy, cx, cy) = (camera.fx(), camera.fy(), camera.cx(), camera.cy());
    let (model, coefficients): (&str, &[f64]) = match camera.lens() {
        Lens::None => ("plumb_bob", &[0.0; 5]),
        Lens::PlumbBob(k) => ("plumb_bob", k),
        Lens::Rational(k) => ("rational_polynomial", k),
        Lens::KannalaBrandt(k) => ("equidistant", k),
    };
    // `{:?}` keeps a decimal point in whole numbers, and enough digits to read back the same value.
    let matrix = |name: &str, columns: usize, data: &[f64]| {
        format!("{name}:\n  rows: {}\n  cols: {columns}\n  data: {data:?}\n", data.len() / columns)
    };
    let text = [
        format!("image_width: {}\nimage_height: {}\ncamera_name: camera\n", camera.width(), camera.height()),
        matrix("camera_matrix", 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        format!("distortion_model: {model}\n"),
        matrix("distortion_coefficients", coefficients.len(), coefficients),
        matrix("rectification_matrix", 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        matrix("projection_matrix", 4, &[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
    ];
    std::fs::write(path, text.concat()).map_err(Error::io("write", path))
}

/// Writes an MCAP of ROS 2 messages: `/camera/image_raw` (`sensor_msgs/msg/Image`, `mono8`) or `/camera/image_raw/compressed`
/// (`sensor_msgs/msg/CompressedImage`), and `/camera/camera_info` beside every image.
pub struct ImageMcapWriter {
    path: PathBuf,
    writer: mcap::Writer<BufWriter<File>>,
    camera: Camera,
    camera_channel: u16,
    image_channel: Option<u16>,
    compressed_channel: Option<u16>,
    sequence: u32,
}

impl std::fmt::Debug for ImageMcapWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ImageMcapWriter").field("path", &self.path).finish_non_exhaustive()
    }
}

/// Frame of reference in the messages' headers.
const FRAME: &str = "camera";

/// Definitions that the file carries along, so that any reader knows the types.
const HEADER_MSG: &str = "\
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";
const IMAGE_MSG: &str = "\
std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
";
const COMPRESSED_IMAGE_MSG: &str = "\
std_msgs/Header header
string format
uint8[] data
";
const CAMERA_INFO_MSG: &str = "\
std_msgs/Header header
uint32 height
uint32 width
string distortion_model
float64[] d
float64[9] k
float64[9] r
float64[12] p
uint32 binning_x
uint32 binning_y
sensor_msgs/RegionOfInterest roi
";
const ROI_MSG: &str = "\
================================================================================
MSG: sensor_msgs/RegionOfInterest
uint32 x_offset
uint32 y_offset
uint32 height
uint32 width
bool do_rectify
";

impl ImageMcapWriter {
    /// Starts a new file.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn create(path: &Path, camera: &Camera) -> Result<Self> {
        let file = File::create(path).map_err(Error::io("create", path))?;
        let options = mcap::WriteOptions::new().profile("ros2").library(concat!("netpose ", env!("CARGO_PKG_VERSION")));
        let mut writer = options.create(BufWriter::new(file)).map_err(failed(path))?;
        let info = [CAMERA_INFO_MSG, HEADER_MSG, ROI_MSG].concat();
        let camera_channel = channel(&mut writer, "/camera/camera_info", "CameraInfo", &info).map_err(failed(path))?;
        Ok(Self {
            path: path.to_owned(),
            writer,
            camera: *camera,
            camera_channel,
            image_channel: None,
            compressed_channel: None,
            sequence: 0,
        })
    }

    /// Adds an image as it is.
    ///
    /// # Errors
    /// [`Error::Io`] names the path; [`Error::Value`] for a time before 1970 or after 2038, which ROS cannot tell.
    pub fn write(&mut self, timestamp_ns: i64, image: GrayView<'_>) -> Result<()> {
        let message = message(timestamp_ns, |w| {
            w.write_u32(image.height() as u32);
            w.write_u32(image.width() as u32);
            w.write_string("mono8");
            w.write_u8(0);
            w.write_u32(image.width() as u32);
            w.write_sequence_length(image.width() * image.height());
            image.rows().for_each(|row| w.buffer_mut().extend_from_slice(row));
        })?;
        let channel = match self.image_channel {
            Some(channel) => channel,
            None => {
                let schema = [IMAGE_MSG, HEADER_MSG].concat();
                channel(&mut self.writer, "/camera/image_raw", "Image", &schema).map_err(failed(&self.path))?
            }
        };
        self.image_channel = Some(channel);
        self.send(channel, timestamp_ns, &message)
    }

    /// Adds an image file, of `format` `jpeg` or `png`.
    ///
    /// # Errors
    /// As [`ImageMcapWriter::write`].
    pub fn write_encoded(&mut self, timestamp_ns: i64, format: &str, file: &[u8]) -> Result<()> {
        let message = message(timestamp_ns, |w| {
            w.write_string(format);
            w.write_bytes(file);
        })?;
        let channel = match self.compressed_channel {
            Some(channel) => channel,
            None => {
                let (topic, schema) = ("/camera/image_raw/compressed", [COMPRESSED_IMAGE_MSG, HEADER_MSG].concat());
                channel(&mut self.writer, topic, "CompressedImage", &schema).map_err(failed(&self.path))?
            }
        };
        self.compressed_channel = Some(channel);
        self.send(channel, timestamp_ns, &message)
    }

    /// Writes index and footer.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn finish(mut self) -> Result<()> {
        self.writer.finish().map_err(failed(&self.path))?;
        self.writer.into_inner().flush().map_err(Error::io("write", &self.path))
    }

    fn send(&mut self, channel_id: u16, timestamp_ns: i64, image: &[u8]) -> Result<()> {
        let info = camera_info(&self.camera, timestamp_ns)?;
        let time = timestamp_ns.unsigned_abs();
        for (channel_id, data) in [(channel_id, image), (self.camera_channel, &info)] {
            let header = MessageHeader { channel_id, sequence: self.sequence, log_time: time, publish_time: time };
            self.writer.write_to_known_channel(&header, data).map_err(failed(&self.path))?;
        }
        self.sequence = self.sequence.wrapping_add(1);
        Ok(())
    }
}

fn channel(
    writer: &mut mcap::Writer<BufWriter<File>>,
    topic: &str,
    name: &str,
    definition: &str,
) -> mcap::McapResult<u16> {
    let schema = writer.add_schema(&format!("sensor_msgs/msg/{name}"), "ros2msg", definition.as_bytes())?;
    writer.add_channel(schema, topic, "cdr", &BTreeMap::new())
}

/// A stamped message in little-endian CDR.
fn message(timestamp_ns: i64, body: impl FnOnce(&mut CdrWriter<'_, LittleEndian>)) -> Result<Vec<u8>> {
    let seconds = i32::try_from(timestamp_ns.div_euclid(1_000_000_000)).ok().filter(|_| timestamp_ns >= 0);
    let seconds = seconds.ok_or_else(|| Error::Value {
        field: "timestamp_ns",
        value: timestamp_ns.to_string(),
        expected: "a time from 1970 to 2038",
    })?;
    let mut fields = Vec::new();
    let mut writer = CdrWriter::new(&mut fields);
    writer.write_i32(seconds);
    writer.write_u32((timestamp_ns % 1_000_000_000) as u32);
    writer.write_string(FRAME);
    body(&mut writer);
    let mut message = vec![0, 1, 0, 0];
    message.append(&mut fields);
    Ok(message)
}

fn camera_info(camera: &Camera, timestamp_ns: i64) -> Result<Vec<u8>> {
    let (fx, fy, cx, cy) = (camera.fx(), camera.fy(), camera.cx(), camera.cy());
    let (model, coefficients): (&str, &[f64]) = match camera.lens() {
        Lens::None => ("plumb_bob", &[0.0; 5]),
        Lens::PlumbBob(k) => ("plumb_bob", k),
        Lens::Rational(k) => ("rational_polynomial", k),
        Lens::KannalaBrandt(k) => ("equidistant", k),
    };
    message(timestamp_ns, |w| {
        w.write_u32(camera.height());
        w.write_u32(camera.width());
        w.write_string(model);
        w.write_sequence_length(coefficients.len());
        coefficients.iter().for_each(|&k| w.write_f64(k));
        [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0].into_iter().for_each(|k| w.write_f64(k));
        [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0].into_iter().for_each(|k| w.write_f64(k));
        [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0].into_iter().for_each(|k| w.write_f64(k));
        // Binning, window of the sensor: none.
        [0; 6].into_iter().for_each(|n| w.write_u32(n));
        w.write_bool(false);
    })
}
