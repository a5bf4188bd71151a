//! The folder of a run: whole at any moment, the same whether it was stopped or not; and the logs that are written read back.
#![allow(clippy::unwrap_used)]

mod support;

use std::path::Path;

use net_geometry::nalgebra::{Rotation3, Vector2, Vector3};
use net_geometry::{Camera, Junction, JunctionState, Lens, Pose, Twine, TwineState};
use net_log::{
    DEFAULT_CAMERA_FRAME, Example, ImageFolderWriter, ImageMcapWriter, JunctionsParquet, NetColumns, OpenOptions,
    PoseRow, RowStatus, RunFiles, RunSummary, TwinesParquet, open, read_camera, read_junctions, read_poses,
    read_twines, write_camera_yaml, write_report,
};
use proptest::prelude::*;
use support::{picture, png};

const START: i64 = 1_700_000_000_000_000_000;

fn camera(lens: Lens) -> Camera {
    Camera::new(420.5, 421.25, 423.0, 239.125, 848, 480, lens).unwrap()
}

/// Writes other bytes at these parts of a file, and cuts it there.
fn damage(path: &Path, cut: f64, changes: &[(f64, u8)]) {
    let mut bytes = std::fs::read(path).unwrap();
    let length = bytes.len() as f64;
    for &(at, byte) in changes {
        bytes[(at * length) as usize] = byte;
    }
    bytes.truncate((cut * length) as usize);
    std::fs::write(path, bytes).unwrap();
}

/// `count` junctions, named but for every seventh.
fn junctions(frame: u64, count: usize) -> Vec<Junction> {
    let junction = |n: usize| Junction {
        pixel: Vector2::new(frame as f64 + n as f64 / 3.0, -1.5 * n as f64),
        index: (!n.is_multiple_of(7)).then_some((n as i32 - 5, frame as i32)),
        sigma_px: 0.01 * n as f64,
        state: JunctionState::ALL[n % JunctionState::ALL.len()],
    };
    (0..count).map(junction).collect()
}

/// `count` twines, every third with a width; numbers as the file has them, in parts of 64.
fn twines(frame: u64, count: usize) -> Vec<Twine> {
    let twine = |n: usize| Twine {
        index: (n as i32 - 5, frame as i32),
        direction: n % 2,
        state: TwineState::ALL[n % 6],
        llr: n as f32 / 64.0 - 3.0,
        contrast: 5.0 + frame as f32 / 64.0,
        width_px: n.is_multiple_of(3).then_some(2.5 + n as f32 / 64.0),
    };
    (0..count).map(twine).collect()
}

/// The twines of a frame of [`frame`]: now and then none, though there are junctions.
fn twines_of(index: u64) -> Vec<Twine> {
    let junctions = frame(index).1.len();
    twines(index, if index.is_multiple_of(7) { 0 } else { 2 * junctions })
}

/// A run of frames of every status.
fn frame(index: u64) -> (PoseRow, Vec<Junction>) {
    let row = PoseRow::unreadable(index, &format!("{index}.png"), Some(START + index as i64 * 100_000_000));
    let (rotation, depth) = (Rotation3::from_euler_angles(0.01 * index as f64, 0.2, -0.3), 1.0 + 0.1 * index as f64);
    let pose = Pose { rotation, translation: Vector3::new(0.1, 0.2, depth) };
    let found = junctions(index, (index as usize * 13) % 40);
    let measured = PoseRow {
        junctions: Some(found.len() as u64),
        latency_ms: Some(3.0 + index as f64),
        probability: Some(0.5),
        ..row.clone()
    };
    match index % 5 {
        3 => (PoseRow { junctions: Some(0), status: RowStatus::NoNet, ..measured }, vec![]),
        4 => (row, vec![]),
        _ => {
            let net = NetColumns {
                range_m: pose.plane().range().unwrap(),
                distance_m: pose.plane().distance,
                normal: pose.normal(),
                pose,
                sigma_range_m: 0.001,
                sigma_tilt_deg: 0.1,
                sigma_xy_m: 0.002,
            };
            (PoseRow { status: RowStatus::Ok, net: Some(net), ..measured }, found)
        }
    }
}

fn write(files: &mut RunFiles, frames: std::ops::Range<u64>) {
    for index in frames {
        let (row, junctions) = frame(index);
        files.write(&row, &junctions, &twines_of(index)).unwrap();
    }
}

/// The frames of a table and their rows.
type Rows<T> = Vec<(u64, Vec<T>)>;

