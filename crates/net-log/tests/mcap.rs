//! MCAP logs: every encoding, chunk and damage, on files written here.
#![allow(clippy::unwrap_used)]

mod support;

use std::path::{Path, PathBuf};

use net_geometry::{Camera, Lens};
use net_image::Image;
use net_log::{Error, FrameError, Log, OpenOptions, RawFrame, TimeSource, inspect, open};
use proptest::prelude::*;
use support::{
    Entry, Style, encode, grey, image_entry, mcap_bytes, picture, png, ros2_camera_info, ros2_compressed, ros2_image,
};

const START: i64 = 1_700_000_000_000_000_000;
const STEP: i64 = 100_000_000;

/// `count` images of 40 x 30 px, each its own.
fn images(count: usize) -> Vec<Entry> {
    (0..count).map(|i| image_entry("/front/image_raw", START + i as i64 * STEP, &picture(40, 30, i))).collect()
}

fn file(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("log.mcap");
    std::fs::write(&path, bytes).unwrap();
    (dir, path)
}

fn open_with(path: &Path, topic: Option<&str>) -> net_log::Result<Log> {
    open(path, &OpenOptions { topic: topic.map(str::to_owned), ..OpenOptions::default() })
}

/// All frames, and what the log says was wrong with it.
fn read(path: &Path) -> (Vec<RawFrame>, Vec<String>) {
    let mut log = open_with(path, None).unwrap();
    let frames = log.by_ref().collect();
    (frames, log.damage().to_vec())
}

fn read_bytes(bytes: &[u8]) -> (Vec<RawFrame>, Vec<String>) {
    let (_dir, path) = file(bytes);
    read(&path)
}

/// Decodes a log of one message.
fn decode(schema: &'static str, encoding: &'static str, data: Vec<u8>) -> Result<Image<u8>, FrameError> {
    let entry = Entry { topic: "/image", schema, encoding, log_time: 5, data };
    let (frames, damage) = read_bytes(&mcap_bytes(&[entry], Style::default()));
    assert_eq!((frames.len(), damage.len()), (1, 0), "{damage:?}");
    frames[0].decode()
}

fn raw(
    width: u32,
    height: u32,
    encoding: &str,
    big_endian: bool,
    step: u32,
    data: &[u8],
) -> Result<Image<u8>, FrameError> {
    decode("sensor_msgs/msg/Image", "cdr", ros2_image(START, width, height, encoding, big_endian, step, data))
}

#[test]
fn the_same_frames_from_every_kind_of_file() {
    let entries = images(25);
    let styles = [None, Some(mcap::Compression::Zstd), Some(mcap::Compression::Lz4)]
        .into_iter()
        .flat_map(|compression| [true, false].map(|summary| Style { compression, summary, ..Style::default() }));
    let unchunked = [true, false].map(|summary| Style { chunked: false, summary, ..Style::default() });
    for style in styles.chain(unchunked) {
        let (_dir, path) = file(&mcap_bytes(&entries, style));
        let info = inspect(&path, &OpenOptions::default()).unwrap();
        assert_eq!(info.topic.as_deref(), Some("/front/image_raw"));
        assert_eq!((info.frames, info.times), (Some(25), TimeSource::Messages));
        assert_eq!(info.span_ns, Some((START + 1_000_000, START + 24 * STEP + 1_000_000)));
        assert!(info.camera.is_none());
        let (frames, damage) = read(&path);
        assert_eq!((frames.len(), damage), (25, vec![]));
        for (i, frame) in frames.iter().enumerate() {
            assert_eq!((frame.index, &*frame.name), (i as u64, "/front/image_raw"));
            // The time of exposure, not that of logging.
            assert_eq!(frame.timestamp_ns, Some(START + i as i64 * STEP));
            assert_eq!(frame.decode().unwrap(), picture(40, 30, i));
        }
    }
}

#[test]
fn a_header_without_a_time_gets_that_of_logging() {
    let data = ros2_image(0, 2, 1, "mono8", false, 2, &[1, 2]);
    let entry = Entry { topic: "/image", schema: "sensor_msgs/msg/Image", encoding: "cdr", log_time: 123, data };
    assert_eq!(read_bytes(&mcap_bytes(&[entry], Style::default())).0[0].timestamp_ns, Some(123));
}

