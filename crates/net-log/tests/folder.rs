//! Image folders: order, times, formats, and whatever can be wrong with them.
#![allow(clippy::unwrap_used)]

mod support;

use std::path::Path;

use image::{DynamicImage, ImageFormat};
use net_log::{Error, FrameError, LogKind, OpenOptions, RawFrame, TimeBound, TimeSource, inspect, open};
use proptest::prelude::*;
use support::{encode, grey, picture, png, smooth};

fn frames(path: &Path) -> Vec<RawFrame> {
    open(path, &OpenOptions::default()).unwrap().collect()
}

fn folder(names: &[&str]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for (i, name) in names.iter().enumerate() {
        std::fs::write(dir.path().join(name), png(&picture(8, 6, i))).unwrap();
    }
    dir
}

fn names(frames: &[RawFrame]) -> Vec<&str> {
    frames.iter().map(|f| &*f.name).collect()
}

fn times(frames: &[RawFrame]) -> Vec<Option<i64>> {
    frames.iter().map(|f| f.timestamp_ns).collect()
}

#[test]
fn natural_order_and_times_made_up() {
    let dir = folder(&["f10.png", "f9.png", "f1.png"]);
    std::fs::write(dir.path().join("notes.txt"), "none of ours").unwrap();
    std::fs::write(dir.path().join("camera.yaml"), "none of ours").unwrap();
    let options = OpenOptions { fps: 4.0, ..OpenOptions::default() };
    let log = open(dir.path(), &options).unwrap();
    assert_eq!(log.info().kind, LogKind::ImageFolder);
    assert_eq!(log.info().times, TimeSource::MadeUp { fps: 4.0 });
    assert_eq!(log.info().frames, Some(3));
    assert_eq!(log.info().span_ns, Some((0, 500_000_000)));
    assert_eq!(log.info().camera_file, Some(dir.path().join("camera.yaml")));
    let frames: Vec<_> = log.collect();
    assert_eq!(names(&frames), ["f1.png", "f9.png", "f10.png"]);
    assert_eq!(times(&frames), [Some(0), Some(250_000_000), Some(500_000_000)]);
    assert_eq!(frames.iter().map(|f| f.index).collect::<Vec<_>>(), [0, 1, 2]);
    assert_eq!(frames[2].decode().unwrap(), picture(8, 6, 0));
}

#[test]
fn times_from_a_table() {
    let dir = folder(&["a.png", "b.png", "c.png", "d.png"]);
    // Columns in another order, one more of them, a file that is gone, one that is not named, a line never finished.
    let table = "camera,timestamp_ns,file\n0,1000,a.png\n0,2000,b.png\n0,2500,bb.png\n0,\"x\",c.png\n";
    std::fs::write(dir.path().join("timestamps.csv"), table).unwrap();
    let log = open(dir.path(), &OpenOptions::default()).unwrap();
    assert_eq!(log.info().times, TimeSource::TimestampsCsv);
    let frames: Vec<_> = log.collect();
    assert_eq!(names(&frames), ["a.png", "b.png", "bb.png", "c.png", "d.png"]);
    assert_eq!(times(&frames), [Some(1000), Some(2000), Some(2500), None, None]);
    let why: Vec<String> = frames[2..].iter().map(|f| f.decode().unwrap_err().to_string()).collect();
    assert!(why[0].contains("cannot read it"), "{why:?}");
    assert!(why[1].contains("timestamps.csv, line 5: \"x\" is not a whole number"), "{why:?}");
    assert!(why[2].contains("timestamps.csv does not name it"), "{why:?}");
    assert!(frames[..2].iter().all(|f| f.decode().is_ok()));
}

#[test]
fn a_table_that_can_not_be_used() {
    let dir = folder(&["a.png", "b.png"]);
    let open_with = |table: &str| {
        std::fs::write(dir.path().join("timestamps.csv"), table).unwrap();
        open(dir.path(), &OpenOptions::default())
    };
    let text = open_with("name,time\na.png,1\n").unwrap_err().to_string();
    assert!(text.contains("timestamps.csv, line 1: no column \"file\""), "{text}");
    // A table cut off in its last line spoils that line's frame only.
    let frames: Vec<_> = open_with("file,timestamp_ns\na.png,5\nb.png").unwrap().collect();
    assert_eq!(times(&frames), [Some(5), None]);
    let frames: Vec<_> = open_with("file,timestamp_ns\na.png,5\nb.png,6\nb.png,7\n").unwrap().collect();
    assert!(frames[1].decode().unwrap_err().to_string().contains("two times, the second in line 4"));
}

