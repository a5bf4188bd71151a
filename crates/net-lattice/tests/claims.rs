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
