//! Random scenes for studies of accuracy: every seed a scene, drawn over the whole range that an estimator is asked to cover.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::error::{Error, Result};
use crate::scenario::{CameraModel, Scenario};
use crate::scene::{
    Backdrop, Extent, Growth, Kind, Layer, Light, Net, NetPose, Object, Scene, Sensor, Snow, Surface, Texture, Twine,
    Water, Wave,
};

/// Focal length of the studies' camera (the thesis's), px.
const FOCAL_PX: f64 = 600.0;

/// Where random scenes come from. The scene of a seed never depends on another seed's.
///
/// In all of them the net can be seen, in principle: along the direction in which tilt shortens them, meshes at the optical axis are
/// at least 3 px, and point spread and defocus together at most a quarter of that. How much of it is hidden is in the truth
/// ([`LayerTruth::visible_share`](crate::LayerTruth::visible_share)).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Study {
    /// Flat nets: range 0.3 to 8 m (evenly in its logarithm), tilt 0 to 70 degrees about any axis, any turn, light and dark twine, contrast
    /// over noise 0.5 to 10, defocus to 4 px, up to 60 % of the view behind fish, node jitter to 5 %. Half of the meshes are 50 mm
    /// square, the others squares of 20 to 80 mm, rectangles and diamonds; every fourth camera has a lens that distorts, every fifth net
    /// ends inside the view.
    Planar,
    /// Nets as they hang: as [`Study::Planar`] from 0.3 to 3 m and to 55 degrees, the crossing angle off by up to 18 degrees, the
    /// sheet a smooth random field of 22 mm over 0.36 m plus a bend of up to 0.6 per metre, threads bent in the plane; every side
    /// keeps its length. One in three of 27.5 mm mesh, out to 1.6 m.
    Hung,
    /// No net of the mesh asked for: open water, fish, ropes and rods, ladders, kelp, and every [`Texture`], in all kinds of water and
    /// noise.
    Negative,
    /// What a covariance is held against: flat square nets of 50 mm from 0.4 to 4 m and to 55 degrees, contrast over noise 1 to 10,
    /// nothing amiss but the noise.
    Noise,
    /// As [`Study::Noise`], knots 2 % of a side off their places.
    Jitter2,
    /// As [`Study::Noise`], knots 5 % of a side off their places.
    Jitter5,
    /// As [`Study::Noise`], the sheet bent by up to 0.15 per metre in every direction, sides as long as ever.
    Sag,
}

impl Study {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Planar, Self::Hung, Self::Negative, Self::Noise, Self::Jitter2, Self::Jitter5, Self::Sag];

    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Planar => "planar",
            Self::Hung => "hung",
            Self::Negative => "negative",
            Self::Noise => "noise",
            Self::Jitter2 => "jitter2",
            Self::Jitter5 => "jitter5",
            Self::Sag => "sag",
        }
    }

    /// The scene of this seed.
    pub fn scenario(self, seed: u64) -> Scenario {
        let drawn = match self {
            Self::Planar => planar(seed),
            Self::Hung => hung(seed),
            Self::Negative => negative(seed),
            Self::Noise => steady(seed, |_, _| {}),
            Self::Jitter2 => steady(seed, |_, net| net.jitter = 0.02),
            Self::Jitter5 => steady(seed, |_, net| net.jitter = 0.05),
            Self::Sag => steady(seed, |draw, net| {
                let bend = 0.15;
                net.surface.curvature_per_m =
                    [draw.between(-bend, bend), draw.between(-bend, bend), draw.between(-bend, bend)];
            }),
        };
        Scenario { name: format!("study-{}-{seed}", self.name()), seed, ..drawn }
    }

    /// [`Study::Planar`]'s scene of this seed.
    pub fn planar(seed: u64) -> Scenario {
        Self::Planar.scenario(seed)
    }

    /// [`Study::Hung`]'s scene of this seed.
    pub fn hung(seed: u64) -> Scenario {
        Self::Hung.scenario(seed)
    }

    /// [`Study::Negative`]'s scene of this seed.
    pub fn negative(seed: u64) -> Scenario {
        Self::Negative.scenario(seed)
    }
}

