//! Logs that are damaged: the rest stands, and the exit status says that something is missing.

use crate::support::{STATUS, Scratch, assert_says, assert_status, netpose, png};

#[test]
fn a_corrupt_image_in_the_middle_is_one_unreadable_row() {
    let scratch = Scratch::new();
    scratch.image_log(6, 96, 64);
    let whole = png(96, 64, 9);
    scratch.write("log/f002.png", &whole[..whole.len() / 2]);
    scratch.write("log/f004.png", b"");
    let output = scratch.run(&[]);
    assert_status(&output, 1);
    assert_says(&output, &["f002.png", "f004.png", "unreadable"]);
    let rows = scratch.poses();
    let unreadable: Vec<&str> = rows.iter().filter(|r| r[STATUS] == "unreadable").map(|r| r[1].as_str()).collect();
    assert_eq!((rows.len(), unreadable), (6, vec!["f002.png", "f004.png"]));
    assert!(rows[2][4..].iter().all(String::is_empty), "an unreadable row carries no values: {:?}", rows[2]);
    let record = scratch.record();
    assert_eq!((record["finished"].as_bool(), record["frames"]["unreadable"].as_u64()), (Some(true), Some(2)));
    assert_eq!(record["unreadable"][0]["file"], "f002.png");
}

#[test]
fn an_empty_folder_is_no_log() {
    let scratch = Scratch::new();
    scratch.image_log(1, 32, 24);
    std::fs::remove_dir_all(scratch.path("log")).unwrap();
    std::fs::create_dir(scratch.path("log")).unwrap();
    let output = scratch.run(&[]);
    assert_status(&output, 1);
    assert_says(&output, &["no images"]);
    assert!(!scratch.path("out").exists());
    std::fs::remove_dir(scratch.path("log")).unwrap();
    assert_status(&scratch.run(&[]), 1);
}

#[test]
fn a_picture_of_another_size_is_unreadable_and_the_rest_stands() {
    let scratch = Scratch::new();
    scratch.image_log(4, 96, 64);
    scratch.write("log/f002.png", png(64, 96, 1));
    let output = scratch.run(&[]);
    assert_status(&output, 1);
    assert_says(&output, &["f002.png", "96x64", "64x96"]);
    let status: Vec<String> = scratch.poses().into_iter().map(|r| r[STATUS].clone()).collect();
    assert_eq!(status, ["no_net", "no_net", "unreadable", "no_net"]);
}

#[test]
fn a_camera_of_another_size_ends_the_run_before_any_claim() {
    let scratch = Scratch::new();
    scratch.image_log(3, 96, 64);
    scratch.camera(192, 128);
    let output = scratch.run(&[]);
    assert_status(&output, 1);
    assert_says(&output, &["192x128", "96x64", "--camera"]);
    assert!(scratch.poses().is_empty());
    assert_eq!(scratch.record()["finished"], false);
}

#[test]
fn times_that_run_backwards_are_unreadable_frames() {
    let scratch = Scratch::new();
    scratch.image_log(5, 48, 32);
    scratch.write(
        "log/timestamps.csv",
        "file,timestamp_ns\nf000.png,100\nf001.png,200\nf002.png,150\nf003.png,300\nf004.png,400\n",
    );
    let output = scratch.run(&[]);
    assert_status(&output, 1);
    assert_says(&output, &["time", "f00"]);
    let rows = scratch.poses();
    assert_eq!(rows.iter().filter(|r| r[STATUS] == "unreadable").count(), 1, "{rows:?}");
    let times: Vec<i64> = rows.iter().filter(|r| r[STATUS] != "unreadable").map(|r| r[2].parse().unwrap()).collect();
    assert!(times.is_sorted(), "{times:?}");
}

#[test]
fn a_camera_file_that_makes_no_sense_names_field_and_value() {
    let scratch = Scratch::new();
    scratch.image_log(1, 32, 24);
    let good = std::fs::read_to_string(scratch.path("camera.yaml")).unwrap();
    scratch.write("camera.yaml", good.replace("image_width: 32", "image_width: -32"));
    let output = scratch.run(&[]);
    assert_status(&output, 1);
    assert_says(&output, &["camera.yaml", "image_width", "-32"]);
}

