//! Runs with exact truth: motion drawn from the model, measurements with errors of known covariance.

use net_geometry::Pose;
use net_geometry::nalgebra::{Matrix6, Rotation3, Vector2, Vector3, Vector6};
use net_track::{Answer, Config, Measurement, Sample, Suspect, Verdict};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Side of a cell, m.
pub const CELL: f64 = 0.05;

/// A run and its truth.
pub struct Run {
    pub truth: Vec<Pose>,
    pub samples: Vec<Sample>,
    rng: ChaCha8Rng,
}

/// Normal numbers.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Covariance of a lattice pose 1.5 m off: turn 2 mrad, place 1 mm, range 3 mm, and tilt that moves the camera.
pub fn covariance(pose: &Pose) -> Matrix6<f64> {
    let mut c = Matrix6::zeros();
    for k in 0..3 {
        c[(k, k)] = 0.002f64.powi(2);
        c[(k + 3, k + 3)] = if k == 2 { 0.003f64.powi(2) } else { 0.001f64.powi(2) };
    }
    // The place is that of the net at the optical axis: turning about it shifts the origin.
    let axis = Vector3::new(0.0, 0.0, pose.plane().range().unwrap_or(1.5));
    let mut j = Matrix6::identity();
    j.fixed_view_mut::<3, 3>(3, 0).copy_from(&-(pose.translation - axis).cross_matrix());
    let c = j * c * j.transpose();
    0.5 * (c + c.transpose())
}

/// A pose with an error drawn from a covariance.
pub fn disturbed(pose: &Pose, covariance: &Matrix6<f64>, rng: &mut ChaCha8Rng) -> Pose {
    let unit = Vector6::from_fn(|_, _| normal(rng));
    let e = covariance.cholesky().expect("positive definite").l() * unit;
    pose.perturbed(Vector3::new(e[0], e[1], e[2]), Vector3::new(e[3], e[4], e[5]))
}

impl Run {
    /// `n` frames at 10 Hz, speed and turning as the configuration has them, starting at `velocity`, m/s.
    pub fn new(n: usize, velocity: Vector3<f64>, config: &Config, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let dt: f64 = 0.1;
        let (mut centre, mut v) = (Vector3::new(0.01, -0.02, -1.5), velocity);
        let (mut rotation, mut turning) = (Rotation3::from_euler_angles(0.1, -0.15, 0.05), Vector3::zeros());
        let mut truth = Vec::new();
        for _ in 0..n {
            truth.push(Pose { rotation, translation: -(rotation * centre) });
            // Exact steps of the model: place and rate share a Gaussian.
            let mut walk = |density: f64| {
                let (a, b) = (normal(&mut rng), normal(&mut rng));
                (density * dt.powf(1.5) / 3f64.sqrt() * a, density * dt.sqrt() * (0.75f64.sqrt() * a + 0.5 * b))
            };
            let steps: [_; 3] = std::array::from_fn(|_| walk(config.acceleration_density));
            let turns: [_; 3] = std::array::from_fn(|_| walk(0.5 * config.turning_density));
            centre += v * dt + Vector3::from_fn(|i, _| steps[i].0);
            v += Vector3::from_fn(|i, _| steps[i].1);
            rotation = Rotation3::new(turning * dt + Vector3::from_fn(|i, _| turns[i].0)) * rotation;
            turning += Vector3::from_fn(|i, _| turns[i].1);
            // Held near the net at about the speed it began with: pulls weaker than the model's noise.
            v -= 0.04 * (v - velocity) + Vector3::z() * (0.02 * (centre.z + 1.5));
            turning -= 0.04 * turning + 0.01 * Vector3::new(rotation[(2, 1)], -rotation[(2, 0)], rotation[(1, 0)]);
        }
        let lattice = [Vector2::new(CELL, 0.0), Vector2::new(0.0, CELL)];
        let samples = truth
            .iter()
            .enumerate()
            .map(|(k, pose)| {
                let covariance = covariance(pose);
                let measured = disturbed(pose, &covariance, &mut rng);
                let measurement = Measurement { pose: measured, covariance, probability: 0.99, lattice, track: 0 };
                Sample {
                    timestamp_ns: 1_700_000_000_000_000_000 + 100_000_000 * k as i64,
                    measurement: Some(measurement),
                    increment: None,
                }
            })
            .collect();
        Self { truth, samples, rng }
    }

    /// From `frame` on the count is too small by so many cells.
    pub fn slip(&mut self, frame: usize, cells: (i32, i32)) {
        for s in &mut self.samples[frame..] {
            if let Some(m) = &mut s.measurement {
                let step = Vector3::new(f64::from(cells.0), f64::from(cells.1), 0.0) * CELL;
                m.pose.translation += m.pose.rotation * step;
            }
        }
    }

    /// A wrong pose.
    pub fn outlier(&mut self, frame: usize) {
        let wrong = Vector6::from_fn(|i, _| if i < 3 { 0.1 } else { 0.04 }).map(|s| s * normal(&mut self.rng));
        if let Some(m) = &mut self.samples[frame].measurement {
            let (turn, shift) = (wrong.fixed_rows::<3>(0).into_owned(), wrong.fixed_rows::<3>(3).into_owned());
            // At least so much that nobody takes it for noise.
            m.pose = m.pose.perturbed(turn + Vector3::repeat(0.05), shift + Vector3::new(0.02, 0.018, 0.1));
        }
    }

    /// A frame without a pose.
    pub fn lose(&mut self, frame: usize) {
        self.samples[frame].measurement = None;
    }

    /// Error of a pose against the truth: (w, c) of the camera, rad and m.
    pub fn error(&self, frame: usize, pose: &Pose) -> (f64, f64) {
        let truth = &self.truth[frame];
        ((pose.rotation * truth.rotation.inverse()).angle(), (pose.camera_in_net() - truth.camera_in_net()).norm())
    }
}

/// A verifier that knows the planted slips: (frame, cells to add).
pub fn knows(slips: &[(usize, (i32, i32))]) -> impl FnMut(&Suspect) -> Answer + '_ {
    |s| {
        let right = slips.contains(&(s.sample, s.cells));
        Answer { verdict: if right { Verdict::Confirmed } else { Verdict::Refuted }, z: 10.0 }
    }
}
