//! Random scenes of the simulator, one line each: what the probability is made of, and whether the answer was right. `cargo run --release -p net-fft --example spectrum_study -- COUNT [SEED]`.
//!
//! The weights of the probability were fitted to these lines (logistic regression); its figures and those of the sigmas in the method's description come from other seeds.

use std::error::Error;

use net_fft::{ThesisConfig, ThesisEstimator};
use net_geometry::{Camera, Lens, Mesh};
use net_image::Image;
use net_sim::{Backdrop, Kind, Layer, NetPose, Object, Scene, Simulator, Texture};

/// Numbers that look random, the same everywhere (SplitMix64).
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
    /// Evenly spread in the logarithm.
    fn scale(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }
    fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }
    fn of(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count - 1)
    }
}

/// Water, sensor and things in front, with or without a net.
fn surroundings(random: &mut Random, scene: &mut Scene) {
    scene.water.veil_grey = random.between(40.0, 150.0);
    scene.water.gradient_grey = random.between(0.0, 60.0);
    scene.sensor.psf_px = random.between(0.5, 1.2);
    scene.sensor.defocus_px = if random.chance(0.4) { random.scale(0.3, 4.0) } else { 0.0 };
    scene.sensor.read_noise_grey = random.scale(0.7, 15.0);
    scene.sensor.jpeg_quality = random.chance(0.4).then_some(70);
    let fish = if random.chance(0.3) { random.of(8) } else { 0 };
    for seed in 0..fish {
        scene.objects.push(Object {
            range_m: random.between(0.3, 1.5),
            x_m: random.between(-0.7, 0.7),
            y_m: random.between(-0.4, 0.4),
            turn_deg: random.between(-60.0, 60.0),
            seed: seed as u64,
            ..Object::default()
        });
    }
}

fn net(random: &mut Random, mesh: &Mesh, range_m: f64) -> Layer {
    let tilt = if random.chance(0.7) { random.between(0.0, 35.0) } else { random.between(0.0, 60.0) };
    let (sin, cos) = random.between(0.0, std::f64::consts::TAU).sin_cos();
    let pose = NetPose {
        range_m,
        tilt_x_deg: tilt * sin,
        tilt_y_deg: tilt * cos,
        roll_deg: if random.chance(0.5) { random.between(-45.0, 45.0) } else { random.between(-8.0, 8.0) },
        x_m: random.between(-0.02, 0.02),
        y_m: random.between(-0.02, 0.02),
    };
    let mut layer = Layer::planar(mesh, pose);
    let net = &mut layer.net;
    if random.chance(0.4) {
        net.shear_deg = random.between(-18.0, 18.0);
    }
    if random.chance(0.4) {
        net.surface.curvature_per_m =
            std::array::from_fn(|k| random.between(-0.3, 0.3) * if k == 1 { 0.5 } else { 1.0 });
    }
    net.jitter = if random.chance(0.5) { random.between(0.0, 0.04) } else { 0.0 };
    net.broken = if random.chance(0.2) { random.between(0.0, 0.1) } else { 0.0 };
    net.twine.diameter_m = mesh.side1() * random.between(0.025, 0.06);
    net.twine.grey = if random.chance(0.5) { random.between(130.0, 230.0) } else { random.between(10.0, 60.0) };
    layer
}

/// A picture that could be taken for a net.
fn decoy(random: &mut Random, scene: &mut Scene, seed: u64) -> String {
    let choice = random.of(Texture::ALL.len() + 6);
    let mut what = String::from("Water");
    if let Some(&texture) = Texture::ALL.get(choice) {
        let pose = NetPose {
            range_m: random.scale(0.4, 4.0),
            tilt_x_deg: random.between(-40.0, 40.0),
            tilt_y_deg: random.between(-40.0, 40.0),
            roll_deg: random.between(-45.0, 45.0),
            ..NetPose::default()
        };
        let scale_m = random.scale(0.02, 0.1);
        what = format!("{texture:?}");
        scene.backdrop = Some(Backdrop {
            texture,
            pose,
            scale_m,
            contrast_grey: random.between(10.0, 50.0),
            seed,
            ..Backdrop::default()
        });
    } else if choice < Texture::ALL.len() + 5 {
        let kind = [Kind::Fish, Kind::Rope, Kind::Ladder, Kind::Kelp, Kind::Rod][choice - Texture::ALL.len()];
        what = format!("{kind:?}");
        for k in 0..1 + random.of(8) {
            scene.objects.push(Object {
                kind,
                range_m: random.between(0.4, 2.0),
                x_m: random.between(-0.8, 0.8),
                y_m: random.between(-0.4, 0.4),
                turn_deg: random.between(-90.0, 90.0),
                length_m: random.between(0.3, 2.0),
                width_m: random.between(0.02, 0.4),
                grey: random.between(10.0, 220.0),
                seed: seed + k as u64,
                ..Object::default()
            });
        }
    }
    what
}

