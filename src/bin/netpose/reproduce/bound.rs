//! The limit: how well any unbiased estimator could do on a drawn picture whose noise is known (Cramér 1946, Rao 1945).

use anyhow::{Context, Result};
use net_geometry::Pose;
use net_geometry::nalgebra::{Matrix2, Matrix6, Rotation3, Vector2, Vector3};
use net_sim::{NetPose, Scene, Simulator};

/// Variance that rounding to whole grey levels adds.
const ROUNDING: f64 = 1.0 / 12.0;
/// Way, px, that a step of the differences moves the picture, about: small beside the point spread, large beside the rounding of floats.
const STEP_PX: f64 = 0.05;
/// Radii and directions at which errors are drawn, all equally probable.
const RADII: usize = 40;
const DIRECTIONS: usize = 24;

/// Error of range (%), of the normal (degrees) and of the place along the net (mm): in the tables one after the other.
pub type Errors = [f64; 3];

/// The least covariance of a flat net's pose, everything else about the picture known.
pub struct Bound {
    /// Turn of the net about the point that the axis meets (rad, camera frame), logarithm of the range, place along the net (m).
    covariance: Matrix6<f64>,
    normal: Vector3<f64>,
}

impl Bound {
    /// Of the scene's first net, by central differences of the picture before noise.
    pub fn new(simulator: &mut Simulator, scene: &Scene) -> Result<Self> {
        let layer = scene.layers.first().context("no net")?;
        let range_m = layer.pose.range_m;
        let focal_px = simulator.camera().fx();
        let (width, height) = (f64::from(simulator.camera().width()), f64::from(simulator.camera().height()));
        // A turn moves the rim as a scaling does, by its share of half the picture; a shift moves all of it.
        let share = STEP_PX / (0.25 * width.hypot(height));
        let steps = [share, share, share, share, STEP_PX * range_m / focal_px, STEP_PX * range_m / focal_px];
        let variance: Vec<f64> = {
            draw(simulator, scene, layer.pose)?;
            let light = simulator.noiseless();
            light.iter().map(|&g| scene.sensor.noise_grey(f64::from(g)).powi(2) + ROUNDING).collect()
        };
        let mut slopes = Vec::with_capacity(6);
        for (k, step) in steps.into_iter().enumerate() {
            draw(simulator, scene, moved(&layer.pose, k, step)?)?;
            let ahead = simulator.noiseless().to_vec();
            draw(simulator, scene, moved(&layer.pose, k, -step)?)?;
            let behind = simulator.noiseless();
            let slope = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)) / (2.0 * step);
            slopes.push(ahead.iter().zip(behind).map(slope).collect::<Vec<f64>>());
        }
        let information = Matrix6::from_fn(|a, b| {
            slopes[a].iter().zip(&slopes[b]).zip(&variance).map(|((x, y), v)| x * y / v).sum::<f64>()
        });
        let covariance = inverse(&information).context("the picture does not show the pose")?;
        Ok(Self { covariance, normal: layer.pose.pose().normal() })
    }

    /// Errors of an estimator that reaches the bound, equally probable.
    pub fn draws(&self) -> Vec<Errors> {
        let c = &self.covariance;
        let across = self.normal.cross(&Vector3::y()).normalize();
        let up = self.normal.cross(&across);
        // The normal moves with the two parts of the turn that are across it.
        let turn = c.fixed_view::<3, 3>(0, 0);
        let part = |a: &Vector3<f64>, b: &Vector3<f64>| (a.transpose() * turn * b)[0];
        let tilt = root(Matrix2::new(part(&across, &across), part(&across, &up), part(&up, &across), part(&up, &up)));
        let place = root(c.fixed_view::<2, 2>(4, 4).into_owned());
        let mut draws = Vec::with_capacity(RADII * DIRECTIONS);
        for i in 0..RADII {
            let radius = (-2.0 * (1.0 - (i as f64 + 0.5) / RADII as f64).ln()).sqrt();
            for j in 0..DIRECTIONS {
                let (sin, cos) = ((j as f64 + 0.5) / DIRECTIONS as f64 * std::f64::consts::TAU).sin_cos();
                let normal = Vector2::new(cos, sin) * radius;
                draws.push([
                    100.0 * c[(3, 3)].sqrt() * normal.x.abs(),
                    (tilt * normal).norm().to_degrees(),
                    1e3 * (place * normal).norm(),
                ]);
            }
        }
        draws
    }
}

