//! Steps of a whole cell: told apart where the net allows, said to be ambiguous where not, never wrong in silence.

mod support;

use nalgebra::{Matrix3, Vector2};
use net_flow::{Config, FlowTracker, Hints, Lattice, Motion, Prior, Status};
use net_geometry::Basis;
use support::{Scene, view};

const CELL: f64 = 30.0;
/// Error of a step that went to the right cell, px: far below a cell, far above the matcher's own.
const RIGHT_CELL_PX: f64 = 1.0;

fn lattice() -> Lattice {
    Lattice::Uniform(Basis { b1: Vector2::new(CELL, 0.0), b2: Vector2::new(0.0, CELL) })
}

/// Two frames, the second moved by `shift`: status of the step and its error, px.
fn step(scene: &Scene, shift: Vector2<f64>, config: &Config, hints: &Hints<'_>) -> (Status, f64) {
    let mut tracker = FlowTracker::new(scene.width, scene.height, config).expect("valid");
    tracker.update(view(&scene.draw(0, &Motion::identity())), &Hints::default()).expect("a picture of its size");
    let result =
        tracker.update(view(&scene.draw(1, &Motion::translation(shift))), hints).expect("a picture of its size");
    let middle = Vector2::new(240.0, 160.0);
    let error = result.step.motion.map_or(f64::NAN, |m| (m.apply(middle) - middle - shift).norm());
    (result.step.status, error)
}

fn shifts() -> impl Iterator<Item = Vector2<f64>> {
    [(0.0, 0.0), (4.0, 3.0), (14.0, -15.5), (30.0, 0.0), (-27.0, 11.0), (21.0, 29.0)]
        .into_iter()
        .map(|(u, v)| Vector2::new(u, v))
}

#[test]
fn an_irregular_net_tells_its_cells_apart() {
    let scene = Scene { flicker: true, ..Scene::new(CELL, 0.06, 15) };
    let mut tracked = 0;
    for shift in shifts() {
        for lattice in [None, Some(lattice())] {
            let (status, error) = step(&scene, shift, &Config::default(), &Hints { lattice, ..Hints::default() });
            if status == Status::Tracked {
                assert!(error < RIGHT_CELL_PX, "{shift} {error}");
                tracked += 1;
            }
        }
    }
    assert!(tracked >= 10, "{tracked} of 12");
}

#[test]
fn a_regular_net_is_ambiguous_and_says_so() {
    let scene = Scene::new(CELL, 0.0, 0);
    for shift in shifts() {
        for lattice in [None, Some(lattice())] {
            let (status, _) = step(&scene, shift, &Config::default(), &Hints { lattice, ..Hints::default() });
            assert_ne!(status, Status::Tracked, "{shift}");
        }
    }
}

#[test]
fn a_prior_decides_where_the_picture_cannot() {
    let scene = Scene::new(CELL, 0.0, 0);
    for shift in shifts() {
        let prior = Prior { motion: Motion::translation(shift + Vector2::new(2.0, -1.5)), sigma_px: 2.0 };
        for lattice in [None, Some(lattice())] {
            let hints = Hints { prior: Some(prior), lattice, ..Hints::default() };
            let (status, error) = step(&scene, shift, &Config::default(), &hints);
            assert!(status == Status::Tracked && error < RIGHT_CELL_PX, "{shift} {status:?} {error}");
        }
    }
}

#[test]
fn a_vague_prior_decides_nothing() {
    let scene = Scene::new(CELL, 0.0, 0);
    let prior = Prior { motion: Motion::identity(), sigma_px: 12.0 };
    for lattice in [None, Some(lattice())] {
        let hints = Hints { prior: Some(prior), lattice, ..Hints::default() };
        let (status, _) = step(&scene, Vector2::new(30.0, 0.0), &Config::default(), &hints);
        assert_ne!(status, Status::Tracked);
    }
}

#[test]
fn a_bound_on_the_step_decides_as_well() {
    let scene = Scene::new(CELL, 0.0, 0);
    let config = Config { max_step_px: Some(12.0), ..Config::default() };
    let (status, error) = step(&scene, Vector2::new(6.0, -4.0), &config, &Hints::default());
    assert!(status == Status::Tracked && error < RIGHT_CELL_PX, "{status:?} {error}");
}

#[test]
fn rivals_are_named_in_cells() {
    let scene = Scene::new(CELL, 0.0, 0);
    let mut tracker = FlowTracker::new(scene.width, scene.height, &Config::default()).expect("valid");
    tracker.update(view(&scene.draw(0, &Motion::identity())), &Hints::default()).expect("a picture of its size");
    let plane = Matrix3::new(CELL, 0.0, 10.0, 0.0, CELL, 10.0, 0.0, 0.0, 1.0);
    let hints = Hints { lattice: Some(Lattice::Plane(plane)), ..Hints::default() };
    let moved = view(&scene.draw(1, &Motion::translation(Vector2::new(3.0, 1.0)))).rows().flatten().copied().collect();
    let moved = net_image::Image::from_vec(moved, scene.width, scene.height).expect("its size");
    let result = tracker.update(view(&moved), &hints).expect("a picture of its size");
    let east = result.step.rivals.iter().find(|r| r.cells == Some((1, 0))).expect("the neighbour to the right");
    // The lattice is exact, the motion's error is hundredths of a pixel.
    assert!((east.shift_px - Vector2::new(CELL, 0.0)).norm() < 0.2, "{}", east.shift_px);
    assert_eq!(result.step.rivals.len(), 8);
}
