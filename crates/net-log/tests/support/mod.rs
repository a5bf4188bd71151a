//! Logs made for tests: pictures, messages, MCAP files.
#![allow(dead_code, clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use mcap::records::MessageHeader;
use net_image::Image;
use re_cdr::{CdrWriter, LittleEndian};

/// A picture of `width` x `height` whose pixels all differ from their neighbours, and from those of another `seed`.
pub fn picture(width: usize, height: usize, seed: usize) -> Image<u8> {
    let data = (0..width * height).map(|i| (i * 37 + (i / width) * 11 + seed * 59) as u8).collect();
    Image::from_vec(data, width, height).unwrap()
}

/// A smooth picture, which JPEG keeps to within a few grey levels.
pub fn smooth(width: usize, height: usize) -> Image<u8> {
    let value = |u: usize, v: usize| (40 + 100 * u / width + 80 * v / height) as u8;
    Image::from_vec((0..height * width).map(|i| value(i % width, i / width)).collect(), width, height).unwrap()
}

/// The picture as a file of the given format.
pub fn encode(picture: &image::DynamicImage, format: image::ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// The grey picture as a PNG file.
pub fn png(picture: &Image<u8>) -> Vec<u8> {
    encode(&grey(picture), image::ImageFormat::Png)
}

/// The grey picture as the image crate has it.
pub fn grey(picture: &Image<u8>) -> image::DynamicImage {
    let (width, height) = (picture.width() as u32, picture.height() as u32);
    image::GrayImage::from_raw(width, height, picture.data().to_vec()).unwrap().into()
}

/// `std_msgs/Header` and what follows it, as ROS 2 lays it out.
pub fn cdr(stamp_ns: i64, body: impl FnOnce(&mut CdrWriter<'_, LittleEndian>)) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = CdrWriter::<LittleEndian>::new(&mut bytes);
    writer.write_i32((stamp_ns / 1_000_000_000) as i32);
    writer.write_u32((stamp_ns % 1_000_000_000) as u32);
    writer.write_string("camera");
    body(&mut writer);
    [vec![0, 1, 0, 0], bytes].concat()
}

/// `sensor_msgs/msg/Image`.
pub fn ros2_image(
    stamp_ns: i64,
    width: u32,
    height: u32,
    encoding: &str,
    big_endian: bool,
    step: u32,
    data: &[u8],
) -> Vec<u8> {
    cdr(stamp_ns, |w| {
        w.write_u32(height);
        w.write_u32(width);
        w.write_string(encoding);
        w.write_u8(u8::from(big_endian));
        w.write_u32(step);
        w.write_bytes(data);
    })
}

/// The grey picture as `sensor_msgs/msg/Image` of encoding `mono8`.
pub fn mono8(stamp_ns: i64, picture: &Image<u8>) -> Vec<u8> {
    let (width, height) = (picture.width() as u32, picture.height() as u32);
    ros2_image(stamp_ns, width, height, "mono8", false, width, picture.data())
}

/// `sensor_msgs/msg/CompressedImage`.
pub fn ros2_compressed(stamp_ns: i64, format: &str, data: &[u8]) -> Vec<u8> {
    cdr(stamp_ns, |w| {
        w.write_string(format);
        w.write_bytes(data);
    })
}

/// `sensor_msgs/msg/CameraInfo` of a `plumb_bob` camera, with `fx, fy, cx, cy` for the image and for the rectified image.
pub fn ros2_camera_info(size: [u32; 2], k: [f64; 4], d: &[f64], p: [f64; 4], binning: u32, roi: [u32; 4]) -> Vec<u8> {
    cdr(7, |w| {
        w.write_u32(size[1]);
        w.write_u32(size[0]);
        w.write_string("plumb_bob");
        w.write_sequence_length(d.len());
        d.iter().for_each(|&x| w.write_f64(x));
        [k[0], 0.0, k[2], 0.0, k[1], k[3], 0.0, 0.0, 1.0].into_iter().for_each(|x| w.write_f64(x));
        [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0].into_iter().for_each(|x| w.write_f64(x));
        [p[0], 0.0, p[2], 0.0, 0.0, p[1], p[3], 0.0, 0.0, 0.0, 1.0, 0.0].into_iter().for_each(|x| w.write_f64(x));
        w.write_u32(binning);
        w.write_u32(binning);
        let [left, top, width, height] = roi;
        [left, top, height, width].into_iter().for_each(|x| w.write_u32(x));
        w.write_bool(false);
    })
}

/// A message to be put into an MCAP.
pub struct Entry {
    pub topic: &'static str,
    pub schema: &'static str,
    pub encoding: &'static str,
    pub log_time: u64,
    pub data: Vec<u8>,
}

/// A ROS 2 image message, logged 1 ms after its stamp.
pub fn image_entry(topic: &'static str, stamp_ns: i64, picture: &Image<u8>) -> Entry {
    let log_time = stamp_ns as u64 + 1_000_000;
    Entry { topic, schema: "sensor_msgs/msg/Image", encoding: "cdr", log_time, data: mono8(stamp_ns, picture) }
}

/// How an MCAP is written.
#[derive(Clone, Copy)]
pub struct Style {
    pub compression: Option<mcap::Compression>,
    pub chunked: bool,
    pub summary: bool,
    pub chunk_size: u64,
}

impl Default for Style {
    fn default() -> Self {
        Self { compression: Some(mcap::Compression::Zstd), chunked: true, summary: true, chunk_size: 20_000 }
    }
}

/// The bytes of an MCAP with these messages.
pub fn mcap_bytes(entries: &[Entry], style: Style) -> Vec<u8> {
    let mut options = mcap::WriteOptions::new()
        .profile("ros2")
        .compression(style.compression)
        .use_chunks(style.chunked)
        .chunk_size(Some(style.chunk_size));
    if !style.summary {
        options = options
            .emit_statistics(false)
            .emit_summary_offsets(false)
            .repeat_channels(false)
            .repeat_schemas(false)
            .emit_chunk_indexes(false)
            .emit_message_indexes(false)
            .emit_attachment_indexes(false)
            .emit_metadata_indexes(false);
    }
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let mut channels = BTreeMap::new();
    for (sequence, entry) in (0..).zip(entries) {
        let channel_id = *channels.entry((entry.topic, entry.schema)).or_insert_with(|| {
            let schema = writer.add_schema(entry.schema, "ros2msg", b"").unwrap();
            writer.add_channel(schema, entry.topic, entry.encoding, &BTreeMap::new()).unwrap()
        });
        let header = MessageHeader { channel_id, sequence, log_time: entry.log_time, publish_time: entry.log_time };
        writer.write_to_known_channel(&header, &entry.data).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// Writes the messages as an MCAP file.
pub fn write_mcap(path: &Path, entries: &[Entry], style: Style) {
    std::fs::write(path, mcap_bytes(entries, style)).unwrap();
}
