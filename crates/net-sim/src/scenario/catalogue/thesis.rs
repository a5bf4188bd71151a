//! The thesis's virtual grids, its tables and its tracking experiment.

use nalgebra::{Rotation3, Vector3};
use net_geometry::Pose;

use super::{CameraModel, Path, Scenario, mesh_50, named};
use crate::scene::{Growth, Layer, NetPose, Object, Scene, Sensor, Twine, Water};
use crate::thesis;

/// A grid on a plain background as Algorithm 1 draws it, mended.
fn grid(rows: u32, columns: u32, pose: NetPose) -> Scene {
    let camera = CameraModel::default().camera().expect("the thesis's camera is one");
    thesis::mended_grid(rows, columns, &mesh_50(), pose, 2.0, &camera).expect("the mesh is one")
}

/// Virtual grids of chapters 4 and 5.
pub(super) fn figures() -> Vec<Scenario> {
    // Figure 4.2b: 1.5 m ahead and 0.5 m aside, then roll 30 and yaw 45 degrees (ZYX, eq. 4.2).
    let turned = Pose {
        rotation: Rotation3::from_euler_angles(30f64.to_radians(), 0.0, 45f64.to_radians()),
        translation: Vector3::new(0.5, 0.0, 1.5),
    };
    let aside = NetPose::from_pose(&turned).unwrap_or_default();
    let tilted = NetPose { range_m: 3.0, tilt_x_deg: 30.0, ..NetPose::default() };
    vec![
        named("fig-4.2a", "Thesis figure 4.2a: 10 x 10 grid, 1.5 m, straight ahead", grid(10, 10, NetPose::at(1.5))),
        named(
            "fig-4.2b",
            "Thesis figure 4.2b: 10 x 10 grid, 0.5 m aside, roll 30, yaw 45 degrees",
            grid(10, 10, aside),
        ),
        named("fig-4.11", "Thesis figure 4.11: 30 x 50 grid, 3 m, tilted 30 degrees", grid(30, 50, tilted)),
        named("fig-5.3", "Thesis figure 5.3: closest grid, 0.6 m", grid(60, 90, NetPose::at(0.6))),
        named("fig-5.4", "Thesis figure 5.4: far grid, 3 m", grid(120, 200, NetPose::at(3.0))),
        named("fig-5.5", "Thesis figure 5.5: the grid the thesis misreads, 4 m", grid(150, 250, NetPose::at(4.0))),
        named(
            "fig-5.6",
            "Thesis figures 5.6 to 5.9: junctions of the 30 x 50 grid, 3 m, 30 degrees",
            grid(30, 50, tilted),
        ),
        named("far-6m", "Twice as far as the thesis reads: 6 m", grid(220, 360, NetPose::at(6.0))),
    ]
}

/// A transparent grid over an underwater scene, as in the comparison with Schellewald 2021.
fn underwater(pose: NetPose, seed: u64) -> Scene {
    let mut layer = Layer::planar(&mesh_50(), pose);
    layer.net.twine = Twine { diameter_m: 2.0 * pose.range_m / 600.0, grey: 150.0, ..Twine::default() };
    Scene {
        layers: vec![layer],
        water: Water { veil_grey: 95.0, gradient_grey: 50.0, mottle_grey: 18.0, mottle_px: 110.0, ..Water::default() },
        sensor: Sensor { psf_px: 0.8, read_noise_grey: 4.0, ..Sensor::default() },
        seed,
        ..Scene::empty()
    }
}

/// Tables 5.3 to 5.5: tilts of 0, 20 and 40 degrees at 80, 120, 160 and 200 cm. The thesis does not say about which axis.
pub(super) fn tables() -> Vec<Scenario> {
    let table = |name: &str, description: &str, tilt_x_deg: f64, tilt_y_deg: f64| {
        // Two of each distance, the lattice lying otherwise.
        let poses = (0..8).map(|k: u8| NetPose {
            range_m: 0.8 + 0.4 * f64::from(k % 4),
            tilt_x_deg,
            tilt_y_deg,
            roll_deg: 0.0,
            x_m: 0.011 * f64::from(k),
            y_m: 0.007 * f64::from(k),
        });
        let poses: Vec<NetPose> = poses.collect();
        let mut scenario = named(name, description, underwater(poses[0], 5));
        scenario.frames = 8;
        scenario.path = Path::Poses(poses);
        scenario
    };
    let mut list = vec![
        named("fig-5.17", "Thesis figure 5.17: grid in an underwater scene, 80 cm, 20 degrees", {
            underwater(NetPose { range_m: 0.8, tilt_x_deg: 20.0, ..NetPose::default() }, 5)
        }),
        table("table-5.3", "Thesis table 5.3: 0 degrees at 80, 120, 160, 200 cm", 0.0, 0.0),
    ];
    for (number, tilt) in [("5.4", 20.0), ("5.5", 40.0)] {
        let describe =
            |axis: &str| format!("Thesis table {number}: {tilt} degrees about {axis} at 80, 120, 160, 200 cm");
        list.push(table(&format!("table-{number}x"), &describe("x"), tilt, 0.0));
        list.push(table(&format!("table-{number}y"), &describe("y"), 0.0, tilt));
    }
    list
}

/// The tracking experiment of section 5.5: 100 frames, and 25 more back to the start.
pub(super) fn tracking() -> Vec<Scenario> {
    let path = |back_s: f64| Path::Similarity {
        range_m: 1.0,
        focal_px: 600.0,
        shift_px: [-113.0, 62.0],
        there_s: 9.9,
        back_s,
    };
    let mut scene = underwater(NetPose::at(1.0), 6);
    scene.layers[0].net.jitter = 0.06;
    scene.layers[0].net.twine = Twine { diameter_m: 0.0035, grey: 165.0, variation: 0.15, ..Twine::default() };
    scene.layers[0].net.growth = Growth { density: 0.03, grey: 160.0, ..Growth::default() };
    scene.light.flicker = 0.15;
    scene.objects = vec![Object {
        range_m: 0.7,
        x_m: -0.62,
        y_m: 0.0,
        turn_deg: 180.0,
        length_m: 0.24,
        width_m: 0.06,
        velocity_m_per_s: [0.152, 0.0, 0.0],
        ..Object::default()
    }];
    let mut there =
        named("tracking", "Thesis 5.5: 100 frames of an irregular net with a fish and flicker", scene.clone());
    (there.frames, there.path) = (100, path(0.0));
    let mut back = named("tracking-loop", "Thesis figure 5.20: the same and back to the start, 125 frames", scene);
    (back.frames, back.path) = (125, path(2.5));
    vec![there, back]
}