impl std::str::FromStr for Study {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|s| s.name() == name);
        found.ok_or_else(|| Error::Name { what: "study", name: name.to_owned() })
    }
}

fn planar(seed: u64) -> Scenario {
    let mut draw = Draw::new(seed, 1);
    let mut net = Net { seed, ..Net::default() };
    (net.side1_m, net.side2_m, net.angle_deg) = draw.mesh();
    let shortest_m = f64::min(net.side1_m, net.side2_m);
    let pose = draw.pose(0.3, 8.0, 70.0, shortest_m);
    net.twine.diameter_m = shortest_m * draw.between(0.03, 0.06);
    if draw.chance(0.5) {
        net.jitter = draw.between(0.0, 0.05);
    }
    if draw.chance(0.4) {
        net.twine.knot = draw.between(1.2, 2.4);
    }
    if draw.chance(0.2) {
        net.extent = draw.extent(&net, &pose);
    }
    let mesh = net.mesh().map_or_else(|_| String::new(), |mesh| mesh.to_string());
    let mut scene = Scene { layers: vec![Layer { net, pose }], seed, ..Scene::empty() };
    draw.contrast(&mut scene, 0.5);
    draw.blur(&mut scene, shortest_m);
    draw.surroundings(&mut scene);
    draw.fish(&mut scene, 0.6);
    Scenario { camera: draw.camera(), ..scenario("A flat net, drawn at random", &mesh, scene) }
}

fn hung(seed: u64) -> Scenario {
    let mut draw = Draw::new(seed, 2);
    let fine = draw.chance(1.0 / 3.0);
    let (mesh, side_m, far_m) = if fine { ("27.5mm", 0.0275, 1.6) } else { ("50mm", 0.05, 3.0) };
    let pose = draw.pose(0.3, far_m, 55.0, side_m);
    let mut net = Net { side1_m: side_m, side2_m: side_m, seed, ..Net::default() };
    net.shear_deg = draw.between(-18.0, 18.0);
    net.surface = draw.surface();
    net.jitter = draw.between(0.0, 0.02);
    net.slack = draw.between(0.0, 0.01);
    net.twine = Twine {
        diameter_m: side_m * draw.between(0.03, 0.06),
        knot: draw.between(1.0, 2.4),
        variation: draw.between(0.0, 0.1),
        ..Twine::default()
    };
    if draw.chance(0.3) {
        net.growth = Growth { density: draw.between(0.0, 0.12), size_m: 0.3 * side_m, ..Growth::default() };
    }
    let mut scene = Scene { layers: vec![Layer { net, pose }], seed, ..Scene::empty() };
    draw.contrast(&mut scene, 1.0);
    draw.blur(&mut scene, side_m);
    draw.surroundings(&mut scene);
    draw.fish(&mut scene, 0.3);
    scenario("A sheared and bent net, drawn at random", mesh, scene)
}

