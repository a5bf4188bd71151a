//! Random simulated sequences, and the tracker's count of cells on them held against the truth.

use std::error::Error;

use net_geometry::nalgebra::Vector2;
use net_sim::{Growth, Image, NetPose, Object, Path, Scenario, Simulator, Surface, Water};
use netpose::{Config, Connection, Status, Tracker};

/// Uniform numbers (Knuth's 64-bit linear congruence, upper bits).
struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Kinds of sequences.
pub const KINDS: [&str; 10] =
    ["strafe", "loop", "approach", "bent", "fish", "murky", "bare", "behind", "rounds", "far"];
/// How often `rounds` goes round, and pictures of open water in each round but the first.
pub const ROUNDS: u32 = 3;
const WATER_FRAMES: u32 = 12;
const CELL_M: f64 = 0.05;
const RATE_HZ: f64 = 10.0;

/// A sequence of this kind.
pub fn sequence(kind: usize, frames: u32, seed: u64) -> Scenario {
    let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ kind as u64);
    for _ in 0..8 {
        random.between(0.0, 1.0);
    }
    let mut scenario = Scenario { frames, rate_hz: RATE_HZ, seed, ..Scenario::default() };
    let camera = &mut scenario.camera;
    (camera.image_width, camera.image_height) = (424, 240);
    (camera.fx, camera.fy, camera.cx, camera.cy) = (300.0, 300.0, 211.5, 119.5);
    let scene = &mut scenario.scene;
    // Cells of 15 px and more; far ones of 5 to 8, where many a frame has a lattice and no pose.
    let range_m = if KINDS[kind] == "far" { random.between(2.0, 2.8) } else { random.between(0.6, 1.2) };
    scene.layers[0].pose = NetPose {
        range_m,
        tilt_x_deg: random.between(-12.0, 12.0),
        tilt_y_deg: random.between(-20.0, 20.0),
        roll_deg: random.between(-8.0, 8.0),
        x_m: random.between(-0.3, 0.3),
        y_m: random.between(-0.3, 0.3),
    };
    let net = &mut scene.layers[0].net;
    net.seed = seed;
    net.jitter = random.between(0.015, 0.05);
    net.slack = random.between(0.0, 0.02);
    net.twine.variation = 0.05;
    net.growth = Growth { density: random.between(0.0, 0.05), size_m: 0.014, ..Growth::default() };
    scene.water.attenuation_per_m = Water::attenuation_of_visibility(random.between(4.0, 12.0));
    scene.sensor.read_noise_grey = random.between(1.0, 3.0);
    scene.sensor.exposure_s = 0.008;
    if KINDS[kind] == "murky" {
        scene.water.attenuation_per_m = Water::attenuation_of_visibility(random.between(2.0, 3.5));
        scene.sensor.read_noise_grey = random.between(3.0, 5.0);
    }
    if KINDS[kind] == "bare" {
        net.growth.density = 0.0;
        net.jitter = random.between(0.01, 0.02);
    }
    if matches!(KINDS[kind], "bent" | "behind" | "far") {
        net.surface = Surface {
            curvature_per_m: [random.between(-0.5, 0.5), random.between(-0.2, 0.2), random.between(-0.4, 0.4)],
            cubic_per_m2: [random.between(-0.2, 0.2), 0.0, random.between(-0.2, 0.2), 0.0],
            ..Surface::default()
        };
    }
    if KINDS[kind] == "behind" {
        // Blur of up to a quarter of a cell.
        scene.sensor.exposure_s = 0.025;
        let mut behind = scene.layers[0].clone();
        behind.net.seed = seed + 1;
        behind.pose.range_m += random.between(0.4, 0.8);
        behind.pose.roll_deg += random.between(-10.0, 10.0);
        scene.layers.push(behind);
    }
    if KINDS[kind] == "fish" {
        scene.objects = (0..4u8)
            .map(|k| Object {
                range_m: range_m * random.between(0.5, 0.8),
                x_m: -0.4 - 0.5 * f64::from(k),
                y_m: random.between(-0.2, 0.2),
                turn_deg: 180.0,
                length_m: 0.45,
                width_m: 0.11,
                grey: 75.0,
                contrast: 0.65,
                velocity_m_per_s: [0.35, 0.0, 0.0],
                seed: seed + u64::from(k),
                ..Object::default()
            })
            .collect();
    }
    // Up to a cell a frame.
    let most = CELL_M * RATE_HZ;
    let length_s = f64::from(frames) / RATE_HZ;
    scenario.path = match KINDS[kind] {
        // The longest step is that on the ellipse's longer side.
        "loop" | "rounds" => {
            let radius = random.between(0.5, 1.0) * most * length_s / std::f64::consts::TAU;
            Path::Loop { radius_m: [radius, 0.6 * radius], depth_m: 0.08, nod_deg: 5.0, roll_deg: 4.0 }
        }
        "approach" => Path::Approach {
            to_m: range_m * random.between(0.7, 1.3),
            tilt_y_deg: random.between(-15.0, 15.0),
            // Eased in and out: half as fast again in the middle as on average.
            aside_m: [random.between(-0.65, 0.65) * most * length_s, random.between(-0.1, 0.1) * most * length_s],
        },
        _ => Path::Strafe {
            speed_m_per_s: [random.between(-1.0, 1.0) * most, random.between(-1.0, 1.0) * most],
            heave_m: 0.03,
            sway_deg: 3.0,
            period_s: 5.0,
        },
    };
    scenario
}