#[test]
fn every_pixel_encoding() {
    let grey = |width: u32, height: u32, encoding: &str, data: &[u8]| {
        let step = data.len() as u32 / height;
        raw(width, height, encoding, false, step, data).unwrap().data().to_vec()
    };
    assert_eq!(grey(3, 2, "mono8", &[1, 2, 3, 4, 5, 6]), [1, 2, 3, 4, 5, 6]);
    assert_eq!(grey(3, 2, "8UC1", &[1, 2, 3, 4, 5, 6]), [1, 2, 3, 4, 5, 6]);
    assert_eq!(grey(2, 1, "rgb8", &[255, 0, 0, 0, 0, 255]), [76, 29]);
    assert_eq!(grey(2, 1, "bgr8", &[255, 0, 0, 0, 0, 255]), [29, 76]);
    assert_eq!(grey(2, 1, "8UC3", &[255, 0, 0, 0, 0, 255]), [29, 76]);
    assert_eq!(grey(2, 1, "rgba8", &[255, 0, 0, 9, 0, 0, 255, 9]), [76, 29]);
    assert_eq!(grey(2, 1, "bgra8", &[255, 0, 0, 9, 0, 0, 255, 9]), [29, 76]);
    assert_eq!(grey(2, 1, "yuv422", &[9, 40, 9, 50]), [40, 50]);
    assert_eq!(grey(2, 1, "yuv422_yuy2", &[40, 9, 50, 9]), [40, 50]);
    // The chroma rows behind are not looked at.
    assert_eq!(raw(2, 2, "nv12", false, 2, &[1, 2, 3, 4, 9, 9]).unwrap().data(), [1, 2, 3, 4]);
    // Sixteen bits, both byte orders, and twelve of sixteen.
    assert_eq!(grey(2, 1, "mono16", &[0xFF, 0x12, 0x00, 0xFE]), [0x12, 0xFE]);
    assert_eq!(grey(2, 1, "16UC1", &[0xF0, 0x0F, 0x10, 0x00]), [0xFF, 0x01]);
    let swapped = raw(2, 1, "mono16", true, 4, &[0x12, 0xFF, 0xFE, 0x00]).unwrap();
    assert_eq!(swapped.data(), [0x12, 0xFE]);
    // Rows with a gap between them, the last one without.
    assert_eq!(raw(2, 2, "mono8", false, 4, &[1, 2, 0, 0, 3, 4]).unwrap().data(), [1, 2, 3, 4]);
}

#[test]
fn nothing_of_a_bayer_pattern_is_left() {
    // A surface of one colour, under a lamp that makes the four kinds of pixel very different.
    let (r, g, b) = (200.0, 100.0, 40.0);
    for (encoding, first) in
        [("bayer_rggb8", [r, g, g, b]), ("bayer_bggr8", [b, g, g, r]), ("bayer_grbg8", [g, r, b, g])]
    {
        let data: Vec<u8> = (0..6 * 5).map(|i| first[(i / 6 % 2) * 2 + i % 6 % 2] as u8).collect();
        let image = raw(6, 5, encoding, false, 6, &data).unwrap();
        // (R + 2 G + B) / 4, at every pixel, borders included.
        assert!(image.data().iter().all(|&p| p == 110), "{encoding}: {:?}", image.data());
        let words: Vec<u8> = data.iter().flat_map(|&p| (u16::from(p) << 8).to_be_bytes()).collect();
        let image = raw(6, 5, &encoding.replace('8', "16"), true, 12, &words).unwrap();
        assert!(image.data().iter().all(|&p| p == 110), "{encoding} of sixteen bits: {:?}", image.data());
    }
    assert_eq!(raw(1, 1, "bayer_rggb8", false, 1, &[77]).unwrap().data(), [77]);
}