/// Square root of a covariance.
fn root(c: Matrix2<f64>) -> Matrix2<f64> {
    c.cholesky().map_or_else(Matrix2::zeros, |c| c.l())
}

/// Unit diagonal first: a turn, a logarithm and metres differ by orders of magnitude.
fn inverse(information: &Matrix6<f64>) -> Option<Matrix6<f64>> {
    let scale = information.diagonal().map(|d| 1.0 / d.sqrt());
    let scaled = Matrix6::from_fn(|a, b| information[(a, b)] * scale[a] * scale[b]);
    let inverse = scaled.cholesky()?.inverse();
    Some(Matrix6::from_fn(|a, b| inverse[(a, b)] * scale[a] * scale[b]))
}

/// The pose after a step of one of the six parameters.
fn moved(pose: &NetPose, parameter: usize, step: f64) -> Result<NetPose> {
    let mut moved = *pose;
    match parameter {
        3 => moved.range_m *= step.exp(),
        4 => moved.x_m += step,
        5 => moved.y_m += step,
        axis => {
            let mut turn = Vector3::zeros();
            turn[axis] = step;
            let at = pose.pose();
            let middle = Vector3::z() * pose.range_m;
            let turn = Rotation3::new(turn);
            let turned = Pose { rotation: turn * at.rotation, translation: middle + turn * (at.translation - middle) };
            moved = NetPose::from_pose(&turned).context("the axis misses the net")?;
        }
    }
    Ok(moved)
}

/// Draws the scene with its first net elsewhere.
fn draw(simulator: &mut Simulator, scene: &Scene, pose: NetPose) -> Result<()> {
    let mut scene = scene.clone();
    if let Some(layer) = scene.layers.first_mut() {
        layer.pose = pose;
    }
    simulator.render(&scene, 0, &mut net_sim::Image::default())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use net_geometry::{Camera, Lens, Mesh};
    use net_sim::{Layer, Scene, Sensor};

    use super::*;
    use crate::stats::median;

    #[test]
    fn the_bound_is_that_of_closed_form_and_grows_with_the_noise() -> Result<()> {
        let camera = Camera::new(150.0, 150.0, 104.0, 74.0, 208, 148, Lens::None)?;
        let mut simulator = Simulator::new(camera);
        let scene = |noise: f64| -> Result<Scene> {
            let layer = Layer::planar(&Mesh::square(0.05)?, NetPose::at(0.6));
            let sensor = Sensor { read_noise_grey: noise, ..Sensor::default() };
            Ok(Scene { layers: vec![layer], sensor, ..Scene::default() })
        };
        let quiet = Bound::new(&mut simulator, &scene(4.0)?)?;
        let loud = Bound::new(&mut simulator, &scene(8.0)?)?;
        // Variance goes with the square of the noise; rounding adds 1/12 to both.
        let expected = (64.0 + ROUNDING) / (16.0 + ROUNDING);
        for k in 0..6 {
            assert!((loud.covariance[(k, k)] / quiet.covariance[(k, k)] / expected - 1.0).abs() < 1e-3, "{k}");
        }
        // Straight ahead, the place along the net stands alone but for the turns: no better than the slope's own energy allows.
        draw(&mut simulator, &scene(4.0)?, NetPose::at(0.6))?;
        let row = simulator.noiseless().to_vec();
        let energy: f64 = row.windows(3).map(|w| (0.5 * f64::from(w[2] - w[0])).powi(2)).sum();
        let least = (16.0 + ROUNDING).sqrt() / energy.sqrt() * 0.6 / 150.0;
        let sigma = quiet.covariance[(4, 4)].sqrt();
        // Differences over two pixels flatten a point spread of 0.6 px; the turns take some.
        assert!((0.5 * least..3.0 * least).contains(&sigma), "{sigma} against {least}");
        // Of normal errors half are below 0.6745 standard deviations.
        let range: Vec<f64> = quiet.draws().iter().map(|d| d[0]).collect();
        assert!((median(&range) / (67.45 * quiet.covariance[(3, 3)].sqrt()) - 1.0).abs() < 0.02);
        Ok(())
    }
}
