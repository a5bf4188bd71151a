//! `netpose run` on logs that are as they should be.

use crate::support::{STATUS, Scratch, assert_says, assert_status, stderr, stdout};

const HEADER: &str = "frame,file,timestamp_ns,status,probability,range_m,distance_m,normal_x,normal_y,normal_z,\
                      tx,ty,tz,qw,qx,qy,qz,sigma_range_m,sigma_tilt_deg,sigma_xy_m,junctions,latency_ms";
/// The only column that may differ from run to run.
const LATENCY: usize = 21;

fn without_latency(mut rows: Vec<Vec<String>>) -> Vec<Vec<String>> {
    for row in &mut rows {
        row[LATENCY].clear();
    }
    rows
}

#[test]
fn every_frame_gets_a_row_in_the_logs_order() {
    let scratch = Scratch::new();
    scratch.image_log(5, 96, 64);
    let output = scratch.run(&[]);
    assert_status(&output, 0);
    let text = std::fs::read_to_string(scratch.path("out/poses.csv")).unwrap();
    assert!(text.lines().next().unwrap().starts_with(HEADER), "{text}");
    let rows = scratch.poses();
    let frames: Vec<_> = rows.iter().map(|r| (r[0].as_str(), r[1].as_str(), r[2].as_str())).collect();
    assert_eq!(frames[0], ("0", "f000.png", "1700000000000000000"));
    assert_eq!(frames[4], ("4", "f004.png", "1700000000400000000"));
    assert_eq!(rows.len(), 5);
    let record = scratch.record();
    assert_eq!(record["finished"], true);
    assert_eq!(record["frames"]["no_net"], 5);
    assert_eq!(record["mesh"], "50mm");
    for name in ["junctions.parquet", "twines.parquet", "trajectory.tum", "annotated.mcap", "report.html"] {
        assert!(scratch.path("out").join(name).is_file(), "{name}");
    }
    assert!(stdout(&output).starts_with("5 frames: "), "{}", stdout(&output));
}

#[test]
fn the_number_of_jobs_changes_nothing() {
    let one = Scratch::new();
    one.image_log(12, 96, 64);
    assert_status(&one.run(&["--jobs", "1"]), 0);
    let expected = without_latency(one.poses());
    for jobs in ["2", "7"] {
        assert_status(&one.run(&["--jobs", jobs, "--force"]), 0);
        assert_eq!(without_latency(one.poses()), expected, "--jobs {jobs}");
    }
}

#[test]
fn a_part_of_the_log_keeps_its_frame_numbers() {
    let scratch = Scratch::new();
    scratch.image_log(10, 48, 32);
    assert_status(&scratch.run(&["--from", "0.2", "--to", "0.8", "--stride", "3"]), 0);
    let frames: Vec<String> = scratch.poses().into_iter().map(|r| r[0].clone()).collect();
    assert_eq!(frames, ["2", "5", "8"]);
}

#[test]
fn times_that_are_made_up_are_said_to_be() {
    let scratch = Scratch::new();
    let log = scratch.image_log(3, 48, 32);
    std::fs::remove_file(log.join("timestamps.csv")).unwrap();
    let output = scratch.run(&["--fps", "5"]);
    assert_status(&output, 0);
    assert_says(&output, &["made up", "5 Hz"]);
    let times: Vec<String> = scratch.poses().into_iter().map(|r| r[2].clone()).collect();
    assert_eq!(times, ["0", "200000000", "400000000"]);
    let times = scratch.record()["log"]["times"].to_string();
    assert!(times.contains("made up") && times.contains("5 Hz"), "{times}");
}

#[test]
fn a_camera_file_beside_the_images_is_used_and_named() {
    let scratch = Scratch::new();
    let log = scratch.image_log(2, 48, 32);
    std::fs::rename(scratch.path("camera.yaml"), log.join("camera.yaml")).unwrap();
    let output = crate::support::netpose()
        .arg("run")
        .arg(&log)
        .args(["--cell", "50mm", "--out"])
        .arg(scratch.path("out"))
        .output()
        .unwrap();
    assert_status(&output, 0);
    assert_says(&output, &["camera: ", "camera.yaml"]);
}

/// As beside a log's images. Each picture has the camera of its own folder.
#[test]
fn a_camera_file_beside_single_images_is_used_and_named() {
    let scratch = Scratch::new();
    let image = |pictures: &[&str]| {
        let paths = pictures.iter().map(|p| scratch.path(p));
        crate::support::netpose().arg("image").args(paths).args(["--cell", "50mm"]).output().unwrap()
    };
    for (folder, width) in [("a", 48), ("b", 64)] {
        scratch.write(&format!("{folder}/1.png"), crate::support::png(width, 32, 1));
        scratch.write(&format!("{folder}/2.png"), crate::support::png(width, 32, 2));
        std::fs::rename(scratch.camera(width, 32), scratch.path(folder).join("camera.yaml")).unwrap();
    }
    let output = image(&["a/1.png", "b/1.png", "a/2.png", "b/2.png"]);
    assert_status(&output, 0);
    assert_says(&output, &["a/camera.yaml", "b/camera.yaml"]);
    assert_eq!(stderr(&output).matches("camera: ").count(), 2, "{}", stderr(&output));
    assert_eq!(stdout(&output).matches("no_net").count(), 4);
    // A bare name is a picture of the folder at hand, and the flag has precedence.
    let bare = |more: &[&str]| {
        let mut command = crate::support::netpose();
        command.current_dir(scratch.path("a")).args(["image", "1.png", "--cell", "50mm"]).args(more);
        command.output().unwrap()
    };
    assert_status(&bare(&[]), 0);
    let output = bare(&["--camera", "../b/camera.yaml"]);
    assert_status(&output, 1);
    assert_says(&output, &["64x32", "48x32"]);
}

#[test]
fn overlays_show_every_frame_that_could_be_read() {
    let scratch = Scratch::new();
    scratch.image_log(4, 160, 120);
    scratch.write("log/f002.png", b"no picture");
    let output = scratch.run(&["--overlay"]);
    assert_status(&output, 1);
    let size = |k: u32| image::image_dimensions(scratch.path(&format!("out/overlay/{k:06}.jpg"))).ok();
    assert_eq!([size(0), size(1), size(2), size(3)], [Some((160, 120)), Some((160, 120)), None, Some((160, 120))]);
}

#[test]
fn sixteen_bits_colour_and_single_pixels_are_run() {
    use image::ExtendedColorType::{L16, Rgb8};
    let scratch = Scratch::new();
    scratch.camera(64, 48);
    let sixteen: Vec<u8> =
        crate::support::pixels(64, 48, 3).iter().flat_map(|&g| u16::from(g).wrapping_mul(257).to_ne_bytes()).collect();
    scratch.write("log/a.png", crate::support::encode(&sixteen, 64, 48, L16));
    scratch.write("log/b.png", crate::support::encode(&crate::support::pixels(3 * 64, 48, 5), 64, 48, Rgb8));
    assert_status(&scratch.run(&[]), 0);
    assert!(scratch.poses().iter().all(|row| row[STATUS] != "unreadable"), "{:?}", scratch.poses());

    let tiny = Scratch::new();
    tiny.image_log(3, 1, 1);
    let output = tiny.run(&["--overlay"]);
    assert_status(&output, 0);
    assert!(tiny.poses().iter().all(|row| row[STATUS] == "no_net"), "{}", stderr(&output));
}
