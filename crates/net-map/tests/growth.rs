//! Growth on simulated nets against what the simulator drew, and none on clean ones.

mod support;

use std::collections::BTreeMap;

use net_geometry::nalgebra::Vector2;
use net_junction::{AdjustConfig, ExpectedNet, NetAdjuster};
use net_map::{Config, Frame, Mapper};
use net_sim::{Growth, Image, Light, Scenario, Sensor, Simulator, Twine, Water};

/// A mesh of which something is said.
struct Mesh {
    share: f32,
    /// Share of the mesh that growth, and twine as far as it is wider than an eighth of it, covers in truth.
    truth: f32,
    rim: bool,
}

struct Run {
    seen: usize,
    /// With a best view.
    unhidden: usize,
    meshes: Vec<Mesh>,
    /// Shares of a clean mesh, measured and true.
    clean: (f32, f32),
}

impl Run {
    fn excess(&self, mesh: &Mesh) -> f32 {
        mesh.share - self.clean.0
    }

    fn true_excess(&self, mesh: &Mesh) -> f32 {
        mesh.truth - self.clean.1
    }

    /// Parts of the inner and of the rim's meshes that seem overgrown.
    fn overgrown(&self) -> [f32; 2] {
        [false, true].map(|rim| {
            let all = self.meshes.iter().filter(|m| m.rim == rim);
            all.clone().filter(|m| self.excess(m) > 0.1).count() as f32 / all.count().max(1) as f32
        })
    }

    /// Of the truly overgrown meshes, how many seem so; and of those that seem so for sure, how many are; and the correlation.
    fn growth(&self) -> ([usize; 2], [usize; 2], f32) {
        let pairs: Vec<(f32, f32)> = self.meshes.iter().map(|m| (self.excess(m), self.true_excess(m))).collect();
        let count = |f: &dyn Fn(&(f32, f32)) -> bool| pairs.iter().filter(|p| f(p)).count();
        let found = [count(&|p| p.1 > 0.1 && p.0 > 0.05), count(&|p| p.1 > 0.1)];
        let right = [count(&|p| p.0 > 0.1 && p.1 > 0.05), count(&|p| p.0 > 0.1)];
        (found, right, correlation(&pairs))
    }
}