#[test]
fn times_from_names() {
    let ns = ["1403636579763555584.png", "1403636579813555456.png", "1403636579863555584.png"];
    let frames_of = |names: &[&str]| {
        let dir = folder(names);
        let log = open(dir.path(), &OpenOptions::default()).unwrap();
        (log.info().times, times(&log.collect::<Vec<_>>()))
    };
    let (source, found) = frames_of(&ns);
    assert_eq!(source, TimeSource::FileNames);
    assert_eq!(found, [Some(1403636579763555584), Some(1403636579813555456), Some(1403636579863555584)]);
    // A clock that starts at zero.
    assert_eq!(frames_of(&["0.png", "100000000.png", "200000000.png"]).0, TimeSource::FileNames);
    // One name that is no time has none; the others keep theirs.
    assert_eq!(frames_of(&[ns[0], ns[1], "overview.png"]).1[2], None);
    // Frame numbers, dates and microseconds are not nanoseconds.
    for names in [
        ["0000000001.png", "0000000002.png"],
        ["20231105143000.png", "20231105143001.png"],
        ["1403636579763555.png", "1403636579813555.png"],
    ] {
        assert_eq!(frames_of(&names).0, TimeSource::MadeUp { fps: 10.0 }, "{names:?}");
    }
}

#[test]
fn times_out_of_order() {
    let dir = folder(&["a.png", "b.png", "c.png", "d.png", "e.png", "f.png"]);
    let check = |times: [i64; 6], good: [bool; 6]| {
        let rows: String =
            ["a", "b", "c", "d", "e", "f"].iter().zip(times).map(|(n, t)| format!("{n}.png,{t}\n")).collect();
        std::fs::write(dir.path().join("timestamps.csv"), format!("file,timestamp_ns\n{rows}")).unwrap();
        let frames = frames(dir.path());
        assert_eq!(frames.len(), 6);
        assert_eq!(frames.iter().map(|f| f.decode().is_ok()).collect::<Vec<_>>(), good, "{times:?}");
        // The frames that stay are in order, whatever the times were.
        let kept: Vec<i64> = frames.iter().filter(|f| f.decode().is_ok()).filter_map(|f| f.timestamp_ns).collect();
        assert!(kept.is_sorted_by(|a, b| a < b), "{kept:?}");
    };
    // One runs back; one is the same; one is far ahead; two are swapped; a clock set back for good.
    check([1, 2, 1, 4, 5, 6], [true, true, false, true, true, true]);
    check([1, 2, 2, 4, 5, 6], [true, true, false, true, true, true]);
    check([1, 2, 900, 4, 5, 6], [true, true, false, true, true, true]);
    check([1, 3, 2, 4, 5, 6], [true, false, true, true, true, true]);
    check([7, 8, 9, 1, 2, 3], [true, true, true, false, false, false]);
    let frame = &frames(dir.path())[3];
    assert_eq!(frame.timestamp_ns, Some(1));
    let error = frame.decode().unwrap_err();
    assert_eq!(error, FrameError::TimeOrder { timestamp_ns: 1, line: Some(5), previous: 2, previous_ns: 9 });
    assert!(error.to_string().contains("1 ns (timestamps.csv, line 5), does not come after 9 ns, the time of frame 2"));
}

/// The table's names are those of the folder, however they are written; what lies outside is never opened.
#[test]
fn paths_in_a_table_stay_in_the_folder() {
    let dir = folder(&["a.png", "b.png"]);
    let log = dir.path().join("log");
    std::fs::create_dir_all(log.join("sub")).unwrap();
    for name in ["a.png", "b.png", "c.png", "sub/d.png"] {
        std::fs::write(log.join(name), png(&picture(8, 6, 0))).unwrap();
    }
    let outside = dir.path().join("b.png");
    let outside = outside.to_str().unwrap();
    let table = format!(
        "file,timestamp_ns\n./a.png,1\nb.png,2\n././/b.png,3\n./c.png\nsub/./d.png,5\n../a.png,6\n{outside},7\n,8\n"
    );
    std::fs::write(log.join("timestamps.csv"), table).unwrap();
    let frames = frames(&log);
    let why = |name: &str| {
        let frame = frames.iter().find(|f| &*f.name == name).unwrap_or_else(|| panic!("{name}: {:?}", names(&frames)));
        frame.decode().map(|_| frame.timestamp_ns).map_err(|e| e.to_string())
    };
    assert_eq!(frames.len(), 7, "{:?}", names(&frames));
    assert_eq!((why("a.png"), why("sub/d.png")), (Ok(Some(1)), Ok(Some(5))));
    assert!(why("b.png").unwrap_err().contains("two times, the second in line 4"));
    assert!(why("c.png").unwrap_err().contains("line 5 has no time"));
    for (name, line) in [("../a.png", 7), (outside, 8), ("", 9)] {
        let why = why(name).unwrap_err();
        assert!(why.contains(&format!("timestamps.csv, line {line}: {name:?} is no file of this folder")), "{why}");
    }
}

