//! From a virtual net to a verdict: sim, run and eval together.

use std::process::Output;

use crate::support::{Scratch, assert_says, assert_status, netpose, stdout};

fn sim(scratch: &Scratch, dir: &str, more: &[&str]) -> Output {
    netpose()
        .arg("sim")
        .arg(scratch.path(dir))
        .args(["--scenario", "strafe", "--frames", "3"])
        .args(more)
        .output()
        .unwrap()
}

fn run(scratch: &Scratch, log: &str, out: &str, more: &[&str]) {
    let output = netpose()
        .arg("run")
        .arg(scratch.path(log))
        .args(["--cell", "50mm", "--out"])
        .arg(scratch.path(out))
        .args(more)
        .output()
        .unwrap();
    assert_status(&output, 0);
}

/// Rows of `poses.csv` without some of their columns.
fn poses_without(scratch: &Scratch, out: &str, columns: &[usize]) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(scratch.path(out).join("poses.csv")).unwrap();
    let cells = |line: &str| -> Vec<String> {
        line.split(',').enumerate().filter(|(k, _)| !columns.contains(k)).map(|(_, cell)| cell.to_owned()).collect()
    };
    text.lines().map(cells).collect()
}

/// Frames and twines of `twines.parquet`.
fn twines(scratch: &Scratch, out: &str) -> Vec<(u64, Vec<net_geometry::Twine>)> {
    let frames = net_log::read_twines(&scratch.path(out).join("twines.parquet")).expect("a table that is whole");
    let frames: Vec<_> = frames.map(|frame| frame.expect("a frame")).collect();
    assert_eq!(frames.iter().map(|f| f.0).collect::<Vec<_>>(), [0, 1, 2]);
    frames
}

const FILE: usize = 1;
const LATENCY: usize = 21;

#[test]
fn a_virtual_net_is_found_where_it_is() {
    let scratch = Scratch::new();
    assert_status(&sim(&scratch, "log", &[]), 0);
    run(&scratch, "log", "out", &["--jobs", "1"]);
    let output = netpose()
        .arg("eval")
        .arg(scratch.path("out"))
        .arg("--truth")
        .arg(scratch.path("log/truth.csv"))
        .arg("--json")
        .output()
        .unwrap();
    assert_status(&output, 0);
    let report: serde_json::Value = serde_json::from_str(&stdout(&output)).expect("nothing but JSON");
    assert_eq!(
        (report["frames"].as_u64(), report["ok"].as_u64(), report["wrong"].as_u64()),
        (Some(3), Some(3), Some(0))
    );
    // Far looser than the estimator's own tests: what counts here is that units, frames and columns agree end to end.
    assert!(report["range_percent"]["max"].as_f64().unwrap() < 1.0, "{report}");
    assert!(report["normal_deg"]["max"].as_f64().unwrap() < 1.0, "{report}");
    assert!(report["lateral_mm"]["max"].as_f64().unwrap() < 10.0, "{report}");

    // Twines have names that junctions have, and are as wide as blur of a pixel makes 2 mm at 1.2 m.
    for (number, twines) in twines(&scratch, "out") {
        let told: Vec<f32> = twines.iter().filter_map(|t| t.width_px).collect();
        let mean = told.iter().sum::<f32>() / told.len() as f32;
        assert!(twines.len() > 500 && 2 * told.len() > twines.len(), "{number}: {} of {}", told.len(), twines.len());
        assert!((1.5..5.0).contains(&mean), "{number}: {mean}");
    }

    // The same for any number of threads, to the byte, but for the time it took (which annotated.mcap carries as well).
    for jobs in ["2", "3"] {
        run(&scratch, "log", "again", &["--jobs", jobs, "--overlay", "--force"]);
        assert_eq!(poses_without(&scratch, "out", &[LATENCY]), poses_without(&scratch, "again", &[LATENCY]));
        for name in ["junctions.parquet", "twines.parquet", "trajectory.tum"] {
            let read = |out: &str| std::fs::read(scratch.path(out).join(name)).unwrap();
            assert!(read("out") == read("again"), "{name} differs for --jobs {jobs}");
        }
    }
}

/// The tracker of a resumed run does not know the origin of the run before: its counts have numbers of their own.
#[test]
fn a_resumed_run_starts_another_count_of_cells() {
    let scratch = Scratch::new();
    assert_status(&sim(&scratch, "log", &[]), 0);
    run(&scratch, "log", "out", &[]);
    let whole = poses_without(&scratch, "out", &[]);
    let track = whole[0].iter().position(|name| name == "track").expect("a column");
    let text = std::fs::read_to_string(scratch.path("out/poses.csv")).unwrap();
    scratch.write("out/poses.csv", text.lines().take(2).map(|line| line.to_owned() + "\n").collect::<String>());
    run(&scratch, "log", "out", &["--resume"]);
    let tracks: Vec<String> = poses_without(&scratch, "out", &[]).iter().map(|row| row[track].clone()).collect();
    assert_eq!(tracks, ["track", "0", "1", "1"]);
    // The twines of the frames that were done again are there once.
    assert!(twines(&scratch, "out").iter().all(|(_, twines)| twines.len() > 500));
}

