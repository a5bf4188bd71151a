//! What is claimed of pictures without a net, and how large errors are beside what is said of them.

use net_geometry::nalgebra::{UnitQuaternion, Vector6};
use net_image::Image;
use net_lattice::{Config, LatticeEstimate, LatticeEstimator};
use net_sim::{Simulator, Study, Truth};

/// The estimate of one random scene, and the truth.
fn look(study: Study, seed: u64) -> (Option<LatticeEstimate>, Truth) {
    let scenario = study.scenario(seed);
    let (camera, mesh) = (scenario.camera().expect("sound"), scenario.mesh().expect("sound"));
    let frame = scenario.frame(0).expect("one frame");
    let mut image = Image::default();
    let mut simulator = Simulator::new(camera);
    let truth = simulator.render(&frame.scene, frame.seed, &mut image).expect("sound").clone();
    let mut estimator = LatticeEstimator::new(&camera, &mesh, &Config::default()).expect("sound");
    let found = estimator.estimate(image.view().expect("not empty")).expect("its size");
    (found, truth)
}

fn is_claimed(e: &LatticeEstimate) -> bool {
    e.probability >= Config::default().probability_threshold
}

/// Error squared per degree of freedom of the pose against its covariance.
fn normalised(e: &LatticeEstimate, truth: &Truth) -> f64 {
    let lattice = truth.layers[0].lattice_at_axis().expect("the axis meets the net").following(&e.pose);
    let truth = lattice.anchored_at(e.pose.translation).expect("a node").0.pose;
    let turn = UnitQuaternion::from_rotation_matrix(&(e.pose.rotation * truth.rotation.inverse())).scaled_axis();
    let shift = e.pose.translation - truth.translation;
    let d = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
    let inverse = e.covariance.try_inverse().expect("positive definite");
    (d.transpose() * inverse * d)[0] / 6.0
}

#[test]
fn patterns_much_like_a_net_are_not_claimed() {
    // Among some thousand pictures without a net those that came nearest to being claimed, or were by earlier rules: lines and cells at random, scales, bricks.
    for seed in [8015, 10062, 16062, 53418, 53838, 55524, 91148] {
        let (found, _) = look(Study::Negative, seed);
        let p = found.map_or(0.0, |e| e.probability);
        assert!(p < Config::default().probability_threshold, "{seed}: {p}");
    }
}

#[test]
fn errors_are_as_large_as_the_covariance_says() {
    let mean = |study: Study, seeds: std::ops::Range<u64>| {
        let errors: Vec<f64> = seeds
            .map(|seed| look(study, seed))
            .filter_map(|(found, truth)| found.filter(is_claimed).map(|e| normalised(&e, &truth)))
            .collect();
        (errors.len(), errors.iter().sum::<f64>() / errors.len() as f64)
    };
    // Wanted are 0.7 to 1.5, which sixty scenes of each kind keep; of sixteen the mean may be off by 0.4 either way.
    let (claimed, noise) = mean(Study::Noise, 66_000..66_016);
    assert!(claimed >= 15 && (0.3..1.9).contains(&noise), "{noise} of {claimed} flat nets");
    // Bent nets that scatter about the polynomial have outliers: 1.5 to 2.2 of sixty. A sandwich of what the fit leaves alone would say 3 to 8.
    let (claimed, hung) = mean(Study::Hung, 64_000..64_016);
    assert!(claimed >= 7 && (0.4..2.8).contains(&hung), "{hung} of {claimed} bent nets");
}

#[test]
fn curvatures_are_known_as_well_as_is_said() {
    let (mut squares, mut sigmas) = (Vec::new(), Vec::new());
    for seed in 64_000..64_016 {
        let (found, truth) = look(Study::Hung, seed);
        let Some(e) = found.filter(is_claimed) else { continue };
        // Of two that are nearly as large either may come first.
        let ascending = |of: [f64; 2]| if of[0] <= of[1] { [0, 1] } else { [1, 0] };
        let true_ones = truth.layers[0].axis.expect("the axis meets the net").curvatures_per_m;
        let said = e.curvature_sigmas.expect("estimated where a net is bent");
        for (k, t) in ascending(e.curvatures).into_iter().zip(ascending(true_ones)) {
            squares.push(((e.curvatures[k] - true_ones[t]) / said[k]).powi(2));
            sigmas.push(said[k]);
        }
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    sigmas.sort_by(f64::total_cmp);
    let median = sigmas[sigmas.len() / 2];
    // 1.4 squared of forty such scenes, a few outliers among them; of sixteen it may be off by as much again. The prior alone says 0.29 and 0.6 per metre.
    assert!(squares.len() >= 14 && (0.3..4.0).contains(&mean), "{mean} of {} curvatures", squares.len());
    assert!(median < 0.1, "{median} per metre");
}

#[test]
fn what_was_held_has_no_sigma() {
    let mut flat = 0;
    for seed in 66_000..66_008 {
        let (found, _) = look(Study::Noise, seed);
        let Some(e) = found.filter(is_claimed) else { continue };
        let held = [e.model < net_lattice::Model::Rhomb, e.model < net_lattice::Model::Quadratic];
        assert_eq!([e.crossing_angle_sigma.is_none(), e.curvature_sigmas.is_none()], held, "{:?}", e.model);
        if held[0] {
            flat += 1;
            assert_eq!(e.crossing_angle, std::f64::consts::FRAC_PI_2);
        }
    }
    assert!(flat >= 4, "{flat} of eight flat nets are square");
}