#[test]
fn images_that_do_not_fit_their_data() {
    let why = |r: Result<Image<u8>, FrameError>| r.unwrap_err().to_string();
    assert!(
        why(raw(4, 4, "mono8", false, 4, &[0; 15])).contains("4x4 px of mono8 in rows of 4 bytes do not fit 15 bytes")
    );
    assert!(why(raw(4, 4, "mono8", false, 3, &[0; 64])).contains("rows of 3 bytes"));
    assert!(why(raw(0, 4, "mono8", false, 4, &[0; 64])).contains("0x4 px"));
    assert!(why(raw(4, 4, "mono8", false, 0, &[0; 64])).contains("rows of 0 bytes"));
    assert!(why(raw(70_000, 70_000, "mono8", false, 70_000, &[0; 64])).contains("beyond the limit"));
    let text = why(raw(4, 4, "32FC1", false, 16, &[0; 64]));
    assert!(text.contains("image encoding \"32FC1\" is not known; known are mono8, "), "{text}");
    // The message itself is cut off, or of another layout.
    assert!(
        why(decode("sensor_msgs/msg/Image", "cdr", support::mono8(START, &picture(4, 4, 0))[..40].to_vec()))
            .contains("unexpected end")
    );
    assert!(why(decode("sensor_msgs/msg/Image", "cdr", vec![0, 11, 0, 0, 1, 2])).contains("CDR encapsulation 00 0b"));
    assert!(why(decode("sensor_msgs/msg/Image", "cdr", vec![])).contains("0 bytes"));
}

#[test]
fn compressed_images() {
    let truth = picture(31, 17, 2);
    // The format string lies; the bytes tell.
    let data = ros2_compressed(START, "jpeg", &png(&truth));
    assert_eq!(decode("sensor_msgs/msg/CompressedImage", "cdr", data).unwrap(), truth);
    let webp = encode(&grey(&truth).to_rgb8().into(), image::ImageFormat::WebP);
    let data = ros2_compressed(START, "bgr8; webp compressed bgr8", &webp);
    assert_eq!(decode("sensor_msgs/msg/CompressedImage", "cdr", data).unwrap(), truth);
    let cut = &png(&truth)[..100];
    assert!(decode("sensor_msgs/msg/CompressedImage", "cdr", ros2_compressed(START, "png", cut)).is_err());
    let data = ros2_compressed(START, "16UC1; compressedDepth png", &png(&truth));
    assert!(decode("sensor_msgs/msg/CompressedImage", "cdr", data).unwrap_err().to_string().contains("distances"));
    // What rosbag2 does with messages when told to compress them one by one.
    let data = zstd::encode_all(&support::mono8(START, &truth)[..], 3).unwrap();
    assert_eq!(decode("sensor_msgs/msg/Image", "cdr", data).unwrap(), truth);
}

#[test]
fn ros_1_and_foxglove_messages() {
    let truth = picture(5, 3, 4);
    let string = |s: &str| [&(s.len() as u32).to_le_bytes()[..], s.as_bytes()].concat();
    let header = [&9u32.to_le_bytes()[..], &7u32.to_le_bytes(), &8u32.to_le_bytes(), &string("camera")].concat();
    let sized = |data: &[u8]| [&(data.len() as u32).to_le_bytes()[..], data].concat();
    let size = [3u32.to_le_bytes(), 5u32.to_le_bytes()].concat();
    let data = [&header[..], &size, &string("mono8"), &[0], &5u32.to_le_bytes(), &sized(truth.data())].concat();
    assert_eq!(decode("sensor_msgs/Image", "ros1", data).unwrap(), truth);
    let data = [&header[..], &string("png"), &sized(&png(&truth))].concat();
    assert_eq!(decode("sensor_msgs/CompressedImage", "ros1", data).unwrap(), truth);

    // Protocol buffers by hand: tag and wire type, then the value.
    let field = |tag: u8, bytes: &[u8]| [&[tag << 3 | 2, bytes.len() as u8][..], bytes].concat();
    let fixed = |tag: u8, value: u32| [&[tag << 3 | 5][..], &value.to_le_bytes()].concat();
    let time = field(1, &[1 << 3, 7, 2 << 3, 8]);
    let data =
        [&time[..], &fixed(2, 5), &fixed(3, 3), &field(4, b"mono8"), &fixed(5, 5), &field(6, truth.data())].concat();
    assert_eq!(decode("foxglove.RawImage", "protobuf", data.clone()).unwrap(), truth);
    let entry = Entry { topic: "/image", schema: "foxglove.RawImage", encoding: "protobuf", log_time: 1, data };
    assert_eq!(read_bytes(&mcap_bytes(&[entry], Style::default())).0[0].timestamp_ns, Some(7_000_000_008));
    let file = png(&truth);
    assert!(file.len() < 128, "one byte of length");
    let data = [&time[..], &field(2, &file), &field(3, b"png")].concat();
    assert_eq!(decode("foxglove.CompressedImage", "protobuf", data).unwrap(), truth);

    let json = r#"{"timestamp":{"sec":7,"nsec":8},"frame_id":"c","width":2,"height":1,"encoding":"mono8","step":2,"data":"BQY="}"#;
    assert_eq!(decode("foxglove.RawImage", "json", json.into()).unwrap().data(), [5, 6]);
    assert!(decode("foxglove.RawImage", "json", json.replace("BQY=", "B!").into()).is_err());
    assert!(decode("foxglove.RawImage", "json", json[..40].into()).is_err());
}

