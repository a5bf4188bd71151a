//! Random scenes whose truth is known, and what the table and the curves of them hold.

use crate::support::{Scratch, assert_says, assert_status, netpose, stdout};

fn calibrate(scratch: &Scratch, out: &str, more: &[&str]) -> std::process::Output {
    netpose().arg("calibrate").arg("--out").arg(scratch.path(out)).args(more).output().unwrap()
}

/// Rows of `calibration.csv`, without the time that each took.
fn rows(scratch: &Scratch, out: &str) -> Vec<Vec<(String, String)>> {
    let mut reader = csv::Reader::from_path(scratch.path(out).join("calibration.csv")).unwrap();
    let names: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
    let row = |record: csv::StringRecord| {
        names.iter().cloned().zip(record.iter().map(str::to_owned)).filter(|(name, _)| name != "ms").collect()
    };
    reader.records().map(|record| row(record.unwrap())).collect()
}

#[test]
fn scenes_are_told_with_their_truth_in_the_same_order_for_any_number_of_threads() {
    let scratch = Scratch::new();
    let scenes = ["--study", "noise", "--study", "negative", "--scenes", "2", "--seed", "5"];
    let output = calibrate(&scratch, "one", &[&scenes[..], &["--jobs", "1"]].concat());
    assert_status(&output, 0);
    for title in ["Reliability", "Risk and coverage", "By condition", "Scenes without a net"] {
        assert!(stdout(&output).contains(title), "{title}: {}", stdout(&output));
    }
    let one = rows(&scratch, "one");
    let cell = |row: usize, name: &str| -> &str {
        let found = one[row].iter().find(|(column, _)| column == name);
        &found.unwrap_or_else(|| panic!("no column {name}")).1
    };
    let named: Vec<_> = (0..one.len()).map(|k| (cell(k, "study"), cell(k, "seed"))).collect();
    assert_eq!(named, [("noise", "5"), ("noise", "6"), ("negative", "5"), ("negative", "6")]);
    for k in 0..4 {
        let p: f64 = cell(k, "probability").parse().unwrap();
        assert!((0.0..=1.0).contains(&p));
    }
    // Where there is a net there is a truth, and nowhere else.
    let range: f64 = cell(0, "true_range_m").parse().unwrap();
    assert!((0.4..=4.0).contains(&range), "{range}");
    assert_eq!((cell(2, "true_range_m"), cell(2, "visible"), cell(2, "right")), ("", "0", "0"));
    // Statistics of the evidence are columns of their own.
    assert!(one[0].iter().any(|(name, _)| name == "v2_1") && one[0].iter().any(|(name, _)| name == "good_near"));
    for picture in ["reliability.svg", "risk-coverage.svg"] {
        let svg = std::fs::read_to_string(scratch.path("one").join(picture)).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("probability"), "{picture}");
    }
    assert_status(&calibrate(&scratch, "two", &[&scenes[..], &["--jobs", "2"]].concat()), 0);
    assert_eq!(one, rows(&scratch, "two"));
}

#[test]
fn studies_that_are_not_known_are_wrong_usage() {
    let scratch = Scratch::new();
    let output = calibrate(&scratch, "out", &["--study", "dreams"]);
    assert_status(&output, 2);
    assert_says(&output, &["dreams"]);
}
