//! Sequences.

use super::{Path, Scenario, named, ordinary, salmon, tilted};
use crate::scene::{Growth, Hole, Layer, NetPose, Scene, Water};

/// Sequences along smooth paths.
pub(super) fn sequences() -> Vec<Scenario> {
    let mut list = Vec::new();
    let mut add = |name: &str, description: &str, scene: Scene, path: Path| {
        let mut scenario = named(name, description, scene);
        (scenario.frames, scenario.path) = (100, path);
        scenario.scene.sensor.exposure_s = 0.008;
        list.push(scenario);
    };
    let grown = |pose: NetPose| {
        let mut scene = ordinary(pose);
        scene.layers[0].net.growth = Growth { density: 0.04, size_m: 0.014, ..Growth::default() };
        scene
    };
    let strafe = |to: f64| Path::Strafe { speed_m_per_s: [0.0, to], heave_m: 0.03, sway_deg: 4.0, period_s: 6.0 };
    add(
        "strafe",
        "100 frames along the net, 0 to 0.5 m/s: at the end a whole mesh a frame",
        grown(tilted(1.2, 3.0, 0.0, 2.0)),
        strafe(0.5),
    );
    add(
        "strafe-slow",
        "100 frames along the net, at most a third of a mesh a frame",
        grown(tilted(1.2, 3.0, 0.0, 2.0)),
        strafe(0.16),
    );
    let mut approach = grown(tilted(2.6, 5.0, 20.0, 3.0));
    approach.water.attenuation_per_m = Water::attenuation_of_visibility(8.0);
    let path = Path::Approach { to_m: 0.6, tilt_y_deg: -4.0, aside_m: [0.3, 0.1] };
    add("approach", "100 frames from 2.6 m to 0.6 m", approach, path);
    let around = Path::Loop { radius_m: [0.25, 0.15], depth_m: 0.12, nod_deg: 6.0, roll_deg: 5.0 };
    add("loop", "100 frames around and back: the last pose is the first", grown(tilted(1.1, 0.0, 0.0, 0.0)), around);
    let mut inspect = ordinary(tilted(1.65, 2.0, 22.0, 2.0));
    inspect.layers[0].net.holes = vec![
        Hole { i: 2.5, j: -1.5, radius_i: 0.8, radius_j: 0.8 },
        Hole { i: 7.0, j: 2.0, radius_i: 1.7, radius_j: 1.3 },
        Hole { i: 4.5, j: 4.0, radius_i: 0.3, radius_j: 0.6 },
    ];
    let mut back = Layer { pose: tilted(2.35, 4.0, 16.0, -4.0), ..inspect.layers[0].clone() };
    (back.net.seed, back.net.holes) = (3, Vec::new());
    inspect.layers.push(back);
    inspect.snow.density_per_m3 = 300.0;
    let path = Path::Approach { to_m: 0.95, tilt_y_deg: -2.0, aside_m: [0.35, 0.05] };
    add("inspect", "100 frames of an inspection: approach, holes, a second net, snow", inspect, path);
    let mut shoal = grown(tilted(1.3, 0.0, 6.0, 0.0));
    shoal.objects = (0..9u8)
        .map(|k| {
            let row = 0.11 * f64::from(k % 3) - 0.1;
            let heading = if k % 4 == 3 { 0.0 } else { 180.0 };
            let start = if heading == 0.0 { 1.6 } else { -0.3 - 0.42 * f64::from(k) };
            salmon(0.75 + 0.08 * f64::from(k % 4), start, row, heading, 40 + u64::from(k))
        })
        .collect();
    let path = Path::Strafe { speed_m_per_s: [0.18, 0.18], heave_m: 0.02, sway_deg: 3.0, period_s: 5.0 };
    add("shoal", "100 frames at 0.18 m/s with salmon between camera and net", shoal, path);
    list
}
