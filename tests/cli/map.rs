//! What a run adds with `--smooth` and `--map`, and `netpose smooth` on a run that is done.

use crate::support::{Scratch, assert_says, assert_status, netpose, stdout};

/// Three frames of a virtual net, run with both.
fn mapped(scratch: &Scratch) {
    let output =
        netpose().arg("sim").arg(scratch.path("log")).args(["--scenario", "strafe", "--frames", "3"]).output().unwrap();
    assert_status(&output, 0);
    let output = netpose()
        .arg("run")
        .arg(scratch.path("log"))
        .args(["--cell", "50mm", "--smooth", "--map", "--out"])
        .arg(scratch.path("out"))
        .output()
        .unwrap();
    assert_status(&output, 0);
    assert_says(&output, &["map: 0 holes"]);
    assert!(stdout(&output).contains("3 poses smoothed"), "{}", stdout(&output));
}

#[test]
fn a_run_is_smoothed_and_mapped() {
    let scratch = Scratch::new();
    mapped(&scratch);
    let read = |name: &str| std::fs::read_to_string(scratch.path("out").join(name)).unwrap();
    let smooth = read("poses_smooth.csv");
    let columns: Vec<&str> = smooth.lines().next().unwrap().split(',').collect();
    let usual = read("poses.csv").lines().next().unwrap().split(',').take(22).map(str::to_owned).collect::<Vec<_>>();
    assert!(columns.iter().take(22).eq(usual.iter()), "{columns:?}");
    let residual = columns.iter().position(|c| *c == "residual").unwrap();
    assert_eq!(smooth.lines().count(), 4);
    for row in smooth.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        // Six deviations in six numbers: nothing pulls the poses away from where they were measured.
        assert!(cells[3] == "ok" && cells[residual].parse::<f64>().unwrap() < 6.0, "{row}");
    }
    // Every frame goes on from the one before, and the vote is sure of it; whatever the tracker's count did.
    let count = read("count.csv");
    let sure = |row: &str| row.split(',').nth(2) == Some("0") && row.split(',').nth(7) == Some("1");
    assert!(count.lines().count() == 4 && count.lines().skip(1).all(sure), "{count}");
    assert_eq!(read("slips.csv").lines().count(), 1, "a header and no slip");
    assert_eq!(read("holes.csv").lines().count(), 1, "a header and no hole");
    assert!(scratch.path("out/growth.parquet").metadata().unwrap().len() > 1000);
    for name in ["map_0.png", "coverage_0.png", "growth_0.png"] {
        let picture = image::open(scratch.path("out/map").join(name)).unwrap();
        assert!(picture.width() > 100 && picture.height() > 100, "{name}");
    }
    assert!(!scratch.path("out/map/tiles").exists(), "tiles are removed");
    // Smoothing again changes nothing, log or no log.
    std::fs::remove_dir_all(scratch.path("log")).unwrap();
    let output = netpose().arg("smooth").arg(scratch.path("out")).output().unwrap();
    assert_status(&output, 0);
    assert_eq!(read("poses_smooth.csv"), smooth);
}

#[test]
fn what_cannot_be_smoothed_or_mapped_is_said() {
    let scratch = Scratch::new();
    let output = netpose().arg("smooth").arg(scratch.path("nothing")).output().unwrap();
    assert_status(&output, 1);
    assert_says(&output, &["run.json"]);
    scratch.image_log(2, 48, 32);
    assert_status(&scratch.run(&["--map", "--resume"]), 2);
    // Frames without a net: an empty map, no poses.
    let output = scratch.run(&["--map", "--smooth"]);
    assert_status(&output, 0);
    assert_says(&output, &["map: 0 holes, 0 pictures"]);
    assert!(stdout(&output).contains("0 poses smoothed"), "{}", stdout(&output));
    // The thesis's method knows no twines: its map would be that of a net without holes.
    let thesis = scratch.write("thesis.toml", "method = \"thesis\"\n");
    let thesis = thesis.to_str().unwrap();
    for (asked, named) in [("--map", "--map"), ("--layers", "layers")] {
        let output = scratch.run(&[asked, "--force", "--config", thesis]);
        assert_status(&output, 2);
        assert_says(&output, &[named, "thesis"]);
    }
    let wrong = scratch.write("smooth.toml", "acceleration_density = -1.0\n");
    let output = netpose().arg("smooth").arg(scratch.path("out")).arg("--config").arg(wrong).output().unwrap();
    assert_status(&output, 2);
    assert_says(&output, &["acceleration_density", "-1"]);
}
