//! Time to draw: `cargo bench -p net-sim`.

use criterion::{Criterion, criterion_group, criterion_main};
use net_sim::{Image, Scenario, Simulator};

fn render(c: &mut Criterion) {
    let mut group = c.benchmark_group("net-sim 848x480");
    group.sample_size(10);
    for name in ["plain", "far-6m", "ordinary", "hung", "oblique", "barrel", "fish", "strafe"] {
        let scenario = Scenario::by_name(name).expect("it is in the catalogue");
        let frame = scenario.frame(scenario.frames / 2).expect("it is valid");
        let mut simulator = Simulator::new(scenario.camera().expect("it is valid"));
        let mut image = Image::default();
        group.bench_function(name, |b| b.iter(|| simulator.render(&frame.scene, frame.seed, &mut image).map(|_| ())));
    }
    group.finish();
}

criterion_group!(benches, render);
criterion_main!(benches);