#[test]
fn from_to_and_stride() {
    let dir = folder(&["0.png", "1.png", "2.png", "3.png", "4.png", "5.png", "6.png"]);
    let of = |from: Option<&str>, to: Option<&str>, stride: u64| {
        let bound = |t: Option<&str>| t.map(|t| t.parse::<TimeBound>().unwrap());
        let stride = std::num::NonZeroU64::new(stride).unwrap();
        let options = OpenOptions { from: bound(from), to: bound(to), stride, ..OpenOptions::default() };
        open(dir.path(), &options).unwrap().map(|f| f.index).collect::<Vec<_>>()
    };
    assert_eq!(of(None, None, 3), [0, 3, 6]);
    assert_eq!(of(Some("0.2"), Some("0.5s"), 1), [2, 3, 4, 5]);
    assert_eq!(of(Some("0.15s"), None, 2), [2, 4, 6]);
    assert_eq!(of(Some("200000000ns"), Some("400000000ns"), 1), [2, 3, 4]);
    assert_eq!(of(Some("9"), None, 1), [0; 0]);
    assert_eq!("1700000000123456789".parse::<TimeBound>().unwrap(), TimeBound::Epoch(1_700_000_000_123_456_789));
    for wrong in ["", "-1", "noon", "NaN", "1e300", "12,5"] {
        assert!(wrong.parse::<TimeBound>().is_err(), "{wrong:?}");
    }
}

#[test]
fn every_format_and_depth_gives_the_same_grey() {
    let truth = smooth(40, 24);
    let plain = grey(&truth);
    let sixteen = DynamicImage::ImageLuma16(image::ImageBuffer::from_fn(40, 24, |u, v| {
        image::Luma([u16::from(truth.row(v as usize)[u as usize]) << 8])
    }));
    let twelve = DynamicImage::ImageLuma16(image::ImageBuffer::from_fn(40, 24, |u, v| {
        image::Luma([u16::from(truth.row(v as usize)[u as usize]) << 4])
    }));
    let exact: Vec<(&str, Vec<u8>)> = vec![
        ("grey.png", encode(&plain, ImageFormat::Png)),
        ("grey.tif", encode(&plain, ImageFormat::Tiff)),
        ("grey.bmp", encode(&plain, ImageFormat::Bmp)),
        ("grey alpha.png", encode(&plain.to_luma_alpha8().into(), ImageFormat::Png)),
        ("rgb.png", encode(&plain.to_rgb8().into(), ImageFormat::Png)),
        ("rgb.tiff", encode(&plain.to_rgb8().into(), ImageFormat::Tiff)),
        ("rgb.bmp", encode(&plain.to_rgb8().into(), ImageFormat::Bmp)),
        ("rgb.webp", encode(&plain.to_rgb8().into(), ImageFormat::WebP)),
        ("rgba.png", encode(&plain.to_rgba8().into(), ImageFormat::Png)),
        ("rgba.webp", encode(&plain.to_rgba8().into(), ImageFormat::WebP)),
        ("sixteen.png", encode(&sixteen, ImageFormat::Png)),
        ("sixteen.tif", encode(&sixteen, ImageFormat::Tiff)),
        ("twelve of sixteen.png", encode(&twelve, ImageFormat::Png)),
        ("no ending", encode(&plain, ImageFormat::Png)),
        // The bytes say what it is, not the name.
        ("named wrongly.jpg", encode(&plain, ImageFormat::Png)),
    ];
    let dir = tempfile::tempdir().unwrap();
    for (name, bytes) in &exact {
        std::fs::write(dir.path().join(name), bytes).unwrap();
    }
    let found = frames(dir.path());
    assert_eq!(found.len(), exact.len(), "{:?}", names(&found));
    for frame in found {
        assert_eq!(frame.decode().unwrap(), truth, "{}", frame.name);
    }
}

