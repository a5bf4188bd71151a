//! Named scenarios, sequences, studies, the thesis's algorithm, and that all is the same every time.

use crate::support::{Result, camera, hash};
use nalgebra::{Vector2, Vector3};
use net_sim::{Extent, Image, NetPose, Path, Scenario, Scene, Simulator, Study, thesis};

#[test]
fn every_scenario_has_a_name_of_its_own_and_can_be_written_down() -> Result {
    let all = Scenario::all();
    let names: std::collections::BTreeSet<_> = all.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names.len(), all.len());
    for scenario in &all {
        scenario.validate()?;
        assert!(!scenario.description.is_empty() && !scenario.description.contains('\n'));
        assert_eq!(&Scenario::by_name(&scenario.name)?, scenario);
        let text = toml::to_string(scenario)?;
        assert_eq!(&toml::from_str::<Scenario>(&text)?, scenario, "{text}");
        assert_eq!(scenario.name.starts_with("no-"), scenario.scene.layers.is_empty(), "{}", scenario.name);
    }
    assert_eq!(Scenario::by_name("fig-5.8")?.name, "fig-5.6");
    assert!(Scenario::by_name("atlantis").unwrap_err().to_string().contains("atlantis"));
    // A file may say no more than what differs.
    let short: Scenario =
        toml::from_str("frames = 3\n[[scene.layers]]\npose = { range_m = 2.0, tilt_y_deg = 10.0 }\n")?;
    assert_eq!(short.scene.layers[0].pose.range_m, 2.0);
    assert!(toml::from_str::<Scenario>("rnage_m = 2.0").unwrap_err().to_string().contains("rnage_m"));
    Ok(())
}

/// The mesh that a scenario tells users to give is the one that is drawn first: a wrong one is a wrong range.
#[test]
fn every_scenario_names_the_mesh_it_draws() -> Result {
    for scenario in Scenario::all() {
        let Some(layer) = scenario.scene.layers.first() else { continue };
        let (mesh, net) = (scenario.mesh()?, &layer.net);
        let drawn = [net.side1_m, net.side2_m, net.angle_deg.to_radians()];
        for (named, drawn) in [mesh.side1(), mesh.side2(), mesh.angle()].into_iter().zip(drawn) {
            // Both were written as decimal numbers.
            assert!((named - drawn).abs() < 1e-9, "{}: {named} named, {drawn} drawn", scenario.name);
        }
    }
    Ok(())
}

#[test]
fn the_same_scene_and_seed_make_the_same_bytes() -> Result {
    // Hashes of the middle frames' pictures, so that an unintended change of the simulator does not pass unseen. An intended one
    // changes them: the test prints the new ones.
    let expected = [
        ("plain", 0x99D1_1B19_E31D_BD36),
        ("ordinary", 0xB7C3_265E_E01B_EAA3),
        ("holes", 0x4FB9_8FB3_19A8_F751),
        ("growth", 0xB91B_6C69_B4FA_6EE1),
        ("hung", 0xBEA1_848C_8F60_D9A4),
        ("barrel", 0x775D_5932_267F_77DA),
        ("jpeg", 0xA179_8FDF_02DB_79E4),
        ("tracking", 0x4AFB_EE97_9B3C_6B32),
        ("no-kelp", 0x3CD6_164A_AF1B_A595),
    ];
    let mut image = Image::default();
    let mut reused = Simulator::new(camera());
    let mut changed = Vec::new();
    for (name, known) in expected {
        let scenario = Scenario::by_name(name)?;
        let frame = scenario.frame(scenario.frames / 2)?;
        let mut fresh = Simulator::new(scenario.camera()?);
        let truth = fresh.render(&frame.scene, frame.seed, &mut image)?.clone();
        let bytes = hash(image.data());
        // A simulator that has drawn other things before gives the same.
        if scenario.camera()? == camera() {
            assert_eq!(reused.render(&frame.scene, frame.seed, &mut image)?, &truth, "{name}");
            assert_eq!(hash(image.data()), bytes, "{name}");
        }
        // Another seed is other noise.
        fresh.render(&frame.scene, frame.seed + 1, &mut image)?;
        assert!(hash(image.data()) != bytes || frame.scene.sensor.read_noise_grey == 0.0, "{name}");
        if bytes != known {
            changed.push(format!("(\"{name}\", 0x{bytes:016X})"));
        }
    }
    assert!(changed.is_empty(), "pictures have changed: {}", changed.join(", "));
    Ok(())
}