/// Maps some frames of a scenario, by the true places of its knots.
fn run(scenario: &Scenario, frames: &[u32]) -> Run {
    let camera = scenario.camera().expect("a camera");
    let (width, height) = (camera.width(), camera.height());
    let mesh = scenario.mesh().expect("a mesh");
    let mut simulator = Simulator::new(camera);
    let mut adjuster = NetAdjuster::new(width as usize, height as usize, &AdjustConfig::default()).expect("default");
    let mut mapper = Mapper::new(BTreeMap::new(), &Config::default()).expect("valid");
    let (mut image, mut bare) = (Image::default(), Image::default());
    let mut truths: BTreeMap<(i32, i32), (f32, bool)> = BTreeMap::new();
    for (number, &k) in (0..).zip(frames) {
        let frame = scenario.frame(k).expect("a frame");
        let truth = simulator.render(&frame.scene, frame.seed, &mut image).expect("a scene");
        let nodes: BTreeMap<(i32, i32), (Vector2<f64>, f64)> =
            truth.layers[0].nodes.iter().map(|n| (n.index, (n.pixel, n.depth_m))).collect();
        let pose = frame.scene.layers[0].pose.pose();
        let expected = ExpectedNet { camera, mesh, pose, anchored: true };
        let view = image.view().expect("pixels");
        adjuster.adjust(view, &expected).expect("the size is right");
        let twines = support::looks(adjuster.twines());
        // Bilinear between the knots.
        let pixel = |at: Vector2<f64>| {
            let (i, j) = (at.x.floor() as i32, at.y.floor() as i32);
            let (x, y) = (at.x - f64::from(i), at.y - f64::from(j));
            let near = |di: i32, dj: i32| {
                let share = (if di == 0 { 1.0 - x } else { x }) * (if dj == 0 { 1.0 - y } else { y });
                if share == 0.0 {
                    Some((Vector2::zeros(), 0.0))
                } else {
                    nodes.get(&(i + di, j + dj)).map(|n| (n.0 * share, n.1 * share))
                }
            };
            let all = [near(0, 0)?, near(1, 0)?, near(0, 1)?, near(1, 1)?];
            Some(all.iter().fold((Vector2::zeros(), 0.0), |s, n| (s.0 + n.0, s.1 + n.1)))
        };
        mapper
            .add(&Frame {
                number,
                track: 0,
                image: view,
                view: &pixel,
                axis: Vector2::new(f64::from(number), 0.0),
                twines: &twines,
            })
            .expect("in order");
        // The same net white on black, in clear water, by a perfect camera.
        let mut scene = frame.scene.clone();
        scene.layers.truncate(1);
        scene.objects.clear();
        scene.water = Water {
            veil_grey: 0.0,
            attenuation_per_m: 0.0,
            gradient_grey: 0.0,
            mottle_grey: 0.0,
            rays_grey: 0.0,
            glow_grey: 0.0,
            ..scene.water
        };
        scene.snow.density_per_m3 = 0.0;
        scene.light = Light::default();
        scene.sensor = Sensor {
            psf_px: 0.3,
            defocus_px: 0.0,
            read_noise_grey: 0.0,
            exposure_s: 0.0,
            full_well_e: 1e9,
            ..scene.sensor
        };
        let net = &mut scene.layers[0].net;
        net.twine = Twine { grey: 250.0, variation: 0.0, shading: 0.0, ..net.twine };
        net.growth.grey = 250.0;
        simulator.render(&scene, 0, &mut bare).expect("a scene");
        let bare = bare.view().expect("pixels");
        for &(i, j) in nodes.keys() {
            let mut sum = 0.0;
            let whole = (0..64).all(|s| {
                let at = Vector2::new(
                    f64::from(i) + (f64::from(s % 8) + 0.5) / 8.0,
                    f64::from(j) + (f64::from(s / 8) + 0.5) / 8.0,
                );
                pixel(at).and_then(|(p, _)| net_image::bilinear(bare, p.x, p.y)).is_some_and(|g| {
                    sum += (g / 250.0).min(1.0) / 64.0;
                    true
                })
            });
            if whole {
                let (p, _) = pixel(Vector2::new(f64::from(i) + 0.5, f64::from(j) + 0.5)).expect("inside");
                let rim = p.x < 60.0 || p.y < 60.0 || p.x > f64::from(width) - 60.0 || p.y > f64::from(height) - 60.0;
                truths.entry((i, j)).and_modify(|t| t.1 &= rim).or_insert((sum, rim));
            }
        }
    }
    let keys: Vec<_> = mapper.keys().iter().copied().collect();
    let (mut seen, mut unhidden, mut meshes) = (0, 0, Vec::new());
    for key in keys {
        let tile = mapper.tile(key).expect("in memory");
        for (place, cell) in tile.cells.iter().enumerate().filter(|(_, c)| c.frames > 0) {
            seen += 1;
            unhidden += usize::from(cell.best_px > 0.0);
            if let (Some(share), Some(&(truth, rim))) = (cell.blocked_share(), truths.get(&key.cell(place))) {
                meshes.push(Mesh { share, truth, rim });
            }
        }
    }
    let tenth = |of: fn(&Mesh) -> f32| {
        let mut values: Vec<f32> = meshes.iter().map(of).collect();
        values.sort_by(f32::total_cmp);
        values.get(values.len() / 10).copied().unwrap_or(0.0)
    };
    let clean = (tenth(|m| m.share), tenth(|m| m.truth));
    Run { seen, unhidden, meshes, clean }
}

