//! A small generator of net sequences with known motion.
#![allow(dead_code)] // each test file uses its own part

use nalgebra::Vector2;
use net_flow::Motion;
use net_image::{GrayView, Image};

/// Deterministic numbers.
pub struct Random(pub u64);

impl Random {
    /// Uniform in 0..1.
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
    /// Near enough to a standard normal.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// What a sequence shows.
pub struct Scene {
    pub width: usize,
    pub height: usize,
    /// Knot to knot, px.
    pub cell: f64,
    /// Displacement of the knots, cells.
    pub jitter: f64,
    pub fouling: usize,
    pub fish: usize,
    /// Whether the light flickers.
    pub flicker: bool,
    /// Standard deviation of the sensor's noise, grey levels.
    pub noise: f64,
    pub seed: u64,
    /// The net as light, 0 to 1, twice as fine as the pictures, and its knots in picture units.
    pub texture: Image<u8>,
    pub knots: Vec<Vector2<f64>>,
    pub background: Image<u8>,
}

/// Texture margin round the picture, px.
const MARGIN: f64 = 220.0;
/// Texture pixels per picture pixel.
const FINE: f64 = 2.0;

impl Scene {
    pub fn new(cell: f64, jitter: f64, fouling: usize) -> Self {
        let (width, height) = (480, 320);
        let mut random = Random(7);
        let (w, h) = (width as f64 + 2.0 * MARGIN, height as f64 + 2.0 * MARGIN);
        let (columns, rows) = ((w / cell) as usize + 2, (h / cell) as usize + 2);
        let mut knots = Vec::new();
        for j in 0..rows {
            for i in 0..columns {
                let offset = Vector2::new(random.normal(), random.normal()) * (jitter * cell);
                knots.push(Vector2::new(i as f64, j as f64) * cell + offset - Vector2::repeat(MARGIN));
            }
        }
        let mut light = vec![0u8; (w * FINE) as usize * (h * FINE) as usize];
        let stride = (w * FINE) as usize;
        let mut paint = |centre: Vector2<f64>, reach: f64, value: &dyn Fn(Vector2<f64>) -> f64| {
            let c = (centre + Vector2::repeat(MARGIN)) * FINE;
            let r = (reach * FINE).ceil();
            for v in (c.y - r).floor() as i64..=(c.y + r).ceil() as i64 {
                for u in (c.x - r).floor() as i64..=(c.x + r).ceil() as i64 {
                    if u < 0 || v < 0 || u as usize >= stride || v as usize * stride + u as usize >= light.len() {
                        continue;
                    }
                    let at = Vector2::new(u as f64, v as f64) / FINE - Vector2::repeat(MARGIN);
                    let old = &mut light[v as usize * stride + u as usize];
                    *old = (*old).max((255.0 * value(at)) as u8);
                }
            }
        };
        for j in 0..rows {
            for i in 0..columns {
                let a = knots[j * columns + i];
                for (di, dj) in [(1, 0), (0, 1)] {
                    if i + di >= columns || j + dj >= rows {
                        continue;
                    }
                    let b = knots[(j + dj) * columns + i + di];
                    let (middle, length) = ((a + b) / 2.0, (b - a).norm());
                    paint(middle, length / 2.0 + 3.0, &|p| {
                        let along = ((p - a).dot(&(b - a)) / (length * length)).clamp(0.0, 1.0);
                        (1.8 - (p - a - (b - a) * along).norm()).clamp(0.0, 1.0) * 0.8
                    });
                }
            }
        }
        for _ in 0..fouling {
            let centre = Vector2::new(random.uniform() * w, random.uniform() * h) - Vector2::repeat(MARGIN);
            let radius = 3.0 + 5.0 * random.uniform();
            paint(centre, radius + 1.0, &|p| (radius - (p - centre).norm() + 0.5).clamp(0.0, 1.0) * 0.7);
        }
        let texture = Image::from_vec(light, stride, (h * FINE) as usize).expect("as many as its size says");
        let water = |i: usize| {
            let (u, v) = ((i % width) as f64, (i / width) as f64);
            (80.0 + 25.0 * (u / 190.0).sin() * (v / 130.0).cos() + 12.0 * (u / 47.0 + v / 61.0).sin()) as u8
        };
        let background = Image::from_vec((0..width * height).map(water).collect(), width, height).expect("its size");
        Self {
            width,
            height,
            cell,
            jitter,
            fouling,
            fish: 0,
            flicker: false,
            noise: 3.0,
            seed: 1,
            texture,
            knots,
            background,
        }
    }