#[test]
fn sequences_are_smooth_and_loops_close() -> Result {
    for scenario in Scenario::all().iter().filter(|s| s.frames >= 100) {
        let mut last: Option<(NetPose, i64)> = None;
        for k in 0..scenario.frames {
            let frame = scenario.frame(k)?;
            let pose = frame.scene.layers[0].pose;
            if let Some((before, time)) = last {
                assert_eq!(frame.timestamp_ns - time, 100_000_000, "{}", scenario.name);
                // No more than 0.6 m/s or 40 degrees/s anywhere.
                let way = (pose.pose().camera_in_net() - before.pose().camera_in_net()).norm();
                let turn = (pose.pose().rotation.inverse() * before.pose().rotation).angle().to_degrees();
                assert!(way < 0.08 && turn < 4.0, "{} frame {k}: {way} m, {turn} degrees", scenario.name);
            }
            last = Some((pose, frame.timestamp_ns));
        }
    }
    for (name, first, last) in [("loop", 0, 99), ("tracking-loop", 0, 124)] {
        let scenario = Scenario::by_name(name)?;
        let (a, b) =
            (scenario.frame(first)?.scene.layers[0].pose.pose(), scenario.frame(last)?.scene.layers[0].pose.pose());
        assert!((a.matrix() - b.matrix()).norm() < 1e-9, "{name}");
    }
    Ok(())
}

#[test]
fn strafing_reaches_the_speed_asked_for() -> Result {
    let scenario = Scenario::by_name("strafe")?;
    let x = |k: u32| Ok::<_, net_sim::Error>(scenario.frame(k)?.scene.layers[0].pose.x_m);
    // From 0 to 0.5 m/s in 9.9 s: the last frame's way is one mesh of 50 mm, less half a frame's acceleration.
    assert!((x(99)? - x(98)? - 0.05 * (1.0 - 0.5 / 99.0)).abs() < 1e-9);
    assert!((x(99)? - x(0)? - 0.25 * 9.9).abs() < 1e-9);
    Ok(())
}

#[test]
fn motion_blur_follows_the_path() -> Result {
    // The motion given to the sensor is the path's derivative: a step of it from the middle of the exposure is where the path goes.
    let scenario = Scenario::by_name("strafe")?;
    let frame = scenario.frame(60)?;
    let later = Scenario { rate_hz: 1000.0, frames: 9901, ..scenario.clone() };
    let (now, next) = (later.frame(6000)?, later.frame(6001)?);
    assert!((now.scene.layers[0].pose.x_m - frame.scene.layers[0].pose.x_m).abs() < 1e-9);
    let pose = now.scene.layers[0].pose.pose();
    let moved = pose.transform(next.scene.layers[0].pose.pose().camera_in_net());
    let motion = nalgebra::Vector3::from(frame.scene.motion.linear_m_per_s) * 0.001;
    assert!((moved - motion).norm() < 1e-6, "{moved} {motion}");
    Ok(())
}

