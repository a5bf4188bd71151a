//! Wear, objects, water, light and the sensor: what they do to the picture, and what truth says of it.

use crate::support::{Result, camera, centre, edges, pose, quiet, small_camera};
use nalgebra::Vector2;
use net_sim::{
    Growth, Hole, Image, Kind, Layer, Motion, NetPose, Object, Scene, Sensor, Simulator, Twine, Visibility, Water,
};

/// Value of the pixel nearest to `p`.
fn at(picture: &[f32], width: usize, p: Vector2<f64>) -> f64 {
    f64::from(picture[p.y.round() as usize * width + p.x.round() as usize])
}

#[test]
fn twine_is_missing_where_truth_says_and_nowhere_else() -> Result {
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let mut scene = quiet("50mm", pose(0.9, 6.0, -8.0, 10.0));
    let hole = Hole { i: -3.2, j: 1.1, radius_i: 1.7, radius_j: 1.2 };
    scene.layers[0].net.holes = vec![hole];
    scene.layers[0].net.broken = 0.05;
    scene.layers[0].net.jitter = 0.02;
    let truth = simulator.render(&scene, 1, &mut image)?.clone();
    let missing: std::collections::BTreeSet<_> = truth.layers[0].missing_edges.iter().map(|e| e.nodes).collect();
    let picture = simulator.noiseless();
    let (mut gone, mut kept) = (0, 0);
    for (a, b, family) in edges(&truth) {
        let middle = (a.pixel + b.pixel) * 0.5;
        let half = |k| if family == k { 0.5 } else { 0.0 };
        let (i, j) = (f64::from(a.index.0) + half(0), f64::from(a.index.1) + half(1));
        let inside = ((i - hole.i) / hole.radius_i).powi(2) + ((j - hole.j) / hole.radius_j).powi(2) < 1.0;
        if missing.contains(&[a.index, b.index]) {
            gone += 1;
            // Stubs end before the middle of a piece.
            assert!((at(picture, 848, middle) - 90.0).abs() < 1.0, "{:?} {:?}", a.index, b.index);
        } else {
            kept += 1;
            assert!(!inside, "{:?} {:?} is inside the hole", a.index, b.index);
            assert!(at(picture, 848, middle) > 120.0, "{:?} {:?}", a.index, b.index);
        }
    }
    // A tenth of a thousand breaks, three deviations either way, and the hole's.
    let share = f64::from(gone) / f64::from(gone + kept);
    assert!(kept > 500 && (0.03..0.1).contains(&share), "{gone} of {}", gone + kept);
    let lone = truth.layers[0].nodes.iter().filter(|n| n.visibility == Visibility::Missing).count();
    assert!(lone >= 1, "the hole holds a knot");
    let stubs = truth.layers[0].missing_edges.iter().flat_map(|e| e.stubs_m);
    assert!(stubs.clone().any(|s| s > 0.0) && stubs.clone().all(|s| s < 0.4001 * 0.06));
    Ok(())
}

#[test]
fn what_objects_hide_is_hidden() -> Result {
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let mut scene = quiet("50mm", pose(1.2, 5.0, 5.0, 4.0));
    let fish = |range_m, x_m, y_m| Object { range_m, x_m, y_m, turn_deg: 20.0, ..Object::default() };
    scene.objects = vec![fish(0.8, -0.1, 0.05), fish(2.0, 0.5, 0.3)];
    let truth = simulator.render(&scene, 1, &mut image)?.clone();
    assert_eq!(truth.outlines.len(), 2);
    // The deeper fish is behind the net and is drawn first.
    let near = &truth.outlines[1];
    let inside = |p: Vector2<f64>| {
        let pairs = near.iter().zip(near.iter().cycle().skip(1));
        pairs.filter(|(a, b)| (a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y)).count()
            % 2
            == 1
    };
    let hidden = truth.layers[0].nodes.iter().filter(|n| n.visibility == Visibility::Occluded).count();
    assert!(hidden > 10, "{hidden}");
    for node in &truth.layers[0].nodes {
        let border = near.iter().map(|p| (p - node.pixel).norm()).fold(f64::INFINITY, f64::min);
        if border > 12.0 {
            assert_eq!(node.visibility == Visibility::Occluded, inside(node.pixel), "{node:?}");
        }
    }
    // Its brightness where it hides the net is not the twine's.
    let picture = simulator.noiseless();
    let twine = truth.layers[0].nodes.iter().filter(|n| n.visibility == Visibility::Occluded);
    assert!(twine.map(|n| at(picture, 848, n.pixel)).all(|g| g < 160.0));
    Ok(())
}

