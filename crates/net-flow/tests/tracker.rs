//! The tracker's manners: bad input, loss, memory, determinism.

mod support;

use nalgebra::Vector2;
use net_flow::{Config, Error, FlowTracker, Hints, Mode, Motion, Prior, Status, TrackState};
use net_image::{GrayView, Image};
use support::{Random, Scene, view};

fn tracker(scene: &Scene) -> FlowTracker {
    FlowTracker::new(scene.width, scene.height, &Config::default()).expect("valid")
}

#[test]
fn nothing_is_allocated_after_the_first_frames() {
    let scene = Scene { fish: 1, ..Scene::new(30.0, 0.06, 15) };
    let frames: Vec<_> =
        (0..14).map(|k| scene.draw(k, &Motion::translation(Vector2::new(-2.5, 1.5) * k as f64))).collect();
    for mode in [Mode::Summed, Mode::KeyFrame] {
        let mut tracker =
            FlowTracker::new(scene.width, scene.height, &Config { mode, ..Config::default() }).expect("valid");
        for frame in &frames[..6] {
            tracker.update(view(frame), &Hints::default()).expect("a picture of its size");
        }
        let counted = allocation_counter::measure(|| {
            for frame in &frames[6..] {
                tracker.update(view(frame), &Hints::default()).expect("a picture of its size");
            }
        });
        assert_eq!(counted.count_total, 0, "{mode:?}: {counted:?}");
    }
}

#[test]
fn the_same_pictures_give_the_same_tracks() {
    let scene = Scene { fish: 2, flicker: true, ..Scene::new(30.0, 0.06, 15) };
    let run = || {
        let mut tracker = tracker(&scene);
        for k in 0..6 {
            let frame = scene.draw(k, &scene.wander(k, 40, false));
            tracker.update(view(&frame), &Hints::default()).expect("a picture of its size");
        }
        tracker.tracks().to_vec()
    };
    assert_eq!(run(), run());
}

#[test]
fn another_net_is_a_loss_and_a_fresh_start() {
    let scene = Scene::new(30.0, 0.06, 15);
    let mut tracker = tracker(&scene);
    let update = |tracker: &mut FlowTracker, image: &Image<u8>| {
        tracker.update(view(image), &Hints::default()).expect("a picture of its size").status
    };
    let frame = scene.draw(0, &Motion::identity());
    assert_eq!(update(&mut tracker, &frame), Status::Started);
    assert_eq!(update(&mut tracker, &frame), Status::Tracked);
    let ids: Vec<u64> = tracker.tracks().iter().map(|t| t.id).collect();
    let mut random = Random(3);
    let noise = Image::from_vec((0..480 * 320).map(|_| (255.0 * random.uniform()) as u8).collect(), 480, 320);
    assert_eq!(update(&mut tracker, &noise.expect("its size")), Status::Lost);
    assert!(tracker.tracks().iter().all(|t| !ids.contains(&t.id) && t.state == TrackState::New));
    assert_eq!(update(&mut tracker, &frame), Status::Lost);
    assert_eq!(update(&mut tracker, &frame), Status::Tracked);
}

#[test]
fn pictures_without_content_are_lost_not_wrong() {
    for value in [0, 128, 255] {
        let flat = vec![value; 480 * 320];
        let flat = GrayView::packed(&flat, 480, 320).expect("a view");
        let mut tracker = FlowTracker::new(480, 320, &Config::default()).expect("valid");
        assert_eq!(tracker.update(flat, &Hints::default()).expect("its size").status, Status::Started);
        let result = tracker.update(flat, &Hints::default()).expect("its size");
        assert_eq!((result.status, result.step.motion), (Status::Lost, None));
    }
    let mut tiny = FlowTracker::new(1, 1, &Config::default()).expect("valid");
    for expected in [Status::Started, Status::Lost, Status::Lost] {
        let view = GrayView::packed(&[7], 1, 1).expect("a view");
        assert_eq!(tiny.update(view, &Hints::default()).expect("its size").status, expected);
    }
}

#[test]
fn bad_arguments_are_named() {
    assert!(matches!(FlowTracker::new(0, 5, &Config::default()), Err(Error::Value { field: "width", .. })));
    let config = Config { min_agreed: f64::NAN, ..Config::default() };
    assert!(matches!(FlowTracker::new(5, 5, &config), Err(Error::Value { field: "min_agreed", .. })));
    let scene = Scene::new(30.0, 0.0, 0);
    let mut tracker = tracker(&scene);
    let small = GrayView::packed(&[0; 6], 3, 2).expect("a view");
    assert!(matches!(
        tracker.update(small, &Hints::default()),
        Err(Error::ImageSize { width: 3, height: 2, expected_width: 480, .. })
    ));
    let prior = Prior { motion: Motion::identity(), sigma_px: f64::NAN };
    let frame = scene.draw(0, &Motion::identity());
    let hints = Hints { prior: Some(prior), ..Hints::default() };
    assert!(matches!(tracker.update(view(&frame), &hints), Err(Error::Value { field: "sigma_px", .. })));
    // Nothing was taken from the failed calls.
    assert_eq!(tracker.update(view(&frame), &Hints::default()).expect("its size").status, Status::Started);
}

#[test]
fn given_seeds_are_followed_and_odd_ones_dropped() {
    let scene = Scene::new(30.0, 0.06, 15);
    let mut tracker = tracker(&scene);
    let seeds = [Vector2::new(100.25, 90.5), Vector2::new(f64::NAN, 1.0), Vector2::new(-5.0, 1e12)];
    let hints = Hints { seeds: &seeds, ..Hints::default() };
    let frame = scene.draw(0, &Motion::identity());
    let result = tracker.update(view(&frame), &hints).expect("its size");
    assert_eq!(result.tracks.iter().filter(|t| seeds.contains(&t.pixel)).count(), 1);
    tracker.add_points(&seeds);
    let shift = Vector2::new(2.5, -1.25);
    let frame = scene.draw(1, &Motion::translation(shift));
    let result = tracker.update(view(&frame), &Hints::default()).expect("its size");
    assert!(result.tracks.iter().all(|t| t.pixel.x.is_finite() && t.pixel.x >= 0.0));
    let near = result.tracks.iter().filter(|t| (t.pixel - seeds[0] - shift).norm() < 0.1).count();
    assert_eq!(near, 2);
}