#[test]
fn the_tracking_test_moves_by_its_similarity() -> Result {
    // p = c + s R (q - c) + t, pixels of frame 0 to pixels of frame k, as the experiment defines it.
    const PX: f64 = 1e-9;
    let scenario = Scenario::by_name("tracking")?;
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    let mut nodes = |k: u32| -> Result<_> {
        let mut scene = scenario.frame(k)?.scene;
        (scene.objects, scene.layers[0].net.growth.density, scene.layers[0].net.jitter) = (Vec::new(), 0.0, 0.0);
        Ok(simulator.render(&scene, 1, &mut image)?.layers[0].nodes.clone())
    };
    let (first, later) = (nodes(0)?, nodes(70)?);
    let tau = std::f64::consts::TAU;
    let u = 70.0 / 99.0;
    let t = Vector2::new(-113.0 * u + 3.0 * (tau * 3.0 * u).sin(), 62.0 * u + 2.0 * (tau * 2.0 * u).sin());
    let (turn, scale) = (2f64.to_radians() * (tau * 1.5 * u).sin(), 1.0 + 0.03 * (tau * u).sin());
    let centre = Vector2::new(424.0, 240.0);
    let mut met = 0;
    for a in &first {
        let Some(b) = later.iter().find(|b| b.index == a.index) else { continue };
        let expected = centre + nalgebra::Rotation2::new(turn) * (a.pixel - centre) * scale + t;
        assert!((b.pixel - expected).norm() < PX, "{a:?} {b:?} {expected}");
        met += 1;
    }
    assert!(met > 100, "{met}");
    Ok(())
}

#[test]
fn layers_and_backdrops_move_with_the_camera() -> Result {
    // The way from the front net to the back net is the same in every frame.
    let scenario = Scenario::by_name("inspect")?;
    let between = |k: u32| -> Result<_> {
        let scene = scenario.frame(k)?.scene;
        let (front, back) = (scene.layers[0].pose.pose(), scene.layers[1].pose.pose());
        Ok((front.inverse_transform(back.translation), front.rotation.inverse() * back.rotation))
    };
    let ((a, r), (b, s)) = (between(0)?, between(80)?);
    assert!((a - b).norm() < 1e-9 && (r.matrix() - s.matrix()).norm() < 1e-9, "{a} {b} {r} {s}");
    let mut scenario = Scenario::by_name("no-bricks")?;
    scenario.frames = 10;
    scenario.path = Path::Strafe { speed_m_per_s: [0.2, 0.2], heave_m: 0.0, sway_deg: 0.0, period_s: 5.0 };
    let x = |k: u32| Ok::<_, net_sim::Error>(scenario.frame(k)?.scene.backdrop.map(|b| b.pose.x_m));
    assert!((x(5)?.unwrap_or(0.0) - x(0)?.unwrap_or(0.0) - 0.1).abs() < 1e-9);
    Ok(())
}

#[test]
fn algorithm_1_as_printed_is_half_a_cell_off_and_on_whole_pixels() -> Result {
    let camera = camera();
    let mesh = "50mm".parse()?;
    let mut image = Image::default();
    let pose = NetPose::at(1.5);
    let grid = thesis::create_grid(10, 10, &mesh, &camera, &pose.pose(), &mut image)?;
    assert_eq!(grid.points.len(), 100);
    // 20 px a cell; knots from -5 to 4 cells.
    assert_eq!(grid.pixels[0], Vector2::new(424.0 - 100.0, 240.0 - 100.0));
    assert_eq!(grid.pixels[99], Vector2::new(424.0 + 80.0, 240.0 + 80.0));
    let view = image.view().ok_or("it has pixels")?;
    assert_eq!(
        (view.get(324, 200), view.get(323, 200), view.get(322, 200), view.get(325, 205)),
        (Some(220), Some(220), Some(30), Some(30))
    );
    assert!(image.data().iter().all(|&p| p == 30 || p == 220));
    // Mended: the middle of the net is the middle of the picture.
    let scene = thesis::mended_grid(10, 10, &mesh, pose, 2.0, &camera)?;
    let mut simulator = Simulator::new(camera);
    let truth = simulator.render(&scene, 1, &mut image)?;
    let nodes = &truth.layers[0].nodes;
    assert_eq!(nodes.len(), 100);
    let mean = nodes.iter().map(|n| n.pixel).sum::<Vector2<f64>>() / 100.0;
    assert!((mean - Vector2::new(424.0, 240.0)).norm() < 1e-9, "{mean}");
    assert!(thesis::create_grid(1, 10, &mesh, &camera, &pose.pose(), &mut image).is_err());
    Ok(())
}