#[test]
fn every_kind_of_object_is_drawn_and_outlined() -> Result {
    let mut simulator = Simulator::new(small_camera());
    let mut image = Image::default();
    for (kind, outlines) in [(Kind::Fish, 1), (Kind::Rope, 1), (Kind::Rod, 1), (Kind::Kelp, 1), (Kind::Ladder, 2 + 5)] {
        let object = Object { kind, length_m: 0.5, width_m: 0.12, grey: 200.0, ..Object::default() };
        let scene = Scene { objects: vec![object], ..Scene::empty() };
        let truth = simulator.render(&scene, 1, &mut image)?;
        assert_eq!(truth.outlines.len(), outlines, "{kind:?}");
        assert!(truth.layers.is_empty());
        let touched = simulator.noiseless().iter().filter(|&&g| (g - 90.0).abs() > 3.0).count();
        assert!(touched > 300, "{kind:?}: {touched}");
    }
    Ok(())
}

#[test]
fn growth_covers_the_knots_it_says() -> Result {
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let mut scene = quiet("50mm", NetPose::at(0.8));
    scene.layers[0].net.growth = Growth { density: 0.4, size_m: 0.025, grey: 10.0, ..Growth::default() };
    let truth = simulator.render(&scene, 1, &mut image)?.clone();
    let fouled: Vec<_> = truth.layers[0].nodes.iter().filter(|n| n.visibility == Visibility::Fouled).collect();
    assert!(fouled.len() > 10, "{}", fouled.len());
    // A tuft is a heap of balls: over most of its knots is weed, not twine.
    let picture = simulator.noiseless();
    let covered = fouled.iter().filter(|n| at(picture, 848, n.pixel) < 120.0).count();
    assert!(covered * 10 > fouled.len() * 6, "{covered} of {}", fouled.len());
    // And over those said to be clean is twine.
    let clean: Vec<_> = truth.layers[0].nodes.iter().filter(|n| n.visibility == Visibility::Visible).collect();
    let dark = clean.iter().filter(|n| at(picture, 848, n.pixel) < 120.0).count();
    assert!(clean.len() > 50 && dark * 20 < clean.len(), "{dark} of {}", clean.len());
    Ok(())
}

#[test]
fn a_second_net_is_behind_the_first() -> Result {
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let mut scene = quiet("50mm", NetPose::at(1.0));
    // Square on and at twice the distance every other knot of the back net is behind the front one's.
    scene.layers.push(Layer { pose: NetPose::at(2.0), ..scene.layers[0].clone() });
    scene.layers[1].net.twine.grey = 20.0;
    let truth = simulator.render(&scene, 1, &mut image)?.clone();
    assert_eq!(truth.layers.len(), 2);
    assert!(truth.layers[0].nodes.iter().all(|n| n.visibility == Visibility::Visible));
    for node in &truth.layers[1].nodes {
        let behind = node.index.0 % 2 == 0 || node.index.1 % 2 == 0;
        assert_eq!(node.visibility == Visibility::BehindNet, behind, "{node:?}");
    }
    Ok(())
}

#[test]
fn water_takes_and_gives_light_with_range() -> Result {
    // Twine so wide that its middle is one colour: I = J exp(-c r) + B (1 - exp(-c r)), r along the line of sight.
    const GREY: f64 = 0.01;
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    for range_m in [0.6, 1.5] {
        let mut scene = quiet("50mm", NetPose::at(range_m));
        scene.layers[0].net.twine = Twine { diameter_m: 0.03, ..Twine::default() };
        scene.water = Water { attenuation_per_m: 0.8, ..Water::default() };
        let truth = simulator.render(&scene, 1, &mut image)?.clone();
        for node in truth.layers[0].nodes.iter().filter(|n| n.pixel.x > 40.0 && n.pixel.x < 800.0) {
            let through = (-0.8 * node.point.norm()).exp();
            let expected = 200.0 * through + 90.0 * (1.0 - through);
            if node.pixel.y > 20.0 && node.pixel.y < 460.0 {
                let got = at(simulator.noiseless(), 848, node.pixel);
                assert!((got - expected).abs() < GREY, "{node:?}: {got} {expected}");
            }
        }
        let contrast = (200.0 - 90.0) * (-0.8 * range_m).exp();
        // In the middle of the picture is a knot: the light behind it was taken before it was drawn.
        assert!((truth.layers[0].contrast_grey - contrast).abs() < GREY, "{}", truth.layers[0].contrast_grey);
    }
    Ok(())
}

