//! Time of a whole detection at 848 x 480.

#![allow(clippy::unwrap_used)] // a bench may stop

#[path = "../tests/scene/mod.rs"]
mod scene;

use criterion::{Criterion, criterion_group, criterion_main};
use net_junction::{Config, Expectation, JunctionDetector};
use scene::{HEIGHT, WIDTH, scene, view};

fn detect(c: &mut Criterion) {
    let mut group = c.benchmark_group("detect 848x480");
    for range in [0.6, 1.5, 3.0] {
        let s = scene(range, 0.0, 20.0, 5.0);
        let (picture, expectation) = (s.draw(), Expectation::Net(s.net));
        for (name, config) in [("default", Config::default()), ("thesis", Config::thesis())] {
            let mut detector = JunctionDetector::new(WIDTH, HEIGHT, &config).unwrap();
            group.bench_function(format!("{name}, net at {range} m"), |b| {
                b.iter(|| detector.detect(view(&picture), Some(&expectation)).unwrap().len());
            });
        }
    }
    let s = scene(1.5, 0.0, 20.0, 5.0);
    let picture = s.draw();
    let mut detector = JunctionDetector::new(WIDTH, HEIGHT, &Config::default()).unwrap();
    group.bench_function("nothing expected, net at 1.5 m", |b| {
        b.iter(|| detector.detect(view(&picture), None).unwrap().len());
    });
    group.finish();
}

criterion_group!(benches, detect);
criterion_main!(benches);