    /// The picture of frame `k` when the net, as it lay at the start, has moved by `motion`.
    pub fn draw(&self, k: usize, motion: &Motion) -> Image<u8> {
        let mut random = Random(self.seed.wrapping_mul(1000) + k as u64);
        let back = motion.inverse().expect("test motions are invertible");
        let gain = if self.flicker { 1.0 + 0.15 * (k as f64 / 2.7).sin() + 0.05 * random.normal() } else { 1.0 };
        let noise: Vec<f64> = (0..9973).map(|_| self.noise * random.normal()).collect();
        let mut image = Image::new(self.width, self.height);
        let fine = self.texture.view().expect("a picture");
        for v in 0..self.height {
            let start = (random.uniform() * 9000.0) as usize;
            for u in 0..self.width {
                let p = Vector2::new(u as f64, v as f64);
                let at = (back.apply(p) + Vector2::repeat(MARGIN)) * FINE;
                let twine = net_image::bilinear(fine, at.x, at.y).map_or(0.0, f64::from) / 255.0;
                let mut x = f64::from(self.background.row(v)[u]) * (1.0 - 0.6 * twine) + 126.0 * twine;
                for f in 0..self.fish {
                    let fish = Vector2::new(
                        (13.0 * k as f64 * (1.0 + 0.2 * f as f64) + 260.0 * f as f64) % (self.width as f64 + 200.0)
                            - 100.0,
                        [160.0, 70.0, 250.0][f % 3],
                    );
                    let d = p - fish;
                    if (d.x / 70.0).powi(2) + (d.y / 22.0).powi(2) < 1.0 {
                        x = 60.0 + 25.0 * (d.x / 9.0).sin() + if d.y < 0.0 { 30.0 } else { 0.0 };
                    }
                }
                if self.flicker {
                    x = x * gain + 6.0 * (u as f64 / 130.0 + k as f64 / 3.0).sin();
                }
                image.row_mut(v)[u] = (x + noise[(start + u) % noise.len()] + 0.5) as u8;
            }
        }
        image
    }

    /// The smooth wander of a vehicle at rest against a net: turns, comes nearer, drifts; frame `k` of `n`, back at the start when `n`
    /// frames have passed if `closed`.
    pub fn wander(&self, k: usize, n: usize, closed: bool) -> Motion {
        let u = k as f64 / (n as f64 - 1.0);
        let way = if closed { (std::f64::consts::PI * u).sin() } else { u };
        let tau = std::f64::consts::TAU;
        let shift = Vector2::new(-75.0 * way + 3.0 * (tau * 3.0 * u).sin(), 41.0 * way + 2.0 * (tau * 2.0 * u).sin());
        let (angle, scale) = (0.035 * (tau * u).sin(), 1.0 + 0.03 * (tau * u).sin());
        let (a, b) = (scale * angle.cos(), scale * angle.sin());
        let c = Vector2::new(self.width as f64, self.height as f64) / 2.0;
        let turned = Vector2::new(a * c.x - b * c.y, b * c.x + a * c.y);
        Motion::similarity(a, b, c + shift - turned)
    }

    /// Knots that stay at least 40 px inside the picture under all of `motions`.
    pub fn steady_knots(&self, motions: &[Motion]) -> Vec<Vector2<f64>> {
        let inside = |p: Vector2<f64>| {
            p.x > 40.0 && p.y > 40.0 && p.x < self.width as f64 - 40.0 && p.y < self.height as f64 - 40.0
        };
        let steady = |p: &&Vector2<f64>| motions.iter().all(|m| inside(m.apply(**p)));
        self.knots.iter().filter(steady).copied().collect()
    }
}

/// Borrows a picture.
pub fn view(image: &Image<u8>) -> GrayView<'_> {
    image.view().expect("pictures of the generator have pixels")
}

/// The median of the distances.
pub fn median(mut values: Vec<f64>) -> f64 {
    assert!(!values.is_empty(), "nothing to take a median of");
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
