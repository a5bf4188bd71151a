//! Predictions out of this world, for a bent net that was found: no net or an answer, never a panic.

use net_geometry::Pose;
use net_geometry::nalgebra::{Rotation3, Vector3};
use net_image::Image;
use net_lattice::{Config, LatticeEstimator, Model};
use net_sim::{Simulator, Study};

#[test]
fn predictions_out_of_this_world_are_no_net() {
    let scenario = Study::Hung.scenario(73_055);
    let (camera, mesh) = (scenario.camera().expect("sound"), scenario.mesh().expect("sound"));
    let frame = scenario.frame(0).expect("one frame");
    let mut image = Image::default();
    Simulator::new(camera).render(&frame.scene, frame.seed, &mut image).expect("sound");
    let view = image.view().expect("not empty");
    let mut estimator = LatticeEstimator::new(&camera, &mesh, &Config::default()).expect("sound");
    let found = estimator.estimate(view).expect("its size").expect("a net");
    assert!(found.model > Model::Rhomb, "a sheet that bends: {:?}", found.model);
    let ask = Config::default().probability_threshold;
    let far = [1e3, 1e9, 1e60, 1e100, 1e200, f64::MAX, f64::INFINITY, f64::NAN];
    for value in far.into_iter().flat_map(|v| [v, -v]) {
        for axis in 0..3 {
            let mut shift = Vector3::zeros();
            shift[axis] = value;
            for rotation in [found.pose.rotation, Rotation3::new(Vector3::new(value, 0.3, 0.0))] {
                estimator.follow_on(&found);
                let predicted = Pose { rotation, translation: found.pose.translation + shift };
                let answer = estimator.update(view, &predicted).expect("its size");
                // A thousand metres along the net are whole cells, and the lattice is there; whatever is claimed must be a pose.
                let sound = |e: &net_lattice::LatticeEstimate| e.range.is_finite() && (0.1..20.0).contains(&e.range);
                assert!(answer.is_none_or(|e| e.probability < ask || sound(&e)), "{shift:?} {rotation:?}");
            }
        }
    }
}
