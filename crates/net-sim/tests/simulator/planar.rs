//! Flat nets: where twines are drawn, how bright, and what truth says of them.

use std::collections::{BTreeSet, HashMap};

use nalgebra::{Vector2, Vector3};
use net_geometry::{Camera, Lens, Mesh};
use net_sim::{Extent, Image, Net, NetPose, Scene, Simulator, Twine};

use crate::support::{Result, camera, centre, quiet};

/// Poses from the closest to the farthest, straight and oblique.
fn poses() -> Vec<NetPose> {
    let pose = |range_m, tilt_x_deg, tilt_y_deg, roll_deg| NetPose {
        range_m,
        tilt_x_deg,
        tilt_y_deg,
        roll_deg,
        x_m: 0.013,
        y_m: -0.007,
    };
    vec![
        pose(0.5, 0.0, 0.0, 0.0),
        pose(1.2, 20.0, -15.0, 7.0),
        pose(1.5, -10.0, 55.0, -20.0),
        pose(2.0, 30.0, 10.0, 40.0),
    ]
}

#[test]
fn twines_are_drawn_where_truth_says() -> Result {
    // A twine's centre of brightness must lie on the line between its knots. Mean over hundreds of places; anything systematic
    // would become a bias of every estimator. A hundredth of what the best estimator resolves on one junction (0.05 px).
    const MEAN_PX: f64 = 0.0005;
    // One place: sampling a point spread of 0.6 px once a pixel leaves an alias of exp(-2 pi^2 0.36) = 8e-4 in the centroid, a real
    // camera's too; the width's change along the twine adds to it.
    const WORST_PX: f64 = 0.005;
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    for (pose, mesh) in poses().into_iter().zip(["50mm", "50mm", "50mm", "150mm"]) {
        let scene = quiet(mesh, pose);
        let truth = simulator.render(&scene, 1, &mut image)?.clone();
        let nodes: HashMap<_, _> = truth.layers[0].nodes.iter().map(|n| (n.index, n.pixel)).collect();
        let mut errors = Vec::new();
        for (&(i, j), &a) in &nodes {
            // Steep twines cross a row once; half way between their knots nothing else is near.
            for next in [(i, j + 1), (i + 1, j)] {
                let Some(&b) = nodes.get(&next) else { continue };
                let along = b - a;
                // At a whole row near the middle.
                let t = (((a + b) / 2.0).y.round() - a.y) / along.y;
                let p = a + along * t;
                if along.y.abs() < 1.5 * along.x.abs() || along.y.abs() < 24.0 || !(0.4..0.6).contains(&t) {
                    continue;
                }
                let half = 7;
                // The neighbours of one family may be close in an oblique view.
                let beside = [(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)].map(|n| nodes.get(&n).copied());
                let clear = beside.iter().flatten().all(|q| {
                    let d = (q - a) - along * (q - a).dot(&along) / along.norm_squared();
                    d.norm() < 1e-6 || d.norm() > 1.6 * f64::from(half)
                });
                if !clear {
                    continue;
                }
                if let Some(u) = centre(simulator.noiseless(), 848, p, half as usize, false, 90.0) {
                    errors.push(u - p.x);
                }
            }
        }
        assert!(errors.len() > 20, "{} places at {pose:?}", errors.len());
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let worst = errors.iter().fold(0.0, |w: f64, e| w.max(e.abs()));
        println!("{:4.1} m: {} places, mean {mean:+.6} px, worst {worst:.5} px", pose.range_m, errors.len());
        assert!(mean.abs() < MEAN_PX, "mean {mean} px over {} places at {pose:?}", errors.len());
        assert!(worst < WORST_PX, "worst {worst} px at {pose:?}");
    }
    Ok(())
}