fn correlation(pairs: &[(f32, f32)]) -> f32 {
    let n = pairs.len() as f32;
    let mean = pairs.iter().fold((0.0, 0.0), |s, p| (s.0 + p.0 / n, s.1 + p.1 / n));
    let sums = pairs.iter().fold((0.0, 0.0, 0.0), |s, p| {
        let (a, b) = (p.0 - mean.0, p.1 - mean.1);
        (s.0 + a * a, s.1 + b * b, s.2 + a * b)
    });
    sums.2 / (sums.0 * sums.1).sqrt()
}

/// A scenario's first net alone, another draw of it, with growth of this density on it.
fn scenario(name: &str, growth: f64) -> Scenario {
    let mut scenario = Scenario::by_name(name).expect("known");
    scenario.scene.layers.truncate(1);
    let net = &mut scenario.scene.layers[0].net;
    net.growth = Growth { density: growth, size_m: 0.018, ..net.growth };
    for seed in [&mut net.seed, &mut scenario.scene.seed, &mut scenario.seed] {
        *seed += 500;
    }
    scenario
}

#[test]
fn a_clean_net_is_clean_in_murky_and_in_uneven_light() {
    let mut graded = scenario("ordinary", 0.0);
    (graded.scene.light.gradient, graded.scene.light.vignette, graded.scene.water.gradient_grey) = (0.7, 0.6, 110.0);
    let cases = [
        ("graded light", graded, &[0][..], 0.95),
        ("ordinary", scenario("ordinary", 0.0), &[0], 0.95),
        ("strafe", scenario("strafe", 0.0), &[0, 20, 40, 60, 80], 0.95),
        ("inspect, no net behind", scenario("inspect", 0.0), &[0, 20, 40, 60, 80], 0.5),
        // Here twine is no stronger than noise, or lit unevenly, and growth is not judged.
        ("turbid", scenario("turbid", 0.0), &[0], 0.0),
        ("low light", scenario("lowlight", 0.0), &[0], 0.0),
        ("caustics", scenario("caustics", 0.0), &[0], 0.0),
    ];
    for (name, scenario, frames, least) in cases {
        let run = run(&scenario, frames);
        let [inner, rim] = run.overgrown();
        println!("{name}: {} of {} told, overgrown: inner {inner:.3}, rim {rim:.3}", run.meshes.len(), run.seen);
        assert!(run.meshes.len() as f32 >= least * run.seen as f32, "{name}");
        assert!(run.unhidden as f32 >= 0.9 * run.seen as f32, "{name}: coverage is known where growth is not");
        let wrong = run.meshes.iter().filter(|m| run.excess(m) > 0.1).count();
        assert!(wrong as f32 <= 0.02 * run.seen as f32, "{name}: {wrong} of {}", run.seen);
    }
}

#[test]
fn growth_is_found_where_it_is() {
    let cases = [
        ("growth", scenario("growth", 0.3), &[0][..], 0.8),
        ("much growth", scenario("growth", 0.9), &[0], 0.8),
        ("dark net", scenario("dark", 0.3), &[0], 0.8),
        ("approach", scenario("approach", 0.2), &[0, 30, 50, 70, 85], 0.7),
        // Where growth itself makes it stand out.
        ("turbid", scenario("turbid", 0.9), &[0], 0.7),
    ];
    for (name, scenario, frames, least) in cases {
        let run = run(&scenario, frames);
        let (found, right, correlation) = run.growth();
        println!(
            "{name}: {} of {} told, found {found:?}, right {right:?}, correlation {correlation:.2}",
            run.meshes.len(),
            run.seen
        );
        assert!(found[1] > 20 && found[0] as f32 >= 0.85 * found[1] as f32, "{name}: found {found:?}");
        assert!(right[0] as f32 >= 0.95 * right[1] as f32, "{name}: right {right:?}");
        assert!(correlation > least, "{name}: correlation {correlation}");
    }
}
