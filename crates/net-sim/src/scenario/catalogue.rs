//! The scenarios that have a name.

use nalgebra::{Rotation3, Vector3};
use net_geometry::{Mesh, Pose};

use super::{CameraModel, Path, Scenario};
use crate::scene::{
    Backdrop, Extent, Growth, Hole, Kind, Layer, Light, Net, NetPose, Object, Scene, Sensor, Snow, Surface, Texture,
    Twine, Water, Wave,
};
use crate::thesis;

pub(super) fn all() -> Vec<Scenario> {
    let mut list = thesis_figures();
    list.extend(thesis_tables());
    list.extend(thesis_tracking());
    list.extend(conditions());
    list.extend(hung());
    list.extend(sequences());
    list.extend(negatives());
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

/// A grid on a plain background as Algorithm 1 draws it, mended.
fn grid(rows: u32, columns: u32, pose: NetPose) -> Scene {
    let camera = CameraModel::default().camera().expect("the thesis's camera is one");
    thesis::mended_grid(rows, columns, &mesh_50(), pose, 2.0, &camera).expect("the mesh is one")
}

/// Virtual grids of chapters 4 and 5.
fn thesis_figures() -> Vec<Scenario> {
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
fn thesis_tables() -> Vec<Scenario> {
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
fn thesis_tracking() -> Vec<Scenario> {
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

/// One still each for what makes reading a net hard.
fn conditions() -> Vec<Scenario> {
    let mut list = vec![
        Scenario::default(),
        named(
            "ordinary",
            "An ordinary light net in ordinary water, 1.2 m, turned both ways",
            ordinary(tilted(1.2, 12.0, -18.0, 5.0)),
        ),
    ];
    let mut add = |name: &str, description: &str, pose: NetPose, change: &dyn Fn(&mut Scene)| {
        let mut scene = ordinary(pose);
        change(&mut scene);
        list.push(named(name, description, scene));
    };
    add("dark", "A dark net on bright water", tilted(1.0, -10.0, 15.0, -8.0), &|s| {
        s.layers[0].net.twine.grey = 25.0;
        s.water.veil_grey = 150.0;
    });
    add("close", "0.4 m: a few large meshes", tilted(0.4, 8.0, 10.0, 4.0), &|_| {});
    add("far", "5 m in clear water: meshes of 6 px", tilted(5.0, 5.0, 10.0, 0.0), &|s| {
        s.water.attenuation_per_m = Water::attenuation_of_visibility(25.0);
    });
    add("oblique", "60 degrees: near meshes six times the far ones", tilted(1.4, 10.0, 58.0, -12.0), &|_| {});
    add("turbid", "Visibility of 2 m", tilted(1.1, -8.0, 12.0, 3.0), &|s| {
        s.water.attenuation_per_m = Water::attenuation_of_visibility(2.0);
        s.sensor.defocus_px = 0.9;
        s.snow.density_per_m3 = 250.0;
    });
    add("lowlight", "Little light: noise as strong as the twine", tilted(1.2, 10.0, -10.0, 0.0), &|s| {
        s.sensor = Sensor { gain: 0.2, full_well_e: 1200.0, read_noise_grey: 5.0, ..s.sensor };
    });
    add("bright", "Overexposed towards the surface", tilted(1.2, 25.0, 0.0, 0.0), &|s| {
        s.water = Water { veil_grey: 215.0, gradient_grey: 130.0, ..s.water };
        s.layers[0].net.twine.grey = 90.0;
    });
    add("lamp", "At night by the vehicle's own lamps, with their glow", tilted(1.1, 0.0, 15.0, 0.0), &|s| {
        s.water = Water { veil_grey: 18.0, glow_grey: 55.0, gradient_grey: 0.0, ..s.water };
        s.light = Light { lamp: 0.95, lamp_beam_deg: 22.0, ..s.light };
    });
    add(
        "caustics",
        "Near the surface: moving light on the net and shafts in the water",
        tilted(1.0, 15.0, 5.0, 2.0),
        &|s| {
            s.light.caustic = 0.35;
            s.water.rays_grey = 9.0;
        },
    );
    add("snow", "Dense marine snow, some of it close to the lens", tilted(1.3, 5.0, -12.0, 0.0), &|s| {
        s.snow = Snow { density_per_m3: 900.0, size_m: 0.0018, ..s.snow };
    });
    add("fish", "Salmon in front of the net and behind it", tilted(1.3, 5.0, 10.0, 0.0), &|s| {
        s.objects = vec![
            salmon(0.7, -0.12, 0.05, 12.0, 1),
            salmon(0.95, 0.35, -0.2, 168.0, 2),
            salmon(1.9, -0.5, 0.45, -8.0, 3),
            salmon(2.3, 0.9, 0.3, 5.0, 4),
        ];
    });
    add("crowd", "Half of the view hidden by salmon", tilted(1.5, 5.0, -14.0, 0.0), &|s| {
        s.objects = (0..16u8)
            .map(|k| {
                let (column, row) = (f64::from(k % 4) - 1.5, f64::from(k / 4) - 1.5);
                let drift = 0.05 * (f64::from(k) * 2.4).sin();
                salmon(
                    0.8 + 0.03 * f64::from(k % 5),
                    0.29 * column + drift,
                    0.155 * row,
                    14.0 * drift * 20.0,
                    20 + u64::from(k),
                )
            })
            .collect();
    });
    add("growth", "Weed and mussels in patches", tilted(1.1, 10.0, 8.0, 3.0), &|s| {
        s.layers[0].net.growth = Growth { density: 0.3, size_m: 0.018, ..Growth::default() };
    });
    add("holes", "Three torn places and a few single breaks", tilted(1.2, 6.0, -10.0, 2.0), &|s| {
        s.layers[0].net.broken = 0.004;
        s.layers[0].net.holes = vec![
            Hole { i: -5.5, j: -1.5, radius_i: 1.6, radius_j: 1.6 },
            Hole { i: 4.0, j: 2.5, radius_i: 0.9, radius_j: 2.6 },
            Hole { i: 6.5, j: -3.5, radius_i: 0.7, radius_j: 0.7 },
        ];
    });
    add("double", "A second net half a metre behind the first", tilted(1.0, 5.0, 8.0, 2.0), &|s| {
        let mut back = s.layers[0].clone();
        back.pose = tilted(1.5, 2.0, -6.0, -5.0);
        back.net.seed = 9;
        s.layers.push(back);
    });
    add("knots", "A coarse dark net with tied knots and slack twine", tilted(0.9, 10.0, 12.0, 45.0), &|s| {
        s.layers[0].net = Net { side1_m: 0.06, side2_m: 0.06, jitter: 0.03, slack: 0.025, ..s.layers[0].net.clone() };
        s.layers[0].net.twine = Twine { diameter_m: 0.003, knot: 2.4, grey: 35.0, ..s.layers[0].net.twine };
    });
    add("edge", "The net ends within the view", tilted(1.6, 0.0, 18.0, 3.0), &|s| {
        s.layers[0].net.extent = Extent::Cells { i: [-5, 60], j: [-60, 6] };
    });
    add("blur", "A moving camera: 10 px of motion blur", tilted(1.2, 0.0, 10.0, 0.0), &|s| {
        s.sensor.exposure_s = 0.03;
        s.motion.linear_m_per_s = [0.6, 0.15, 0.0];
    });
    add("defocus", "Out of focus by 2 px", tilted(1.0, 8.0, 8.0, 0.0), &|s| s.sensor.defocus_px = 2.0);
    add("jpeg", "Compressed to quality 20", tilted(1.2, 6.0, -9.0, 2.0), &|s| s.sensor.jpeg_quality = Some(20));
    let mut rectangle = named("rectangle", "Meshes of 60 x 40 mm", ordinary(tilted(1.2, 10.0, 10.0, 10.0)));
    rectangle.scene.layers[0].net.side1_m = 0.06;
    rectangle.scene.layers[0].net.side2_m = 0.04;
    rectangle.mesh = "60x40mm".to_owned();
    let mut diamond =
        named("diamond", "Diamond meshes of 50 mm at 70 degrees", ordinary(tilted(1.1, -10.0, 10.0, 35.0)));
    diamond.scene.layers[0].net.angle_deg = 70.0;
    diamond.mesh = "50x50mm@70deg".to_owned();
    let mut fine = named("fine", "Fine meshes of 15 mm", ordinary(tilted(0.6, 10.0, -8.0, 4.0)));
    fine.scene.layers[0].net = Net { side1_m: 0.015, side2_m: 0.015, ..fine.scene.layers[0].net.clone() };
    fine.scene.layers[0].net.twine.diameter_m = 0.0012;
    fine.mesh = "15mm".to_owned();
    let mut barrel =
        named("barrel", "A wide lens with strong barrel distortion", ordinary(tilted(0.8, 8.0, 12.0, 3.0)));
    barrel.camera = CameraModel {
        fx: 470.0,
        fy: 470.0,
        distortion_model: "plumb_bob".to_owned(),
        distortion_coefficients: vec![-0.28, 0.09, 0.0008, -0.0005, -0.012],
        ..CameraModel::default()
    };
    let mut fisheye = named("fisheye", "A fisheye lens", ordinary(tilted(0.7, 8.0, -10.0, 3.0)));
    fisheye.camera = CameraModel {
        fx: 330.0,
        fy: 330.0,
        distortion_model: "equidistant".to_owned(),
        distortion_coefficients: vec![-0.02, 0.004, -0.002, 0.0004],
        ..CameraModel::default()
    };
    list.extend([rectangle, diamond, fine, barrel, fisheye]);
    list
}

/// Nets as they hang: sheared and bent, sides keeping their length.
fn hung() -> Vec<Scenario> {
    let belly = Surface {
        waves: vec![Wave { amplitude_m: 0.03, length_m: 1.6, direction_deg: 70.0, phase_deg: 60.0 }],
        ..Surface::default()
    };
    let mut list = Vec::new();
    let mut add = |name: &str, description: &str, pose: NetPose, change: &dyn Fn(&mut Net)| {
        let mut scene = ordinary(pose);
        change(&mut scene.layers[0].net);
        list.push(named(name, description, scene));
    };
    add("sheared", "A square mesh under load: crossing at 78 degrees, flat", tilted(0.9, 10.0, 12.0, 20.0), &|n| {
        n.shear_deg = -12.0
    });
    add("hung", "As nets hang: crossing at 80 degrees, bent with a radius of 2 m", tilted(0.8, 6.0, 10.0, 6.0), &|n| {
        n.shear_deg = -10.0;
        n.surface = Surface { curvature_per_m: [-0.5, 0.1, 0.2], thread_bend_per_m: [0.08, -0.1], ..belly.clone() };
    });
    add("bent", "Strongly bent: radii of 0.9 m and 2 m, of opposite sign", tilted(1.2, 0.0, 15.0, -10.0), &|n| {
        n.surface = Surface {
            curvature_per_m: [1.1, 0.0, -0.5],
            cubic_per_m2: [0.3, 0.0, -0.2, 0.1],
            reach_m: 1.5,
            ..Surface::default()
        };
    });
    add("waves", "A net in waves of 4 cm", tilted(1.4, 10.0, 20.0, 0.0), &|n| {
        let wave =
            |amplitude_m, length_m, direction_deg, phase_deg| Wave { amplitude_m, length_m, direction_deg, phase_deg };
        n.surface.waves = vec![wave(0.04, 1.5, 15.0, 40.0), wave(0.025, 0.9, 100.0, 10.0)];
    });
    list
}

/// Sequences along smooth paths.
fn sequences() -> Vec<Scenario> {
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

/// Pictures without a net of the mesh that is asked for.
fn negatives() -> Vec<Scenario> {
    let water = || {
        let mut scene = ordinary(NetPose::default());
        scene.layers.clear();
        scene
    };
    let mut list = Vec::new();
    let mut add = |name: &str, description: &str, change: &dyn Fn(&mut Scene)| {
        let mut scene = water();
        change(&mut scene);
        list.push(named(name, description, scene));
    };
    add("no-water", "No net: open water with shafts of light and snow", &|s| {
        s.water = Water { rays_grey: 14.0, mottle_grey: 9.0, ..s.water };
        s.snow.density_per_m3 = 300.0;
    });
    add("no-fish", "No net: salmon", &|s| {
        s.objects =
            vec![salmon(0.9, -0.2, 0.0, 8.0, 1), salmon(1.3, 0.5, -0.3, 175.0, 2), salmon(1.6, -0.6, 0.4, 0.0, 3)];
    });
    add("no-ropes", "No net: mooring ropes and cables", &|s| {
        let rope = |x_m: f64, y_m: f64, turn_deg: f64, width_m: f64, grey: f64, kind: Kind| Object {
            kind,
            range_m: 1.1,
            x_m,
            y_m,
            turn_deg,
            length_m: 5.0,
            width_m,
            grey,
            contrast: 0.7,
            ..Object::default()
        };
        s.objects = vec![
            rope(-0.3, 0.0, 82.0, 0.04, 150.0, Kind::Rope),
            rope(0.25, 0.0, 97.0, 0.028, 170.0, Kind::Rope),
            rope(0.0, 0.2, 12.0, 0.02, 40.0, Kind::Rod),
            rope(0.45, 0.0, 70.0, 0.012, 50.0, Kind::Rod),
        ];
    });
    add("no-ladder", "No net: a ladder", &|s| {
        let ladder = |x_m: f64, turn_deg: f64| Object {
            kind: Kind::Ladder,
            range_m: 1.2,
            x_m,
            turn_deg,
            length_m: 4.0,
            width_m: 0.3,
            grey: 175.0,
            ..Object::default()
        };
        s.objects = vec![ladder(0.05, 86.0)];
    });
    add("no-kelp", "No net: kelp", &|s| {
        s.objects = (0..12u8)
            .map(|k| Object {
                kind: Kind::Kelp,
                range_m: 0.9 + 0.12 * f64::from(k % 5),
                x_m: -0.75 + 0.135 * f64::from(k),
                turn_deg: 88.0 + 5.0 * (f64::from(k) * 1.7).sin(),
                length_m: 2.4,
                width_m: 0.035 + 0.008 * f64::from(k % 4),
                grey: 45.0 + 6.0 * f64::from(k % 3),
                seed: u64::from(k),
                ..Object::default()
            })
            .collect();
    });
    let textures = [
        (Texture::Seabed, "no-seabed", "No net: the seabed", 0.08),
        (Texture::Noise, "no-noise", "No net: grainy noise", 0.03),
        (Texture::Band, "no-band", "No net: noise of one wavelength, a ring in the spectrum", 0.05),
        (Texture::Stripes, "no-stripes", "No net: bars of one direction", 0.05),
        (Texture::Bricks, "no-bricks", "No net: bricks in running bond", 0.065),
        (Texture::Scales, "no-scales", "No net: overlapping scales", 0.06),
        (Texture::Cells, "no-cells", "No net: cells of random shape", 0.05),
        (Texture::Hexagons, "no-hexagons", "No net of this mesh: six-sided meshes", 0.05),
        (Texture::Sticks, "no-sticks", "No net: straight lines of all directions", 0.05),
        (Texture::LatticeNoise, "no-lattice-noise", "No net: noise with a net's spectrum, phases wandering", 0.05),
        (Texture::RandomGrid, "no-random-grid", "No net: two families of twine at random spacings", 0.05),
    ];
    for (texture, name, description, scale_m) in textures {
        add(name, description, &|s| {
            let pose = tilted(1.2, if texture == Texture::Seabed { -35.0 } else { 12.0 }, 14.0, 5.0);
            s.backdrop = Some(Backdrop { texture, pose, scale_m, grey: 110.0, contrast_grey: 32.0, seed: 1 });
        });
    }
    list
}