#[test]
fn noise_has_the_variance_of_read_out_and_light() -> Result {
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    for (veil_grey, full_well_e, read_noise_grey) in [(100.0, 0.0, 4.0), (60.0, 3000.0, 2.0), (160.0, 3000.0, 2.0)] {
        let sensor = Sensor { full_well_e, read_noise_grey, ..Sensor::default() };
        let scene = Scene { water: Water { veil_grey, ..Water::default() }, sensor, ..Scene::empty() };
        let truth = simulator.render(&scene, 3, &mut image)?;
        let n = image.data().len() as f64;
        let mean = image.data().iter().map(|&p| f64::from(p)).sum::<f64>() / n;
        let variance = image.data().iter().map(|&p| (f64::from(p) - mean).powi(2)).sum::<f64>() / n;
        // Rounding adds 1/12. 400,000 pixels know a deviation to 0.11 %; five times that.
        let expected = truth.noise_grey.powi(2) + 1.0 / 12.0;
        assert!((mean - veil_grey).abs() < 0.05, "{mean}");
        assert!((variance / expected - 1.0).abs() < 0.012, "{variance} {expected}");
        let shot = if full_well_e > 0.0 { veil_grey * 255.0 / full_well_e } else { 0.0 };
        assert!((truth.noise_grey.powi(2) - shot - read_noise_grey.powi(2)).abs() < 1e-9);
    }
    Ok(())
}

#[test]
fn blur_moves_no_light() -> Result {
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    // A net that ends well inside the view, so that no light leaves it.
    let mut scene = quiet("50mm", pose(1.4, 10.0, 10.0, 15.0));
    scene.layers[0].net.extent = net_sim::Extent::centred(7, 7);
    let light = |simulator: &Simulator| simulator.noiseless().iter().map(|&g| f64::from(g) - 90.0).sum::<f64>();
    let peak = |simulator: &Simulator| simulator.noiseless().iter().fold(0.0f32, |m, &g| m.max(g));
    simulator.render(&scene, 1, &mut image)?;
    let (sharp, sharp_peak) = (light(&simulator), peak(&simulator));
    scene.sensor.defocus_px = 2.5;
    simulator.render(&scene, 1, &mut image)?;
    // Single precision over 400,000 pixels.
    assert!((light(&simulator) / sharp - 1.0).abs() < 1e-3, "{} {sharp}", light(&simulator));
    assert!(peak(&simulator) < 0.8 * sharp_peak);
    Ok(())
}

#[test]
fn motion_blur_is_centred_on_the_middle_of_the_exposure() -> Result {
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let mut scene = quiet("50mm", NetPose { x_m: 0.013, ..NetPose::at(0.8) });
    simulator.render(&scene, 1, &mut image)?;
    let (still, sharp) = (simulator.noiseless().to_vec(), image.clone());
    // 0.01 s at 1 m/s is 7.5 px at 0.8 m.
    scene.sensor.exposure_s = 0.01;
    scene.motion = Motion { linear_m_per_s: [1.0, 0.0, 0.0], ..Motion::default() };
    let truth = simulator.render(&scene, 1, &mut image)?.clone();
    assert!(sharp != image);
    let mut count = 0;
    for (a, b, family) in edges(&truth) {
        let middle = (a.pixel + b.pixel) * 0.5;
        if family == 0 || middle.x < 30.0 || middle.x > 818.0 {
            continue;
        }
        let (Some(before), Some(after)) =
            (centre(&still, 848, middle, 14, false, 90.0), centre(simulator.noiseless(), 848, middle, 14, false, 90.0))
        else {
            continue;
        };
        // The mean of eleven equally spaced pictures has no bias but the aliasing of each, 0.001 px; and off the axis a cylinder looks the
        // wider the farther out it is, by u / (f² + u²) a px: times the variance of 7.5 px, 4.7 px², that is up to 0.003 px.
        let off = middle.x - 424.0;
        let wider = off / (600.0 * 600.0 + off * off) * 7.5 * 7.5 / 12.0;
        assert!((before + wider - after).abs() < 0.001, "{before} {after} {wider}");
        let blurred = at(simulator.noiseless(), 848, middle);
        assert!(blurred < at(&still, 848, middle) - 30.0, "{blurred}");
        count += 1;
    }
    assert!(count > 50, "{count}");
    Ok(())
}

