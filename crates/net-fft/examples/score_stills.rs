//! Scores the estimator on pictures with known poses: `cargo run --release -p net-fft --example score_stills -- FOLDER [NAME] [--thesis] [--features]`.
//!
//! FOLDER holds pictures and, beside each, a JSON file of the same name with `K`, `dist`, `width`, `height` and `layers` (`R`, `t`, `a1`, `a2`, `cell_len`, `cell_angle_deg`, `dist_axis`, `fit`,
//! `fit_local`). Right means: range within 5 %, normal and in-plane rotation within 5 degrees. An estimate is claimed from a probability of one half.

use std::error::Error;
use std::path::{Path, PathBuf};

use net_fft::{ThesisConfig, ThesisEstimator, ThesisEstimate};
use net_geometry::nalgebra::{Matrix3, Vector3};
use net_geometry::{Camera, Lens, Mesh};
use net_image::View;
use serde_json::Value;

/// Range, %, normal and in-plane rotation, degrees, that still count as right.
const TOLERANCES: [f64; 3] = [5.0, 5.0, 5.0];

#[derive(Default)]
struct Tally {
    nets: u32,
    right: u32,
    wrong: u32,
    pictures_without: u32,
    false_alarms: u32,
    range: Vec<f64>,
    tilt: Vec<f64>,
    sigmas: Vec<f64>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let (flags, words): (Vec<String>, Vec<String>) = std::env::args().skip(1).partition(|arg| arg.starts_with("--"));
    let folder = words.first().ok_or("which folder?")?;
    let has = |flag: &str| flags.iter().any(|other| other == flag);
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<Result<_, std::io::Error>>()?;
    files.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
    files.retain(|path| words.get(1).is_none_or(|name| path.to_string_lossy().contains(name)));
    files.sort();
    let mut tally = Tally::default();
    for file in files {
        let truth: Value = serde_json::from_str(&std::fs::read_to_string(&file)?)?;
        if truth["K"].is_array() {
            score(&file, &truth, has("--thesis"), has("--features"), &mut tally)?;
        }
    }
    let middle = |values: &mut Vec<f64>, part: f64| {
        values.sort_by(f64::total_cmp);
        values.get((values.len() as f64 * part) as usize).copied().unwrap_or(f64::NAN)
    };
    println!(
        "{} nets: {} right, {} wrong, {} refused; {} without: {} false alarms; of the right ones median {:.3} % {:.3} deg, 95th percentile {:.2} % {:.2} deg; error over sigma {:.2} / {:.2}",
        tally.nets,
        tally.right,
        tally.wrong,
        tally.nets - tally.right - tally.wrong,
        tally.pictures_without,
        tally.false_alarms,
        middle(&mut tally.range, 0.5),
        middle(&mut tally.tilt, 0.5),
        middle(&mut tally.range, 0.95),
        middle(&mut tally.tilt, 0.95),
        middle(&mut tally.sigmas, 0.5),
        middle(&mut tally.sigmas, 0.9),
    );
    Ok(())
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn score(file: &Path, truth: &Value, thesis: bool, features: bool, tally: &mut Tally) -> Result<(), Box<dyn Error>> {
    let name = truth["file"].as_str().ok_or("no file")?;
    let picture = image::open(file.with_file_name(name))?.to_luma8();
    let k = |row: usize, column: usize| number(&truth["K"][row][column]);
    let mut lens = [0.0; 5];
    for (to, from) in lens.iter_mut().zip(truth["dist"].as_array().ok_or("no dist")?) {
        *to = number(from);
    }
    let lens = if lens == [0.0; 5] { Lens::None } else { Lens::PlumbBob(lens) };
    let camera = Camera::new(k(0, 0), k(1, 1), k(0, 2), k(1, 2), picture.width(), picture.height(), lens)?;
    let layer = &truth["layers"][0];
    let mesh = if layer.is_null() {
        Mesh::square(0.05)?
    } else {
        // Of nets that hang askew the user knows the sides, not the angle.
        let askew = truth["group"] == "H" || name.contains("skew");
        let angle = if askew { 90.0 } else { truth["spec_angle"].as_f64().unwrap_or(number(&layer["cell_angle_deg"])) };
        Mesh::oblique(number(&layer["cell_len"][0]), number(&layer["cell_len"][1]), angle.to_radians())?
    };
    let configs = if thesis { vec![ThesisConfig::thesis(false), ThesisConfig::thesis(true)] } else { vec![ThesisConfig::default()] };
    let mut best: Option<ThesisEstimate> = None;
    let start = std::time::Instant::now();
    for config in configs {
        let mut estimator = ThesisEstimator::new(&camera, &mesh, &config)?;
        let view = View::packed(picture.as_raw(), picture.width() as usize, picture.height() as usize)?;
        if let Some(found) = estimator.estimate(view)?
            && best.is_none_or(|other| found.probability > other.probability)
        {
            best = Some(found);
        }
    }
    let milliseconds = start.elapsed().as_secs_f64() * 1e3;
    let claimed = best.is_some_and(|found| found.probability >= 0.5);
    let verdict = match (&best, layer.is_null()) {
        (_, true) => {
            tally.pictures_without += 1;
            tally.false_alarms += u32::from(claimed);
            "without a net".to_owned()
        }
        (None, false) => {
            tally.nets += 1;
            "nothing".to_owned()
        }
        (Some(found), false) => {
            tally.nets += 1;
            let errors = errors(found, layer);
            let right = errors.iter().zip(TOLERANCES).all(|(error, tolerance)| *error <= tolerance);
            if claimed && right {
                tally.right += 1;
                tally.range.push(errors[0]);
                tally.tilt.push(errors[1]);
                let sigma = found.covariance.sigma_range(&found.pose) / found.range() * 100.0;
                tally.sigmas.push(errors[0] / sigma);
                tally.sigmas.push(errors[1] / found.covariance.sigma_tilt(&found.pose).to_degrees());
            }
            tally.wrong += u32::from(claimed && !right);
            let word = if right { "RIGHT" } else { "WRONG" };
            format!(
                "range {:.3} off {:.2} % {:.2} deg {:.2} deg {word}",
                found.range(),
                errors[0],
                errors[1],
                errors[2]
            )
        }
    };
    let probability = best.map_or(0.0, |found| found.probability);
    println!("{name:44} p {probability:.3} {verdict} [{milliseconds:.1} ms]");
    if features && let Some(found) = best {
        println!("FEATURES {name} {verdict} {:?}", found.support);
    }
    Ok(())
}

/// Range, %, normal and in-plane rotation, degrees.
fn errors(found: &ThesisEstimate, layer: &Value) -> [f64; 3] {
    let turn = Matrix3::from_fn(|row, column| number(&layer["R"][row][column]));
    // Of a bent net the truth is that about the optical axis.
    let bent = layer["fit"]["max_offplane_m"].as_f64().is_some_and(|off| off > 0.0055);
    let fit = if bent && layer["fit_local"]["normal_cam"].is_array() { &layer["fit_local"] } else { &layer["fit"] };
    let mut normal = turn.column(2).into_owned();
    if let Some(fitted) = fit["normal_cam"].as_array() {
        normal = Vector3::from_fn(|i, _| number(&fitted[i]));
    }
    let mut range = fit["dist_axis"].as_f64().unwrap_or(number(&layer["dist_axis"]));
    if bent {
        range = layer["fit"]["axis_depth_local"].as_f64().unwrap_or(range);
    }
    let angle = |a: &Vector3<f64>, b: &Vector3<f64>| a.cross(b).norm().atan2(a.dot(b).abs()).to_degrees();
    let side = |key: &str| turn * Vector3::new(number(&layer[key][0]), number(&layer[key][1]), 0.0);
    let in_plane = angle(&found.pose.x_axis(), &side("a1")).min(angle(&found.pose.x_axis(), &side("a2")));
    [100.0 * (found.range() / range - 1.0).abs(), angle(&found.plane.normal, &normal), in_plane]
}
