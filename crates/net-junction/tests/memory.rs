//! No memory is allocated per frame once the buffers have grown, and the same input gives the same output.

#![allow(clippy::unwrap_used)] // shared by tests

mod scene;

use net_junction::{Config, Expectation, JunctionDetector};
use scene::{HEIGHT, WIDTH, scene, view};

#[test]
fn nothing_is_allocated_after_warm_up() {
    let expected: Vec<_> = [(1.0, 0.0, 20.0), (2.0, 30.0, 0.0), (1.3, 10.0, 10.0)]
        .map(|(range, tilt_x, tilt_y)| scene(range, tilt_x, tilt_y, 5.0))
        .into_iter()
        .map(|s| (s.draw(), Expectation::Net(s.net)))
        .collect();
    let mut detector = JunctionDetector::new(WIDTH, HEIGHT, &Config::default()).unwrap();
    let all = |detector: &mut JunctionDetector| {
        let mut count = 0;
        for (picture, expectation) in &expected {
            count += detector.detect(view(picture), Some(expectation)).unwrap().len();
            count += detector.detect(view(picture), None).unwrap().len();
        }
        count
    };
    let found = all(&mut detector);
    assert!(found > 3000, "{found} junctions");
    let mut again = 0;
    let allocations = allocation_counter::measure(|| again = all(&mut detector));
    assert_eq!(again, found);
    assert_eq!(allocations.count_total, 0);
}

#[test]
fn the_same_picture_gives_the_same_junctions_whatever_came_before() {
    let s = scene(1.5, 0.0, 25.0, -8.0);
    let (picture, expectation) = (s.draw(), Expectation::Net(s.net));
    let mut fresh = JunctionDetector::new(WIDTH, HEIGHT, &Config::default()).unwrap();
    let first = fresh.detect(view(&picture), Some(&expectation)).unwrap().to_vec();
    let other = scene(0.7, 0.0, 0.0, 0.0).draw();
    fresh.detect(view(&other), None).unwrap();
    assert_eq!(fresh.detect(view(&picture), Some(&expectation)).unwrap(), first);
}
