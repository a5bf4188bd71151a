//! The random parts of a study's scenes.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use nalgebra::{Rotation3, Vector3};
use net_geometry::Pose;

use super::FOCAL_PX;
use crate::scenario::CameraModel;
use crate::scene::{Extent, Kind, Layer, Light, Net, NetPose, Object, Scene, Sensor, Snow, Surface, Water, Wave};

/// Random numbers in the order they are asked for.
pub(super) struct Draw(ChaCha8Rng);

impl Draw {
    pub(super) fn new(seed: u64, kind: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(kind);
        Self(rng)
    }

    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    pub(super) fn logarithmic(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    pub(super) fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    pub(super) fn chance(&mut self, share: f64) -> bool {
        self.0.random::<f64>() < share
    }

    pub(super) fn index(&mut self, count: u64) -> u64 {
        self.0.random_range(0..count)
    }

    pub(super) fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// Sides, m, and angle, degrees, in whole millimetres and degrees as people write them.
    pub(super) fn mesh(&mut self) -> (f64, f64, f64) {
        let mut side_m = |low: f64, high: f64| self.between(low, high).round() / 1000.0;
        let (a, b) = (side_m(20.0, 80.0), side_m(25.0, 50.0));
        // Sides that differ by less than a quarter could be taken for each other.
        let long = b * (1.25 + 0.75 * self.0.random::<f64>());
        let long = (1000.0 * long).round() / 1000.0;
        match self.index(8) {
            0 => (a, a, 90.0),
            1 => (long, b, 90.0),
            2 => (b, long, 90.0),
            3 => (b, b, self.between(55.0, 85.0).round()),
            _ => (0.05, 0.05, 90.0),
        }
    }

    /// A net that ends inside the view, around where the axis meets it.
    pub(super) fn extent(&mut self, net: &Net, pose: &NetPose) -> Extent {
        let end = |at_m: f64, side_m: f64, draw: &mut Self| {
            // Half the view is 0.7 of the range wide and 0.4 high.
            let most = (0.6 * pose.range_m / side_m).max(4.0);
            let mut reach = || draw.between(3.0, most).round() as i32;
            let (before, after) = (reach(), reach());
            let middle = (at_m / side_m).round() as i32;
            [middle - before, middle + after]
        };
        Extent::Cells { i: end(pose.x_m, net.side1_m, self), j: end(pose.y_m, net.side2_m, self) }
    }

    /// The thesis's camera; one in four with a lens: barrel, pincushion, rational, fisheye.
    pub(super) fn camera(&mut self) -> CameraModel {
        let lens = |model: &str, coefficients: &[f64]| CameraModel {
            distortion_model: model.to_owned(),
            distortion_coefficients: coefficients.to_vec(),
            ..CameraModel::default()
        };
        match self.index(16) {
            0 => lens("plumb_bob", &[-0.28, 0.09, 0.0008, -0.0005, 0.0]),
            1 => lens("plumb_bob", &[0.12, -0.02, -0.0006, 0.0009, 0.0]),
            2 => lens("rational_polynomial", &[0.35, 0.08, 0.0004, 0.0003, 0.01, 0.62, 0.16, 0.02]),
            3 => lens("equidistant", &[-0.02, 0.004, -0.001, 0.0]),
            _ => CameraModel::default(),
        }
    }

    /// A pose at which meshes of this side are at least 3 px where the axis meets the net.
    pub(super) fn pose(&mut self, near_m: f64, far_m: f64, tilt_deg: f64, side_m: f64) -> NetPose {
        loop {
            let range_m = self.logarithmic(near_m, far_m);
            let tilt = self.between(0.0, tilt_deg).to_radians();
            let azimuth = self.between(0.0, std::f64::consts::TAU);
            // Normal (sin t cos a, sin t sin a, cos t) as R = Rx Ry Rz has it: (sin b, -sin a cos b, cos a cos b).
            let (x, y, z) = (tilt.sin() * azimuth.cos(), tilt.sin() * azimuth.sin(), tilt.cos());
            let pose = NetPose {
                range_m,
                tilt_x_deg: (-y).atan2(z).to_degrees(),
                tilt_y_deg: x.asin().to_degrees(),
                roll_deg: self.between(-180.0, 180.0),
                x_m: self.between(-0.5, 0.5) * side_m,
                y_m: self.between(-0.5, 0.5) * side_m,
            };
            if FOCAL_PX * side_m * tilt.cos() / range_m >= 3.0 {
                return pose;
            }
        }
    }

    /// Contrast and noise: contrast over noise is at least `least` and at most 10, in grey levels that eight bits can hold.
    pub(super) fn contrast(&mut self, scene: &mut Scene, least: f64) {
        let snr = self.logarithmic(least, 10.0);
        // What arrives of the twine's contrast is what counts, so the twine is the stronger the more the water takes.
        let contrast = self.logarithmic(8.0, 90.0);
        let noise = (contrast / snr).clamp(1.0, 40.0);
        let contrast = (noise * snr).clamp(4.0, 90.0);
        let signed = self.sign() * contrast;
        let veil = if signed > 0.0 { self.between(35.0, 140.0) } else { self.between(100.0, 180.0) };
        let range_m = scene.layers.first().map_or(1.0, |l| l.pose.range_m);
        let mut through = 1.0;
        if self.chance(0.5) {
            through = self.between(0.55, 1.0);
        }
        // A dark twine cannot be darker than black.
        if signed < 0.0 {
            through = f64::max(through, -signed / veil);
        }
        scene.water = Water { veil_grey: veil, attenuation_per_m: -through.ln() / range_m, ..Water::default() };
        let grey = (veil + signed / through).max(0.0);
        for layer in &mut scene.layers {
            layer.net.twine.grey = grey;
        }
        scene.sensor = Sensor { read_noise_grey: noise, psf_px: self.between(0.5, 0.8), ..Sensor::default() };
    }

    /// Defocus in every third scene, as much as its meshes allow.
    pub(super) fn blur(&mut self, scene: &mut Scene, side_m: f64) {
        let Some(layer) = scene.layers.first() else { return };
        let cos = layer.pose.pose().normal().z;
        let mesh_px = FOCAL_PX * side_m * cos / layer.pose.range_m;
        let most = (0.25 * mesh_px).powi(2) - scene.sensor.psf_px.powi(2);
        if self.chance(1.0 / 3.0) && most > 0.0 {
            scene.sensor.defocus_px = self.between(0.0, most.sqrt().min(4.0));
        }
    }

    /// Clouds, gradients, vignette, snow.
    pub(super) fn surroundings(&mut self, scene: &mut Scene) {
        scene.water.mottle_grey = self.between(0.0, 12.0);
        scene.water.mottle_px = self.logarithmic(60.0, 300.0);
        scene.water.gradient_grey = self.between(-30.0, 50.0);
        scene.light =
            Light { vignette: self.between(0.0, 0.4), gradient: self.between(-0.15, 0.15), ..Light::default() };
        if self.chance(0.3) {
            scene.snow = Snow { density_per_m3: self.logarithmic(20.0, 600.0), ..Snow::default() };
        }
    }

    /// Fish over up to `most` of the view, in six of ten scenes, all nearer than the net.
    pub(super) fn fish(&mut self, scene: &mut Scene, most: f64) {
        if !self.chance(0.6) {
            return;
        }
        let net_m = scene.layers.first().map_or(2.0, |l| l.pose.range_m);
        let (view_w, view_h) = (848.0 / FOCAL_PX, 480.0 / FOCAL_PX);
        let open = 1.0 - self.between(0.05, most);
        let mut covered = 1.0;
        // Each fish leaves uncovered what it does not overlap: on average its share of what is still open.
        while covered > open && scene.objects.len() < 60 {
            let range_m = net_m * self.between(0.35, 0.8);
            let length_m = range_m * self.logarithmic(0.12, 0.5);
            let width_m = length_m * self.between(0.2, 0.3);
            scene.objects.push(Object {
                kind: Kind::Fish,
                range_m,
                x_m: range_m * view_w * self.between(-0.5, 0.5),
                y_m: range_m * view_h * self.between(-0.5, 0.5),
                turn_deg: self.between(-180.0, 180.0),
                length_m,
                width_m,
                grey: self.between(20.0, 130.0),
                contrast: self.between(0.2, 0.7),
                seed: self.index(1 << 40),
                ..Object::default()
            });
            covered *= 1.0 - 0.75 * length_m * width_m / (range_m * range_m * view_w * view_h);
        }
    }

    /// A few long things across the view.
    pub(super) fn bars(&mut self, scene: &mut Scene, kinds: &[Kind], slant: f64, width_m: [f64; 2]) {
        let common_deg = self.between(0.0, 180.0);
        for _ in 0..=self.index(7) {
            let range_m = self.between(0.6, 2.0);
            scene.objects.push(Object {
                kind: kinds[self.index(kinds.len() as u64) as usize],
                range_m,
                x_m: range_m * self.between(-0.6, 0.6),
                y_m: range_m * self.between(-0.3, 0.3),
                turn_deg: common_deg + 30.0 * slant * self.normal().clamp(-2.0, 2.0),
                length_m: 4.0 * range_m,
                width_m: self.logarithmic(width_m[0], width_m[1]),
                grey: self.between(10.0, 220.0),
                contrast: self.between(0.2, 0.9),
                seed: self.index(1 << 40),
                ..Object::default()
            });
        }
    }

    /// Poses of a net and of one behind it, apart everywhere in view.
    pub(super) fn behind(&mut self, side_m: f64) -> (NetPose, NetPose) {
        loop {
            let front = self.pose(0.4, 1.5, 40.0, side_m);
            let mut back = self.pose(0.4, 1.5, 55.0, side_m);
            back.range_m = front.range_m * self.between(1.3, 2.5);
            let (near, far) = (front.pose().plane(), back.pose().plane());
            let turned = near.normal.angle(&far.normal).to_degrees();
            let apart = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)].into_iter().all(|(x, y)| {
                let corner = Vector3::new(x * 424.0 / FOCAL_PX, y * 240.0 / FOCAL_PX, 1.0);
                let depths = near.depth_along(corner).zip(far.depth_along(corner));
                depths.is_some_and(|(near, far)| far > 1.15 * near)
            });
            if turned <= 25.0 && apart && FOCAL_PX * side_m * far.normal.z / back.range_m >= 4.0 {
                return (front, back);
            }
        }
    }

    /// A sheet on the optical axis, and one sewn to it along its second mesh direction.
    pub(super) fn sewn(&mut self, net: &Net) -> Vec<Layer> {
        /// Cells from the seam to the far end of a sheet: out of view.
        const FAR: i32 = 300;
        loop {
            let pose = self.pose(0.5, 2.5, 40.0, net.side1_m);
            let side = self.sign();
            let aside_m = pose.x_m + side * pose.range_m * self.between(0.05, 0.3);
            let column = (aside_m / net.side1_m).round() as i32;
            let turn =
                Rotation3::from_axis_angle(&Vector3::y_axis(), (self.sign() * self.between(10.0, 50.0)).to_radians());
            let shift_m = self.between(-0.5, 0.5) * net.side2_m;
            let first = pose.pose();
            let origin = first.transform(Vector3::new(f64::from(column) * net.side1_m, shift_m, 0.0));
            let second = Pose { rotation: first.rotation * turn, translation: origin };
            let Some(second) =
                NetPose::from_pose(&second).filter(|p| p.pose().normal().z > 0.35 && p.validate().is_ok())
            else {
                continue;
            };
            let sheet = |pose: NetPose, column: i32, side: f64, number: u64| {
                let i = if side > 0.0 { [column - FAR, column] } else { [column, column + FAR] };
                let net = Net {
                    extent: Extent::Cells { i, j: [-FAR, FAR] },
                    seed: net.seed.wrapping_add(number),
                    ..net.clone()
                };
                Layer { net, pose }
            };
            return vec![sheet(pose, column, side, 0), sheet(second, 0, -side, 1)];
        }
    }

    /// A sheet: a smooth random field of 22 mm and 0.36 m (as sixteen waves), a bend, and bent threads.
    pub(super) fn surface(&mut self) -> Surface {
        const WAVES: usize = 16;
        const FIELD_M: f64 = 0.022;
        const LENGTH_M: f64 = 0.36;
        let waves = (0..WAVES).map(|_| {
            // A Gaussian field's wave vectors are normal, of deviation 1/length; none shorter than half a metre is let through.
            let (x, y) = (self.normal() / LENGTH_M, self.normal() / LENGTH_M);
            let number = f64::hypot(x, y).clamp(0.5, 12.0);
            Wave {
                amplitude_m: FIELD_M * (2.0 / WAVES as f64).sqrt(),
                length_m: std::f64::consts::TAU / number,
                direction_deg: y.atan2(x).to_degrees(),
                phase_deg: self.between(-180.0, 180.0),
            }
        });
        let waves = waves.collect();
        Surface {
            waves,
            curvature_per_m: [self.between(-0.6, 0.6), self.between(-0.2, 0.2), self.between(-0.6, 0.6)],
            thread_bend_per_m: [0.1 * self.normal(), 0.1 * self.normal()],
            reach_m: 1.5,
            ..Surface::default()
        }
    }
}
