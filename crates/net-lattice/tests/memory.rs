//! No memory is allocated per picture once the buffers have grown, neither for a cold start nor for a picture that is followed; the same
//! pictures give the same answers, whatever came before.

#![allow(clippy::unwrap_used)] // a test may stop

use net_lattice::{Config, LatticeEstimate, LatticeEstimator};
use net_sim::{Image, Scenario, Simulator, Study};

/// Two frames of a camera that passes a net, a bent net, one so wide that only a relief follows it, and open water, all of one size and mesh.
fn pictures(scenario: &Scenario) -> Vec<Image<u8>> {
    let mut simulator = Simulator::new(scenario.camera().unwrap());
    let mut draw = |scene: &net_sim::Scene, seed: u64| {
        let mut image = Image::default();
        simulator.render(scene, seed, &mut image).unwrap();
        image
    };
    let mut pictures = Vec::new();
    for k in 0..2 {
        let frame = scenario.frame(k).unwrap();
        pictures.push(draw(&frame.scene, frame.seed));
    }
    let bent = (1..).map(Study::hung).find(|s| s.mesh == scenario.mesh).unwrap();
    pictures.push(draw(&bent.scene, 1));
    let wide = Study::hung(300_304);
    assert_eq!(wide.mesh, scenario.mesh);
    pictures.push(draw(&wide.scene, 1));
    pictures.push(draw(&net_sim::Scene::empty(), 1));
    pictures
}

#[test]
fn nothing_is_allocated_after_warm_up() {
    let scenario = Scenario::by_name("strafe-slow").unwrap();
    let pictures = pictures(&scenario);
    let mut estimator =
        LatticeEstimator::new(&scenario.camera().unwrap(), &scenario.mesh().unwrap(), &Config::default()).unwrap();
    let mut all = || {
        let mut probabilities = [0.0; 6];
        let probability = |found: Option<&LatticeEstimate>| found.map_or(-1.0, |found| found.probability);
        for (image, p) in pictures.iter().zip(&mut probabilities) {
            *p = probability(estimator.estimate(image.view().unwrap()).unwrap().as_ref());
        }
        let first = estimator.estimate(pictures[0].view().unwrap()).unwrap().unwrap();
        let next = estimator.update(pictures[1].view().unwrap(), &first.pose).unwrap();
        probabilities[5] = probability(next.as_ref());
        probabilities
    };
    let first = all();
    assert!(first[0] > 0.5 && first[5] > 0.5, "the net is found and followed: {first:?}");
    let mut again = [0.0; 6];
    let allocations = allocation_counter::measure(|| again = all());
    assert_eq!(again, first);
    assert_eq!(allocations.count_total, 0);
}
