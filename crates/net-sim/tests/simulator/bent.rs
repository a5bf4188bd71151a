//! Nets that are sheared, bent, jittered or seen through a lens: where their twines are drawn, and that they do not stretch.

use crate::support::{Result, camera, centre, edges, pose, quiet};
use nalgebra::{Vector2, Vector3};
use net_geometry::{Camera, Lens};
use net_sim::{Image, Net, NetPose, Scene, Simulator, Surface, Truth, Wave};

/// A sheet with everything a [`Surface`] has.
fn sheet() -> Surface {
    let wave =
        |amplitude_m, length_m, direction_deg, phase_deg| Wave { amplitude_m, length_m, direction_deg, phase_deg };
    Surface {
        curvature_per_m: [0.6, 0.2, -0.4],
        cubic_per_m2: [0.2, -0.1, 0.15, 0.1],
        quartic_per_m3: [0.1, 0.0, -0.1, 0.0, 0.1],
        reach_m: 1.5,
        waves: vec![wave(0.02, 1.2, 20.0, 30.0), wave(0.01, 0.8, 110.0, -70.0)],
        thread_bend_per_m: [0.2, -0.15],
        isometric: true,
    }
}

fn hung(net: Net, pose: NetPose) -> Scene {
    let mut scene = quiet("50mm", pose);
    scene.layers[0].net = net;
    scene
}

#[test]
fn sides_keep_their_length() -> Result {
    // The knots are solved for, so what is left is rounding: far inside the 1e-4 that an estimator could notice.
    const SHARE: f64 = 1e-9;
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let rectangle = Net { side1_m: 0.06, side2_m: 0.04, shear_deg: 14.0, surface: sheet(), ..Net::default() };
    let square = Net { shear_deg: -12.0, surface: sheet(), ..Net::default() };
    for net in [square, rectangle] {
        for pose in [pose(0.6, 5.0, 10.0, 20.0), pose(1.5, -25.0, 30.0, -35.0)] {
            let sides = [net.side1_m, net.side2_m];
            let truth = simulator.render(&hung(net.clone(), pose), 1, &mut image)?;
            let all = edges(truth);
            assert!(all.len() > 100, "{}", all.len());
            for (a, b, family) in all {
                let share = (b.point - a.point).norm() / sides[family] - 1.0;
                assert!(share.abs() < SHARE, "{:?} to {:?}: {share}", a.index, b.index);
            }
        }
    }
    Ok(())
}

#[test]
fn lifted_nets_stretch_and_say_so() -> Result {
    // The quick deviation from a plane: knots straight above the flat lattice's.
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let surface = Surface { curvature_per_m: [0.8, 0.0, 0.8], isometric: false, ..Surface::default() };
    let truth = simulator.render(&hung(Net { surface, ..Net::default() }, NetPose::at(1.2)), 1, &mut image)?;
    let longest = edges(truth).iter().map(|(a, b, _)| (b.point - a.point).norm()).fold(0.0, f64::max);
    assert!(longest > 0.05 * 1.01, "{longest}");
    Ok(())
}

#[test]
fn what_the_axis_meets_is_what_was_asked_for() -> Result {
    // At the net's origin the sheet's polynomial has no height and no slope, so the pose's own numbers are the truth there; shear
    // is defined there, and the curvatures are the polynomial's.
    const TINY: f64 = 1e-9;
    // Through the cubics that the lattice is interpolated with: fourth order in a cell of a sheet that bends by 0.03 a cell.
    const CELL_RAD: f64 = 1e-5;
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let surface = Surface { curvature_per_m: [0.7, 0.0, -0.3], ..Surface::default() };
    let net = Net { shear_deg: -9.0, surface, ..Net::default() };
    let at_origin = NetPose { x_m: 0.0, y_m: 0.0, ..pose(1.1, 12.0, -20.0, 30.0) };
    let axis = simulator.render(&hung(net.clone(), at_origin), 1, &mut image)?.layers[0].axis.ok_or("no axis")?;
    assert!((axis.range_m - 1.1).abs() < TINY, "{axis:?}");
    assert!((axis.normal - at_origin.pose().normal()).norm() < TINY, "{axis:?}");
    assert!(axis.cells.norm() < TINY, "{axis:?}");
    assert!((axis.crossing_angle.to_degrees() - 81.0).abs() < CELL_RAD.to_degrees(), "{axis:?}");
    assert!((axis.curvatures_per_m[0] - 0.7).abs() < 1e-6 && (axis.curvatures_per_m[1] + 0.3).abs() < 1e-6, "{axis:?}");
    Ok(())
}