/// Naive picture: many rays a pixel, each meets a cylinder or not, then the point spread as a sum.
fn supersampled(scene: &Scene, camera: &Camera, mesh: &Mesh, fine: usize) -> Vec<f64> {
    let (width, height) = (camera.width() as usize, camera.height() as usize);
    let pose = scene.layers[0].pose.pose();
    let twine = scene.layers[0].net.twine;
    let margin = 8;
    let (w, h) = ((width + 2 * margin) * fine, (height + 2 * margin) * fine);
    let at = |k: usize| (k as f64 + 0.5) / fine as f64 - 0.5 - margin as f64;
    let mut hits = vec![0.0; w * h];
    for (y, row) in hits.chunks_exact_mut(w).enumerate() {
        for (x, hit) in row.iter_mut().enumerate() {
            let Some(ray) = camera.ray_from_pixel(Vector2::new(at(x), at(y))) else { continue };
            let Some(depth) = pose.plane().depth_along(ray) else { continue };
            let p = pose.inverse_transform(ray * depth);
            let j = p.y / mesh.a2().y;
            let i = (p.x - j * mesh.a2().x) / mesh.side1();
            // The twines around: the ray's distance from each axis against half a diameter.
            let near = |along: Vector2<f64>, through: Vector2<f64>| {
                let q = pose.transform(Vector3::new(through.x, through.y, 0.0));
                let a = pose.rotation * Vector3::new(along.x, along.y, 0.0);
                let across = ray.cross(&a);
                q.dot(&across).abs() / across.norm() < 0.5 * twine.diameter_m
            };
            let any = [-1.0, 0.0, 1.0, 2.0].iter().any(|k| {
                near(mesh.a1(), mesh.node(0.0, j.floor() + k)) || near(mesh.a2(), mesh.node(i.floor() + k, 0.0))
            });
            *hit = f64::from(u8::from(any));
        }
    }
    // Gaussian point spread sampled at pixel centres, rows first.
    let sigma = scene.sensor.psf_px * fine as f64;
    let weights = |centre: f64, n: usize| {
        let raw: Vec<(usize, f64)> = (0..n)
            .filter(|&k| (k as f64 - centre).abs() < 6.0 * sigma)
            .map(|k| (k, (-0.5 * ((k as f64 - centre) / sigma).powi(2)).exp()))
            .collect();
        let sum: f64 = raw.iter().map(|x| x.1).sum();
        raw.into_iter().map(|(k, x)| (k, x / sum)).collect::<Vec<_>>()
    };
    let centre = |pixel: usize| ((pixel + margin) * fine) as f64 + 0.5 * fine as f64 - 0.5;
    let mut rows = vec![0.0; width * h];
    for u in 0..width {
        for (k, weight) in weights(centre(u), w) {
            for y in 0..h {
                rows[y * width + u] += weight * hits[y * w + k];
            }
        }
    }
    let mut out = vec![0.0; width * height];
    for v in 0..height {
        for (k, weight) in weights(centre(v), h) {
            for u in 0..width {
                out[v * width + u] += weight * rows[k * width + u];
            }
        }
    }
    let (veil, grey) = (scene.water.veil_grey, twine.grey);
    out.iter().map(|c| veil + c * (grey - veil)).collect()
}

#[test]
fn pictures_agree_with_ray_casting() -> Result {
    // Ray casting with 11 x 11 rays a pixel has its own error: a twine of w px is one ray more or less, 1/11 px times the
    // contrast of 110 grey levels times the point spread's peak of 0.66 per px = 6, less where rays average over the slant.
    // The mean is free of it. Crossings, a hundredth of the picture, are exact only where twines cross at right angles in it.
    const RMS_GREY: f64 = 0.8;
    const MEAN_GREY: f64 = 0.02;
    let camera = Camera::new(100.0, 100.0, 47.5, 35.5, 96, 72, Lens::None)?;
    let mut simulator = Simulator::new(camera);
    let mut image = Image::default();
    for (mesh, pose, twine_m) in [
        ("50mm", NetPose { range_m: 0.4, roll_deg: 20.0, ..NetPose::default() }, 0.004),
        ("50mm", NetPose { range_m: 0.5, tilt_y_deg: 50.0, roll_deg: 10.0, ..NetPose::default() }, 0.003),
        ("60x40mm", NetPose { range_m: 0.6, tilt_x_deg: 40.0, roll_deg: -25.0, ..NetPose::default() }, 0.003),
        ("50x50mm@65deg", NetPose { range_m: 0.5, tilt_x_deg: 20.0, tilt_y_deg: -20.0, ..NetPose::default() }, 0.004),
    ] {
        let mut scene = quiet(mesh, pose);
        scene.layers[0].net.twine.diameter_m = twine_m;
        simulator.render(&scene, 1, &mut image)?;
        let expected = supersampled(&scene, &camera, &mesh.parse()?, 11);
        let n = expected.len() as f64;
        let difference = || simulator.noiseless().iter().zip(&expected).map(|(&a, &b)| f64::from(a) - b);
        let rms = (difference().map(|d| d * d).sum::<f64>() / n).sqrt();
        let mean = difference().sum::<f64>() / n;
        println!("{mesh} {pose:?}: rms {rms:.3}, mean {mean:+.4} grey levels");
        assert!(rms < RMS_GREY && mean.abs() < MEAN_GREY, "{mesh}: rms {rms}, mean {mean} grey levels");
    }
    Ok(())
}

