//! The vote on a simulated vehicle that passes along the net at up to a cell a frame.

use nalgebra::{Vector2, Vector3};
use net_flow::vote::{CellVote, Verdict, VoteConfig, VoteResult};
use net_image::{GrayView, Pyramid};
use net_sim::{Image, Scenario, Simulator};

/// Runs the vote over `frames`, each numbered wrong by `per_frame` cells more than the one before until the vote corrects it. Panics at a wrong decision.
fn run(name: &str, frames: std::ops::Range<u32>, per_frame: (i32, i32)) -> Vec<VoteResult> {
    let scenario = Scenario::by_name(name).expect("a scenario");
    let camera = scenario.camera().expect("a camera");
    let mut simulator = Simulator::new(camera);
    let mut vote = CellVote::new(&VoteConfig::default()).expect("valid");
    let mut image = Image::default();
    let mut results = Vec::new();
    // Cells to add to the truth's numbers to get the caller's, and how fast that grows: a velocity wrong by whole cells.
    let (mut off, mut drift) = ((0, 0), per_frame);
    for (n, k) in frames.enumerate() {
        let frame = scenario.frame(k).expect("a frame");
        let truth = simulator.render(&frame.scene, frame.seed, &mut image).expect("a picture").layers[0].clone();
        let axis = truth.axis.expect("the net fills the view");
        if n > 0 {
            off = (off.0 + drift.0, off.1 + drift.1);
        }
        let [a1, a2] = axis.directions.map(|d| d * 0.05);
        let (point, cells) = (Vector3::new(0.0, 0.0, axis.range_m), axis.cells);
        let camera = *simulator.camera();
        let pixel = |at: Vector2<f64>| {
            let from_axis = at - Vector2::new(f64::from(off.0), f64::from(off.1)) - cells;
            let p = point + a1 * from_axis.x + a2 * from_axis.y;
            camera.pixel_from_point(p)
        };
        let middle = (cells.x.round() as i32 + off.0, cells.y.round() as i32 + off.1);
        let result = vote.update(image.view().expect("pixels"), middle, pixel);
        if let Some((i, j)) = result.correction() {
            off = (off.0 + i, off.1 + j);
            drift = (drift.0 + result.shifts[0].cells.0, drift.1 + result.shifts[0].cells.1);
            assert!(off == (0, 0) || result.dropped > 0, "{name} {k}: {result:?}");
        }
        results.push(result);
    }
    results
}

#[test]
fn right_numbers_are_confirmed_at_a_cell_a_frame() {
    let results = run("strafe", 92..98, (0, 0));
    let decided = results.iter().filter(|r| r.verdict == Verdict::Decided).count();
    assert!(decided >= 4, "{results:?}");
}

#[test]
fn a_velocity_wrong_by_a_cell_is_found_out() {
    for alias in [(1, 0), (-1, 0), (0, 2)] {
        let results = run("strafe", 92..96, alias);
        assert!(results.iter().any(|r| r.verdict == Verdict::Decided), "{alias:?} {results:?}");
    }
}

#[test]
fn salmon_decide_nothing_wrong() {
    // `run` refuses wrong decisions; undecided frames are fine here, blind ones are not.
    let results = run("shoal", 40..45, (-1, 0));
    assert!(results[1..].iter().all(|r| r.verdict != Verdict::Blind), "{results:?}");
}

#[test]
fn nothing_to_see_is_blind() {
    let mut vote = CellVote::new(&VoteConfig::default()).expect("valid");
    let flat = vec![100u8; 320 * 240];
    let view = GrayView::packed(&flat, 320, 240).expect("a view");
    let square = |at: Vector2<f64>| Some(at * 20.0 + Vector2::new(160.0, 120.0));
    assert_eq!(vote.update(view, (0, 0), square).verdict, Verdict::Blind);
    assert_eq!(vote.update(view, (0, 0), |_| None).verdict, Verdict::Blind);
    assert_eq!(vote.update(view, (0, 0), |_| Some(Vector2::new(f64::NAN, 0.0))).verdict, Verdict::Blind);
    assert_eq!(vote.update(view, (i32::MAX, i32::MIN), square).verdict, Verdict::Blind);
}

#[test]
fn an_empty_picture_is_blind() {
    let mut vote = CellVote::new(&VoteConfig::default()).expect("valid");
    let pixel = |at: Vector2<f64>| Some(at * 30.0 + Vector2::new(420.0, 240.0));
    assert_eq!(vote.update_flat(&Pyramid::new(4), (0, 0), pixel).verdict, Verdict::Blind);
}

#[test]
fn bad_parameters_are_named() {
    let config = VoteConfig { min_z: f64::NAN, ..VoteConfig::default() };
    assert!(matches!(CellVote::new(&config), Err(net_flow::Error::Value { field: "min_z", .. })));
}

#[test]
fn the_count_is_said_to_be_broken_when_doubt_outlasts_the_memory() {
    let config = VoteConfig { memory_frames: 2, min_z: 100.0, ..VoteConfig::default() };
    let mut vote = CellVote::new(&config).expect("valid");
    let texture: Vec<u8> = (0..320u32 * 240).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let lattice = |i: u32| u8::from(i % 320 % 20 < 2 || i / 320 % 20 < 2) * 150;
    let picture: Vec<u8> = (0..320 * 240).map(|i| texture[i as usize] / 8 + lattice(i)).collect();
    let view = GrayView::packed(&picture, 320, 240).expect("a view");
    let square = |at: Vector2<f64>| Some(at * 20.0 + Vector2::new(160.5, 120.5));
    let dropped: Vec<u32> = (0..5).map(|_| vote.update(view, (0, 0), square).dropped).collect();
    // The first frame starts, two fit the memory, and no evidence reaches 100 deviations.
    assert_eq!(dropped, [0, 0, 0, 1, 2]);
}
