//! What is claimed, and what is not.

#![allow(clippy::unwrap_used)] // a test may stop

mod scene;

use net_fft::ThesisConfig;
use net_sim::{Backdrop, Kind, NetPose, Object, Scene, Texture};
use scene::{Off, camera, draw, estimate, scene_of, square};

#[test]
fn textures_that_are_no_net_are_refused() {
    for texture in Texture::ALL {
        for (seed, range_m) in [(1, 0.8), (2, 1.6)] {
            let pose = NetPose { range_m, tilt_y_deg: 20.0, roll_deg: 8.0, ..NetPose::default() };
            let backdrop = Backdrop { texture, pose, seed, ..Backdrop::default() };
            let scene = Scene { backdrop: Some(backdrop), ..Scene::empty() };
            let (picture, _) = draw(&camera(), &scene, seed);
            let Some(found) = estimate(&camera(), &square(), &ThesisConfig::default(), &picture) else { continue };
            assert!(found.probability < 0.5, "{texture:?} at {range_m} m: {} {:?}", found.probability, found.support);
        }
    }
}

#[test]
fn objects_are_no_nets() {
    for kind in [Kind::Fish, Kind::Rope, Kind::Ladder, Kind::Kelp, Kind::Rod] {
        let objects = (0..6)
            .map(|k| Object {
                kind,
                x_m: 0.2 * f64::from(k) - 0.5,
                y_m: 0.1 * f64::from(k % 3) - 0.1,
                turn_deg: 90.0,
                length_m: 1.5,
                seed: k as u64,
                ..Object::default()
            })
            .collect();
        let (picture, _) = draw(&camera(), &Scene { objects, ..Scene::empty() }, 4);
        let found = estimate(&camera(), &square(), &ThesisConfig::default(), &picture);
        let probability = found.map_or(0.0, |found| found.probability);
        assert!(probability < 0.5, "{kind:?}: {probability}");
    }
}

#[test]
fn open_water_is_no_net() {
    for seed in 0..4 {
        let (picture, _) = draw(&camera(), &Scene::empty(), seed);
        let found = estimate(&camera(), &square(), &ThesisConfig::default(), &picture);
        assert!(found.is_none_or(|found| found.probability < 0.1));
    }
}

#[test]
fn faint_nets_are_refused_before_they_are_wrong() {
    for (seed, defocus_px) in [0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 9.0].into_iter().enumerate() {
        for range in [0.5, 1.5, 4.0] {
            let mut scene = scene_of(&square(), range, 10.0, 20.0, 5.0);
            scene.sensor.defocus_px = defocus_px;
            scene.sensor.read_noise_grey = 12.0;
            let (picture, truth) = draw(&camera(), &scene, seed as u64);
            let Some(found) = estimate(&camera(), &square(), &ThesisConfig::default(), &picture) else { continue };
            let off = Off::of(&found, &truth.unwrap());
            assert!(
                off.is_right() || found.probability < 0.5,
                "blur {defocus_px} px at {range} m: {} {off:?}",
                found.probability
            );
        }
    }
}
