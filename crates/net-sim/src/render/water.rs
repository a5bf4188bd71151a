//! Light and water: how bright a thing is where it is, and what of that arrives.

use nalgebra::{Vector2, Vector3};
use net_geometry::Camera;

use crate::random::{Addressed, Stream};
use crate::scene::Scene;

/// Open water is worked out on a grid this fine, px, and interpolated.
const GRID_PX: usize = 4;

/// Brightness of open water, grey levels, pixel by pixel.
#[derive(Debug, Default)]
pub(crate) struct Veil {
    grid: Vec<f32>,
    pub(crate) grey: Vec<f32>,
    width: usize,
    height: usize,
}

impl Veil {
    /// Works it out for `scene`.
    pub(crate) fn fill(&mut self, scene: &Scene, camera: &Camera) {
        (self.width, self.height) = (camera.width() as usize, camera.height() as usize);
        let water = &scene.water;
        self.grey.clear();
        if [water.gradient_grey, water.mottle_grey, water.rays_grey, water.glow_grey].iter().all(|&g| g == 0.0) {
            self.grey.resize(self.width * self.height, water.veil_grey as f32);
            return;
        }
        let (columns, rows) = (self.width.div_ceil(GRID_PX) + 1, self.height.div_ceil(GRID_PX) + 1);
        let shine = Shine::new(scene, camera);
        self.grid.clear();
        for row in 0..rows {
            for column in 0..columns {
                let pixel = Vector2::new((column * GRID_PX) as f64, (row * GRID_PX) as f64);
                self.grid.push(shine.at(pixel).max(0.0) as f32);
            }
        }
        for v in 0..self.height {
            let (row, t) = (v / GRID_PX, (v % GRID_PX) as f32 / GRID_PX as f32);
            let (upper, lower) = (&self.grid[row * columns..][..columns], &self.grid[(row + 1) * columns..][..columns]);
            for column in 0..columns - 1 {
                let left = upper[column] + (lower[column] - upper[column]) * t;
                let right = upper[column + 1] + (lower[column + 1] - upper[column + 1]) * t;
                let count = GRID_PX.min(self.width - column * GRID_PX);
                self.grey.extend((0..count).map(|k| left + (right - left) * (k as f32 / GRID_PX as f32)));
            }
        }
    }

    /// At the pixel nearest to `p`, grey levels.
    #[inline]
    pub(crate) fn at(&self, p: Vector2<f64>) -> f64 {
        let (u, v) = (p.x.round().max(0.0) as usize, p.y.round().max(0.0) as usize);
        f64::from(self.grey[v.min(self.height - 1) * self.width + u.min(self.width - 1)])
    }
}

/// Brightness of open water as a function of the pixel.
struct Shine<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    mottle: Addressed,
    rays: Addressed,
    /// Where shafts of light come together, px: far outside the picture.
    sun: Vector2<f64>,
    diagonal: f64,
}

impl<'a> Shine<'a> {
    fn new(scene: &'a Scene, camera: &'a Camera) -> Self {
        let size = Vector2::new(f64::from(camera.width()), f64::from(camera.height()));
        let (sin, cos) = scene.light.from_deg.to_radians().sin_cos();
        let sun = size * 0.5 + Vector2::new(cos, sin) * (1.2 * size.norm());
        let mottle = Addressed::new(scene.seed, Stream::Mottle);
        Self { scene, camera, mottle, rays: Addressed::new(scene.seed, Stream::Rays), sun, diagonal: size.norm() }
    }

    fn at(&self, pixel: Vector2<f64>) -> f64 {
        let water = &self.scene.water;
        let mut grey = water.veil_grey;
        grey += water.gradient_grey * (0.5 - pixel.y / f64::from(self.camera.height()));
        if water.mottle_grey > 0.0 {
            let p = pixel / water.mottle_px;
            grey += water.mottle_grey
                * (self.mottle.smooth(p.x, p.y, 0) + 0.35 * self.mottle.smooth(3.1 * p.x, 3.1 * p.y, 1));
        }
        if water.rays_grey > 0.0 {
            let way = pixel - self.sun;
            let across = way.y.atan2(way.x) * 45.0;
            let along = way.norm() / self.diagonal;
            let shafts = self.rays.smooth(across, 0.4 * self.scene.time_s, 0)
                + 0.6 * self.rays.smooth(2.7 * across, 0.7 * self.scene.time_s, 1);
            grey += water.rays_grey * shafts * (1.9 - along).clamp(0.0, 1.0);
        }
        if water.glow_grey > 0.0 {
            grey += water.glow_grey * beam(self.scene, self.camera, pixel);
        }
        grey
    }
}