/// Plane through points, by least squares on heights over `like`.
fn fitted(points: &[Vector3<f64>], centre: Vector3<f64>, normal: Vector3<f64>) -> (f64, Vector3<f64>) {
    // Quartic in the plane's own coordinates, so that bend does not tilt the fit.
    let e1 = normal.cross(&Vector3::x()).normalize();
    let e2 = normal.cross(&e1);
    let rows: Vec<_> = points.iter().map(|p| p - centre).map(|d| (d.dot(&e1), d.dot(&e2), d.dot(&normal))).collect();
    let a = nalgebra::DMatrix::from_fn(rows.len(), 15, |r, c| {
        let (x, y, _) = rows[r];
        // 1, x, y, x², xy, y², ... to fourth order.
        let order = [0, 1, 1, 2, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 4][c];
        let ys = c as i32 - order * (order + 1) / 2;
        x.powi(order - ys) * y.powi(ys)
    });
    let b = nalgebra::DVector::from_iterator(rows.len(), rows.iter().map(|r| r.2));
    let s = a.svd(true, true).solve(&b, 1e-14).unwrap();
    (s[0], (normal - e1 * s[1] - e2 * s[2]).normalize())
}

#[test]
fn the_tangent_plane_is_that_of_the_knots_around() -> Result {
    // Off the origin the tangent plane has to be found; a quartic through the knots within 0.15 m must touch it, but for what
    // waves of 0.8 m leave over there: (2 pi 0.15 / 0.8)^5 / 5! of their centimetre, and less in the middle.
    const OFF_M: f64 = 2e-5;
    const TURN_RAD: f64 = 1e-3;
    const CELLS: f64 = 0.02;
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let net = Net { shear_deg: -10.0, surface: sheet(), ..Net::default() };
    let away = NetPose { x_m: 0.41, y_m: -0.23, ..pose(1.0, 8.0, -14.0, 25.0) };
    let layer = &simulator.render(&hung(net, away), 1, &mut image)?.layers[0];
    let axis = layer.axis.ok_or("no axis")?;
    let foot = Vector3::z() * axis.range_m;
    let near: Vec<_> = layer.nodes.iter().filter(|n| (n.point - foot).norm() < 0.15).collect();
    assert!(near.len() > 15, "{}", near.len());
    let points: Vec<_> = near.iter().map(|n| n.point).collect();
    let (off, normal) = fitted(&points, foot, axis.normal);
    assert!(off.abs() < OFF_M, "{off}");
    assert!(normal.angle(&axis.normal) < TURN_RAD, "{normal} {}", axis.normal);
    assert!((axis.distance_m - axis.range_m * axis.normal.z).abs() < 1e-12);
    // Lattice coordinates: the knots beside it, by their distances along the directions there.
    for node in near.iter().filter(|n| (n.point - foot).norm() < 0.05) {
        let cells = Vector2::new(f64::from(node.index.0), f64::from(node.index.1)) - axis.cells;
        let expected = axis.directions[0] * (cells.x * 0.05) + axis.directions[1] * (cells.y * 0.05);
        assert!((node.point - foot - expected).norm() < CELLS * 0.05, "{node:?}");
    }
    Ok(())
}

#[test]
fn the_lattice_at_the_axis_has_the_knots_around_it() -> Result {
    // Of a flat net all of them; of a bent one those near the axis, less what it bends over two cells (0.3 / 2 * 0.1² m = 1.5 mm
    // in depth, 0.06 % of a pixel's worth sideways).
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let flat = Net { shear_deg: 7.0, ..Net::default() };
    let bent = Net {
        shear_deg: 7.0,
        surface: Surface { curvature_per_m: [0.3, 0.0, 0.2], ..Surface::default() },
        ..Net::default()
    };
    for (net, reach_m, tolerance_px) in [(flat, 10.0, 1e-9), (bent, 0.1, 1.5)] {
        let away = NetPose { x_m: 0.33, y_m: -0.21, ..pose(1.0, 10.0, -12.0, 30.0) };
        let layer = simulator.render(&hung(net, away), 1, &mut image)?.layers[0].clone();
        let lattice = layer.lattice_at_axis().ok_or("no axis")?;
        let foot = Vector3::z() * layer.axis.ok_or("no axis")?.range_m;
        let near = layer.nodes.iter().filter(|n| (n.point - foot).norm() < reach_m);
        assert!(near.clone().count() > 3);
        for node in near {
            let pixel = lattice.pixel_of_node(&camera(), node.index).ok_or("behind")?;
            assert!((pixel - node.pixel).norm() < tolerance_px, "{node:?} {pixel}");
        }
    }
    Ok(())
}