#[test]
fn colour_is_weighted_as_jpeg_does() {
    let dir = tempfile::tempdir().unwrap();
    let pixels = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255], [10, 200, 90]];
    let picture = image::RgbImage::from_fn(5, 1, |u, _| image::Rgb(pixels[u as usize]));
    std::fs::write(dir.path().join("colour.png"), encode(&picture.into(), ImageFormat::Png)).unwrap();
    // 0.299 R + 0.587 G + 0.114 B, rounded.
    assert_eq!(frames(dir.path())[0].decode().unwrap().data(), [76, 150, 29, 255, 131]);
}

/// A JPEG of `smooth(40, 24)`, written by libjpeg at quality 90.
const JPEG: &[u8] = include_bytes!("support/smooth.jpg");

#[test]
fn jpeg_is_read_straight_to_luma() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("a.jpeg"), JPEG).unwrap();
    let found = frames(dir.path())[0].decode().unwrap();
    // Quality 90 quantises the slope of a smooth picture by no more than this.
    const MOST: u8 = 4;
    let truth = smooth(40, 24);
    assert_eq!((found.width(), found.height()), (40, 24));
    let worst = found.data().iter().zip(truth.data()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(worst <= MOST, "{worst}");
}

#[test]
fn broken_pictures_are_unreadable_frames_and_the_rest_stands() {
    let truth = picture(64, 48, 3);
    let whole = png(&truth);
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).unwrap();
    write("00.png", &whole);
    write("01.png", &whole[..whole.len() / 2]);
    write("02.png", &[]);
    write("03.png", b"not a picture at all");
    write("04.jpg", &JPEG[..JPEG.len() / 2]);
    write("05.jpg", &JPEG[..JPEG.len() - 2]);
    write("06.tif", &encode(&grey(&truth), ImageFormat::Tiff)[..200]);
    write("07.bmp", &encode(&grey(&truth), ImageFormat::Bmp)[..200]);
    write("08.webp", &encode(&grey(&truth).to_rgb8().into(), ImageFormat::WebP)[..60]);
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 0xFF;
    write("09.png", &flipped);
    write("10.png", &whole);
    let frames = frames(dir.path());
    assert_eq!(frames.len(), 11);
    for (i, frame) in frames.iter().enumerate() {
        assert_eq!(frame.index, i as u64);
        match frame.decode() {
            Ok(image) => assert!((i == 0 || i == 10) && image == truth, "{}", frame.name),
            Err(error) => assert!((1..10).contains(&i) && !error.to_string().is_empty(), "{}: {error}", frame.name),
        }
    }
}

/// To open a pipe that nobody writes into waits for ever. Where this fails it does not end.
#[cfg(unix)]
#[test]
fn pipes_are_not_opened() {
    let dir = folder(&["a.png", "c.png"]);
    let pipe = |name: &str| {
        let path = dir.path().join(name);
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        path
    };
    pipe("b.png");
    pipe("no ending");
    std::os::unix::fs::symlink(pipe("elsewhere"), dir.path().join("link.png")).unwrap();
    let frames = frames(dir.path());
    assert_eq!(names(&frames), ["a.png", "b.png", "c.png", "link.png"]);
    assert_eq!(frames.iter().map(|f| f.decode().is_ok()).collect::<Vec<_>>(), [true, false, true, false]);
    let why = frames[1].decode().unwrap_err().to_string();
    assert!(why.contains("it is no regular file"), "{why}");
    let refusal = |path: &Path| open(path, &OpenOptions::default()).unwrap_err().to_string();
    for log in [pipe("log.mcap"), pipe("log")] {
        assert!(refusal(&log).contains("it is no regular file"), "{}", refusal(&log));
    }
    // A pipe of times is no reason to make them up.
    pipe("timestamps.csv");
    assert!(refusal(dir.path()).contains("timestamps.csv: it is no regular file"), "{}", refusal(dir.path()));
}

