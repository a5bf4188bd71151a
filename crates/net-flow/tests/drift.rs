//! Drift over a hundred frames, round a loop, with fish, flicker and noise.

mod support;

use nalgebra::Vector2;
use net_flow::{Config, FlowTracker, Hints, Mode, Motion, Status, loop_error};
use support::{Scene, median, view};

const FRAMES: usize = 100;
/// What the method asks of a track summed over 99 steps, px.
const SUMMED_MEDIAN_PX: f64 = 0.5;
/// What the method asks of the direct match started from the sum, px.
const DIRECT_MEDIAN_PX: f64 = 0.1;

/// Follows the steady knots over the sequence; errors of their last positions, px, and the worst status.
fn follow(scene: &Scene, motions: &[Motion], mode: Mode) -> (Vec<f64>, Status) {
    let config = Config { mode, ..Config::default() };
    let mut tracker = FlowTracker::new(scene.width, scene.height, &config).expect("valid");
    let knots = scene.steady_knots(motions);
    assert!(knots.len() >= 20, "{} knots", knots.len());
    let mut worst = Status::Tracked;
    let mut first = 0;
    for (k, motion) in motions.iter().enumerate() {
        let result = tracker.update(view(&scene.draw(k, motion)), &Hints::default()).expect("a picture of its size");
        if k > 0 && result.status != Status::Tracked {
            worst = result.status;
        }
        if k == 0 {
            let start: Vec<_> = knots.iter().map(|&p| motion.apply(p)).collect();
            first = tracker.add_points(&start).expect("some");
        }
    }
    let last = motions.last().expect("frames");
    let of = |id: u64| tracker.tracks().iter().find(|t| t.id == id).expect("steady knots stay in view").pixel;
    let errors = knots.iter().zip(first..).map(|(&p, id)| (of(id) - last.apply(p)).norm()).collect();
    (errors, worst)
}

fn wander(scene: &Scene, closed: bool) -> Vec<Motion> {
    (0..FRAMES).map(|k| scene.wander(k, FRAMES, closed)).collect()
}

fn hard_scene() -> Scene {
    Scene { fish: 1, flicker: true, noise: 4.0, ..Scene::new(30.0, 0.06, 25) }
}

#[test]
fn summed_track_stays_within_half_a_pixel() {
    let scene = hard_scene();
    let (errors, worst) = follow(&scene, &wander(&scene, false), Mode::Summed);
    assert_eq!(worst, Status::Tracked);
    assert!(median(errors) <= SUMMED_MEDIAN_PX);
}

#[test]
fn direct_match_from_the_key_frame_does_not_drift() {
    let scene = hard_scene();
    let (errors, worst) = follow(&scene, &wander(&scene, false), Mode::KeyFrame);
    assert_eq!(worst, Status::Tracked);
    // No point may be off by more than the method asks of summed tracks in the median.
    assert!(errors.iter().all(|&e| e <= SUMMED_MEDIAN_PX), "{errors:?}");
    assert!(median(errors) <= DIRECT_MEDIAN_PX);
}

#[test]
fn a_loop_closes() {
    let scene = hard_scene();
    let motions = wander(&scene, true);
    let knots = scene.steady_knots(&motions);
    let mut tracker = FlowTracker::new(scene.width, scene.height, &Config::default()).expect("valid");
    let mut first_id = 0;
    for (k, motion) in motions.iter().enumerate() {
        tracker.update(view(&scene.draw(k, motion)), &Hints::default()).expect("a picture of its size");
        if k == 0 {
            first_id = tracker.add_points(&knots.iter().map(|&p| motion.apply(p)).collect::<Vec<_>>()).expect("some");
        }
    }
    let (first, last) = (motions[0], motions[FRAMES - 1]);
    let back = last.then(&first.inverse().expect("invertible")).expect("a motion");
    // The loop ends where it began; the two motions differ by rounding only.
    assert!((back.apply(Vector2::new(100.0, 100.0)) - Vector2::new(100.0, 100.0)).norm() < 1e-6);
    let start: Vec<_> = knots.iter().map(|&p| first.apply(p)).collect();
    let of = |id| tracker.tracks().iter().find(|t| t.id == id).map(|t| t.pixel);
    let end: Vec<_> = (0..start.len() as u64).map(|k| of(first_id + k)).collect();
    let error = loop_error(&start, &end);
    assert_eq!(error.lost, 0);
    assert!(error.median_px <= DIRECT_MEDIAN_PX && error.max_px <= SUMMED_MEDIAN_PX, "{error:?}");
}

#[test]
fn three_fish_carry_nothing_off() {
    let scene = Scene { fish: 3, ..hard_scene() };
    let (errors, worst) = follow(&scene, &wander(&scene, false)[..40], Mode::KeyFrame);
    assert_eq!(worst, Status::Tracked);
    assert!(errors.iter().all(|&e| e <= SUMMED_MEDIAN_PX), "{errors:?}");
}

#[test]
fn heavy_noise_is_borne() {
    let scene = Scene { noise: 15.0, ..hard_scene() };
    let (errors, _) = follow(&scene, &wander(&scene, false)[..40], Mode::KeyFrame);
    // Noise four times the usual: four times the error asked of direct matches.
    assert!(median(errors) <= 4.0 * DIRECT_MEDIAN_PX);
}