/// Contents of all files that a run has, junctions and twines as rows.
fn contents(dir: &Path) -> (String, String, Rows<Junction>, Rows<Twine>) {
    let text = |name: &str| std::fs::read_to_string(dir.join(name)).unwrap();
    let junctions = read_junctions(&dir.join("junctions.parquet")).unwrap().map(Result::unwrap).collect();
    let twines = read_twines(&dir.join("twines.parquet")).unwrap().map(Result::unwrap).collect();
    (text("poses.csv"), text("trajectory.tum"), junctions, twines)
}

#[test]
fn junctions_read_back_frame_by_frame() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("junctions.parquet");
    let mut writer = JunctionsParquet::create(&path).unwrap();
    assert_eq!(read_junctions(&path).unwrap().count(), 0, "whole, and empty, at once");
    // Enough for many groups, by rows and by frames, with frames that have none.
    let count = |frame: u64| match frame {
        f if f.is_multiple_of(3) => 0,
        f if f < 60 => 1200,
        _ => 1,
    };
    const FRAMES: u64 = 9000;
    for frame in 0..FRAMES {
        writer.write(frame, &junctions(frame, count(frame))).unwrap();
        if frame % 450 == 449 {
            // Read while it is written: what a killed process leaves.
            let frames: Vec<_> = read_junctions(&path).unwrap().map(Result::unwrap).collect();
            // A group has at most 256 frames with junctions; two thirds of all have some.
            assert!(frames.len() as u64 + 256 >= (frame + 1) * 2 / 3, "{} of {frame}", frames.len());
            assert!(frames.iter().all(|(f, found)| *found == junctions(*f, count(*f))));
        }
    }
    writer.finish().unwrap();
    let mut expected = (0..FRAMES).filter(|f: &u64| !f.is_multiple_of(3));
    for frame in read_junctions(&path).unwrap() {
        let (number, found) = frame.unwrap();
        assert_eq!(Some(number), expected.next());
        assert_eq!(found, junctions(number, count(number)));
    }
    assert_eq!(expected.next(), None);
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "nothing is left beside it");
}

#[test]
fn twines_read_back_frame_by_frame() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("twines.parquet");
    let mut writer = TwinesParquet::create(&path).unwrap();
    assert_eq!(read_twines(&path).unwrap().last_frame(), None);
    let count = |frame: u64| if frame.is_multiple_of(3) { 0 } else { 2000 };
    for frame in 0..100 {
        writer.write(frame, &twines(frame, count(frame))).unwrap();
    }
    writer.finish().unwrap();
    // A frame without twines is known to have none.
    assert_eq!(read_twines(&path).unwrap().last_frame(), Some(99));
    let mut expected = (0..100).filter(|f: &u64| count(*f) > 0);
    for frame in read_twines(&path).unwrap() {
        let (number, found) = frame.unwrap();
        assert_eq!(Some(number), expected.next());
        assert_eq!(found, twines(number, count(number)));
    }
    assert_eq!(expected.next(), None);
    assert!(read_junctions(&path).err().unwrap().to_string().contains("its columns are not frame, u, v"));
    let bytes = std::fs::metadata(&path).unwrap().len();
    assert!(bytes < 66 * 2000 * 12, "{bytes} bytes: not more than a dozen for a twine");
}

/// A table of twines that was lost, or that another version left out, is made anew with all else that it belongs to.
#[test]
fn frames_whose_twines_are_lost_are_done_again() {
    let dir = tempfile::tempdir().unwrap();
    let mut files = RunFiles::create(dir.path(), &[]).unwrap();
    write(&mut files, 0..20);
    files.finish(&camera(Lens::None), DEFAULT_CAMERA_FRAME).unwrap();
    let whole = contents(dir.path());
    std::fs::remove_file(dir.path().join("twines.parquet")).unwrap();
    let (mut files, rows) = RunFiles::resume(dir.path(), &[]).unwrap();
    // The first of the frames has no junctions.
    assert_eq!(rows.len(), 1);
    write(&mut files, 1..20);
    files.finish(&camera(Lens::None), DEFAULT_CAMERA_FRAME).unwrap();
    assert_eq!(contents(dir.path()), whole);
}

