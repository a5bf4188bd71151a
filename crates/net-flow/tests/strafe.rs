//! A vehicle that passes along the net at up to a cell a frame, its speed unknown: right, or called ambiguous, never wrong in silence.

use nalgebra::Vector2;
use net_flow::{Config, FlowTracker, Hints, Status};
use net_sim::{Image, NodeTruth, Scenario, Simulator};

/// A step is right when it carries the knots to within this share of a cell in the median.
const RIGHT_SHARE: f64 = 0.25;

/// Statuses of the steps between `frames` of a scenario; panics at a slip in silence.
fn run(name: &str, frames: std::ops::Range<u32>) -> Vec<Status> {
    let scenario = Scenario::by_name(name).expect("a scenario");
    let camera = scenario.camera().expect("a camera");
    let (width, height) = (camera.width() as usize, camera.height() as usize);
    let mut tracker = FlowTracker::new(width, height, &Config::default()).expect("valid");
    let mut simulator = Simulator::new(camera);
    let mut image = Image::default();
    let mut before: Vec<NodeTruth> = Vec::new();
    let mut statuses = Vec::new();
    for k in frames {
        let frame = scenario.frame(k).expect("a frame");
        let truth = simulator.render(&frame.scene, frame.seed, &mut image).expect("a picture");
        let nodes = truth.layers[0].nodes.clone();
        let result = tracker.update(image.view().expect("pixels"), &Hints::default()).expect("its size");
        if let (Status::Tracked, Some(motion)) = (result.step.status, result.step.motion) {
            let pixel = |nodes: &[NodeTruth], index| nodes.iter().find(|n| n.index == index).map(|n| n.pixel);
            let mut errors: Vec<f64> = Vec::new();
            let mut cell = Vector2::new(f64::INFINITY, 0.0);
            for a in &before {
                errors.extend(pixel(&nodes, a.index).map(|b| (motion.apply(a.pixel) - b).norm()));
                let right = pixel(&before, (a.index.0 + 1, a.index.1));
                cell = right.map(|r| r - a.pixel).filter(|c| c.norm() < cell.norm()).unwrap_or(cell);
            }
            errors.sort_by(f64::total_cmp);
            assert!(errors[errors.len() / 2] < RIGHT_SHARE * cell.norm(), "{name} {k}: {}", errors[errors.len() / 2]);
        }
        statuses.push(result.step.status);
        before = nodes;
    }
    statuses
}

#[test]
fn a_cell_a_frame_from_an_unknown_speed() {
    let statuses = run("strafe", 92..98);
    assert!(!statuses[1..].contains(&Status::Lost), "{statuses:?}");
}

#[test]
fn slow_passes_are_mostly_certain() {
    let statuses = run("strafe-slow", 60..66);
    let tracked = statuses.iter().filter(|&&s| s == Status::Tracked).count();
    assert!(tracked >= 3, "{statuses:?}");
}

#[test]
fn salmon_in_front_carry_nothing_off() {
    let statuses = run("shoal", 40..46);
    assert!(!statuses[1..].contains(&Status::Lost), "{statuses:?}");
}
