//! The caller's word on the camera's motion: steps of most of a cell, a prior that is wrong, a net that is out of view for a while.

#![allow(clippy::unwrap_used)]

use net_geometry::nalgebra::{Matrix6, Vector3, Vector6};
use net_sim::{Image, Layer, Net, NetPose, Scene, Sensor, Simulator};
use netpose::{Camera, Config, Connection, Estimate, Lens, Mesh, MotionPrior, Pose, Status, Tracker};

const CELL_M: f64 = 0.05;
const FRAME_NS: i64 = 100_000_000;
/// Error of the place along the net, m, beyond which the count is off: whole cells are 50 mm.
const HALF_A_CELL_M: f64 = 0.5 * CELL_M;

/// The net's pose after a way along it, m.
fn pose(x_m: f64) -> Pose {
    NetPose { range_m: 1.0, tilt_y_deg: 10.0, tilt_x_deg: 4.0, x_m, ..NetPose::default() }.pose()
}

/// Pictures of a net with the slight disorder of all nets.
struct World {
    simulator: Simulator,
    image: Image<u8>,
    tracker: Tracker,
    frame: i64,
    /// Displacement of the knots, cells, and the sensor's noise, grey levels.
    jitter: f64,
    noise_grey: f64,
}

impl World {
    fn new() -> Self {
        let camera = Camera::new(320.0, 320.0, 211.5, 119.5, 424, 240, Lens::None).unwrap();
        let tracker = Tracker::new(camera, Mesh::square(CELL_M).unwrap(), &Config::default()).unwrap();
        Self {
            simulator: Simulator::new(camera),
            image: Image::default(),
            tracker,
            frame: 0,
            jitter: 0.04,
            noise_grey: 2.0,
        }
    }

    /// A frame at `x_m` along the net, or of open water; the prior's motion and standard deviations.
    fn frame(&mut self, x_m: Option<f64>, prior: Option<MotionPrior>) -> Estimate<'_> {
        let net = Net { jitter: self.jitter, seed: 5, ..Net::default() };
        let layers = x_m.map(|x| Layer { net, pose: NetPose::from_pose(&pose(x)).unwrap() });
        let scene = Scene {
            layers: layers.into_iter().collect(),
            sensor: Sensor { read_noise_grey: self.noise_grey, ..Sensor::default() },
            ..Scene::default()
        };
        self.simulator.render(&scene, 77 + self.frame.unsigned_abs(), &mut self.image).unwrap();
        self.frame += 1;
        let (view, time) = (self.image.view().unwrap(), self.frame * FRAME_NS);
        match prior {
            Some(prior) => self.tracker.update_with_prior(view, time, &prior).unwrap(),
            None => self.tracker.update(view, time).unwrap(),
        }
    }
}

/// The motion from one place to another, 2 mrad and `sigma_m` sure.
fn prior(from_m: f64, to_m: f64, sigma_m: f64) -> MotionPrior {
    let (before, now) = (pose(from_m), pose(to_m));
    let rotation = now.rotation * before.rotation.inverse();
    let translation = now.translation - rotation * before.translation;
    let sigmas = Vector6::new(2e-3, 2e-3, 2e-3, sigma_m, sigma_m, sigma_m);
    MotionPrior {
        now_from_before: Pose { rotation, translation },
        covariance: Matrix6::from_diagonal(&sigmas.map(|s| s * s)),
    }
}

/// Place of the camera along the net's X, and the count.
fn place(estimate: &Estimate<'_>) -> (f64, u32) {
    assert_eq!(estimate.status, Status::Ok);
    (estimate.net.unwrap().pose.camera_in_net().x, estimate.track)
}

/// Frames that are off by more than half a cell against the first of the same count, and counts begun.
fn silent_and_flagged(found: &[(f64, u32)], truth: &[f64]) -> (usize, usize) {
    let mut silent = 0;
    for (k, (x, track)) in found.iter().enumerate() {
        let first = found.iter().position(|f| f.1 == *track).unwrap();
        let error = (x - found[first].0) - (truth[k] - truth[first]);
        silent += usize::from(error.abs() > HALF_A_CELL_M);
    }
    let flagged = found.windows(2).filter(|f| f[0].1 != f[1].1).count();
    (silent, flagged)
}

/// Steps of 0.8 cells either way, in no order that a velocity could foretell.
fn steps() -> Vec<f64> {
    let mut truth = vec![0.0];
    for forward in [1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0, 1.0, 1.0] {
        truth.push(truth[truth.len() - 1] + forward * 0.8 * CELL_M);
    }
    truth
}

#[test]
fn steps_of_most_of_a_cell_are_counted_with_a_prior_and_never_wrong_in_silence_without() {
    let truth = steps();
    for with_prior in [true, false] {
        let mut world = World::new();
        let found: Vec<_> = (0..truth.len())
            .map(|k| {
                let prior = (with_prior && k > 0).then(|| prior(truth[k - 1], truth[k], 0.002));
                place(&world.frame(Some(truth[k]), prior))
            })
            .collect();
        let (silent, flagged) = silent_and_flagged(&found, &truth);
        assert_eq!(silent, 0, "with prior: {with_prior}: {found:?}");
        if with_prior {
            assert_eq!(flagged, 0, "{found:?}");
        }
    }
}