#[test]
fn the_same_seed_draws_the_same_log_and_mcap_holds_the_same_frames() {
    let scratch = Scratch::new();
    assert_status(&sim(&scratch, "a", &["--seed", "7"]), 0);
    assert_status(&sim(&scratch, "b", &["--seed", "7"]), 0);
    assert_status(&sim(&scratch, "c", &["--seed", "8"]), 0);
    assert_status(&sim(&scratch, "m", &["--seed", "7", "--mcap"]), 0);
    let read = |name: &str| std::fs::read(scratch.path(name)).unwrap();
    for name in ["f000002.png", "truth.csv", "truth_junctions.csv", "timestamps.csv", "camera.yaml", "scenario.toml"] {
        assert!(read(&format!("a/{name}")) == read(&format!("b/{name}")), "{name} differs");
    }
    assert!(read("a/f000002.png") != read("c/f000002.png"), "another seed, the same picture");
    run(&scratch, "a", "out_a", &[]);
    run(&scratch, "m/log.mcap", "out_m", &[]);
    let poses = |out: &str| poses_without(&scratch, out, &[FILE, LATENCY]);
    assert_eq!(poses("out_a"), poses("out_m"));
}

#[test]
fn every_net_of_a_scene_has_its_truth() {
    let scratch = Scratch::new();
    let output = netpose().arg("sim").arg(scratch.path("log")).args(["--scenario", "double"]).output().unwrap();
    assert_status(&output, 0);
    let rows = |name: &str| -> Vec<std::collections::HashMap<String, String>> {
        csv::Reader::from_path(scratch.path("log").join(name)).unwrap().deserialize().map(Result::unwrap).collect()
    };
    let (nearest, all) = (rows("truth.csv"), rows("truth_layers.csv"));
    assert_eq!(all.iter().map(|row| row["layer"].as_str()).collect::<Vec<_>>(), ["0", "1"]);
    // The first is the one of truth.csv; the second hangs behind it.
    assert!(nearest[0].iter().all(|(column, cell)| &all[0][column] == cell));
    let range = |k: usize| all[k]["range_m"].parse::<f64>().unwrap();
    assert!(range(1) > range(0) + 0.3, "{} {}", range(0), range(1));
    // Knots of both are told apart by the same number.
    let junctions = rows("truth_junctions.csv");
    for layer in ["0", "1"] {
        assert!(junctions.iter().filter(|row| row["layer"] == layer).count() > 100, "layer {layer}");
    }
}

#[test]
fn a_scenario_from_a_file_is_drawn_and_a_wrong_one_refused() {
    let scratch = Scratch::new();
    let file = scratch.write("mine.toml", "frames = 1\nmesh = \"30mm\"\n[camera]\nimage_width = 64\nimage_height = 48\ncx = 32.0\ncy = 24.0\nfx = 60.0\nfy = 60.0\n");
    let draw = |dir: &str, scenario: &str| {
        netpose().arg("sim").arg(scratch.path(dir)).args(["--scenario", scenario]).output().unwrap()
    };
    assert_status(&draw("mine", file.to_str().unwrap()), 0);
    assert_eq!(image::image_dimensions(scratch.path("mine/f000000.png")).unwrap(), (64, 48));
    let output = draw("mine", file.to_str().unwrap());
    assert_status(&output, 1);
    assert_says(&output, &["not empty"]);
    let wrong = scratch.write("wrong.toml", "framess = 1\n");
    let output = draw("wrong", wrong.to_str().unwrap());
    assert_status(&output, 2);
    assert_says(&output, &["framess"]);
    let output = draw("none", "no-such-net");
    assert_status(&output, 2);
    assert_says(&output, &["no-such-net", "--list"]);
}

#[test]
fn a_net_behind_a_net_gets_a_row_of_its_own() {
    let scratch = Scratch::new();
    let drawn = netpose()
        .arg("sim")
        .arg(scratch.path("log"))
        .args(["--scenario", "study-layers-2", "--frames", "1"])
        .output()
        .unwrap();
    assert_status(&drawn, 0);
    run(&scratch, "log", "out", &["--layers"]);
    let rows = |path: &str| -> Vec<std::collections::HashMap<String, String>> {
        csv::Reader::from_path(scratch.path(path)).unwrap().deserialize().map(Result::unwrap).collect()
    };
    let (poses, layers, truth) = (rows("out/poses.csv"), rows("out/layers.csv"), rows("log/truth_layers.csv"));
    assert_eq!(layers.iter().map(|row| row["layer"].as_str()).collect::<Vec<_>>(), ["0", "1"]);
    let number = |row: &std::collections::HashMap<String, String>, column: &str| row[column].parse::<f64>().unwrap();
    for (row, net) in layers.iter().zip(&truth) {
        // A tenth of what a claim is allowed.
        assert!((number(row, "range_m") / number(net, "range_m") - 1.0).abs() < 0.005, "{row:?}");
        assert!(number(row, "probability") >= 0.5);
    }
    // One of them is the net of poses.csv.
    let followed: Vec<_> = layers.iter().filter(|row| row["followed"] == "1").collect();
    assert_eq!(followed.len(), 1);
    assert_eq!(followed[0]["range_m"], poses[0]["range_m"]);
    // A run without the flag leaves no rows of an earlier one behind.
    run(&scratch, "log", "out", &["--force"]);
    assert!(!scratch.path("out/layers.csv").exists());
    // Nothing to resume from.
    let output = netpose()
        .arg("run")
        .arg(scratch.path("log"))
        .args(["--cell", "50mm", "--layers", "--resume", "--out"])
        .arg(scratch.path("out"))
        .output()
        .unwrap();
    assert_status(&output, 2);
}
