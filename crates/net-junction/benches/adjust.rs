//! Time of a net adjustment, knots and twines, at 848 x 480, from true poses of flat nets.

use criterion::{Criterion, criterion_group, criterion_main};
use net_junction::{AdjustConfig, ExpectedNet, NetAdjuster};
use net_sim::{Image, NetPose, Scenario, Simulator};

fn adjust(c: &mut Criterion) {
    let mut group = c.benchmark_group("adjust 848x480");
    for range_m in [0.6, 1.5, 3.0] {
        let mut scenario = Scenario::default();
        let pose = NetPose { range_m, tilt_y_deg: 20.0, roll_deg: 5.0, x_m: 0.013, y_m: -0.007, ..NetPose::default() };
        scenario.scene.layers[0].pose = pose;
        let (camera, mesh) = (scenario.camera().expect("sound"), scenario.mesh().expect("sound"));
        let mut image = Image::default();
        Simulator::new(camera).render(&scenario.scene, 1, &mut image).expect("sound");
        let view = image.view().expect("drawn");
        let map = ExpectedNet { camera, mesh, pose: pose.pose(), anchored: true };
        let mut adjuster = NetAdjuster::new(view.width(), view.height(), &AdjustConfig::default()).expect("sound");
        let knots = adjuster.adjust(view, &map).expect("its size").len();
        group.bench_function(format!("{knots} knots, net at {range_m} m"), |b| {
            b.iter(|| adjuster.adjust(view, &map).expect("its size").len());
        });
    }
    group.finish();
}

criterion_group!(benches, adjust);
criterion_main!(benches);
