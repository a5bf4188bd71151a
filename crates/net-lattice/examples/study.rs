//! Errors on random scenes from the simulator, whether the covariance knows them, and what is claimed where there is no net.
//!
//!     cargo run --release -p net-lattice --example study -- [SCENES] [SEED] [flat|bent|none] [JITTER]
//!
//! `flat`: square nets, 0.3 to 6 m, tilted up to 60 degrees, contrast over noise 0.5 to 6. `bent`: the same sheared and bent without
//! stretch. `none`: every texture and object of the simulator that is no net. JITTER: knots off their places, share of a side.

// Scenes will have more fields than are set here.
#![allow(clippy::needless_update)]

use net_geometry::nalgebra::{Rotation3, Vector2, Vector3, Vector6};
use net_geometry::{Camera, Lens, Mesh};
use net_image::Image;
use net_lattice::{Config, LatticeEstimator};
use net_sim::{Backdrop, Kind, Layer, NetPose, Object, Scene, Sensor, Simulator, Surface, Texture, Twine, Water};

struct Stream(u64);
impl Stream {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
    fn within(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.next()
    }
}

fn quantile(values: &mut [f64], q: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(((values.len().max(1) - 1) as f64 * q).round() as usize).copied().unwrap_or(f64::NAN)
}

fn main() {
    let arg = |k: usize, default: u64| std::env::args().nth(k).and_then(|a| a.parse().ok()).unwrap_or(default);
    let (count, seed) = (arg(1, 50), arg(2, 1));
    let mode = std::env::args().nth(3).unwrap_or_else(|| "flat".into());
    let jitter = std::env::args().nth(4).and_then(|a| a.parse().ok()).unwrap_or(0.0);
    if mode == "none" {
        return negatives(count, seed);
    }
    let camera = Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None).expect("fixed and sound");
    let mesh = Mesh::square(0.05).expect("fixed and sound");
    let config = Config::default();
    let mut estimator = LatticeEstimator::new(&camera, &mesh, &config).expect("defaults are valid");
    let mut simulator = Simulator::new(camera);
    let mut random = Stream(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let mut image = Image::default();
    let (mut range, mut normal, mut xy, mut nees, mut crossing) = (vec![], vec![], vec![], vec![], vec![]);
    let (mut refused, mut wrong) = (0, 0);
    for k in 0..count {
        for _ in 0..3 {
            random.next();
        }
        let depth = (random.within(0.3f64.ln(), 6f64.ln())).exp();
        let tilt = random.within(0.0, 60.0);
        let azimuth = random.within(0.0, std::f64::consts::TAU);
        let contrast = if random.next() < 0.5 { 60.0 } else { -60.0 };
        let snr = (random.within(0.5f64.ln(), 6f64.ln())).exp();
        let pose = NetPose {
            range_m: depth,
            tilt_x_deg: tilt * azimuth.cos(),
            tilt_y_deg: tilt * azimuth.sin(),
            roll_deg: random.within(-44.0, 44.0),
            x_m: random.within(-0.025, 0.025),
            y_m: random.within(-0.025, 0.025),
        };
        let mut layer = Layer::planar(&mesh, pose);
        layer.net.twine =
            Twine { diameter_m: random.within(0.0015, 0.003), grey: 110.0 + contrast, ..Twine::default() };
        layer.net.jitter = jitter;
        layer.net.seed = seed * 10_000 + k;
        if mode == "bent" {
            // Standard deviations of a random sheet of 22 mm over 0.36 m, as pens show it.
            let mut g = |sd: f64| sd * ((0..12).map(|_| random.next()).sum::<f64>() - 6.0);
            layer.net.shear_deg = g(7.0).clamp(-18.0, 18.0);
            layer.net.surface = Surface {
                curvature_per_m: [g(0.3), g(0.17), g(0.3)],
                cubic_per_m2: [g(0.15), g(0.25), g(0.25), g(0.15)],
                quartic_per_m3: [g(0.1), g(0.2), g(0.3), g(0.2), g(0.1)],
                thread_bend_per_m: [g(0.1), g(0.1)],
                reach_m: 1.5,
                ..Surface::default()
            };
        }
        let scene = Scene {
            layers: vec![layer],
            water: Water { veil_grey: 110.0, ..Water::default() },
            sensor: Sensor { psf_px: 0.7, read_noise_grey: contrast.abs() / snr, ..Sensor::default() },
            ..Scene::empty()
        };
        let truth = match simulator.render(&scene, seed * 10_000 + k, &mut image) {
            Ok(t) => t.layers[0].clone(),
            Err(error) => {
                eprintln!("{error}");
                continue;
            }
        };
        let Some(view) = image.view() else { continue };
        let name = format!("{k:4} {depth:5.2} m tilt {tilt:4.1} snr {snr:4.2}");
        let found = estimator.estimate(view).ok().flatten();
        let Some(e) = found else {
            println!("{name} nothing");
            refused += 1;
            continue;
        };
        let axis = truth.axis.expect("the axis meets an endless net");
        let dr = 100.0 * (e.range / axis.range_m - 1.0);
        let dn = axis.normal.angle(&e.pose.normal()).to_degrees();
        // Truth in the estimate's labels: of the four quarter turns the nearest, of the nodes the nearest.
        let turn = (0..4)
            .map(|k| {
                truth.pose.rotation
                    * Rotation3::from_axis_angle(&Vector3::z_axis(), f64::from(k) * std::f64::consts::FRAC_PI_2)
            })
            .map(|r| (e.pose.rotation * r.inverse()).scaled_axis())
            .min_by(|a, b| a.norm().total_cmp(&b.norm()))
            .unwrap_or_default();
        let o = truth.pose.inverse_transform(e.pose.translation);
        let node = mesh.node((o.x / mesh.side1()).round(), (o.y / mesh.side2()).round());
        let shift = e.pose.translation - truth.pose.transform(Vector3::new(node.x, node.y, 0.0));
        let ok = e.probability >= config.probability_threshold;
        let bad = dr.abs() > 5.0 || dn > 5.0;
        let d = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
        let n = e.covariance.try_inverse().map_or(f64::NAN, |c| (d.transpose() * c * d)[0] / 6.0);
        println!(
            "{name} p {:.3} range {dr:8.4} % normal {dn:7.4} xy {:.3} mm nees {n:6.2} {:?} sep {:.2} unlike {:.2} bal {:.2} cs {:.1} dis {:.2} V {:.1} {:.1} V2 {:.1} {:.1} z {:.3}{}",
            e.probability,
            1e3 * Vector2::new(o.x - node.x, o.y - node.y).norm(),
            e.model,
            e.evidence.separable,
            e.evidence.unlike,
            e.evidence.balance,
            e.evidence.cell_snr,
            e.evidence.dissent,
            e.evidence.v[0],
            e.evidence.v[1],
            e.evidence.v2[0],
            e.evidence.v2[1],
            e.range,
            match (ok, bad) {
                (true, true) => " WRONG",
                (false, true) => " refused, wrong",
                (false, false) => " refused",
                _ => "",
            }
        );
        if !ok {
            refused += 1;
        } else if bad {
            wrong += 1;
        } else {
            range.push(dr.abs());
            normal.push(dn);
            xy.push(1e3 * Vector2::new(o.x - node.x, o.y - node.y).norm());
            nees.push(n);
            let (a, b) = (e.crossing_angle, axis.crossing_angle);
            crossing.push((a - b).abs().min((std::f64::consts::PI - a - b).abs()).to_degrees());
        }
    }
    println!("{} scenes: right {}, wrong claims {wrong}, refused {refused}", count, range.len());
    for (name, v) in [
        ("range %", &mut range),
        ("normal deg", &mut normal),
        ("xy mm", &mut xy),
        ("crossing deg", &mut crossing),
        ("nees/6", &mut nees),
    ] {
        println!("{name:12} median {:.4}  95th percentile {:.4}", quantile(v, 0.5), quantile(v, 0.95));
    }
}

