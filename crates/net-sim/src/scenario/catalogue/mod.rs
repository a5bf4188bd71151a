//! The scenarios that have a name.

mod negatives;
mod sequences;
mod stills;
mod thesis;

use net_geometry::Mesh;

use super::{CameraModel, Path, Scenario};
use crate::scene::{Layer, Light, NetPose, Object, Scene, Sensor, Snow, Twine, Water};

pub(super) fn all() -> Vec<Scenario> {
    let mut list = thesis::figures();
    list.extend(thesis::tables());
    list.extend(thesis::tracking());
    list.extend(stills::conditions());
    list.extend(stills::hung());
    list.extend(sequences::sequences());
    list.extend(negatives::negatives());
    list
}

fn named(name: &str, description: &str, scene: Scene) -> Scenario {
    Scenario { name: name.to_owned(), description: description.to_owned(), scene, ..Scenario::default() }
}

/// The thesis's mesh.
fn mesh_50() -> Mesh {
    // Positive and finite.
    Mesh::square(0.05).expect("a side of 0.05 m makes a mesh")
}

/// An ordinary net in ordinary water: knots, a little jitter, haze, gradient, shot noise.
fn ordinary(pose: NetPose) -> Scene {
    let mut layer = Layer::planar(&mesh_50(), pose);
    layer.net.twine = Twine { knot: 2.0, variation: 0.06, shading: 0.35, ..Twine::default() };
    layer.net.jitter = 0.012;
    layer.net.slack = 0.008;
    Scene {
        layers: vec![layer],
        water: Water {
            veil_grey: 105.0,
            attenuation_per_m: Water::attenuation_of_visibility(10.0),
            gradient_grey: 45.0,
            mottle_grey: 4.0,
            mottle_px: 160.0,
            ..Water::default()
        },
        light: Light { gradient: 0.15, vignette: 0.2, ..Light::default() },
        snow: Snow { density_per_m3: 40.0, ..Snow::default() },
        sensor: Sensor { full_well_e: 9000.0, read_noise_grey: 1.0, ..Sensor::default() },
        ..Scene::empty()
    }
}

fn tilted(range_m: f64, tilt_x_deg: f64, tilt_y_deg: f64, roll_deg: f64) -> NetPose {
    NetPose { range_m, tilt_x_deg, tilt_y_deg, roll_deg, x_m: 0.012, y_m: -0.017 }
}

/// A salmon at a place in view.
fn salmon(range_m: f64, x_m: f64, y_m: f64, turn_deg: f64, seed: u64) -> Object {
    let way = turn_deg.to_radians();
    // It swims with its snout ahead, which is opposite to its long side's direction.
    let velocity_m_per_s = [-0.35 * way.cos(), -0.35 * way.sin(), 0.0];
    Object {
        range_m,
        x_m,
        y_m,
        turn_deg,
        length_m: 0.55,
        width_m: 0.13,
        grey: 75.0,
        contrast: 0.65,
        velocity_m_per_s,
        seed,
        ..Object::default()
    }
}