#[test]
fn the_junction_grid_has_the_thesis_s_knots() -> Result {
    // 30 x 50 knots, 28 x 48 of them inside the border.
    let scenario = Scenario::by_name("fig-5.6")?;
    let mut simulator = Simulator::new(scenario.camera()?);
    let mut image = Image::default();
    let frame = scenario.frame(0)?;
    let layer = &simulator.render(&frame.scene, frame.seed, &mut image)?.layers[0];
    assert_eq!(layer.nodes.len(), 1500);
    let axis = layer.axis.ok_or("no axis")?;
    assert!((axis.range_m - 3.0).abs() < 1e-12 && (axis.normal.z.acos().to_degrees() - 30.0).abs() < 1e-9);
    assert_eq!(frame.scene.layers[0].net.extent, Extent::centred(50, 30));
    Ok(())
}

#[test]
fn studies_cover_what_they_promise() -> Result {
    let range = |s: &Scene| s.layers[0].pose.range_m;
    let tilt = |s: &Scene| s.layers[0].pose.pose().normal().z.acos().to_degrees();
    let (mut near, mut far, mut steep, mut dark, mut hidden, mut ends, mut lens, mut meshes) = (0, 0, 0, 0, 0, 0, 0, 0);
    for seed in 0..300 {
        let planar = Study::planar(seed);
        planar.validate()?;
        assert_eq!(planar, Study::planar(seed));
        let scene = &planar.scene;
        let net = &scene.layers[0].net;
        assert!((0.3..=8.0).contains(&range(scene)) && tilt(scene) <= 70.001, "{:?}", scene.layers[0].pose);
        // The mesh that the user gives is the net's.
        assert_eq!(planar.mesh()?, net.mesh()?, "seed {seed}");
        near += i32::from(range(scene) < 0.6);
        far += i32::from(range(scene) > 4.0);
        steep += i32::from(tilt(scene) > 50.0);
        dark += i32::from(net.twine.grey < scene.water.veil_grey);
        hidden += i32::from(!scene.objects.is_empty());
        ends += i32::from(net.extent != Extent::Full);
        lens += i32::from(!planar.camera.distortion_coefficients.is_empty());
        meshes += i32::from(planar.mesh != "50mm");
        let through = (-scene.water.attenuation_per_m * range(scene)).exp();
        let contrast = (net.twine.grey - scene.water.veil_grey).abs() * through;
        let snr = contrast / scene.sensor.read_noise_grey;
        assert!((0.499..10.001).contains(&snr), "seed {seed}: {snr}");
        let hung = Study::hung(seed);
        hung.validate()?;
        assert!(hung.scene.layers[0].net.surface.isometric);
        let negative = Study::negative(seed);
        negative.validate()?;
        assert!(negative.scene.layers.is_empty());
        for study in [Study::Noise, Study::Jitter2, Study::Jitter5, Study::Sag] {
            let scenario = study.scenario(seed);
            scenario.validate()?;
            let net = &scenario.scene.layers[0].net;
            // Nothing amiss but what the study is of.
            let expected = match study {
                Study::Jitter2 => 0.02,
                Study::Jitter5 => 0.05,
                _ => 0.0,
            };
            assert_eq!((net.jitter, net.surface.curvature_per_m != [0.0; 3]), (expected, study == Study::Sag));
        }
    }
    // Each is expected in a fifth of the scenes or more (far and steep ones less often: their meshes must stay 3 px).
    for (what, count) in [
        ("near", near),
        ("far", far),
        ("steep", steep),
        ("dark", dark),
        ("hidden", hidden),
        ("ends", ends),
        ("lens", lens),
        ("meshes", meshes),
    ] {
        assert!((15..200).contains(&count), "{what}: {count} of 300");
    }
    Ok(())
}