/// Mean and worst distance, px, between twines as drawn and the line (or what the lens makes of it) between their knots, half way
/// along, and the number of places.
fn offsets(simulator: &Simulator, truth: &Truth) -> (f64, f64, usize) {
    let camera = *simulator.camera();
    let (half, width) = (6, camera.width() as usize);
    let mut errors = Vec::new();
    let all = edges(truth);
    for &(a, b, _) in &all {
        let along = b.pixel - a.pixel;
        let down = along.x.abs() > along.y.abs();
        if along.amax() < 22.0 {
            continue;
        }
        // The point of the twine whose pixel lies on a whole row (or column) near its middle, by bisection on the way along it.
        let at = |t: f64| camera.pixel_from_point(a.point + (b.point - a.point) * t).unwrap();
        let axis = |p: Vector2<f64>| if down { p.x } else { p.y };
        let target = axis(at(0.5)).round();
        let rising = axis(b.pixel) > axis(a.pixel);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let t = 0.5 * (low + high);
            if (axis(at(t)) < target) == rising { low = t } else { high = t }
        }
        let p = at(low);
        // Nothing else near.
        let clear = truth.layers[0].nodes.iter().all(|n| (n.pixel - p).norm() > 10.0)
            && all.iter().all(|(c, d, _)| {
                let same = (c.index == a.index && d.index == b.index) || c.index == b.index || d.index == a.index;
                same || {
                    let side = d.pixel - c.pixel;
                    let t = ((p - c.pixel).dot(&side) / side.norm_squared()).clamp(0.0, 1.0);
                    (c.pixel + side * t - p).norm() > 10.0
                }
            });
        if !clear {
            continue;
        }
        if let Some(found) = centre(simulator.noiseless(), width, p, half, down, 90.0) {
            errors.push(found - if down { p.y } else { p.x });
        }
    }
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    (mean, errors.iter().fold(0.0, |w: f64, e| w.max(e.abs())), errors.len())
}

#[test]
fn bent_and_jittered_twines_run_from_knot_to_knot() -> Result {
    // As for flat nets, but that twine now bends at the knots and its width changes.
    const MEAN_PX: f64 = 0.001;
    const WORST_PX: f64 = 0.01;
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let bent = Net { shear_deg: -10.0, surface: sheet(), ..Net::default() };
    let uneven = Net { jitter: 0.05, ..Net::default() };
    for net in [bent, uneven] {
        let truth = simulator.render(&hung(net, pose(0.7, 8.0, 10.0, 20.0)), 1, &mut image)?.clone();
        let (mean, worst, count) = offsets(&simulator, &truth);
        println!("{count} places: mean {mean:+.5}, worst {worst:.4} px");
        assert!(count > 60 && mean.abs() < MEAN_PX && worst < WORST_PX, "{count}: {mean} {worst}");
    }
    Ok(())
}

#[test]
fn lenses_bend_twines_as_they_bend_points() -> Result {
    // A parabola through three exact points follows what these lenses make of 20 px of twine.
    const MEAN_PX: f64 = 0.002;
    const WORST_PX: f64 = 0.02;
    let lenses = [
        Lens::PlumbBob([-0.3, 0.1, 0.001, -0.0007, -0.015]),
        Lens::Rational([0.2, -0.05, 0.0005, 0.0003, 0.01, 0.45, -0.02, 0.005]),
        Lens::KannalaBrandt([-0.03, 0.01, -0.004, 0.0005]),
    ];
    for lens in lenses {
        let camera = Camera::new(480.0, 470.0, 420.0, 236.0, 848, 480, lens)?;
        let mut simulator = Simulator::new(camera);
        let mut image = Image::default();
        let truth = simulator.render(&quiet("50mm", pose(0.5, 8.0, 10.0, 20.0)), 1, &mut image)?.clone();
        let (mean, worst, count) = offsets(&simulator, &truth);
        println!("{lens:?}: {count} places: mean {mean:+.5}, worst {worst:.4} px");
        assert!(count > 60 && mean.abs() < MEAN_PX && worst < WORST_PX, "{lens:?} {count}: {mean} {worst}");
    }
    Ok(())
}

#[test]
fn jitter_has_the_size_asked_for_and_stays_from_frame_to_frame() -> Result {
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let uneven = |pose| hung(Net { jitter: 0.04, seed: 5, ..Net::default() }, pose);
    let here = simulator.render(&uneven(NetPose::at(2.0)), 1, &mut image)?.layers[0].clone();
    let deviations: Vec<f64> = here
        .nodes
        .iter()
        .flat_map(|n| {
            let p = here.pose.inverse_transform(n.point);
            [p.x / 0.05 - f64::from(n.index.0), p.y / 0.05 - f64::from(n.index.1)]
        })
        .collect();
    let deviation = (deviations.iter().map(|d| d * d).sum::<f64>() / deviations.len() as f64).sqrt();
    // Over a thousand numbers: a deviation is known to 1 / sqrt(2 n) = 2 %; three times that.
    assert!(deviations.len() > 1000 && (deviation / 0.04 - 1.0).abs() < 0.06, "{deviation}");
    let there = simulator.render(&uneven(pose(1.7, 10.0, 0.0, 3.0)), 2, &mut image)?.layers[0].clone();
    let before: std::collections::BTreeMap<_, _> =
        here.nodes.iter().map(|n| (n.index, here.pose.inverse_transform(n.point))).collect();
    let mut met = 0;
    for node in &there.nodes {
        if let Some(p) = before.get(&node.index) {
            met += 1;
            // The way through two poses and back.
            assert!((there.pose.inverse_transform(node.point) - p).norm() < 1e-12, "{node:?}");
        }
    }
    assert!(met > 500, "{met}");
    Ok(())
}
