//! Wrong usage: exit status 2, and an error that says which flag helps.

use crate::support::{Scratch, assert_says, assert_status, netpose, stdout};

#[test]
fn a_mesh_that_is_not_given_is_asked_for_by_its_flag() {
    let scratch = Scratch::new();
    let log = scratch.image_log(1, 32, 24);
    for command in [vec!["run", "--out", "x"], vec!["image"]] {
        let output = netpose().current_dir(scratch.path("")).args(&command).arg(&log).output().unwrap();
        assert_status(&output, 2);
        assert_says(&output, &["--cell 50mm"]);
    }
}

#[test]
fn a_camera_that_is_nowhere_is_asked_for_by_its_flag() {
    let scratch = Scratch::new();
    let log = scratch.image_log(1, 32, 24);
    let output =
        netpose().arg("run").arg(&log).args(["--cell", "50mm", "--out"]).arg(scratch.path("out")).output().unwrap();
    assert_status(&output, 2);
    assert_says(&output, &["--camera"]);
    assert!(!scratch.path("out").exists(), "nothing is made before all is known");
    let output = netpose().arg("image").arg(log.join("f000.png")).args(["--cell", "50mm"]).output().unwrap();
    assert_status(&output, 2);
    assert_says(&output, &["--camera"]);
}

#[test]
fn values_that_cannot_be_read_are_wrong_usage() {
    let scratch = Scratch::new();
    scratch.image_log(1, 32, 24);
    for (more, words) in [
        (&["--cell", "50 furlongs"][..], &["50x40mm"][..]),
        (&["--from", "yesterday"], &["--from", "seconds"]),
        (&["--stride", "0"], &["--stride"]),
        (&["--jobs", "0"], &["--jobs"]),
        (&["--cell", "0.05mm"], &["0.05mm", "1 mm to 2 m"]),
        (&["--from", "-1"], &["--from", "-1", "seconds"]),
        (&["--resume", "--force"], &["--resume", "--force"]),
        (&["--no-such-flag"], &["--no-such-flag"]),
    ] {
        let log = scratch.path("log");
        let output = netpose().arg("run").arg(log).args(["--out", "out"]).args(more).output().unwrap();
        assert_status(&output, 2);
        assert_says(&output, words);
    }
}

#[test]
fn flags_that_contradict_each_other_or_the_log_are_wrong_usage() {
    let scratch = Scratch::new();
    scratch.image_log(2, 32, 24);
    let output = scratch.run(&["--from", "5", "--to", "1"]);
    assert_status(&output, 2);
    assert_says(&output, &["--from is later than --to", "5 s", "1 s"]);
    std::fs::remove_file(scratch.path("log/timestamps.csv")).unwrap();
    let output = scratch.run(&["--fps", "0"]);
    assert_status(&output, 2);
    assert_says(&output, &["--fps is 0"]);
    assert!(!scratch.path("out").exists());
    // A folder of images has no topics.
    let output = scratch.run(&["--topic", "/camera"]);
    assert_status(&output, 2);
    assert_says(&output, &["--topic is \"/camera\"", "a folder of images has none"]);
    let output = netpose().arg("info").arg(scratch.path("log")).args(["--topic", "/camera"]).output().unwrap();
    assert_status(&output, 2);
    assert_says(&output, &["--topic is \"/camera\""]);
    assert!(!scratch.path("out").exists());
    // Results among the images would be part of the log the next time. Whatever the path's spelling.
    let before = std::fs::read_dir(scratch.path("log")).unwrap().count();
    let output = netpose()
        .arg("run")
        .arg(scratch.path("log"))
        .arg("--camera")
        .arg(scratch.path("camera.yaml"))
        .args(["--cell", "50mm", "--out"])
        .arg(scratch.path("log/../log"))
        .output()
        .unwrap();
    assert_status(&output, 2);
    assert_says(&output, &["--out", "is the log itself"]);
    assert_eq!(std::fs::read_dir(scratch.path("log")).unwrap().count(), before);
}

#[test]
fn a_part_of_the_log_without_a_frame_is_said_to_be_empty() {
    let scratch = Scratch::new();
    scratch.image_log(3, 32, 24);
    let output = scratch.run(&["--from", "500"]);
    assert_status(&output, 1);
    assert_says(&output, &["no frame of the log was read", "from 500 s", "0.200 s long"]);
}

#[test]
fn a_configuration_with_an_unknown_key_is_refused_by_its_name() {
    let scratch = Scratch::new();
    scratch.image_log(1, 32, 24);
    let config = scratch.write("config.toml", "metod = \"thesis\"\n");
    let output = scratch.run(&["--config", config.to_str().unwrap()]);
    assert_status(&output, 2);
    assert_says(&output, &["config.toml", "metod", "method"]);
}

/// A search for nothing would end as "no net" in every picture.
#[test]
fn a_configuration_that_can_find_nothing_is_refused_by_field_and_value() {
    let scratch = Scratch::new();
    scratch.image_log(1, 32, 24);
    for (table, field) in
        [("search", "candidates_per_section"), ("search", "fits"), ("search", "pairs"), ("section.score", "max_peaks")]
    {
        let config = scratch.write("config.toml", format!("method = \"thesis\"\n[thesis.{table}]\n{field} = 0\n"));
        let output = scratch.run(&["--config", config.to_str().unwrap()]);
        assert_status(&output, 2);
        assert_says(&output, &["config.toml", &format!("{field} is 0: 1 or more")]);
    }
    assert!(!scratch.path("out").exists());
}

#[test]
fn help_names_every_command_and_the_exit_status() {
    let output = netpose().arg("--help").output().unwrap();
    assert_status(&output, 0);
    for word in ["run", "image", "sim", "eval", "info", "reproduce", "Exit status"] {
        assert!(stdout(&output).contains(word), "{word}");
    }
}
