//! The kinds of simulated pictures.

use net_sim::{
    Extent, Growth, Hole, Kind, Layer, Light, Net, NetPose, Object, Scenario, Scene, Sensor, Snow, Study, Twine, Water,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The thesis's grid, of which there is one.
pub const GRID: &str = "the thesis's 30 x 50 grid";

type Make = fn(u64) -> Scenario;

/// A name for each kind, and how to make its scene of a seed.
pub const KINDS: &[(&str, Make)] = &[
    ("flat, dark", |s| make(s, 0.0, |_, _| {})),
    ("flat, white", |s| make(s, 1.0, |_, _| {})),
    ("faint, white", |s| make(s, 1.0, fade)),
    ("faint, white, torn", |s| {
        make(s, 1.0, |draw, scene| {
            fade(draw, scene);
            tear(draw, scene);
        })
    }),
    ("turbid", |s| make(s, 0.5, turbid)),
    ("low light", |s| {
        make(s, 0.5, |_, scene| {
            scene.sensor = Sensor { gain: 0.25, full_well_e: 1200.0, read_noise_grey: 3.0, ..scene.sensor };
        })
    }),
    ("noise", |s| make(s, 0.5, |draw, scene| scene.sensor.read_noise_grey = draw.between(6.0, 12.0))),
    ("snow", |s| make(s, 0.5, |_, scene| scene.snow = Snow { density_per_m3: 900.0, size_m: 0.0018, ..scene.snow })),
    ("fish", |s| make(s, 0.5, fish)),
    ("overgrown", |s| make(s, 0.5, overgrow)),
    ("overgrown, torn", |s| {
        make(s, 0.5, |draw, scene| {
            overgrow(draw, scene);
            tear(draw, scene);
        })
    }),
    ("hung, bent", |s| make(s, 0.5, bend)),
    ("motion blur of 8 px", |s| make(s, 0.5, motion)),
    (GRID, |_| Scenario::by_name("fig-5.6").unwrap_or_default()),
    ("net's end", |s| make(s, 0.5, end)),
    ("water alone", |s| {
        make(s, 0.5, |draw, scene| {
            scene.sensor.read_noise_grey = draw.between(6.0, 12.0);
            scene.layers[0].net.twine.diameter_m = 1e-5;
        })
    }),
    ("holes, flat", |s| make(s, 0.5, tear)),
    ("holes, bent", |s| {
        make(s, 0.5, |draw, scene| {
            bend(draw, scene);
            tear(draw, scene);
        })
    }),
];

struct Draw(ChaCha8Rng, u64);

impl Draw {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    fn logarithmic(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }
}

/// A net with cells of 10 to 30 px in ordinary water: knots, jitter, slack, haze, shading, shot noise; white with a probability of `white`.
fn make(seed: u64, white: f64, change: impl Fn(&mut Draw, &mut Scene)) -> Scenario {
    let mut draw = Draw(ChaCha8Rng::seed_from_u64(seed), seed);
    let pose = NetPose {
        range_m: 600.0 * 0.05 / draw.logarithmic(10.0, 30.0),
        tilt_x_deg: draw.between(-25.0, 25.0),
        tilt_y_deg: draw.between(-30.0, 30.0),
        roll_deg: draw.between(-180.0, 180.0),
        x_m: draw.between(-0.025, 0.025),
        y_m: draw.between(-0.025, 0.025),
    };
    let white = draw.between(0.0, 1.0) < white;
    let twine = Twine {
        diameter_m: draw.between(0.0015, 0.003),
        knot: draw.between(1.0, 2.4),
        variation: 0.06,
        shading: 0.35,
        grey: if white { 200.0 } else { 25.0 },
    };
    let net = Net { twine, jitter: draw.between(0.005, 0.02), slack: 0.008, seed, ..Net::default() };
    let veil_grey = if white { draw.between(60.0, 110.0) } else { draw.between(110.0, 150.0) };
    let mut scene = Scene {
        layers: vec![Layer { net, pose }],
        water: Water {
            veil_grey,
            attenuation_per_m: Water::attenuation_of_visibility(10.0),
            gradient_grey: 45.0,
            mottle_grey: 4.0,
            mottle_px: 160.0,
            ..Water::default()
        },
        light: Light { gradient: 0.15, vignette: 0.2, ..Light::default() },
        snow: Snow { density_per_m3: 40.0, ..Snow::default() },
        sensor: Sensor { full_well_e: 9000.0, read_noise_grey: 1.0, ..Sensor::default() },
        seed,
        ..Scene::empty()
    };
    change(&mut draw, &mut scene);
    Scenario { seed, scene, ..Scenario::default() }
}

/// Light twine of uneven brightness before water that is brighter towards the light, there nearly as bright as the twine.
fn fade(draw: &mut Draw, scene: &mut Scene) {
    let twine = &mut scene.layers[0].net.twine;
    twine.grey = draw.between(110.0, 150.0);
    twine.variation = draw.between(0.08, 0.2);
    let brightest = twine.grey * draw.between(0.5, 0.95);
    scene.water.gradient_grey = draw.between(30.0, 70.0);
    scene.water.veil_grey = brightest - 0.5 * scene.water.gradient_grey;
    scene.water.attenuation_per_m = Water::attenuation_of_visibility(draw.between(5.0, 10.0));
    scene.light.from_deg = draw.between(-180.0, 0.0);
}

fn turbid(draw: &mut Draw, scene: &mut Scene) {
    scene.water.attenuation_per_m = Water::attenuation_of_visibility(draw.between(2.0, 3.0));
    scene.sensor.defocus_px = 0.9;
    scene.snow.density_per_m3 = 250.0;
    for layer in &mut scene.layers {
        layer.pose.range_m = draw.between(1.0, 1.6);
    }
}

fn fish(draw: &mut Draw, scene: &mut Scene) {
    let range_m = scene.layers[0].pose.range_m;
    for k in 0..6 {
        let range_m = range_m * draw.between(0.5, 0.85);
        scene.objects.push(Object {
            kind: Kind::Fish,
            range_m,
            x_m: range_m * draw.between(-0.7, 0.7),
            y_m: range_m * draw.between(-0.4, 0.4),
            turn_deg: draw.between(-180.0, 180.0),
            length_m: range_m * draw.between(0.2, 0.4),
            width_m: range_m * draw.between(0.05, 0.1),
            grey: draw.between(30.0, 120.0),
            contrast: draw.between(0.3, 0.7),
            seed: draw.1 * 100 + k,
            ..Object::default()
        });
    }
}

/// Tufts on a twentieth to a third of the twines.
fn overgrow(draw: &mut Draw, scene: &mut Scene) {
    let net = &mut scene.layers[0].net;
    net.growth =
        Growth { density: draw.logarithmic(0.05, 0.35), size_m: draw.between(0.008, 0.02), ..Growth::default() };
}

/// As nets hang: the sheet, mesh and place of the study of hung nets.
fn bend(draw: &mut Draw, scene: &mut Scene) {
    let drawn = Study::hung(draw.1).scene.layers.remove(0);
    let net = &mut scene.layers[0].net;
    *net =
        Net { side1_m: drawn.net.side1_m, side2_m: drawn.net.side2_m, shear_deg: drawn.net.shear_deg, ..net.clone() };
    net.surface = drawn.net.surface;
    net.twine.diameter_m = drawn.net.twine.diameter_m;
    scene.layers[0].pose = drawn.pose;
}

fn motion(draw: &mut Draw, scene: &mut Scene) {
    let way: f64 = draw.between(0.0, std::f64::consts::TAU);
    scene.sensor.exposure_s = 0.02;
    let speed = 8.0 * scene.layers[0].pose.range_m / (600.0 * scene.sensor.exposure_s);
    scene.motion.linear_m_per_s = [speed * way.cos(), speed * way.sin(), 0.0];
}

fn end(draw: &mut Draw, scene: &mut Scene) {
    let reach = 0.6 * scene.layers[0].pose.range_m / 0.05;
    let mut last = || draw.between(3.0, reach) as i32;
    scene.layers[0].net.extent = Extent::Cells { i: [-last(), 60], j: [-60, last()] };
}

/// A net torn in one to three places, and single twines broken.
fn tear(draw: &mut Draw, scene: &mut Scene) {
    let range_m = scene.layers[0].pose.range_m;
    let net = &mut scene.layers[0].net;
    net.broken = 0.004;
    let reach = 0.5 * range_m / net.side1_m;
    for _ in 0..1 + draw.1 % 3 {
        net.holes.push(Hole {
            i: draw.between(-reach, reach),
            j: draw.between(-0.6 * reach, 0.6 * reach),
            radius_i: draw.between(0.6, 2.0),
            radius_j: draw.between(0.6, 2.0),
        });
    }
}