/// A write that fails half-way, as on a full disk or when the process is killed in it.
#[test]
fn a_group_torn_in_the_middle_costs_that_group_only() {
    let dir = tempfile::tempdir().unwrap();
    let mut files = RunFiles::create(dir.path(), &[]).unwrap();
    let rows: Vec<_> = (0..600_u64).map(|i| frame(5 * i)).collect();
    rows.iter().for_each(|(row, junctions)| files.write(row, junctions, &[]).unwrap());
    drop(files);
    let path = dir.path().join("junctions.parquet");
    let kept = read_junctions(&path).unwrap().count();
    let journal = std::fs::read(dir.path().join("junctions.parquet.journal")).unwrap();
    let start = u64::from_le_bytes(*journal.first_chunk().unwrap());
    // Over the old footer, then nothing.
    let mut bytes = std::fs::read(&path).unwrap();
    bytes.truncate(start as usize + 5000);
    std::fs::write(&path, &bytes).unwrap();
    assert!(read_junctions(&path).is_err());
    let (_, rows) = RunFiles::resume(dir.path(), &[]).unwrap();
    let left = read_junctions(&path).unwrap().count();
    assert!(left > 0 && left + 256 == kept, "{left} of {kept}");
    assert!(rows.len() < 600 && rows.iter().filter(|r| r.junctions > Some(0)).count() == left);
}

#[test]
fn what_may_not_be_written() {
    let dir = tempfile::tempdir().unwrap();
    let mut files = RunFiles::create(dir.path(), &[]).unwrap();
    let (row, _) = frame(1);
    let text = files.write(&row, &junctions(1, 2), &[]).unwrap_err().to_string();
    assert!(text.contains("Some(13) in the row and 2 in the list"), "{text}");
    let mut nan = junctions(1, 13);
    nan[3].pixel.x = f64::NAN;
    assert!(files.write(&row, &nan, &[]).unwrap_err().to_string().contains("junction is (NaN, "));
    let file = dir.path().join("a file");
    std::fs::write(&file, "").unwrap();
    let text = RunFiles::create(&file, &[]).unwrap_err().to_string();
    assert!(text.starts_with("cannot create ") && text.contains("a file"), "{text}");
    let text = RunFiles::create(Path::new("/proc/netpose"), &[]).unwrap_err().to_string();
    assert!(text.starts_with("cannot create /proc/netpose: "), "{text}");
}

#[test]
fn a_new_run_leaves_nothing_of_an_old_one() {
    let dir = tempfile::tempdir().unwrap();
    let run = |frames: u64| {
        let mut files = RunFiles::create(dir.path(), &[]).unwrap();
        write(&mut files, 0..frames);
        files
    };
    run(20).finish(&camera(Lens::None), DEFAULT_CAMERA_FRAME).unwrap();
    assert!(dir.path().join("annotated.mcap").exists());
    drop(run(2));
    assert!(!dir.path().join("annotated.mcap").exists());
    assert_eq!(read_poses(&dir.path().join("poses.csv")).unwrap().len(), 2);
}

#[test]
fn annotations_meet_their_images() {
    let dir = tempfile::tempdir().unwrap();
    let mut files = RunFiles::create(dir.path(), &[]).unwrap();
    write(&mut files, 0..10);
    files.finish(&camera(Lens::KannalaBrandt([0.1; 4])), "front_optical").unwrap();
    let bytes = std::fs::read(dir.path().join("annotated.mcap")).unwrap();
    let mut times = std::collections::BTreeMap::<String, Vec<u64>>::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!((schema.encoding.as_str(), message.channel.message_encoding.as_str()), ("protobuf", "protobuf"));
        times.entry(format!("{} {}", message.channel.topic, schema.name)).or_default().push(message.log_time);
    }
    let all: Vec<u64> = (0..10).map(|i| START as u64 + i * 100_000_000).collect();
    let posed: Vec<u64> = all.iter().copied().enumerate().filter(|(i, _)| i % 5 < 3).map(|(_, t)| t).collect();
    let expected = [
        ("/netpose/annotations foxglove.ImageAnnotations", all.clone()),
        ("/netpose/calibration foxglove.CameraCalibration", vec![all[0]]),
        ("/netpose/estimate netpose.Estimate", all.clone()),
        ("/netpose/pose foxglove.PoseInFrame", posed.clone()),
        ("/netpose/transform foxglove.FrameTransform", posed),
    ];
    assert_eq!(times.into_iter().collect::<Vec<_>>(), expected.map(|(k, v)| (k.to_owned(), v)));
    // Our own reader understands the calibration, and that there are no images.
    let text = open(&dir.path().join("annotated.mcap"), &OpenOptions::default()).unwrap_err().to_string();
    assert!(text.contains("none of its topics holds images"), "{text}");
    let info = net_log::inspect(&dir.path().join("annotated.mcap"), &OpenOptions::default()).unwrap();
    assert_eq!(info.camera.unwrap().camera.unwrap(), camera(Lens::KannalaBrandt([0.1; 4])));
}