#[test]
fn nets_of_the_layers_stay_apart_and_sheets_meet_at_their_seam() -> Result {
    for seed in 0..40 {
        let scenario = Study::Layers.scenario(seed);
        scenario.validate()?;
        let [front, back] = [0, 1].map(|k| scenario.scene.layers[k].pose.pose().plane());
        let camera = scenario.camera()?;
        for (u, v) in [(0.0, 0.0), (847.0, 0.0), (0.0, 479.0), (847.0, 479.0), (424.0, 240.0)] {
            let ray = camera.ray_from_pixel(Vector2::new(u, v)).ok_or("no ray")?;
            let depths = front.depth_along(ray).zip(back.depth_along(ray)).ok_or("the view leaves a net")?;
            assert!(depths.1 > 1.1 * depths.0, "seed {seed}: {depths:?}");
        }

        let scenario = Study::Seam.scenario(seed);
        scenario.validate()?;
        let mut image = Image::default();
        let truth = Simulator::new(camera).render(&scenario.scene, 1, &mut image)?.clone();
        // The axis meets the first sheet where that has knots around it, and at the seam both have the same line.
        let [first, second] = [&truth.layers[0], &truth.layers[1]];
        let on_axis = first.axis.ok_or("the axis misses the sheet")?.cells.x;
        let Extent::Cells { i, .. } = scenario.scene.layers[0].net.extent else { return Err("endless".into()) };
        assert!(f64::from(i[0]) < on_axis && on_axis < f64::from(i[1]), "seed {seed}");
        let seam = if i[1] - on_axis as i32 > 150 { i[0] } else { i[1] };
        let line = |net: &net_sim::LayerTruth, column: i32, y: f64| {
            net.pose.transform(net.mesh.a1().push(0.0) * f64::from(column) + Vector3::y() * y)
        };
        let along = (line(first, seam, 1.0) - line(first, seam, 0.0)).normalize();
        for y in [-0.4, 0.0, 0.7] {
            let off = line(second, 0, y) - line(first, seam, 0.0);
            // on the line, to rounding
            assert!((off - along * along.dot(&off)).norm() < 1e-9, "seed {seed}");
        }
    }
    Ok(())
}

#[test]
fn studies_have_names() -> Result {
    for study in Study::ALL {
        assert_eq!(study.name().parse::<Study>()?, study);
        let scenario = study.scenario(17);
        assert_eq!(Scenario::by_name(&scenario.name)?, scenario);
    }
    assert!("dreams".parse::<Study>().is_err());
    assert!(Scenario::by_name("study-dreams-1").is_err() && Scenario::by_name("study-planar-x").is_err());
    Ok(())
}

#[test]
fn finite_study_nets_end_inside_the_view() -> Result {
    // Of nets that end, those of the first 60 seeds: knots in the picture are fewer than without an end, and the axis meets the net.
    let mut image = Image::default();
    let mut met = 0;
    for seed in 0..60 {
        let scenario = Study::planar(seed);
        let mut scene = scenario.scene.clone();
        if scene.layers[0].net.extent == Extent::Full {
            continue;
        }
        let mut simulator = Simulator::new(scenario.camera()?);
        let layer = simulator.render(&scene, 1, &mut image)?.layers[0].clone();
        assert!(layer.axis.is_some(), "seed {seed}");
        assert!((0.0..=1.0).contains(&layer.visible_share()));
        scene.layers[0].net.extent = Extent::Full;
        met += i32::from(simulator.render(&scene, 1, &mut image)?.layers[0].nodes.len() > layer.nodes.len());
    }
    assert!(met > 3, "{met}");
    Ok(())
}

#[test]
fn hung_studies_hang_without_stretch() -> Result {
    // With jitter and slack taken off, sides are exact whatever the sheet drawn.
    let mut simulator = Simulator::new(camera());
    let mut image = Image::default();
    for seed in 0..12 {
        let mut scene = Study::hung(seed).scene;
        let net = &mut scene.layers[0].net;
        (net.jitter, net.slack) = (0.0, 0.0);
        let side = net.side1_m;
        let truth = simulator.render(&scene, 1, &mut image)?;
        assert!(truth.layers[0].axis.is_some(), "seed {seed}");
        let all = crate::support::edges(truth);
        assert!(all.len() > 50, "seed {seed}: {}", all.len());
        let worst = all.iter().map(|(a, b, _)| ((b.point - a.point).norm() / side - 1.0).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-9, "seed {seed}: {worst}");
    }
    Ok(())
}
