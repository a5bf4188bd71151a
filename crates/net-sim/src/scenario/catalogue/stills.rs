//! What makes reading a net hard, one thing at a time.

use super::{CameraModel, Scenario, named, ordinary, salmon, tilted};
use crate::scene::{Extent, Growth, Hole, Light, Net, NetPose, Scene, Sensor, Snow, Surface, Twine, Water, Wave};

/// One still each for what makes reading a net hard.
pub(super) fn conditions() -> Vec<Scenario> {
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
    add("edge", "The net ends within the view", tilted(1.6, 0.0, 18.0, 3.0), &|s| {
        s.layers[0].net.extent = Extent::Cells { i: [-5, 60], j: [-60, 6] };
    });
    add("blur", "A moving camera: 10 px of motion blur", tilted(1.2, 0.0, 10.0, 0.0), &|s| {
        s.sensor.exposure_s = 0.03;
        s.motion.linear_m_per_s = [0.6, 0.15, 0.0];
    });
    add("defocus", "Out of focus by 2 px", tilted(1.0, 8.0, 8.0, 0.0), &|s| s.sensor.defocus_px = 2.0);
    add("jpeg", "Compressed to quality 20", tilted(1.2, 6.0, -9.0, 2.0), &|s| s.sensor.jpeg_quality = Some(20));
    let mut knots =
        named("knots", "A coarse dark net with tied knots and slack twine", ordinary(tilted(0.9, 10.0, 12.0, 45.0)));
    let net = &mut knots.scene.layers[0].net;
    *net = Net { side1_m: 0.06, side2_m: 0.06, jitter: 0.03, slack: 0.025, ..net.clone() };
    net.twine = Twine { diameter_m: 0.003, knot: 2.4, grey: 35.0, ..net.twine };
    knots.mesh = "60mm".to_owned();
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
    list.extend([knots, rectangle, diamond, fine, barrel, fisheye]);
    list
}

/// Nets as they hang: sheared and bent, sides keeping their length.
pub(super) fn hung() -> Vec<Scenario> {
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