#[test]
fn several_topics_are_listed_ready_to_paste() {
    let mut entries = images(3);
    let data = ros2_compressed(START, "png", &png(&picture(8, 8, 0)));
    let entry = |topic, schema, data| Entry { topic, schema, encoding: "cdr", log_time: START as u64, data };
    entries.push(entry("/rear/image_raw/compressed", "sensor_msgs/msg/CompressedImage", data));
    entries.push(entry("/rosout", "rcl_interfaces/msg/Log", vec![0, 1, 0, 0]));
    for summary in [true, false] {
        let (_dir, path) = file(&mcap_bytes(&entries, Style { summary, ..Style::default() }));
        let error = open_with(&path, None).unwrap_err();
        let Error::SeveralTopics { lines, .. } = &error else { panic!("{error}") };
        assert_eq!(
            lines,
            &[
                "  --topic /front/image_raw    # 3 x sensor_msgs/msg/Image",
                "  --topic /rear/image_raw/compressed    # 1 x sensor_msgs/msg/CompressedImage"
            ]
        );
        assert!(error.to_string().contains("2 image topics; choose one:\n  --topic /front/image_raw "), "{error}");
        let text = open_with(&path, Some("/rosout")).unwrap_err().to_string();
        assert!(text.contains("no image topic \"/rosout\"; it has:\n  --topic /front"), "{text}");
        assert_eq!(open_with(&path, Some("/rear/image_raw/compressed")).unwrap().count(), 1);
        let info = inspect(&path, &OpenOptions::default()).unwrap();
        assert_eq!((info.topics.len(), info.topic), (3, None));
    }
    let (_dir, path) = file(&mcap_bytes(&entries[4..], Style::default()));
    let text = open_with(&path, None).unwrap_err().to_string();
    assert!(text.contains("none of its topics holds images: /rosout (rcl_interfaces/msg/Log)"), "{text}");
    let (_dir, path) = file(&mcap_bytes(&[], Style::default()));
    assert!(open_with(&path, None).unwrap_err().to_string().contains("it holds no topics"));
}