fn negative(seed: u64) -> Scenario {
    let mut draw = Draw::new(seed, 3);
    let mut scene = Scene { seed, ..Scene::empty() };
    draw.contrast(&mut scene, 1.0);
    draw.surroundings(&mut scene);
    scene.sensor.defocus_px = if draw.chance(0.3) { draw.between(0.0, 2.0) } else { 0.0 };
    let what = match draw.index(5 + Texture::ALL.len() as u64) as usize {
        0 => {
            scene.water.rays_grey = draw.between(0.0, 20.0);
            scene.water.mottle_grey = draw.between(2.0, 20.0);
            scene.snow.density_per_m3 = draw.between(0.0, 1000.0);
            "open water".to_owned()
        }
        1 => {
            draw.fish(&mut scene, 0.6);
            "fish".to_owned()
        }
        2 => {
            draw.bars(&mut scene, &[Kind::Rope, Kind::Rod], 1.0, [0.006, 0.05]);
            "ropes and rods".to_owned()
        }
        3 => {
            draw.bars(&mut scene, &[Kind::Ladder], 0.3, [0.15, 0.45]);
            "ladders".to_owned()
        }
        4 => {
            draw.bars(&mut scene, &[Kind::Kelp], 1.5, [0.02, 0.08]);
            "kelp".to_owned()
        }
        texture => {
            let texture = Texture::ALL[texture - 5];
            scene.backdrop = Some(Backdrop {
                texture,
                pose: draw.pose(0.4, 4.0, 60.0, 0.05),
                scale_m: 0.05 * draw.logarithmic(0.4, 2.5),
                grey: scene.water.veil_grey,
                contrast_grey: draw.sign() * draw.between(8.0, 60.0),
                seed,
            });
            format!("{texture:?}").to_lowercase()
        }
    };
    scenario(&what, "50mm", scene)
}

/// Flat square nets and noise, and what `change` adds.
fn steady(seed: u64, change: fn(&mut Draw, &mut Net)) -> Scenario {
    let mut draw = Draw::new(seed, 4);
    let mut net = Net { seed, ..Net::default() };
    let pose = draw.pose(0.4, 4.0, 55.0, net.side1_m);
    net.twine.diameter_m = draw.between(0.0015, 0.003);
    let mut scene = Scene { layers: vec![Layer { net, pose }], seed, ..Scene::empty() };
    draw.contrast(&mut scene, 1.0);
    scene.layers.iter_mut().for_each(|layer| change(&mut draw, &mut layer.net));
    scenario("A flat net for covariances, drawn at random", "50mm", scene)
}

fn scenario(description: &str, mesh: &str, scene: Scene) -> Scenario {
    Scenario { description: description.to_owned(), mesh: mesh.to_owned(), scene, ..Scenario::default() }
}

/// Random numbers in the order they are asked for.
struct Draw(ChaCha8Rng);

impl Draw {
    fn new(seed: u64, kind: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(kind);
        Self(rng)
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    fn logarithmic(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    fn chance(&mut self, share: f64) -> bool {
        self.0.random::<f64>() < share
    }

    fn index(&mut self, count: u64) -> u64 {
        self.0.random_range(0..count)
    }

    fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// Sides, m, and angle, degrees, in whole millimetres and degrees as people write them.
    fn mesh(&mut self) -> (f64, f64, f64) {
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
    fn extent(&mut self, net: &Net, pose: &NetPose) -> Extent {
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
    fn camera(&mut self) -> CameraModel {
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
    fn pose(&mut self, near_m: f64, far_m: f64, tilt_deg: f64, side_m: f64) -> NetPose {
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
    fn contrast(&mut self, scene: &mut Scene, least: f64) {
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
    fn blur(&mut self, scene: &mut Scene, side_m: f64) {
        let Some(layer) = scene.layers.first() else { return };
        let cos = layer.pose.pose().normal().z;
        let mesh_px = FOCAL_PX * side_m * cos / layer.pose.range_m;
        let most = (0.25 * mesh_px).powi(2) - scene.sensor.psf_px.powi(2);
        if self.chance(1.0 / 3.0) && most > 0.0 {
            scene.sensor.defocus_px = self.between(0.0, most.sqrt().min(4.0));
        }
    }

    /// Clouds, gradients, vignette, snow.
    fn surroundings(&mut self, scene: &mut Scene) {
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
    fn fish(&mut self, scene: &mut Scene, most: f64) {
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
    fn bars(&mut self, scene: &mut Scene, kinds: &[Kind], slant: f64, width_m: [f64; 2]) {
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

    /// A sheet: a smooth random field of 22 mm and 0.36 m (as sixteen waves), a bend, and bent threads.
    fn surface(&mut self) -> Surface {
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
