//! The verifier: the vote on the two pictures round a suspected slip.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result};
use net_flow::vote::{CellVote, Verdict as Vote, VoteConfig};
use net_geometry::nalgebra::{Matrix2, Vector2};
use net_image::Image;
use net_log::{OpenOptions, RunSummary};
use net_track::{Answer, Measurement, Suspect, Verdict};
use netpose::{Camera, Lens};
use serde_json::Value;

use super::rows::Rows;
/// Largest shift that the vote tries, cells.
const REACH: i32 = 8;

/// Reads the pictures again, in one pass, and asks the vote about every suspect.
pub fn look(log: &Path, summary: &RunSummary, rows: &Rows, suspects: &[Suspect]) -> Result<Vec<Answer>> {
    let camera = camera_of_run(&summary.camera).context("run.json does not say the camera")?;
    let frame_of = |sample: usize| rows.rows[rows.row_of[sample]].frame;
    let wanted: BTreeSet<u64> = suspects.iter().flat_map(|s| [frame_of(s.before), frame_of(s.sample)]).collect();
    let mut answers = vec![Answer::UNKNOWN; suspects.len()];
    let mut pictures: BTreeMap<u64, Image<u8>> = BTreeMap::new();
    let mut log = net_log::open(log, &OpenOptions { topic: summary.log.topic.clone(), ..OpenOptions::default() })?;
    for frame in log.by_ref().filter(|f| wanted.contains(&f.index)) {
        // A picture that can no longer be read proves nothing.
        let Ok(picture) = frame.decode() else { continue };
        pictures.insert(frame.index, picture);
        for (suspect, answer) in suspects.iter().zip(&mut answers) {
            if frame_of(suspect.sample) == frame.index {
                *answer = ask(&camera, rows, &pictures, suspect, frame_of)?;
            }
        }
        // Suspects are about neighbours: what no later one needs can go.
        let needed = |f: u64| suspects.iter().any(|s| frame_of(s.before) == f && frame_of(s.sample) > frame.index);
        pictures.retain(|f, _| needed(*f));
        if wanted.last() == Some(&frame.index) {
            break;
        }
    }
    Ok(answers)
}

fn ask(
    camera: &Camera,
    rows: &Rows,
    pictures: &BTreeMap<u64, Image<u8>>,
    suspect: &Suspect,
    frame_of: impl Fn(usize) -> u64,
) -> Result<Answer> {
    let reach = suspect.cells.0.abs().max(suspect.cells.1.abs()).max(2) + 2;
    if reach > REACH {
        return Ok(Answer::UNKNOWN);
    }
    let mut vote = CellVote::new(&VoteConfig { reach_cells: reach as usize, ..VoteConfig::default() })?;
    let mut result = None;
    for sample in [suspect.before, suspect.sample] {
        let measured = rows.samples[sample].measurement.as_ref();
        let view = pictures.get(&frame_of(sample)).and_then(Image::view);
        let (Some(measured), Some(view)) = (measured, view) else { return Ok(Answer::UNKNOWN) };
        let Some(middle) = middle(measured) else { return Ok(Answer::UNKNOWN) };
        let [a1, a2] = measured.lattice;
        result = Some(vote.update(view, middle, |at: Vector2<f64>| {
            camera.pixel_from_point(measured.pose.transform((a1 * at.x + a2 * at.y).push(0.0)))
        }));
    }
    let answer = result.filter(|r| r.verdict == Vote::Decided).map(|r| {
        let right = r.shifts[0].cells == suspect.cells;
        Answer { verdict: if right { Verdict::Confirmed } else { Verdict::Refuted }, z: r.shifts[0].z }
    });
    Ok(answer.unwrap_or(Answer { verdict: Verdict::Unknown, z: result.map_or(f64::NAN, |r| r.shifts[0].z) }))
}

/// The cell at the optical axis.
fn middle(measured: &Measurement) -> Option<(i32, i32)> {
    let on_net = measured.pose.net_from_ray(net_geometry::nalgebra::Vector3::z())?;
    let cells = Matrix2::from_columns(&measured.lattice).try_inverse()? * on_net;
    (cells.amax() < 1e6).then(|| (cells.x.round() as i32, cells.y.round() as i32))
}

/// The camera as `run.json` has it.
fn camera_of_run(value: &Value) -> Option<Camera> {
    let number = |name: &str| value.get(name)?.as_f64();
    let side = |name: &str| value.get(name)?.as_u64().and_then(|n| u32::try_from(n).ok());
    let k: Vec<f64> =
        value.get("distortion_coefficients")?.as_array()?.iter().map(Value::as_f64).collect::<Option<_>>()?;
    let lens = match value.get("distortion_model")?.as_str()? {
        "none" => Lens::None,
        "plumb_bob" => Lens::PlumbBob(k.try_into().ok()?),
        "rational_polynomial" => Lens::Rational(k.try_into().ok()?),
        "equidistant" => Lens::KannalaBrandt(k.try_into().ok()?),
        _ => return None,
    };
    let (fx, fy, cx, cy) = (number("fx")?, number("fy")?, number("cx")?, number("cy")?);
    Camera::new(fx, fy, cx, cy, side("width")?, side("height")?, lens).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::describe;

    #[test]
    fn a_camera_reads_back_as_it_was_written() {
        let lenses =
            [Lens::None, Lens::PlumbBob([-0.2, 0.05, 0.001, -0.002, 0.0]), Lens::KannalaBrandt([0.1, 0.0, 0.01, 0.0])];
        for lens in lenses {
            let camera = Camera::new(600.5, 601.0, 424.0, 240.25, 848, 480, lens).expect("a camera");
            assert_eq!(camera_of_run(&describe::camera_json(&camera, "a file")), Some(camera));
        }
        assert_eq!(camera_of_run(&serde_json::json!({ "fx": 1.0 })), None);
    }
}