#[test]
fn knots_and_shading_show() -> Result {
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let mut scene = quiet("50mm", NetPose { x_m: 0.01, y_m: 0.01, ..NetPose::at(0.5) });
    let truth = simulator.render(&scene, 1, &mut image)?.clone();
    let beside = |p: Vector2<f64>| p + Vector2::new(2.0, 2.0);
    let knot =
        truth.layers[0].nodes.iter().find(|n| (n.pixel - Vector2::new(400.0, 240.0)).norm() < 60.0).ok_or("none")?;
    let plain = at(simulator.noiseless(), 848, beside(knot.pixel));
    scene.layers[0].net.twine.knot = 3.0;
    simulator.render(&scene, 1, &mut image)?;
    assert!(at(simulator.noiseless(), 848, beside(knot.pixel)) > plain + 30.0, "{plain}");
    // Lit from above: the centre of brightness of level twine moves up by shading/3 of the radius, exactly, for a strip.
    scene.layers[0].net.twine = Twine { shading: 0.9, ..Twine::default() };
    simulator.render(&scene, 1, &mut image)?;
    for (a, b, family) in edges(&truth) {
        let middle = (a.pixel + b.pixel) * 0.5;
        if family != 0 || !(30.0..450.0).contains(&middle.y) || !(10.0..830.0).contains(&middle.x) {
            continue;
        }
        // Of twine on black: shading moves its own light; over a background of 90 the step counts by 200/110.
        // Off the axis a cylinder looks the wider.
        let wider = (1.0 + ((middle.y - 240.0) / 600.0).powi(2)).sqrt();
        let up = 0.9 / 3.0 * (0.001 * 600.0 / 0.5) * wider * 200.0 / 110.0;
        let v = centre(simulator.noiseless(), 848, middle, 8, true, 90.0).ok_or("no twine")?;
        assert!((middle.y - up - v).abs() < 0.01, "{v} {} {up}", middle.y);
    }
    Ok(())
}

#[test]
fn snow_light_and_clouds_change_the_picture() -> Result {
    let mut simulator = Simulator::new(small_camera());
    let mut image = Image::default();
    let plain = quiet("50mm", NetPose::at(1.0));
    simulator.render(&plain, 1, &mut image)?;
    let before = image.clone();
    type Change = fn(&mut Scene);
    let changes: [(&str, Change); 11] = [
        ("snow", |s| s.snow.density_per_m3 = 500.0),
        ("mottle", |s| s.water.mottle_grey = 10.0),
        ("gradient", |s| s.water.gradient_grey = 30.0),
        ("rays", |s| s.water.rays_grey = 10.0),
        ("glow", |s| s.water.glow_grey = 30.0),
        ("caustic", |s| s.light.caustic = 0.4),
        ("lamp", |s| s.light.lamp = 0.8),
        ("light", |s| s.light.gradient = 0.4),
        ("vignette", |s| s.light.vignette = 0.3),
        ("gain", |s| s.sensor.gain = 0.5),
        ("jpeg", |s| s.sensor.jpeg_quality = Some(30)),
    ];
    for (name, change) in changes {
        let mut scene = plain.clone();
        change(&mut scene);
        simulator.render(&scene, 1, &mut image)?;
        let changed = image.data().iter().zip(before.data()).filter(|(a, b)| a.abs_diff(**b) > 1).count();
        assert!(changed > 100, "{name}: {changed}");
    }
    // Time moves what moves.
    let mut scene = plain;
    scene.light.flicker = 0.3;
    scene.snow.density_per_m3 = 500.0;
    simulator.render(&scene, 1, &mut image)?;
    let before = image.clone();
    scene.time_s = 0.4;
    simulator.render(&scene, 1, &mut image)?;
    assert!(before != image);
    Ok(())
}