#[test]
fn a_prior_that_is_wrong_by_a_cell_makes_no_wrong_claim() {
    let truth = steps();
    // Sure of itself, and vague: 2 mm, 30 mm.
    for sigma_m in [0.002, 0.03] {
        let mut world = World::new();
        let found: Vec<_> = (0..truth.len())
            .map(|k| {
                let wrong = (k > 0).then(|| prior(truth[k - 1], truth[k] + CELL_M, sigma_m));
                place(&world.frame(Some(truth[k]), wrong))
            })
            .collect();
        assert_eq!(silent_and_flagged(&found, &truth).0, 0, "{sigma_m}: {found:?}");
    }
}

#[test]
fn the_count_goes_on_when_the_net_was_out_of_view() {
    // Three frames of open water while the camera goes on by 2.4 cells: by the priors' sum, and without them because the cells are recognised.
    for with_prior in [true, false] {
        let mut world = World::new();
        let (mut x, mut found, mut truth) = (0.0, Vec::new(), Vec::new());
        let mut connections = Vec::new();
        for k in 0..14 {
            let step = if k == 0 { 0.0 } else { 0.8 * CELL_M };
            let told = with_prior.then(|| prior(x, x + step, 0.001));
            x += step;
            let seen = !(5..8).contains(&k);
            let estimate = world.frame(seen.then_some(x), told);
            if seen {
                found.push(place(&estimate));
                truth.push(x);
                connections.push(estimate.connection);
            } else {
                assert_eq!(estimate.status, Status::NoNet);
            }
        }
        let (silent, flagged) = silent_and_flagged(&found, &truth);
        assert_eq!(silent, 0, "{found:?}");
        if with_prior {
            assert_eq!(flagged, 0, "{found:?} {connections:?}");
        }
        let last = (found[found.len() - 1].1, found[4].1);
        assert_eq!(last.0, last.1, "the old count in the end: {found:?} {connections:?}");
        assert_eq!(connections[0], Connection::Started);
    }
}

#[test]
fn after_a_long_gap_the_count_is_not_carried_on_by_where_the_net_was() {
    // One frame, seven of open water while the camera goes on by 0.8 cells each, and the net again, 6.4 cells on: farther than the vote looks.
    let mut world = World::new();
    let truth: Vec<f64> = [0].into_iter().chain(8..16).map(|k| f64::from(k) * 0.8 * CELL_M).collect();
    let mut found = vec![place(&world.frame(Some(truth[0]), None))];
    for _ in 1..8 {
        assert_eq!(world.frame(None, None).status, Status::NoNet);
    }
    for (k, x) in truth.iter().enumerate().skip(1) {
        let estimate = world.frame(Some(*x), None);
        let said = matches!(estimate.connection, Connection::Restarted | Connection::Recognised);
        assert!(k > 1 || said, "{:?}", estimate.connection);
        found.push(place(&estimate));
    }
    assert_eq!(silent_and_flagged(&found, &truth).0, 0, "{found:?}");
}

#[test]
fn what_is_no_motion_is_refused_and_leaves_the_tracker_as_it_was() {
    let mut world = World::new();
    let before = place(&world.frame(Some(0.0), None));
    let broken = MotionPrior {
        now_from_before: Pose { translation: Vector3::new(f64::NAN, 0.0, 0.0), ..pose(0.0) },
        covariance: Matrix6::zeros(),
    };
    let (view, time) = (world.image.view().unwrap(), (world.frame + 1) * FRAME_NS);
    assert!(matches!(world.tracker.update_with_prior(view, time, &broken), Err(netpose::Error::Prior { .. })));
    assert_eq!(place(&world.tracker.update(view, time).unwrap()).1, before.1);
}

#[test]
fn a_run_begun_at_a_cell_a_frame_is_one_count_and_says_where_it_doubted() {
    // Nothing tells the first step: the lattice names it by less than half a cell, and is wrong.
    let truth: Vec<f64> = (0..10).map(|k| f64::from(k) * 0.9 * CELL_M).collect();
    // So little disorder and so much noise that one look does not tell either.
    let mut world = World { jitter: 0.02, noise_grey: 12.0, ..World::new() };
    let (mut found, mut doubted, mut doubts) = (Vec::new(), Vec::new(), 0);
    for x in &truth {
        let estimate = world.frame(Some(*x), None);
        let seen = (place(&estimate), estimate.connection, estimate.net.unwrap());
        let (corrected, n) = (estimate.corrected, estimate.in_doubt);
        if seen.1 == Connection::Settled {
            // What the settlement says of the frames before it makes them right.
            for (at, k) in doubted.drain(..) {
                let cells = (corrected.0 * k as i32 / n as i32, corrected.1 * k as i32 / n as i32);
                let (_, net): &((f64, u32), netpose::NetPose) = &found[at];
                let net = net.renumbered(cells, &Mesh::square(CELL_M).unwrap());
                found[at] = ((net.pose.camera_in_net().x, seen.0.1), net);
            }
        }
        if seen.1 == Connection::Doubted {
            doubted.push((found.len(), n));
            doubts += 1;
        }
        found.push((seen.0, seen.2));
    }
    let places: Vec<_> = found.iter().map(|f| f.0).collect();
    assert_eq!(silent_and_flagged(&places, &truth), (0, 0), "{places:?}");
    assert!(doubts > 0, "{places:?}");
}