/// Pictures without a net: how many are claimed to show one, and how sure.
fn negatives(count: u64, seed: u64) {
    let camera = Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None).expect("fixed and sound");
    let mesh = Mesh::square(0.05).expect("fixed and sound");
    let config = Config::default();
    let mut estimator = LatticeEstimator::new(&camera, &mesh, &config).expect("defaults are valid");
    let mut simulator = Simulator::new(camera);
    let mut random = Stream(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let mut image = Image::default();
    let kinds = [Kind::Fish, Kind::Rope, Kind::Ladder, Kind::Kelp, Kind::Rod];
    let (mut alarms, mut worst) = (0, vec![]);
    for k in 0..count {
        let number = k as usize % (Texture::ALL.len() + kinds.len());
        let mut scene = Scene::empty();
        scene.sensor = Sensor { read_noise_grey: random.within(1.0, 8.0), ..Sensor::default() };
        let name = if let Some(texture) = Texture::ALL.get(number) {
            scene.backdrop = Some(Backdrop {
                texture: *texture,
                pose: NetPose {
                    range_m: random.within(0.4, 2.5),
                    tilt_x_deg: random.within(-35.0, 35.0),
                    tilt_y_deg: random.within(-35.0, 35.0),
                    roll_deg: random.within(-44.0, 44.0),
                    ..NetPose::default()
                },
                seed: seed * 1000 + k,
                ..Backdrop::default()
            });
            format!("{texture:?}")
        } else {
            let kind = kinds[number - Texture::ALL.len()];
            for i in 0..4 {
                scene.objects.push(Object {
                    kind,
                    range_m: random.within(0.5, 1.5),
                    x_m: random.within(-0.4, 0.4),
                    y_m: random.within(-0.25, 0.25),
                    turn_deg: random.within(-90.0, 90.0),
                    length_m: if kind == Kind::Fish { 0.45 } else { 2.0 },
                    width_m: random.within(0.02, 0.2),
                    seed: seed * 1000 + 10 * k + i,
                    ..Object::default()
                });
            }
            format!("{kind:?}")
        };
        if let Err(error) = simulator.render(&scene, seed * 10_000 + k, &mut image) {
            eprintln!("{name}: {error}");
            continue;
        }
        let Some(view) = image.view() else { continue };
        let Some(e) = estimator.estimate(view).ok().flatten() else {
            println!("{k:4} {name:14} nothing");
            continue;
        };
        let v = &e.evidence;
        let alarm = e.probability >= config.probability_threshold;
        println!(
            "{k:4} {name:14} p {:.3} sep {:.2} unlike {:.2} bal {:.2} cs {:.1} dis {:.2} V {:.1} {:.1} V2 {:.1} {:.1} good {:.2} near {:.2} n {}/{} z {:.2} {:?} margin {:.2} gain {:.4}{}",
            e.probability,
            v.separable,
            v.unlike,
            v.balance,
            v.cell_snr,
            v.dissent,
            v.v[0],
            v.v[1],
            v.v2[0],
            v.v2[1],
            v.good,
            v.good_near,
            v.tiles,
            v.tiles2,
            e.range,
            e.model,
            e.margin,
            e.gain,
            if alarm { " FALSE ALARM" } else { "" }
        );
        alarms += usize::from(alarm);
        worst.push(e.probability);
    }
    println!(
        "{count} pictures without a net: {alarms} false alarms; highest probability {:.3}, 95th percentile {:.3}",
        quantile(&mut worst.clone(), 1.0),
        quantile(&mut worst, 0.95)
    );
}