#[test]
fn the_camera_beside_the_images() {
    let info = |topic, data| Entry { topic, schema: "sensor_msgs/msg/CameraInfo", encoding: "cdr", log_time: 3, data };
    let (k, p, d) = ([30.5, 31.5, 19.5, 14.5], [28.0, 29.0, 20.0, 15.0], [-0.2, 0.1, 0.0, 0.0, 0.0]);
    let front = ros2_camera_info([40, 30], k, &d, p, 0, [0; 4]);
    let rear = ros2_camera_info([80, 60], k, &[], p, 0, [0; 4]);
    let camera_of = |entries: &[Entry], topic: Option<&str>, summary: bool| {
        let (_dir, path) = file(&mcap_bytes(entries, Style { summary, ..Style::default() }));
        let options = OpenOptions { topic: topic.map(str::to_owned), ..OpenOptions::default() };
        inspect(&path, &options).unwrap().camera
    };
    let both = || {
        let mut entries = images(40);
        entries.insert(20, info("/rear/camera_info", rear.clone()));
        entries.insert(30, info("/front/camera_info", front.clone()));
        entries
    };
    let truth = Camera::new(30.5, 31.5, 19.5, 14.5, 40, 30, Lens::PlumbBob(d)).unwrap();
    for summary in [true, false] {
        let found = camera_of(&both(), None, summary).unwrap();
        assert_eq!((found.topic.as_str(), found.camera.unwrap()), ("/front/camera_info", truth));
    }
    // The only camera serves a topic of another name; of two, none is guessed.
    let only = [image_entry("/image", START, &picture(4, 4, 0)), info("/camera_info", front.clone())];
    assert_eq!(camera_of(&only, None, true).unwrap().camera.unwrap(), truth);
    let mut stranger = both();
    stranger.iter_mut().filter(|e| e.schema.ends_with("Image")).for_each(|e| e.topic = "/third/image_raw");
    let text = camera_of(&stranger, None, true).unwrap().camera.unwrap_err().to_string();
    assert!(text.contains("one of /front/camera_info, /rear/camera_info"), "{text}");
    // A rectified image is one of another camera, without a lens.
    let rectified =
        [image_entry("/front/image_rect", START, &picture(4, 4, 0)), info("/front/camera_info", front.clone())];
    let camera = camera_of(&rectified, None, true).unwrap().camera.unwrap();
    assert_eq!(camera, Camera::new(28.0, 29.0, 20.0, 15.0, 40, 30, Lens::None).unwrap());
    // Binning by two, and a window of the sensor: the ray through a pixel's centre stays what it was.
    let window = ros2_camera_info([40, 30], k, &d, p, 2, [8, 4, 20, 12]);
    let entries = [image_entry("/image", START, &picture(4, 4, 0)), info("/camera_info", window)];
    let camera = camera_of(&entries, None, true).unwrap().camera.unwrap();
    assert_eq!((camera.width(), camera.height()), (10, 6));
    // Image pixel 0 is the mean of sensor pixels 8 and 9.
    assert_eq!((0.0 - camera.cx()) / camera.fx(), (8.5 - 19.5) / 30.5);
    assert_eq!((0.0 - camera.cy()) / camera.fy(), (4.5 - 14.5) / 31.5);
    // A camera that was never calibrated, and a message that is cut off, are errors that name the topic.
    for data in [ros2_camera_info([40, 30], [0.0; 4], &[], p, 0, [0; 4]), front[..50].to_vec()] {
        let entries = [image_entry("/image", START, &picture(4, 4, 0)), info("/camera_info", data)];
        let text = camera_of(&entries, None, true).unwrap().camera.unwrap_err().to_string();
        assert!(text.starts_with("/camera_info: "), "{text}");
    }
}

#[test]
fn a_file_cut_off_anywhere_is_read_to_its_last_whole_message() {
    let entries = images(12);
    for (chunked, compression) in
        [(true, None), (true, Some(mcap::Compression::Zstd)), (true, Some(mcap::Compression::Lz4)), (false, None)]
    {
        let style = Style { chunked, compression, chunk_size: 4000, ..Style::default() };
        let bytes = mcap_bytes(&entries, style);
        let mut before = 0;
        for cut in (100..bytes.len()).step_by(61) {
            let (_dir, path) = file(&bytes[..cut]);
            let mut log = match open_with(&path, None) {
                Ok(log) => log,
                // Cut off before the first topic was named.
                Err(Error::NotALog { .. }) if before == 0 => continue,
                Err(error) => panic!("{error}"),
            };
            let frames: Vec<_> = log.by_ref().collect();
            assert!(frames.len() >= before, "a longer file gives no fewer frames");
            before = frames.len();
            for (i, frame) in frames.iter().enumerate() {
                assert_eq!(frame.decode().unwrap(), picture(40, 30, i));
            }
            // All messages are there once the summary has begun; until then the log says that it is cut off.
            if frames.len() < entries.len() {
                let damage = log.damage();
                assert!(!damage.is_empty() && damage[0].starts_with("log.mcap: "), "{damage:?}");
            }
            if !chunked {
                // Each message of 1,200 px and what is around it takes no more than this.
                assert!(frames.len() >= cut.saturating_sub(300) / 1350, "{} frames in {cut} bytes", frames.len());
            }
        }
        assert_eq!(before, entries.len());
    }
}

