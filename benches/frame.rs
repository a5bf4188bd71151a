//! The whole frame, from grey pixels to pose and junctions, one core: `cargo bench -p netpose --bench frame`.
//!
//! `cold` is the first frame of a new tracker, its buffers' first touch included; `tracked` the next frame of a net that is followed.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use net_sim::{CameraModel, Image, Scenario, Simulator};
use netpose::{Camera, Config, Mesh, Method, Status, Tracker};

/// Time between two frames, ns.
const STEP_NS: i64 = 100_000_000;
/// Frames of the sequence, which is run to and fro.
const FRAMES: u32 = 12;

/// A camera that sees the same at any size of its picture.
fn model(width: u32, height: u32) -> CameraModel {
    let (w, h) = (f64::from(width), f64::from(height));
    let focal = 600.0 * w / 848.0;
    CameraModel {
        image_width: width,
        image_height: height,
        fx: focal,
        fy: focal,
        cx: 0.5 * w,
        cy: 0.5 * h,
        ..CameraModel::default()
    }
}

/// The start of an inspection: an ordinary net from 1.65 m on, turned by 20 degrees.
fn pictures(model: CameraModel) -> (Camera, Mesh, Vec<Image<u8>>) {
    let mut scenario = Scenario::by_name("inspect").expect("a scenario of this name");
    scenario.camera = model;
    let (camera, mesh) = (scenario.camera().expect("sound"), scenario.mesh().expect("sound"));
    let mut simulator = Simulator::new(camera);
    let draw = |k| {
        let frame = scenario.frame(k).expect("a sound scenario");
        let mut image = Image::default();
        simulator.render(&frame.scene, frame.seed, &mut image).expect("a sound scene");
        image
    };
    (camera, mesh, (0..FRAMES).map(draw).collect())
}

fn bench(c: &mut Criterion) {
    for (width, height) in [(848, 480), (1280, 720)] {
        let (camera, mesh, pictures) = pictures(model(width, height));
        let views: Vec<_> = pictures.iter().map(|image| image.view().expect("drawn above")).collect();
        for method in [Method::Thesis, Method::Lattice] {
            let config = Config { method, ..Config::default() };
            let new = || Tracker::new(camera, mesh, &config).expect("defaults are valid");
            let name = format!("{width}x{height} {method:?}").to_lowercase();
            let (mut frame, mut found) = (0_usize, 0_usize);
            c.bench_function(&format!("{name} cold"), |b| {
                b.iter_batched(
                    new,
                    |mut tracker| {
                        found += usize::from(tracker.update(views[0], 0).is_ok_and(|e| e.status == Status::Ok));
                        frame += 1;
                        tracker
                    },
                    BatchSize::PerIteration,
                );
            });
            // A bench of refusals would flatter.
            println!("{name} cold: a pose in {found} of {frame} frames");
            let mut tracker = new();
            (frame, found) = (0, 0);
            c.bench_function(&format!("{name} tracked"), |b| {
                b.iter(|| {
                    // 0, 1, ... 10, 11, 10, ... 1, 0, 1, ...
                    let turn = 2 * (views.len() - 1);
                    let at = frame % turn;
                    let time = frame as i64 * STEP_NS;
                    frame += 1;
                    let estimate = tracker.update(views[at.min(turn - at)], time).expect("in order and of its size");
                    found += usize::from(estimate.status == Status::Ok);
                });
            });
            println!("{name} tracked: a pose in {found} of {frame} frames");
        }
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = bench
}
criterion_main!(benches);