#[test]
fn a_lens_that_is_none_is_an_error_of_its_file() {
    let scratch = Scratch::new();
    let log = scratch.image_log(1, 96, 64);
    let good = std::fs::read_to_string(scratch.path("camera.yaml")).unwrap();
    let camera = scratch.write("camera.yaml", good.replace("[0, 0, 0, 0, 0]", "[1e6, 0, 0, 0, 0]"));
    let image = netpose()
        .arg("image")
        .arg(log.join("f000.png"))
        .arg("--camera")
        .arg(camera)
        .args(["--cell", "50mm"])
        .output()
        .expect("netpose starts");
    for output in [scratch.run(&[]), image] {
        assert_status(&output, 1);
        assert_says(&output, &["camera.yaml", "distortion_coefficients is [1000000.0, 0.0"]);
    }
    assert!(!scratch.path("out").exists());
}

#[test]
fn single_images_that_cannot_be_read_do_not_hide_the_others() {
    let scratch = Scratch::new();
    let log = scratch.image_log(2, 64, 48);
    let bad = scratch.write("bad.jpg", [0xFF, 0xD8, 0xFF, 0xE0]);
    let output = netpose()
        .arg("image")
        .args([log.join("f000.png"), bad, log.join("f001.png")])
        .arg("--camera")
        .arg(scratch.path("camera.yaml"))
        .args(["--cell", "50mm", "--json"])
        .output()
        .unwrap();
    assert_status(&output, 1);
    assert_says(&output, &["bad.jpg"]);
    let lines = crate::support::stdout(&output);
    let status: Vec<String> = lines
        .lines()
        .map(|line| {
            serde_json::from_str::<serde_json::Value>(line).expect("nothing but JSON")["status"]
                .as_str()
                .unwrap()
                .to_owned()
        })
        .collect();
    assert_eq!(status, ["no_net", "unreadable", "no_net"]);
}

#[test]
fn a_truth_that_is_no_pose_is_not_taken_for_no_net() {
    let scratch = Scratch::new();
    scratch.image_log(2, 48, 32);
    assert_status(&scratch.run(&[]), 0);
    let eval = |row: &str| {
        let text = format!("frame,file,tx,ty,tz,qw,qx,qy,qz\n0,f000.png,0,0,1,1,0,0,0\n1,f001.png,{row}\n");
        let truth = scratch.write("truth.csv", text);
        netpose().arg("eval").arg(scratch.path("out")).arg("--truth").arg(truth).output().expect("netpose starts")
    };
    for (row, words) in [
        ("0,0,nan,1,0,0,0", ["line 3", "tz is NaN"]),
        ("0,0,1,0,0,0,0", ["line 3", "no rotation"]),
        ("0,0,1,1,0,,0", ["line 3", "empty"]),
        ("0,0,abc,1,0,0,0", ["line 3", "tz is \"abc\""]),
    ] {
        let output = eval(row);
        assert_status(&output, 1);
        assert_says(&output, &words);
    }
    assert_status(&eval(",,,,,,"), 0);
}

/// `truth_layers.csv` has a row for each net: which of them is meant is not for the program to guess.
#[test]
fn a_truth_with_two_rows_for_a_frame_is_refused() {
    let scratch = Scratch::new();
    scratch.image_log(2, 48, 32);
    assert_status(&scratch.run(&[]), 0);
    let text =
        "frame,file,tx,ty,tz,qw,qx,qy,qz\n0,f000.png,0,0,1,1,0,0,0\n1,f001.png,,,,,,,\n0,f000.png,0,0,2,1,0,0,0\n";
    let truth = scratch.write("layers.csv", text);
    let output =
        netpose().arg("eval").arg(scratch.path("out")).arg("--truth").arg(truth).output().expect("netpose starts");
    assert_status(&output, 1);
    assert_says(&output, &["layers.csv, line 4", "frame 0 is in line 2 already"]);
}

#[test]
fn pictures_of_one_name_are_not_drawn_over_each_other() {
    let scratch = Scratch::new();
    scratch.image_log(1, 48, 32);
    let other = scratch.write("other/f000.png", std::fs::read(scratch.path("log/f000.png")).unwrap());
    let output = netpose()
        .arg("image")
        .args([scratch.path("log/f000.png"), other])
        .arg("--camera")
        .arg(scratch.path("camera.yaml"))
        .args(["--cell", "50mm", "--overlay"])
        .arg(scratch.path("drawn"))
        .output()
        .expect("netpose starts");
    assert_status(&output, 1);
    assert_says(&output, &["one file", "other"]);
}

#[test]
fn a_hundred_thousand_threads_are_refused() {
    let scratch = Scratch::new();
    scratch.image_log(1, 48, 32);
    for jobs in ["0", "100000"] {
        let output = scratch.run(&["--jobs", jobs]);
        assert_status(&output, 2);
        assert_says(&output, &["--jobs", jobs, "1..=256"]);
    }
}