#[test]
fn a_damaged_chunk_costs_its_own_frames_only() {
    let entries = images(12);
    for compression in [None, Some(mcap::Compression::Zstd), Some(mcap::Compression::Lz4)] {
        let style = Style { compression, chunk_size: 4000, ..Style::default() };
        let mut bytes = mcap_bytes(&entries, style);
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        assert_eq!(summary.chunk_indexes.len(), 3, "four images a chunk");
        let chunk = &summary.chunk_indexes[1];
        let middle = chunk.chunk_start_offset + chunk.chunk_length / 2;
        bytes[middle as usize] ^= 0x55;
        let (frames, damage) = read_bytes(&bytes);
        assert_eq!(damage.len(), 1, "{damage:?}");
        assert!(
            damage[0].contains(&format!("the chunk at byte {} is damaged: ", chunk.chunk_start_offset)),
            "{damage:?}"
        );
        // Those before and behind stand; of the chunk itself none is believed, and each has its number all the same.
        assert_eq!(good(&frames), [0, 1, 2, 3, 8, 9, 10, 11], "{compression:?}");
        assert_eq!(frames.iter().map(|f| f.index).collect::<Vec<_>>(), (0..12).collect::<Vec<_>>());
    }
    // Damage between chunks, and a chunk of absurd length: the summary knows where the next one is, and what was lost.
    let whole = mcap_bytes(&entries, Style { chunk_size: 4000, ..Style::default() });
    let start = mcap::Summary::read(&whole).unwrap().unwrap().chunk_indexes[1].chunk_start_offset as usize;
    for (at, value) in [(start, 0), (start + 7, 0x7F)] {
        let mut bytes = whole.clone();
        bytes[at] = value;
        let (frames, damage) = read_bytes(&bytes);
        assert_eq!((frames.len(), damage.len()), (12, 1), "{damage:?}");
        assert_eq!(good(&frames), [0, 1, 2, 3, 8, 9, 10, 11]);
    }
}

/// A plain chunk that says its records end early: none of them is believed, and nothing overflows.
#[test]
fn a_chunk_whose_two_lengths_differ_is_damaged() {
    let whole = mcap_bytes(&images(12), Style { compression: None, chunk_size: 4000, ..Style::default() });
    let chunk = mcap::Summary::read(&whole).unwrap().unwrap().chunk_indexes[1].clone();
    for bytes in [whole.clone(), without_summary(&whole)] {
        let mut bytes = bytes;
        // The second byte of the inner length: behind opcode, length, two times, size, checksum and an empty name.
        let inner = chunk.chunk_start_offset as usize + 9 + 32 + 1;
        bytes[inner] = bytes[inner].wrapping_sub(3);
        let (frames, damage) = read_bytes(&bytes);
        assert!(damage[0].contains("its records do not take"), "{damage:?}");
        assert_eq!((frames.len(), good(&frames)), (12, vec![0, 1, 2, 3, 8, 9, 10, 11]));
    }
}

/// A file cut off behind its last chunk: the message indexes follow each chunk, and nothing points to them.
fn without_summary(whole: &[u8]) -> Vec<u8> {
    let summary = mcap::Summary::read(whole).unwrap().unwrap();
    let last = summary.chunk_indexes.iter().max_by_key(|c| c.chunk_start_offset).unwrap();
    whole[..(last.chunk_start_offset + last.chunk_length + last.message_index_length) as usize].to_vec()
}

/// Numbers of the frames that decode to the picture of their number.
fn good(frames: &[RawFrame]) -> Vec<u64> {
    let right = |f: &&RawFrame| f.decode().is_ok_and(|p| p == picture(40, 30, f.index as usize));
    frames.iter().filter(right).map(|f| f.index).collect()
}

