//! What is refused, and that nothing panics.

use crate::support::{Result, small_camera};
use net_geometry::{Camera, Lens};
use net_sim::{Backdrop, Error, Image, Kind, Layer, NetPose, Object, Scenario, Scene, Simulator, Texture, Wave};
use proptest::prelude::*;

#[test]
fn numbers_out_of_range_are_refused_by_name() {
    let refused = |change: fn(&mut Scene)| {
        let mut scene = Scene::default();
        change(&mut scene);
        match scene.validate() {
            Err(Error::Value { field, .. }) => field,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(refused(|s| s.layers[0].pose.range_m = f64::NAN), "pose.range_m");
    assert_eq!(refused(|s| s.layers[0].pose.range_m = 0.0), "pose.range_m");
    assert_eq!(refused(|s| s.layers[0].pose.tilt_x_deg = 90.0), "pose.tilt_x_deg");
    assert_eq!(refused(|s| s.layers[0].pose.x_m = f64::INFINITY), "pose.x_m");
    assert_eq!(refused(|s| s.layers[0].net.side1_m = -0.05), "net.side1_m");
    assert_eq!(refused(|s| s.layers[0].net.shear_deg = 80.0), "net.angle_deg + net.shear_deg");
    assert_eq!(refused(|s| s.layers[0].net.twine.diameter_m = f64::NAN), "net.twine.diameter_m");
    assert_eq!(
        refused(|s| s.layers[0].net.surface.waves = vec![Wave { length_m: 0.0, ..Wave::default() }]),
        "net.surface.waves.length_m"
    );
    assert_eq!(refused(|s| s.layers[0].net.surface.curvature_per_m[2] = f64::NAN), "net.surface.curvature_per_m");
    assert_eq!(refused(|s| s.layers[0].net.extent = net_sim::Extent::Cells { i: [3, 1], j: [0, 4] }), "net.extent");
    assert_eq!(refused(|s| s.layers = vec![Layer::default(); 9]), "layers");
    assert_eq!(refused(|s| s.sensor.psf_px = 0.0), "sensor.psf_px");
    assert_eq!(refused(|s| s.sensor.jpeg_quality = Some(0)), "sensor.jpeg_quality");
    assert_eq!(refused(|s| s.water.attenuation_per_m = -1.0), "water.attenuation_per_m");
    assert_eq!(refused(|s| s.motion.angular_deg_per_s[1] = f64::NAN), "motion.angular_deg_per_s");
    assert_eq!(refused(|s| s.objects = vec![Object { range_m: 0.0, ..Object::default() }]), "objects.range_m");
    assert_eq!(refused(|s| s.time_s = f64::NAN), "time_s");
    let both = NetPose { tilt_x_deg: 85.0, tilt_y_deg: 80.0, ..NetPose::default() };
    assert!(both.validate().is_err(), "89 degrees in all");
    let scenario = Scenario { rate_hz: 0.0, ..Scenario::default() };
    assert!(scenario.frame(0).is_err());
    assert!(Scenario { mesh: "wide".to_owned(), ..Scenario::default() }.validate().is_err());
}

#[test]
fn tiny_pictures_are_drawn() -> Result {
    let mut image = Image::default();
    for (width, height) in [(1, 1), (1, 40), (40, 1), (9, 7)] {
        let camera = Camera::new(50.0, 50.0, 0.0, 0.0, width, height, Lens::None)?;
        let mut scene = Scenario::by_name("ordinary")?.scene;
        scene.sensor.defocus_px = 3.0;
        scene.sensor.jpeg_quality = Some(50);
        scene.backdrop = Some(Backdrop::default());
        Simulator::new(camera).render(&scene, 1, &mut image)?;
        assert_eq!((image.width(), image.height()), (width as usize, height as usize));
    }
    Ok(())
}

#[test]
fn every_texture_is_drawn() -> Result {
    let mut simulator = Simulator::new(small_camera());
    let mut image = Image::default();
    for texture in Texture::ALL {
        let backdrop = Backdrop { texture, contrast_grey: 40.0, ..Backdrop::default() };
        let scene = Scene { backdrop: Some(backdrop), ..Scene::empty() };
        simulator.render(&scene, 1, &mut image)?;
        let n = image.data().len() as f64;
        let mean = image.data().iter().map(|&p| f64::from(p)).sum::<f64>() / n;
        let deviation = (image.data().iter().map(|&p| (f64::from(p) - mean).powi(2)).sum::<f64>() / n).sqrt();
        // About the brightness and the contrast asked for: its noise alone would be 2.
        assert!((mean - 100.0).abs() < 30.0 && (8.0..60.0).contains(&deviation), "{texture:?}: {mean} {deviation}");
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Whatever passes validation is drawn, at the ends of the ranges too, and knots are where the camera sees them.
    #[test]
    fn wild_scenes_are_drawn(
        range_m in prop_oneof![Just(0.02), 0.05..1.5f64, Just(5.0)],
        tilt_x_deg in -89.0..89.0f64,
        tilt_y_deg in -60.0..60.0f64,
        roll_deg in -360.0..360.0f64,
        side_m in prop_oneof![Just(0.04), 0.05..0.3f64],
        shear_deg in -60.0..60.0f64,
        bend in prop::array::uniform3(-5.0..5.0f64),
        amplitude_m in -0.5..0.5f64,
        thread in -5.0..5.0f64,
        isometric: bool,
        jitter in 0.0..0.3f64,
        broken in 0.0..1.0f64,
        kind in prop_oneof![Just(Kind::Fish), Just(Kind::Ladder), Just(Kind::Kelp)],
        object_m in 0.05..3.0f64,
        defocus_px in 0.0..20.0f64,
        speed in -50.0..50.0f64,
    ) {
        let mut scene = Scene::default();
        let layer = &mut scene.layers[0];
        layer.pose = NetPose { range_m, tilt_x_deg, tilt_y_deg, roll_deg, x_m: 0.7, y_m: -0.4 };
        (layer.net.side1_m, layer.net.side2_m, layer.net.shear_deg) = (side_m, 1.7 * side_m, shear_deg);
        (layer.net.jitter, layer.net.slack, layer.net.broken) = (jitter, 0.5 * jitter, broken);
        layer.net.twine.diameter_m = 0.1 * side_m;
        layer.net.twine.knot = 2.0;
        layer.net.growth.density = 0.2;
        layer.net.surface.curvature_per_m = bend;
        layer.net.surface.waves = vec![Wave { amplitude_m, length_m: 0.6, ..Wave::default() }];
        layer.net.surface.thread_bend_per_m = [thread, -thread];
        layer.net.surface.isometric = isometric;
        scene.objects = vec![Object { kind, range_m: object_m, ..Object::default() }];
        scene.sensor.defocus_px = defocus_px;
        scene.sensor.exposure_s = 0.0001;
        scene.motion.linear_m_per_s = [speed, 0.0, -speed];
        if scene.validate().is_err() {
            return Ok(());
        }
        let camera = Camera::new(60.0, 60.0, 39.5, 29.5, 80, 60, Lens::PlumbBob([-0.2, 0.05, 0.0, 0.0, 0.0])).unwrap();
        let mut image = Image::default();
        let mut simulator = Simulator::new(camera);
        let truth = simulator.render(&scene, 1, &mut image).unwrap().clone();
        prop_assert!(simulator.noiseless().iter().all(|g| g.is_finite()));
        for node in &truth.layers[0].nodes {
            let pixel = camera.pixel_from_point(node.point).unwrap();
            prop_assert!((pixel - node.pixel).norm() < 1e-9);
        }
        if let Some(axis) = truth.layers[0].axis {
            prop_assert!(axis.range_m > 0.0 && (axis.normal.norm() - 1.0).abs() < 1e-9 && axis.normal.z > 0.0);
        }
    }
}