#[test]
fn sizes_that_no_camera_has_are_refused_before_memory_is_asked_for() {
    // A PNG header of 2^31 - 1 px squared; a BMP header of 60,000 px squared.
    let mut png = png(&picture(4, 4, 0));
    png[16..24].copy_from_slice(&[0x7F, 0xFF, 0xFF, 0xFF, 0x7F, 0xFF, 0xFF, 0xFF]);
    let mut bmp = encode(&grey(&picture(4, 4, 0)), ImageFormat::Bmp);
    bmp[18..26].copy_from_slice(&[0x60, 0xEA, 0, 0, 0x60, 0xEA, 0, 0]);
    let mut jpeg = JPEG.to_vec();
    let frame_header = jpeg.windows(2).position(|w| w == [0xFF, 0xC0]).unwrap();
    jpeg[frame_header + 5..frame_header + 9].copy_from_slice(&[0xFF, 0xFF, 0xFF, 0xFF]);
    let dir = tempfile::tempdir().unwrap();
    for (name, bytes) in [("a.png", png), ("b.bmp", bmp), ("c.jpg", jpeg)] {
        std::fs::write(dir.path().join(name), bytes).unwrap();
    }
    for frame in frames(dir.path()) {
        assert!(frame.decode().is_err(), "{}", frame.name);
    }
}

#[test]
fn what_is_not_a_log() {
    let dir = tempfile::tempdir().unwrap();
    let refusal = |path: &Path| open(path, &OpenOptions::default()).unwrap_err().to_string();
    assert!(refusal(dir.path()).contains("the folder holds no images"));
    assert!(refusal(&dir.path().join("none")).starts_with("cannot read "));
    let file = |name: &str, bytes: &[u8]| {
        std::fs::write(dir.path().join(name), bytes).unwrap();
        dir.path().join(name)
    };
    assert!(refusal(&file("a.png", &png(&picture(4, 4, 0)))).contains("a single image"));
    assert!(refusal(&file("a.bag", b"#ROSBAG V2.0\n")).contains("ROS 1 bag"));
    assert!(refusal(&file("a.db3", b"SQLite format 3\0")).contains("SQLite"));
    assert!(refusal(&file("a.mcap", b"")).contains("it is empty"));
    assert!(refusal(&file("b.mcap", b"not an mcap, really")).contains("does not begin as an MCAP file does"));
    assert!(refusal(&file("a.txt", b"hello")).contains("neither a folder of images nor an MCAP file"));
    let options = OpenOptions { fps: 0.0, ..OpenOptions::default() };
    assert!(matches!(inspect(folder(&["a.png"]).path(), &options), Err(Error::Value { field: "fps", .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// Whatever is cut off or changed in a picture: an error or a picture, never a panic.
    #[test]
    fn any_bytes_of_a_picture(format in 0..5usize, cut in 0.0..1.2f64, changes in prop::collection::vec((0.0..1.0f64, any::<u8>()), 0..4)) {
        let picture = grey(&picture(20, 13, 1));
        let mut bytes = match format {
            0 => encode(&picture, ImageFormat::Png),
            1 => encode(&picture, ImageFormat::Tiff),
            2 => encode(&picture, ImageFormat::Bmp),
            3 => encode(&picture.to_rgb8().into(), ImageFormat::WebP),
            _ => JPEG.to_vec(),
        };
        for (at, byte) in changes {
            let at = (at * bytes.len() as f64) as usize;
            bytes[at] = byte;
        }
        bytes.truncate((cut * bytes.len() as f64) as usize);
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("a.png"), &bytes).unwrap();
        let frames = frames(dir.path());
        prop_assert_eq!(frames.len(), 1);
        if let Ok(image) = frames[0].decode() {
            prop_assert_eq!(image.data().len(), image.width() * image.height());
        }
    }

    /// Whatever is in the table of times: no panic, every image a frame, times of readable frames in order.
    #[test]
    fn any_table_of_times(table in "(file,timestamp_ns\n)?([ab].png,?-?[0-9]{0,20}[\n,x\"]?){0,6}") {
        let dir = folder(&["a.png", "b.png"]);
        std::fs::write(dir.path().join("timestamps.csv"), table).unwrap();
        if let Ok(log) = open(dir.path(), &OpenOptions::default()) {
            let frames: Vec<_> = log.collect();
            prop_assert!(names(&frames).contains(&"a.png") && names(&frames).contains(&"b.png"));
            let kept: Vec<_> = frames.iter().filter(|f| f.decode().is_ok()).map(|f| f.timestamp_ns.unwrap()).collect();
            prop_assert!(kept.is_sorted_by(|a, b| a < b), "{:?}", kept);
        }
    }
}