#[test]
fn the_report_is_one_page() {
    let dir = tempfile::tempdir().unwrap();
    let mut files = RunFiles::create(dir.path(), &[]).unwrap();
    write(&mut files, 0..40);
    let mut summary = RunSummary { version: "9.8.7".to_owned(), ..RunSummary::default() };
    summary.log.path = "a log <with> \"signs\" & such".to_owned();
    summary.log.times = "made up, 10 frames per second".to_owned();
    summary.log.damage = vec!["x.mcap: cut off at byte 12, inside of a chunk".to_owned()];
    summary.name_unreadable(4, "4.png", &"PNG: unexpected end");
    let example = Example { caption: "frame 7".to_owned(), png: png(&picture(8, 8, 0)) };
    write_report(files.paths(), &summary, &[example]).unwrap();
    let page = std::fs::read_to_string(dir.path().join("report.html")).unwrap();
    assert!(page.starts_with("<!DOCTYPE html>") && page.trim_end().ends_with("</html>"));
    assert_eq!(page.matches("<svg").count(), 5);
    // One count of cells needs no warning.
    assert!(!page.contains("started anew"));
    for part in [
        "9.8.7",
        "4.png",
        "unexpected end",
        "Times are made up",
        "byte 12",
        "data:image/png;base64,iVBOR",
        "<b>24</b><small>60.0 %</small>",
        "a log &#60;with&#62;",
    ] {
        assert!(page.contains(part), "{part}");
    }
    // Names are text, and nothing is fetched from elsewhere.
    assert!(!page.contains("<with>") && !page.contains("src=\"http") && !page.contains("href="));
    // A run without a single frame has a page too.
    RunFiles::create(dir.path(), &[]).unwrap();
    write_report(files.paths(), &RunSummary::default(), &[]).unwrap();
}

#[test]
fn logs_that_are_written_read_back() {
    let dir = tempfile::tempdir().unwrap();
    let (folder, file) = (dir.path().join("folder"), dir.path().join("log.mcap"));
    let truth = camera(Lens::Rational([0.1, -0.2, 1e-3, 0.0, 0.3, 1.0, 2.0, 3.5]));
    let mut images = ImageFolderWriter::create(&folder, &truth).unwrap();
    let mut mcap = ImageMcapWriter::create(&file, &truth).unwrap();
    let pictures: Vec<_> = (0..5).map(|i| picture(20, 10, i)).collect();
    for (i, p) in pictures.iter().enumerate() {
        let time = START + i as i64 * 33_333_333;
        images.write(&format!("frame_{i}.png"), time, p.view().unwrap()).unwrap();
        mcap.write(time, p.view().unwrap()).unwrap();
    }
    mcap.finish().unwrap();
    assert_eq!(read_camera(&folder.join("camera.yaml")).unwrap(), truth);
    for path in [&folder, &file] {
        let log = open(path, &OpenOptions::default()).unwrap();
        if path == &file {
            let found = log.info().camera.as_ref().unwrap();
            assert_eq!((found.topic.as_str(), found.camera.as_ref().unwrap()), ("/camera/camera_info", &truth));
        }
        for (i, frame) in log.enumerate() {
            assert_eq!(frame.timestamp_ns, Some(START + i as i64 * 33_333_333));
            assert_eq!(frame.decode().unwrap(), pictures[i]);
        }
    }
    // Encoded images too; and times that ROS cannot tell are refused.
    let mut mcap = ImageMcapWriter::create(&file, &truth).unwrap();
    mcap.write_encoded(START, "png", &png(&pictures[3])).unwrap();
    assert!(mcap.write(-1, pictures[0].view().unwrap()).unwrap_err().to_string().contains("timestamp_ns is -1"));
    mcap.finish().unwrap();
    let mut log = open(&file, &OpenOptions::default()).unwrap();
    assert_eq!(log.info().topic.as_deref(), Some("/camera/image_raw/compressed"));
    assert_eq!(log.next().unwrap().decode().unwrap(), pictures[3]);
    for lens in [Lens::None, Lens::PlumbBob([0.1, 0.0, -1e-9, 0.03, 7.0]), Lens::KannalaBrandt([0.1, 0.2, 0.3, 0.4])] {
        let path = dir.path().join("camera.yaml");
        write_camera_yaml(&path, &camera(lens)).unwrap();
        // A pinhole is written as a lens that bends nothing.
        let lens = if lens == Lens::None { Lens::PlumbBob([0.0; 5]) } else { lens };
        assert_eq!(read_camera(&path).unwrap(), camera(lens));
    }
}

