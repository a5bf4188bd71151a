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
fn a_configuration_with_an_unknown_key_is_refused_by_its_name() {
    let scratch = Scratch::new();
    scratch.image_log(1, 32, 24);
    let config = scratch.write("config.toml", "metod = \"thesis\"\n");
    let output = scratch.run(&["--config", config.to_str().unwrap()]);
    assert_status(&output, 2);
    assert_says(&output, &["config.toml", "metod", "method"]);
}

#[test]
fn help_names_every_command_and_the_exit_status() {
    let output = netpose().arg("--help").output().unwrap();
    assert_status(&output, 0);
    for word in ["run", "image", "sim", "eval", "info", "reproduce", "Exit status"] {
        assert!(stdout(&output).contains(word), "{word}");
    }
}
