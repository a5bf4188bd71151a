//! The folder of results: what is there already, what cannot be written, what is left when the run is stopped.

use std::process::Stdio;

use crate::support::{STATUS, Scratch, assert_says, assert_status, netpose, stderr};

#[test]
fn a_folder_that_holds_a_run_is_not_overwritten_in_silence() {
    let scratch = Scratch::new();
    scratch.image_log(3, 48, 32);
    assert_status(&scratch.run(&[]), 0);
    let before = std::fs::read(scratch.path("out/poses.csv")).unwrap();
    let output = scratch.run(&[]);
    assert_status(&output, 1);
    assert_says(&output, &["--resume", "--force"]);
    assert_eq!(std::fs::read(scratch.path("out/poses.csv")).unwrap(), before);
    assert_status(&scratch.run(&["--force"]), 0);
    assert_eq!(scratch.poses().len(), 3);
}

#[cfg(unix)]
#[test]
fn two_runs_do_not_write_into_one_folder() {
    let scratch = Scratch::new();
    scratch.image_log(3, 48, 32);
    std::fs::create_dir(scratch.path("out")).unwrap();
    let other = std::fs::File::open(scratch.path("out")).unwrap();
    other.lock().unwrap();
    for more in [&[][..], &["--resume"], &["--force"]] {
        let output = scratch.run(more);
        assert_status(&output, 1);
        assert_says(&output, &["another netpose", "out"]);
    }
    drop(other);
    assert_status(&scratch.run(&[]), 0);
}

#[test]
fn a_run_that_failed_before_its_first_frame_is_in_nobodys_way() {
    let scratch = Scratch::new();
    scratch.image_log(3, 48, 32);
    scratch.camera(64, 64);
    assert_status(&scratch.run(&[]), 1);
    scratch.camera(48, 32);
    assert_status(&scratch.run(&[]), 0);
    assert_eq!(scratch.poses().len(), 3);
}

#[test]
fn a_folder_that_cannot_be_made_is_named() {
    let scratch = Scratch::new();
    scratch.image_log(1, 48, 32);
    // A file where the folder should be: refused to every user, root included.
    scratch.write("out", "a file");
    let output = scratch.run(&[]);
    assert_status(&output, 1);
    assert_says(&output, &["out"]);
}

/// A limit on the size of files stands in for a full disk: both make a write fail in the middle of the run.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_ends_the_run_with_the_frames_done_so_far() {
    let scratch = Scratch::new();
    let all = 500;
    scratch.image_log(all, 32, 24);
    // Blocks of 512 bytes in POSIX sh, of 1024 in bash: room for run.json and for some rows, not for all.
    let script = "trap '' XFSZ; ulimit -f 24; exec \"$0\" \"$@\"";
    let output = std::process::Command::new("sh")
        .args(["-c", script, env!("CARGO_BIN_EXE_netpose"), "run"])
        .arg(scratch.path("log"))
        .arg("--camera")
        .arg(scratch.path("camera.yaml"))
        .args(["--cell", "50mm", "--out"])
        .arg(scratch.path("out"))
        .output()
        .unwrap();
    assert_status(&output, 1);
    assert_says(&output, &["cannot write", "out"]);
    // Once there is room again, the run goes on, and nothing is missing or twice.
    assert_status(&scratch.run(&["--resume"]), 0);
    let frames: Vec<usize> = scratch.poses().iter().map(|r| r[0].parse().unwrap()).collect();
    assert_eq!(frames, (0..all as usize).collect::<Vec<_>>());
}