/// What happened to a kind.
#[derive(Debug, Default, Clone, Copy)]
pub struct Tally {
    pub frames: u32,
    pub refused: u32,
    pub flagged: u32,
    pub recognised: u32,
    pub silent: u32,
    pub large_steps: u32,
}

/// The tracker over a sequence, `rounds` times one after the other.
pub fn run(scenario: &Scenario, rounds: u32, tally: &mut Tally) -> Result<(), Box<dyn Error>> {
    let (camera, mesh) = (scenario.camera()?, scenario.mesh()?);
    let mut tracker = Tracker::new(camera, mesh, &Config::default())?;
    let mut simulator = Simulator::new(camera);
    let mut image = Image::default();
    // Of each count: what its names differ from the true ones by.
    let mut known: Vec<(u32, Vector2<f64>)> = Vec::new();
    let mut last_cells: Option<Vector2<f64>> = None;
    // Not where the round begins: elsewhere in each.
    let water_from = |round: u32| scenario.frames * (1 + round) / 5;
    for k in 0..rounds * scenario.frames {
        let (round, in_round) = (k / scenario.frames, k % scenario.frames);
        let mut frame = scenario.frame(in_round)?;
        let timestamp_ns = frame.timestamp_ns + i64::from(round * scenario.frames) * (1e9 / RATE_HZ) as i64;
        let water = round > 0 && (water_from(round)..water_from(round) + WATER_FRAMES).contains(&in_round);
        if water {
            frame.scene.layers.clear();
        }
        let truth = simulator.render(&frame.scene, frame.seed ^ (u64::from(round) << 32), &mut image)?;
        let cells = truth.layers.first().and_then(|l| l.axis).map(|a| a.cells);
        let Some(cells) = cells else {
            // Water: nothing to count, but the tracker sees it.
            tracker.update(image.view().ok_or("no picture")?, timestamp_ns)?;
            continue;
        };
        tally.frames += 1;
        tally.large_steps += u32::from(last_cells.is_some_and(|last| (cells - last).amax() > 0.5));
        last_cells = Some(cells);
        let estimate = tracker.update(image.view().ok_or("no picture")?, timestamp_ns)?;
        let (status, track, connection) = (estimate.status, estimate.track, estimate.connection);
        if status != Status::Ok {
            tally.refused += 1;
            continue;
        }
        tally.flagged += u32::from(matches!(connection, Connection::Restarted | Connection::Doubted));
        tally.recognised += u32::from(connection == Connection::Recognised);
        let Some(found) = tracker.lattice_at_axis() else { continue };
        let off = (found - cells).map(f64::round);
        match known.iter_mut().find(|(t, _)| *t == track) {
            Some((_, expected)) if *expected != off => {
                tally.silent += 1;
                eprintln!(
                    "{} seed {} frame {k}: {connection:?} in count {track}, off by {:?}",
                    scenario.name,
                    scenario.seed,
                    (off - *expected).as_slice()
                );
                *expected = off;
            }
            Some(_) => {}
            None => known.push((track, off)),
        }
    }
    Ok(())
}