/// Share of the lamps' light in the direction of `pixel`.
fn beam(scene: &Scene, camera: &Camera, pixel: Vector2<f64>) -> f64 {
    let off_axis = camera.ray_from_pixel(pixel).map_or(f64::INFINITY, |ray| ray.xy().norm().atan());
    (-0.5 * (off_axis / scene.light.lamp_beam_deg.to_radians()).powi(2)).exp()
}

/// What light does on its way to a thing and from it to the camera.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Medium<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    veil: &'a Veil,
    caustic: Addressed,
    /// Towards the light in the picture, per px from the middle to a corner.
    towards_light: Vector2<f64>,
    /// Swelling and fading of all light.
    flicker: f64,
}

impl<'a> Medium<'a> {
    pub(crate) fn new(scene: &'a Scene, camera: &'a Camera, veil: &'a Veil) -> Self {
        let (sin, cos) = scene.light.from_deg.to_radians().sin_cos();
        let half_diagonal = 0.5 * f64::from(camera.width()).hypot(f64::from(camera.height()));
        // Two swells that do not repeat together; 0.59 Hz is a period of 17 frames at 10 Hz.
        let wave = |hertz: f64, phase: f64| (std::f64::consts::TAU * hertz * scene.time_s + phase).sin();
        let flicker = 1.0 + scene.light.flicker * (0.75 * wave(0.59, 0.0) + 0.25 * wave(1.37, 1.0));
        Self {
            scene,
            camera,
            veil,
            caustic: Addressed::new(scene.seed, Stream::Caustic),
            towards_light: Vector2::new(cos, sin) / half_diagonal,
            flicker,
        }
    }

    /// Direction towards the light in the picture.
    pub(crate) fn towards_light(&self) -> Vector2<f64> {
        self.towards_light.normalize()
    }

    /// Light that falls on `point` (camera frame), seen at `pixel`, which lies at `place` on its surface, m.
    fn light(&self, point: Vector3<f64>, pixel: Vector2<f64>, place: Vector2<f64>) -> f64 {
        let light = &self.scene.light;
        let mut sum = self.flicker;
        if light.gradient != 0.0 {
            let middle = Vector2::new(f64::from(self.camera.width()), f64::from(self.camera.height())) * 0.5;
            sum *= 1.0 + light.gradient * self.towards_light.dot(&(pixel - middle));
        }
        if light.caustic > 0.0 {
            // Bright threads where two drifting fields cancel; mean 0.38 and deviation 0.33 are taken out.
            let p = place / light.caustic_m;
            let t = 0.55 * self.scene.time_s;
            let field = self.caustic.smooth(p.x + t, p.y - 0.6 * t, 0)
                + self.caustic.smooth(1.3 * p.x - 0.8 * t, 1.3 * p.y + t, 1);
            let thread = (-1.5 * field * field).exp();
            sum *= (1.0 + light.caustic * (thread - 0.38) / 0.33).max(0.0);
        }
        if light.lamp > 0.0 {
            let near = (1.0 / point.norm_squared()).min(9.0);
            sum = (1.0 - light.lamp) * sum + light.lamp * near * beam(self.scene, self.camera, pixel);
        }
        sum.max(0.0)
    }

    /// Share of a thing's light that comes through from `point`.
    pub(crate) fn transmittance(&self, point: Vector3<f64>) -> f64 {
        let c = self.scene.water.attenuation_per_m;
        if c == 0.0 { 1.0 } else { (-c * point.norm()).exp() }
    }

    /// Brightness at the camera, grey levels, of a thing of brightness `grey` at `point` (camera frame), seen at `pixel`.
    pub(crate) fn seen(&self, grey: f64, point: Vector3<f64>, pixel: Vector2<f64>, place: Vector2<f64>) -> f64 {
        let through = self.transmittance(point);
        let own = grey * self.light(point, pixel, place) * through;
        if through == 1.0 { own } else { own + self.veil.at(pixel) * (1.0 - through) }
    }

    pub(crate) fn camera(&self) -> &'a Camera {
        self.camera
    }

    pub(crate) fn scene(&self) -> &'a Scene {
        self.scene
    }
}