/// What comes before `from` is counted by the index, not read: the numbers stay the same.
#[test]
fn frames_keep_their_numbers_wherever_reading_begins() {
    // Five minutes, so that the times of logging leave no doubt.
    let entries: Vec<_> =
        (0..300).map(|i| image_entry("/image", START + i * 1_000_000_000, &picture(9, 7, i as usize))).collect();
    for summary in [true, false] {
        let (_dir, path) = file(&mcap_bytes(&entries, Style { summary, chunk_size: 1500, ..Style::default() }));
        let of = |from: &str, to: Option<&str>| {
            let options =
                OpenOptions { from: from.parse().ok(), to: to.and_then(|t| t.parse().ok()), ..OpenOptions::default() };
            let log = open(&path, &options).unwrap();
            let expected = log.frames_expected().unwrap();
            let frames: Vec<_> = log.collect();
            // The estimate for the progress bar.
            assert!(expected.abs_diff(frames.len() as u64) <= 1, "{expected} {}", frames.len());
            for frame in &frames {
                assert_eq!(frame.timestamp_ns, Some(START + frame.index as i64 * 1_000_000_000));
                assert_eq!(frame.decode().unwrap(), picture(9, 7, frame.index as usize));
            }
            frames.iter().map(|f| f.index).collect::<Vec<_>>()
        };
        assert_eq!(of("200s", None), (200..300).collect::<Vec<_>>());
        assert_eq!(of(&format!("{}ns", START + 250_000_000_000), Some("260")), (250..=260).collect::<Vec<_>>());
        assert_eq!(of("400", None), [0; 0]);
    }
    // Chunks that are passed over are not read: damage in one of them does not show. Where it does show, the frames that are lost
    // have their numbers too, with or without a summary.
    let whole = mcap_bytes(&entries, Style { chunk_size: 1500, ..Style::default() });
    let chunk = mcap::Summary::read(&whole).unwrap().unwrap().chunk_indexes[5].clone();
    for (bytes, first_read) in [(whole.clone(), 200), (without_summary(&whole), 0)] {
        let mut bytes = bytes;
        bytes[(chunk.chunk_start_offset + chunk.chunk_length - 3) as usize] ^= 0x55;
        let (_dir, path) = file(&bytes);
        for (from, damaged) in [(0, true), (200, first_read < 200)] {
            let options = OpenOptions { from: from.to_string().parse().ok(), ..OpenOptions::default() };
            let mut log = open(&path, &options).unwrap();
            let frames: Vec<_> = log.by_ref().collect();
            assert!(frames.iter().map(|f| f.index).eq(from..300), "from {from}");
            let readable = frames.iter().filter(|f| f.decode().is_ok()).inspect(|frame| {
                assert_eq!(frame.timestamp_ns, Some(START + frame.index as i64 * 1_000_000_000));
            });
            let lost = frames.len() - readable.count();
            // A chunk of 1500 bytes holds about ten of these messages.
            assert!(if from == 0 { (5..15).contains(&lost) } else { lost == 0 }, "{lost} lost from {from}");
            assert_eq!(!log.damage().is_empty(), damaged, "{:?}", log.damage());
        }
    }
}

#[test]
fn a_folder_of_files_is_one_log() {
    let entries = images(9);
    let dir = tempfile::tempdir().unwrap();
    // Named so that only a natural order, or the times, put them right.
    for (name, part) in ["bag_9.mcap", "bag_10.mcap", "bag_11.mcap"].iter().zip(entries.chunks(3)) {
        support::write_mcap(&dir.path().join(name), part, Style::default());
    }
    std::fs::write(dir.path().join("metadata.yaml"), "rosbag2_bagfile_information:\n").unwrap();
    let (frames, damage) = read(dir.path());
    assert_eq!((frames.len(), damage.len()), (9, 0));
    for (i, frame) in frames.iter().enumerate() {
        assert_eq!((frame.index, frame.decode().unwrap()), (i as u64, picture(40, 30, i)));
    }
    // A file that never got its first byte, and one cut off: the rest stands.
    std::fs::write(dir.path().join("bag_12.mcap"), b"").unwrap();
    let cut = mcap_bytes(&entries[3..6], Style { chunked: false, ..Style::default() });
    std::fs::write(dir.path().join("bag_10.mcap"), &cut[..cut.len() - 2500]).unwrap();
    let (frames, damage) = read(dir.path());
    assert!((6..9).contains(&frames.len()) && damage.len() == 2, "{} {damage:?}", frames.len());
    // Images beside them: which of the two is meant?
    std::fs::write(dir.path().join("a.png"), png(&picture(4, 4, 0))).unwrap();
    assert!(open_with(dir.path(), None).unwrap_err().to_string().contains("1 images and 4 MCAP files"));
}

