//! Time of lenses, planar PnP, neighbours and names.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{Criterion, criterion_group, criterion_main};
use net_geometry::nalgebra::{Rotation3, Vector2, Vector3};
use net_geometry::{Camera, Dbscan, Lattice, Lens, Mesh, NearestPoints, Pose, planar_pnp};

fn operations(c: &mut Criterion) {
    let lenses = [
        ("no lens", Lens::None),
        ("plumb_bob", Lens::PlumbBob([-0.28, 0.09, 0.0011, -0.0007, -0.012])),
        ("rational", Lens::Rational([0.41, -0.22, -0.0006, 0.0009, 0.013, 0.72, -0.11, 0.021])),
        ("fisheye", Lens::KannalaBrandt([0.031, -0.012, 0.0042, -0.0009])),
    ];
    let pose =
        Pose { rotation: Rotation3::from_euler_angles(0.3, -0.5, 0.2), translation: Vector3::new(0.0, 0.0, 1.5) };
    let mesh = Mesh::square(0.05).unwrap();
    let pixels: Vec<_> = (0..1000).map(|k| Vector2::new(f64::from(k * 37 % 848), f64::from(k * 53 % 480))).collect();
    for (name, lens) in lenses {
        let camera = Camera::new(700.0, 700.0, 424.0, 240.0, 848, 480, lens).unwrap();
        c.bench_function(&format!("{name}: 1000 rays from pixels"), |b| {
            b.iter(|| pixels.iter().filter_map(|&p| camera.ray_from_pixel(p)).map(|r| r.x).sum::<f64>())
        });
        let points: Vec<_> = pixels.iter().filter_map(|&p| camera.ray_from_pixel(p)).collect();
        c.bench_function(&format!("{name}: 1000 pixels from points"), |b| {
            b.iter(|| points.iter().filter_map(|&p| camera.pixel_from_point(p)).map(|r| r.x).sum::<f64>())
        });
        let (lattice, mut nodes) = (Lattice { pose, mesh }, Vec::new());
        lattice.nodes_in_view(&camera, 4.0, &mut nodes);
        c.bench_function(&format!("{name}: {} nodes in view", nodes.len()), |b| {
            b.iter(|| lattice.nodes_in_view(&camera, 4.0, &mut nodes))
        });
    }
    let corners = [(0.0, 0.0), (0.0, 0.05), (0.05, 0.05), (0.05, 0.0)].map(|(x, y)| Vector2::new(x, y));
    let rays = corners.map(|p| pose.transform(p.push(0.0))).map(|p| p / p.z);
    c.bench_function("planar PnP, 4 points", |b| b.iter(|| planar_pnp(&corners, &rays)));

    // Corners of cells of 20 px: four near each knot.
    let corners: Vec<_> = (0..4000)
        .map(|k| (k / 4, Vector2::new(f64::from(k * 7 % 5), f64::from(k * 3 % 7)) * 0.5))
        .map(|(k, jitter)| Vector2::new(f64::from(k % 42), f64::from(k / 42)) * 20.0 + jitter)
        .collect();
    let (mut dbscan, mut labels, mut near) = (Dbscan::default(), Vec::new(), NearestPoints::default());
    c.bench_function("DBSCAN, 4000 points", |b| b.iter(|| dbscan.cluster(&corners, |_| 4.0, 3, &mut labels)));
    c.bench_function("nearest points, fill with 4000", |b| b.iter(|| near.fill(&corners)));
    c.bench_function("nearest points, 1000 queries", |b| {
        b.iter(|| pixels.iter().filter_map(|&p| near.nearest(p, 10.0)).map(|n| n.1).sum::<f64>())
    });
}

criterion_group!(benches, operations);
criterion_main!(benches);
