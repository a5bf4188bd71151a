//! A tracker that follows a net allocates nothing after its first frames, by either method.

#![allow(clippy::unwrap_used)]

use net_sim::{Image, Scenario, Simulator};
use netpose::{Config, Method, Status, Tracker};

/// Frames after which all buffers have grown to their size.
const WARM_UP: usize = 8;
const FRAMES: usize = 16;

/// Allocations of each frame behind the warm-up, where the net was found.
fn allocations_per_frame(method: Method) -> Vec<u64> {
    let mut scenario = Scenario::by_name("strafe-slow").unwrap();
    scenario.camera.image_width = 424;
    scenario.camera.cx = 212.0;
    let mut tracker =
        Tracker::new(scenario.camera().unwrap(), scenario.mesh().unwrap(), &Config { method, ..Config::default() })
            .unwrap();
    let mut simulator = Simulator::new(scenario.camera().unwrap());
    let mut image = Image::default();
    let mut counts = Vec::new();
    for k in 0..FRAMES {
        let frame = scenario.frame(k as u32).unwrap();
        simulator.render(&frame.scene, frame.seed, &mut image).unwrap();
        let mut status = Status::NoNet;
        let allocations = allocation_counter::measure(|| {
            status = tracker.update(image.view().unwrap(), frame.timestamp_ns).unwrap().status;
        });
        assert_eq!(status, Status::Ok, "{method:?} frame {k}");
        counts.push(allocations.count_total);
    }
    counts.split_off(WARM_UP)
}

#[test]
fn the_thesis_method_allocates_nothing() {
    assert_eq!(allocations_per_frame(Method::Thesis), [0; FRAMES - WARM_UP]);
}

#[test]
fn the_lattice_method_allocates_nothing() {
    assert_eq!(allocations_per_frame(Method::Lattice), [0; FRAMES - WARM_UP]);
}