/// The trajectory lost its lines and poses.csv did not: they are made anew from it, to the last digit.
#[test]
fn a_trajectory_is_made_anew_from_the_poses() {
    let (whole, torn) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    for dir in [&whole, &torn] {
        write(&mut RunFiles::create(dir.path(), &[]).unwrap(), 0..60);
    }
    let trajectory = |dir: &Path| std::fs::read(dir.join("trajectory.tum")).unwrap();
    std::fs::write(torn.path().join("trajectory.tum"), b"").unwrap();
    let (files, rows) = RunFiles::resume(torn.path(), &[]).unwrap();
    drop(files);
    // Their junctions were not closed: some frames are done again.
    assert!(!rows.is_empty());
    let lines = trajectory(torn.path());
    assert!(!lines.is_empty() && trajectory(whole.path()).starts_with(&lines));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// A run that is stopped after any frame, by a signal (its files closed) or by force (not closed), and whose files then lose any
    /// number of bytes at their ends, goes on to the same results as one that was never stopped.
    #[test]
    fn stopped_anywhere(stop in 0..60_u64, closed: bool, lost in prop::collection::vec(0..300_u64, 4), grouped: bool) {
        let (whole, torn) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let mut files = RunFiles::create(whole.path(), &[]).unwrap();
        write(&mut files, 0..60);
        files.finish(&camera(Lens::None), DEFAULT_CAMERA_FRAME).unwrap();

        let mut files = RunFiles::create(torn.path(), &[]).unwrap();
        write(&mut files, 0..stop);
        if closed {
            files.finish(&camera(Lens::None), DEFAULT_CAMERA_FRAME).unwrap();
        } else {
            drop(files);
        }
        for (name, lost) in ["poses.csv", "trajectory.tum", "junctions.parquet", "twines.parquet"].iter().zip(&lost) {
            let file = std::fs::OpenOptions::new().write(true).open(torn.path().join(name)).unwrap();
            let length = file.metadata().unwrap().len();
            file.set_len(length.saturating_sub(if grouped { *lost } else { 0 })).unwrap();
        }
        let (mut files, rows) = RunFiles::resume(torn.path(), &[]).unwrap();
        prop_assert!(rows.len() as u64 <= stop);
        for (index, row) in rows.iter().enumerate() {
            prop_assert_eq!((row.frame, row.status), (index as u64, frame(index as u64).0.status));
        }
        if closed && !grouped {
            prop_assert_eq!(rows.len() as u64, stop, "nothing is done twice");
        }
        write(&mut files, rows.len() as u64..60);
        files.finish(&camera(Lens::None), DEFAULT_CAMERA_FRAME).unwrap();
        prop_assert_eq!(contents(torn.path()), contents(whole.path()));
        let annotated = |dir: &Path| std::fs::read(dir.join("annotated.mcap")).unwrap();
        prop_assert_eq!(annotated(torn.path()), annotated(whole.path()));
        let names = |dir: &Path| std::fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name()).collect::<std::collections::BTreeSet<_>>();
        prop_assert_eq!(names(torn.path()), names(whole.path()));
    }

    /// Any bytes: an error, or twines; never a panic.
    #[test]
    fn any_bytes_of_twines(cut in 0.0..1.1f64, changes in prop::collection::vec((0.0..1.0f64, any::<u8>()), 0..5)) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("twines.parquet");
        let mut writer = TwinesParquet::create(&path).unwrap();
        (0..4).for_each(|f| writer.write(f, &twines(f, 20)).unwrap());
        writer.finish().unwrap();
        damage(&path, cut, &changes);
        if let Ok(frames) = read_twines(&path) {
            for (_, found) in frames.map_while(Result::ok) {
                prop_assert!(!found.is_empty());
            }
        }
    }

    /// Any bytes: an error, or junctions; never a panic.
    #[test]
    fn any_bytes_of_junctions(cut in 0.0..1.1f64, changes in prop::collection::vec((0.0..1.0f64, any::<u8>()), 0..5)) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("junctions.parquet");
        let mut writer = JunctionsParquet::create(&path).unwrap();
        (0..4).for_each(|f| writer.write(f, &junctions(f, 20)).unwrap());
        writer.finish().unwrap();
        damage(&path, cut, &changes);
        if let Ok(frames) = read_junctions(&path) {
            // What reads without an error has all its parts.
            for (_, found) in frames.map_while(Result::ok) {
                prop_assert!(!found.is_empty());
            }
        }
    }
}