#[test]
fn files_that_others_recorded() {
    let Some(root) = std::env::var_os("NETPOSE_DATA").map(|data| Path::new(&data).join("logs")).filter(|p| p.is_dir())
    else {
        eprintln!("skipped: NETPOSE_DATA does not name a folder with recorded logs");
        return;
    };
    let root = &root;
    let mut files = Vec::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap().flatten() {
            match entry.path() {
                path if path.is_dir() => folders.push(path),
                path if path.extension().is_some_and(|e| e == "mcap") => files.push(path),
                _ => {}
            }
        }
    }
    files.sort();
    assert!(files.len() > 10);
    for file in files {
        let name = file.strip_prefix(root).unwrap().display().to_string();
        let Ok(info) = inspect(&file, &OpenOptions::default()) else {
            assert!(name.ends_with("chunk_not_closed.mcap"), "{name}");
            continue;
        };
        for topic in info.topics.iter().filter(|t| t.is_image) {
            let mut log = open_with(&file, Some(&topic.name)).unwrap();
            let count = log.by_ref().count() as u64;
            assert!(topic.messages.is_none_or(|n| n == count), "{name} {}: {count}", topic.name);
            assert!(log.damage().is_empty(), "{name}: {:?}", log.damage());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Whatever is cut off, changed or left out: no panic, and the frames that decode are in order.
    #[test]
    fn any_bytes(
        chunked: bool,
        summary: bool,
        compression in 0..3usize,
        cut in 0.0..1.5f64,
        changes in prop::collection::vec((0.0..1.0f64, any::<u8>()), 0..6),
    ) {
        let compression = [None, Some(mcap::Compression::Zstd), Some(mcap::Compression::Lz4)][compression];
        let mut entries = images(4);
        let data = ros2_camera_info([40, 30], [30.0, 30.0, 20.0, 15.0], &[0.1; 5], [30.0; 4], 0, [0; 4]);
        entries.push(Entry { topic: "/camera_info", schema: "sensor_msgs/msg/CameraInfo", encoding: "cdr", log_time: 3, data });
        let mut bytes = mcap_bytes(&entries, Style { compression, chunked, summary, chunk_size: 2000 });
        for (at, byte) in changes {
            let at = (at * bytes.len() as f64) as usize;
            bytes[at] = byte;
        }
        bytes.truncate((cut * bytes.len() as f64) as usize);
        let (_dir, path) = file(&bytes);
        if let Ok(log) = open_with(&path, None) {
            let kept: Vec<_> = log.filter(|f| f.decode().is_ok()).map(|f| f.timestamp_ns.unwrap()).collect();
            prop_assert!(kept.is_sorted_by(|a, b| a < b), "{:?}", kept);
        }
    }

    /// Messages by themselves: the fields of any type from any bytes.
    #[test]
    fn any_message(kind in 0..8usize, cut in 0.0..1.2f64, changes in prop::collection::vec((0.0..1.0f64, any::<u8>()), 0..5)) {
        let (schema, encoding) = [
            ("sensor_msgs/msg/Image", "cdr"), ("sensor_msgs/msg/CompressedImage", "cdr"), ("sensor_msgs/Image", "ros1"),
            ("sensor_msgs/CompressedImage", "ros1"), ("foxglove.RawImage", "protobuf"), ("foxglove.CompressedImage", "protobuf"),
            ("foxglove.RawImage", "json"), ("foxglove.CompressedImage", "json"),
        ][kind];
        let mut data = support::mono8(START, &picture(6, 5, 0));
        for (at, byte) in changes {
            let at = (at * data.len() as f64) as usize;
            data[at] = byte;
        }
        data.truncate((cut * data.len() as f64) as usize);
        if let Ok(image) = decode(schema, encoding, data) {
            prop_assert_eq!(image.data().len(), image.width() * image.height());
        }
    }
}
