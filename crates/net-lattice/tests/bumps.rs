//! Nets that bend otherwise all over a wide view: no polynomial follows them.

use net_geometry::Pose;
use net_geometry::nalgebra::Vector3;
use net_image::Image;
use net_lattice::{Config, LatticeEstimate, LatticeEstimator, Model};
use net_sim::{Scenario, Simulator, Study, Truth};

/// A picture of a hung net of the studies, from a camera moved by so much along the net, m.
fn seen(seed: u64, moved_m: f64) -> (Scenario, Image<u8>, Truth) {
    let mut scenario = Study::Hung.scenario(seed);
    scenario.scene.layers[0].pose.x_m += moved_m;
    let frame = scenario.frame(0).expect("one frame");
    let mut image = Image::default();
    let mut simulator = Simulator::new(scenario.camera().expect("sound"));
    let truth = simulator.render(&frame.scene, frame.seed, &mut image).expect("sound").clone();
    (scenario, image, truth)
}

fn estimator(scenario: &Scenario) -> LatticeEstimator {
    let (camera, mesh) = (scenario.camera().expect("sound"), scenario.mesh().expect("sound"));
    LatticeEstimator::new(&camera, &mesh, &Config::default()).expect("sound")
}

/// Claimed, within the tolerances of a claim, and within four of its own standard deviations.
fn assert_right(found: &LatticeEstimate, truth: &Truth) {
    assert_eq!(found.model, Model::Bumpy);
    assert!(found.probability >= Config::default().probability_threshold, "{}", found.probability);
    let axis = truth.layers[0].axis.as_ref().expect("on the axis");
    let (off, sigma) = (found.pose.normal().angle(&axis.normal), found.tilt_sigma);
    // Of 60 such scenes the median is 0.5 degrees, one in ten is off by more than 1.3.
    assert!(
        off.to_degrees() < 2.0 && off < 4.0 * sigma,
        "normal off by {} of {}",
        off.to_degrees(),
        sigma.to_degrees()
    );
    assert!((found.range / axis.range_m - 1.0).abs() < 5e-3, "{} of {} m", found.range, axis.range_m);
}

#[test]
fn a_wide_view_of_a_bumpy_net_is_answered() {
    // With polynomials alone the first was 14, the second 11 degrees off, and both were refused.
    for seed in [300_097, 300_304, 300_094] {
        let (scenario, image, truth) = seen(seed, 0.0);
        let found = estimator(&scenario).estimate(image.view().expect("not empty")).expect("its size");
        assert_right(&found.expect("a net"), &truth);
    }
}

#[test]
fn a_bumpy_net_is_followed() {
    let (scenario, image, _) = seen(300_097, 0.0);
    let mut estimator = estimator(&scenario);
    let found = estimator.estimate(image.view().expect("not empty")).expect("its size").expect("a net");
    let mut predicted = found.pose;
    for step in 1..=6 {
        // A camera that moves by a fifth of a cell along the net has the net move the other way.
        let moved = 0.01 * f64::from(step);
        let (_, image, truth) = seen(300_097, moved);
        predicted = Pose {
            translation: predicted.translation + predicted.rotation * Vector3::new(-0.01, 0.0, 0.0),
            ..predicted
        };
        let next = estimator.update(image.view().expect("not empty"), &predicted).expect("its size").expect("a net");
        assert_right(&next, &truth);
        predicted = next.pose;
    }
}

#[test]
fn a_polynomial_that_a_relief_contradicts_does_not_answer() {
    // Bent by a quartic the net was claimed (0.86) with a normal 5.8 degrees off: tiles scattered about it by what turns a normal by a degree.
    let (scenario, image, truth) = seen(340_142, 0.0);
    let found = estimator(&scenario).estimate(image.view().expect("not empty")).expect("its size").expect("a net");
    let axis = truth.layers[0].axis.as_ref().expect("on the axis");
    assert_eq!(found.model, Model::Bumpy);
    // Half of what may be claimed; the relief is 0.6 degrees off.
    assert!(found.pose.normal().angle(&axis.normal).to_degrees() < 2.5);
}