/// As [`a_full_disk_ends_the_run_with_the_frames_done_so_far`], with a net: the disk is full while its junctions are written.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_leaves_a_table_of_junctions_that_can_be_read() {
    let scratch = Scratch::new();
    let log = scratch.path("log");
    assert_status(&netpose().arg("sim").arg(&log).args(["--scenario", "strafe", "--frames", "3"]).output().unwrap(), 0);
    // Room for three rows of poses.csv and for run.json; three frames' junctions take more than 100 kB.
    let script = "trap '' XFSZ; ulimit -f 48; exec \"$0\" \"$@\"";
    let mut limited = std::process::Command::new("sh");
    limited.args(["-c", script, env!("CARGO_BIN_EXE_netpose"), "run"]).arg(&log);
    let output = limited.args(["--cell", "50mm", "--out"]).arg(scratch.path("out")).output().unwrap();
    assert_status(&output, 1);
    assert_says(&output, &["cannot write", "junctions.parquet"]);
    let table = scratch.path("out/junctions.parquet");
    let frames_in_it = || -> Vec<(u64, usize)> {
        let frames = net_log::read_junctions(&table).expect("a table that is whole");
        frames.map(|frame| frame.expect("a frame")).map(|(number, junctions)| (number, junctions.len())).collect()
    };
    assert_eq!(frames_in_it(), []);
    // Once there is room again, nothing is missing.
    let mut rest = netpose();
    rest.arg("run").arg(&log).args(["--cell", "50mm", "--resume", "--out"]).arg(scratch.path("out"));
    assert_status(&rest.output().unwrap(), 0);
    let found = frames_in_it();
    assert!(found.len() == 3 && found.iter().all(|&(_, junctions)| junctions > 100), "{found:?}");
}

#[test]
fn resuming_goes_on_behind_the_last_whole_row() {
    let scratch = Scratch::new();
    scratch.image_log(8, 48, 32);
    assert_status(&scratch.run(&[]), 0);
    let whole = std::fs::read_to_string(scratch.path("out/poses.csv")).unwrap();
    // As a machine that lost its power leaves it: the fifth row was never finished.
    let cut = whole.lines().take(5).map(|l| l.to_owned() + "\n").collect::<String>() + "4,f00";
    scratch.write("out/poses.csv", cut);
    assert_status(&scratch.run(&["--resume"]), 0);
    let frames: Vec<usize> = scratch.poses().iter().map(|r| r[0].parse().unwrap()).collect();
    assert_eq!(frames, (0..8).collect::<Vec<_>>());
    assert_eq!(scratch.record()["frames"]["no_net"], 8);
}

#[test]
fn a_run_with_other_settings_is_not_resumed() {
    let scratch = Scratch::new();
    scratch.image_log(3, 48, 32);
    assert_status(&scratch.run(&[]), 0);
    for other in [&["--resume", "--stride", "2"][..], &["--resume", "--to", "1"]] {
        let output = scratch.run(other);
        assert_status(&output, 1);
        assert_says(&output, &["resume", "log"]);
    }
}

/// Ctrl-C: the frames done so far stand, and the run can be resumed.
#[cfg(unix)]
#[test]
fn a_run_that_is_interrupted_leaves_whole_files() {
    use std::io::Read;
    let scratch = Scratch::new();
    // Too many frames to be done before the signal comes; each takes milliseconds.
    let frames = 150;
    scratch.image_log(frames, 96, 64);
    let mut child = netpose()
        .arg("run")
        .arg(scratch.path("log"))
        .arg("--camera")
        .arg(scratch.path("camera.yaml"))
        .args(["--cell", "50mm", "--overlay", "--out"])
        .arg(scratch.path("out"))
        .stderr(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    // Once a picture is there the loop is under way.
    let first = scratch.path("out/overlay/000000.jpg");
    while !first.exists() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    let kill = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let status = child.wait().unwrap();
    let mut said = String::new();
    child.stdout.take().unwrap().read_to_string(&mut said).unwrap();
    if !kill.success() || scratch.record()["finished"] == true {
        return; // It was quicker than the signal.
    }
    assert_eq!(status.code(), Some(1));
    assert!(said.contains("--resume"), "{said}");
    let rows = scratch.poses();
    assert!(!rows.is_empty() && (rows.len() as u64) < frames, "{}", rows.len());
    assert_eq!(scratch.record()["frames"]["no_net"], rows.len());
    let output = scratch.run(&["--resume", "--overlay"]);
    assert_status(&output, 0);
    assert_eq!(scratch.poses().len() as u64, frames, "{}", stderr(&output));
    assert!(scratch.poses().iter().all(|row| row[STATUS] == "no_net"));
}
