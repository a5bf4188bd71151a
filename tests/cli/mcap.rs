//! MCAP logs: the camera comes along, damage is told, topics are offered as flags.

use net_log::ImageMcapWriter;
use netpose::{Camera, GrayView, Lens};

use crate::support::{Scratch, assert_says, assert_status, netpose, pixels, png, stdout};

const WIDTH: u32 = 96;
const HEIGHT: u32 = 64;

fn camera() -> Camera {
    Camera::new(70.0, 70.0, 48.0, 32.0, WIDTH, HEIGHT, Lens::None).unwrap()
}

/// `log.mcap` with frames 0.1 s apart; every one also as PNG in a topic of its own if `twice`.
fn write_log(scratch: &Scratch, frames: u8, twice: bool) -> std::path::PathBuf {
    let path = scratch.path("log.mcap");
    let mut log = ImageMcapWriter::create(&path, &camera()).unwrap();
    for k in 0..frames {
        let time = 1_700_000_000_000_000_000 + i64::from(k) * 100_000_000;
        let grey = pixels(WIDTH, HEIGHT, k);
        log.write(time, GrayView::packed(&grey, WIDTH as usize, HEIGHT as usize).unwrap()).unwrap();
        if twice {
            log.write_encoded(time, "png", &png(WIDTH, HEIGHT, k)).unwrap();
        }
    }
    log.finish().unwrap();
    path
}

fn run(scratch: &Scratch, more: &[&str]) -> std::process::Output {
    netpose()
        .arg("run")
        .arg(scratch.path("log.mcap"))
        .args(["--cell", "50mm", "--out"])
        .arg(scratch.path("out"))
        .args(more)
        .output()
        .unwrap()
}

#[test]
fn the_camera_of_the_log_is_used_without_a_flag() {
    let scratch = Scratch::new();
    write_log(&scratch, 4, false);
    let output = run(&scratch, &[]);
    assert_status(&output, 0);
    assert_says(&output, &["camera: topic /camera/camera_info", "/camera/image_raw"]);
    let times: Vec<String> = scratch.poses().into_iter().map(|row| row[2].clone()).collect();
    assert_eq!((times.len(), times[3].as_str()), (4, "1700000000300000000"));
    assert_eq!(scratch.record()["camera"]["fx"], 70.0);
}

#[test]
fn a_log_that_is_cut_off_is_run_to_its_last_good_message() {
    let scratch = Scratch::new();
    let path = write_log(&scratch, 200, false);
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() * 6 / 10]).unwrap();
    let output = run(&scratch, &["--stride", "10"]);
    assert_status(&output, 0);
    assert_says(&output, &["warning: "]);
    let rows = scratch.poses();
    assert!(!rows.is_empty() && rows.len() < 20, "{}", rows.len());
    assert!(!scratch.record()["log"]["damage"].as_array().unwrap().is_empty());
}

#[test]
fn several_topics_are_offered_ready_to_paste() {
    let scratch = Scratch::new();
    write_log(&scratch, 2, true);
    let output = run(&scratch, &[]);
    assert_status(&output, 2);
    assert_says(&output, &["--topic /camera/image_raw ", "--topic /camera/image_raw/compressed "]);
    assert_status(&run(&scratch, &["--topic", "/camera/image_raw/compressed"]), 0);
    let output = run(&scratch, &["--force", "--topic", "/camera/none"]);
    assert_status(&output, 2);
    assert_says(&output, &["/camera/none", "--topic /camera/image_raw "]);
}

#[test]
fn info_says_what_a_log_holds() {
    let scratch = Scratch::new();
    let path = write_log(&scratch, 3, true);
    let output = netpose().arg("info").arg(&path).output().unwrap();
    assert_status(&output, 0);
    for word in ["MCAP", "--topic /camera/image_raw ", "fx 70.0"] {
        assert!(stdout(&output).contains(word), "{word} in:\n{}", stdout(&output));
    }
    let output = netpose().arg("info").arg(&path).args(["--json", "--topic", "/camera/image_raw"]).output().unwrap();
    assert_status(&output, 0);
    let info: serde_json::Value = serde_json::from_str(&stdout(&output)).expect("nothing but JSON");
    assert_eq!((info["frames"].as_u64(), info["width"].as_u64()), (Some(3), Some(u64::from(WIDTH))));
}
