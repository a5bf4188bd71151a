//! One core, 848 x 480 px: a cold start, and a frame that is followed.

use criterion::{Criterion, criterion_group, criterion_main};
use net_geometry::nalgebra::Vector3;
use net_geometry::{Camera, Lens, Mesh};
use net_image::Image;
use net_lattice::{Config, LatticeEstimator};
use net_sim::{Layer, NetPose, Scene, Simulator};

fn bench(c: &mut Criterion) {
    let camera = Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None).expect("fixed and sound");
    let mesh = Mesh::square(0.05).expect("fixed and sound");
    for range in [0.5, 1.2, 3.0] {
        let pose = NetPose {
            range_m: range,
            tilt_x_deg: 15.0,
            tilt_y_deg: 20.0,
            roll_deg: 8.0,
            x_m: 0.01,
            ..NetPose::default()
        };
        let scene = Scene { layers: vec![Layer::planar(&mesh, pose)], ..Scene::default() };
        let mut image = Image::default();
        Simulator::new(camera).render(&scene, 1, &mut image).expect("a sound scene");
        let view = image.view().expect("drawn above");
        let mut estimator = LatticeEstimator::new(&camera, &mesh, &Config::default()).expect("defaults are valid");
        c.bench_function(&format!("cold start, {range} m"), |b| b.iter(|| estimator.estimate(view)));
        let found = estimator.estimate(view).expect("sizes agree").expect("a clear net");
        let mut predicted = found.pose;
        predicted.translation += Vector3::new(0.004, -0.003, 0.002);
        c.bench_function(&format!("followed frame, {range} m"), |b| b.iter(|| estimator.update(view, &predicted)));
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = bench
}
criterion_main!(benches);