fn main() -> Result<(), Box<dyn Error>> {
    let argument = |k: usize, default: u64| std::env::args().nth(k).map_or(Ok(default), |text| text.parse());
    let (count, first) = (argument(1, 100)?, argument(2, 1000)?);
    println!(
        "seed,net,range_m,tilt_deg,probability,right,range_off,normal_off_deg,turn_off_deg,range_sigmas,tilt_sigmas,evidence,terms,seeing,margin,second_1,second_2,misfit,measurements,mixed,angle_sigmas,residual,ratio_off,what"
    );
    let camera = Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None)?;
    let mut simulator = Simulator::new(camera);
    let mut picture = Image::default();
    for seed in first..first + count {
        let mut random = Random(seed);
        let mut scene = Scene { seed, ..Scene::empty() };
        surroundings(&mut random, &mut scene);
        let has_net = random.chance(0.65);
        let mesh = match random.of(6) {
            0 => Mesh::square(0.025)?,
            1 => Mesh::rectangular(0.06, 0.04)?,
            2 => Mesh::oblique(0.05, 0.05, 1.25)?,
            _ => Mesh::square(0.05)?,
        };
        let mut what = format!("{:.0}x{:.0}", mesh.side1() * 1e3, mesh.side2() * 1e3);
        if has_net {
            let range = mesh.side1() / 0.05 * random.scale(0.3, 6.0);
            scene.layers.push(net(&mut random, &mesh, range));
            if random.chance(0.15) {
                let behind = range * random.between(1.3, 2.5);
                let mut second = net(&mut random, &mesh, behind);
                second.pose.tilt_x_deg = scene.layers[0].pose.tilt_x_deg;
                second.pose.tilt_y_deg = scene.layers[0].pose.tilt_y_deg;
                scene.layers.push(second);
                what += " two";
            }
        } else {
            what = decoy(&mut random, &mut scene, seed);
        }
        let truth = simulator.render(&scene, seed, &mut picture)?;
        let axis = truth.layers.first().and_then(|layer| layer.axis);
        let mut estimator = ThesisEstimator::new(&camera, &mesh, &ThesisConfig::default())?;
        let found = estimator.estimate(picture.view().ok_or("no picture")?)?;
        let Some(found) = found else {
            println!("{seed},{has_net},,,0,,,,,,,,,,,,,,,,,,{what}");
            continue;
        };
        let degrees = |a: &net_geometry::nalgebra::Vector3<f64>, b: &net_geometry::nalgebra::Vector3<f64>| {
            a.cross(b).norm().atan2(a.dot(b).abs()).to_degrees()
        };
        let off = axis.map(|axis| {
            let turn = axis.directions.map(|direction| degrees(&found.pose.x_axis(), &direction));
            let normal = found.plane.normal.cross(&axis.normal).norm().atan2(found.plane.normal.dot(&axis.normal));
            [(found.range() / axis.range_m - 1.0).abs(), normal.to_degrees(), turn[0].min(turn[1])]
        });
        let right = off.is_some_and(|off| off[0] < 0.05 && off[1] < 5.0 && off[2] < 5.0);
        let [range_off, normal_off, turn_off] = off.unwrap_or([f64::NAN; 3]);
        let range_sigmas = range_off * found.range() / found.covariance.sigma_range(&found.pose);
        let tilt_sigmas = normal_off.to_radians() / found.covariance.sigma_tilt(&found.pose);
        let support = &found.support;
        let mean = |family: usize| support.evidence.families[family] / f64::from(support.evidence.terms[family].max(1));
        println!(
            "{seed},{has_net},{:.3},{:.1},{:.4},{right},{range_off:.4},{normal_off:.3},{turn_off:.3},{range_sigmas:.2},{tilt_sigmas:.2},{:.3},{},{:.3},{:.3},{:.2},{:.2},{:.4},{},{:.3},{:.2},{:.4},{:.4},{what}",
            axis.map_or(f64::NAN, |axis| axis.range_m),
            axis.map_or(f64::NAN, |axis| axis.normal.z.acos().to_degrees()),
            found.probability,
            mean(0).min(mean(1)),
            support.evidence.terms[0].min(support.evidence.terms[1]),
            support.sections_seeing,
            support.period_margin_nats,
            support.second_harmonic[0],
            support.second_harmonic[1],
            support.misfit,
            support.measurements,
            support.mixed_orders_nats,
            support.angle_sigmas,
            support.residual_bins,
            support.ratio_off,
        );
    }
    Ok(())
}