#[test]
fn truth_projects_to_itself() -> Result {
    // Closed form, so only rounding is left.
    const TINY: f64 = 1e-9;
    let camera = camera();
    let mut simulator = Simulator::new(camera);
    let mut image = Image::default();
    for (mesh, pose) in ["50mm", "60x40mm", "25x25mm@70deg", "50mm"].into_iter().zip(poses()) {
        let scene = quiet(mesh, pose);
        let layer = &simulator.render(&scene, 1, &mut image)?.layers[0];
        let axis = layer.axis.ok_or("the axis meets the net")?;
        assert!((axis.range_m - pose.range_m).abs() < TINY, "{axis:?}");
        assert!((axis.plane().range().unwrap_or(0.0) - pose.range_m).abs() < TINY, "{axis:?}");
        let foot = layer.mesh.node(axis.cells.x, axis.cells.y);
        assert!((foot - Vector2::new(pose.x_m, pose.y_m)).norm() < TINY, "{foot} {pose:?}");
        assert!(!layer.nodes.is_empty());
        for node in &layer.nodes {
            let flat = layer.mesh.node(f64::from(node.index.0), f64::from(node.index.1));
            let point = layer.pose.transform(Vector3::new(flat.x, flat.y, 0.0));
            let pixel = camera.pixel_from_point(point).ok_or("in front")?;
            assert!((pixel - node.pixel).norm() < TINY && (point.z - node.depth_m).abs() < TINY, "{node:?}");
        }
    }
    Ok(())
}

#[test]
fn a_net_that_fills_the_view_has_all_its_knots() -> Result {
    // Every knot of a lattice much larger than the view that projects into the picture must be listed, and no other.
    let camera = camera();
    let mut simulator = Simulator::new(camera);
    let mut image = Image::default();
    for pose in poses() {
        let scene = quiet("50x40mm@75deg", pose);
        let layer = &simulator.render(&scene, 1, &mut image)?.layers[0];
        // Near the end of sight (four times the range at least) a knot may be in or out.
        let listed: BTreeSet<_> =
            layer.nodes.iter().filter(|n| n.point.norm() < 3.9 * pose.range_m).map(|n| n.index).collect();
        let mut expected = BTreeSet::new();
        for j in -450..450 {
            for i in -450..450 {
                let flat = layer.mesh.node(f64::from(i), f64::from(j));
                let point = layer.pose.transform(Vector3::new(flat.x, flat.y, 0.0));
                let Some(p) = camera.pixel_from_point(point).filter(|_| point.norm() < 3.9 * pose.range_m) else {
                    continue;
                };
                if p.x >= -0.5 && p.y >= -0.5 && p.x < 847.5 && p.y < 479.5 {
                    expected.insert((i, j));
                }
            }
        }
        let odd: Vec<_> = listed.symmetric_difference(&expected).take(5).collect();
        assert!(odd.is_empty() && !listed.is_empty(), "{odd:?} and others at {pose:?}");
        let all: BTreeSet<_> = layer.nodes.iter().map(|n| n.index).collect();
        assert_eq!(all.len(), layer.nodes.len(), "a knot is listed twice");
    }
    Ok(())
}

#[test]
fn finite_nets_end_where_they_should() -> Result {
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let mut scene = quiet("50mm", NetPose::at(1.5));
    scene.layers[0].net.extent = Extent::centred(10, 6);
    let layer = &simulator.render(&scene, 1, &mut image)?.layers[0];
    assert_eq!(layer.nodes.len(), 60);
    // 1.5 m away the knots of column 5 are 100 px right of the centre; beyond them and half the twine there is only water.
    let view = image.view().ok_or("it has pixels")?;
    for v in 0..480 {
        for u in (0..848).filter(|u| !(424 - 84..=424 + 104).contains(u)) {
            assert_eq!(view.get(u, v), Some(90), "({u}, {v})");
        }
    }
    Ok(())
}

#[test]
fn light_and_dark_nets_are_mirror_images() -> Result {
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let mut light = quiet("50mm", poses()[1]);
    light.water.veil_grey = 100.0;
    light.layers[0].net = Net { twine: Twine { grey: 160.0, ..Twine::default() }, ..Net::default() };
    let mut dark = light.clone();
    dark.layers[0].net.twine.grey = 40.0;
    simulator.render(&light, 1, &mut image)?;
    let first = simulator.noiseless().to_vec();
    simulator.render(&dark, 1, &mut image)?;
    // Single precision.
    let same = first.iter().zip(simulator.noiseless()).all(|(a, b)| (a + b - 200.0).abs() < 1e-3);
    assert!(same);
    Ok(())
}
