//! Patterned planes that are no net.

use nalgebra::Vector2;

use super::water::Medium;
use crate::random::{Addressed, Stream};
use crate::scene::{Backdrop, Texture};

/// Rays per pixel and direction for patterns with sharp edges.
const SHARP_RAYS: usize = 2;

/// Draws the backdrop over what `picture` shows.
pub(crate) fn paint(backdrop: &Backdrop, medium: &Medium, picture: &mut [f32]) {
    let camera = medium.camera();
    let pose = backdrop.pose.pose();
    let plane = pose.plane();
    let pattern = Pattern::new(backdrop);
    let width = camera.width() as usize;
    let smooth = matches!(backdrop.texture, Texture::Noise | Texture::Band | Texture::LatticeNoise | Texture::Seabed);
    let rays = if smooth { 1 } else { SHARP_RAYS };
    for (k, out) in picture.iter_mut().enumerate() {
        let centre = Vector2::new((k % width) as f64, (k / width) as f64);
        let (mut sum, mut count) = (0.0, 0);
        for ray in 0..rays * rays {
            let step = |n: usize| (n as f64 + 0.5) / rays as f64 - 0.5;
            let pixel = centre + Vector2::new(step(ray % rays), step(ray / rays));
            let Some(ray) = camera.ray_from_pixel(pixel) else { continue };
            let Some(depth) = plane.depth_along(ray) else { continue };
            let place = pose.inverse_transform(ray * depth).xy();
            // Detail finer than two pixels is lost before it can alias.
            let pixel_m = depth * depth * camera.fx().recip() / plane.distance;
            let kept = 1.0 / (1.0 + (2.0 * pixel_m / backdrop.scale_m).powi(4));
            let grey = backdrop.grey + backdrop.contrast_grey * kept * pattern.at(place);
            sum += medium.seen(grey.max(0.0), ray * depth, pixel, place);
            count += 1;
        }
        if count > 0 {
            *out += (sum / f64::from(count) - f64::from(*out)) as f32 * (count as f32 / (rays * rays) as f32);
        }
    }
}

/// A pattern as a function of the place, about ±1.
struct Pattern {
    texture: Texture,
    scale: f64,
    noise: Addressed,
    /// Plane waves: wave vector per `scale`, phase, amplitude.
    waves: Vec<(Vector2<f64>, f64, f64)>,
    lines: Vec<Line>,
}

/// A straight line, lengths in `scale`.
struct Line {
    through: Vector2<f64>,
    along: Vector2<f64>,
    half_width: f64,
    bright: f64,
}

impl Pattern {
    fn new(backdrop: &Backdrop) -> Self {
        let noise = Addressed::new(backdrop.seed, Stream::Texture);
        let tau = std::f64::consts::TAU;
        let mut waves = Vec::new();
        let mut lines = Vec::new();
        match backdrop.texture {
            Texture::Band => {
                // Sixty waves of one length in all directions.
                for k in 0..60 {
                    let angle = tau * noise.uniform(k, 0, 1);
                    let length = 1.0 + 0.06 * noise.normal(k, 1, 1);
                    let wave = Vector2::new(angle.cos(), angle.sin()) / length;
                    waves.push((wave, tau * noise.uniform(k, 2, 1), (2.0f64 / 60.0).sqrt()));
                }
            }
            Texture::LatticeNoise => {
                // Each harmonic of a square lattice is a bundle of waves a tenth apart: it keeps its phase for a few cells only.
                let harmonics = [
                    (1.0, 0.0, 1.0),
                    (0.0, 1.0, 1.0),
                    (2.0, 0.0, 0.7),
                    (0.0, 2.0, 0.7),
                    (3.0, 0.0, 0.4),
                    (0.0, 3.0, 0.4),
                ];
                for (h, &(x, y, weight)) in harmonics.iter().enumerate() {
                    for k in 0..10 {
                        let at = (h as i64, k);
                        let off = Vector2::new(noise.normal(at.0, at.1, 2), noise.normal(at.0, at.1, 3)) * 0.1;
                        let phase = tau * noise.uniform(at.0, at.1, 4);
                        waves.push((Vector2::new(x, y) + off, phase, weight * (2.0f64 / 10.0 / 3.3).sqrt()));
                    }
                }
            }
            Texture::Sticks => {
                for k in 0..140 {
                    let number = |n: i64| noise.uniform(k, n, 5);
                    let angle = std::f64::consts::PI * number(2);
                    lines.push(Line {
                        through: Vector2::new(number(0) - 0.5, number(1) - 0.5) * 40.0,
                        along: Vector2::new(angle.cos(), angle.sin()),
                        half_width: 0.02 + 0.03 * number(3),
                        bright: 0.5 + number(4),
                    });
                }
            }
            _ => {}
        }
        Self { texture: backdrop.texture, scale: backdrop.scale_m, noise, waves, lines }
    }

    fn at(&self, place: Vector2<f64>) -> f64 {
        let p = place / self.scale;
        let line = |distance: f64, half: f64| -> f64 { if distance.abs() < half { 1.0 } else { 0.0 } };
        match self.texture {
            Texture::Seabed => {
                let sand = self.noise.fractal(0.25 * p.x, 0.25 * p.y, 6);
                let stone = self.noise.fractal(0.06 * p.x, 0.06 * p.y, 3);
                0.7 * sand + if stone > 1.5 { -1.3 } else { 0.3 * stone }
            }
            Texture::Noise => self.noise.smooth(2.0 * p.x, 2.0 * p.y, 0),
            Texture::Band | Texture::LatticeNoise => {
                let tau = std::f64::consts::TAU;
                self.waves.iter().map(|(wave, phase, amplitude)| amplitude * (tau * wave.dot(&p) + phase).cos()).sum()
            }
            Texture::Stripes => {
                let wobble = 0.02 * self.noise.smooth(0.3 * p.x, 0.3 * p.y, 0);
                let s = (p.x + wobble).rem_euclid(1.0);
                (if s < 0.5 { 1.0 } else { -1.0 }) + 0.15 * self.noise.smooth(3.0 * p.x, 0.2 * p.y, 1)
            }
            Texture::Bricks => {
                let row = p.y.floor();
                let x = 0.5 * p.x + 0.5 * row.rem_euclid(2.0);
                let (dx, dy) = (2.0 * (x - x.round()), p.y - p.y.round());
                let mortar = line(dx, 0.07).max(line(dy, 0.07));
                let own = 0.35 * (self.noise.uniform(x.floor() as i64, row as i64, 6) - 0.5);
                1.4 * mortar - 0.4 + own + 0.12 * self.noise.smooth(9.0 * p.x, 9.0 * p.y, 0)
            }
            Texture::Scales => {
                // The topmost of overlapping discs in rows, each row half a disc aside.
                let mut grey = -1.0;
                for k in 0..3 {
                    let row = (p.y / 0.5).floor() - f64::from(k);
                    let x = p.x + 0.5 * row.rem_euclid(2.0);
                    let centre = Vector2::new(x.floor() + 0.5, row * 0.5);
                    let r = (Vector2::new(x, p.y) - centre).norm();
                    if r < 0.75 && p.y >= centre.y {
                        grey = 1.6 * r - 0.6 + if r > 0.66 { -1.2 } else { 0.0 };
                        break;
                    }
                }
                grey + 0.2 * self.noise.smooth(1.3 * p.x, 1.3 * p.y, 0)
            }
            Texture::Cells => {
                let (mut first, mut second) = (f64::INFINITY, f64::INFINITY);
                let (i, j) = (p.x.floor() as i64, p.y.floor() as i64);
                for (a, b) in (-2..=2).flat_map(|a| (-2..=2).map(move |b| (i + a, j + b))) {
                    let seed =
                        Vector2::new(a as f64 + self.noise.uniform(a, b, 7), b as f64 + self.noise.uniform(a, b, 8));
                    let d = (seed - p).norm();
                    if d < first {
                        (first, second) = (d, first);
                    } else {
                        second = second.min(d);
                    }
                }
                1.8 * line(second - first, 0.09) - 0.5
            }
            Texture::Hexagons => {
                // The two nearest centres of a triangular lattice: their bisector is a mesh side.
                let rise = 3f64.sqrt() / 2.0;
                let j = (p.y / rise).floor();
                let (mut first, mut second) = (f64::INFINITY, f64::INFINITY);
                for row in -1..=2 {
                    let y = j + f64::from(row);
                    let shift = 0.5 * y.rem_euclid(2.0);
                    let i = (p.x - shift).floor();
                    for column in -1..=2 {
                        let d = (Vector2::new(i + f64::from(column) + shift, y * rise) - p).norm();
                        if d < first {
                            (first, second) = (d, first);
                        } else {
                            second = second.min(d);
                        }
                    }
                }
                1.8 * line(second - first, 0.06) - 0.4
            }
            Texture::Sticks => {
                let hit = self.lines.iter().find(|l| (p - l.through).perp(&l.along).abs() < l.half_width);
                hit.map_or(-0.3, |l| 1.4 * l.bright)
            }
            Texture::RandomGrid => {
                // Lines at random places, one a cell on average: 0.12 to 0.88 into it.
                let family = |x: f64, layer: i64| {
                    (-1..=1).any(|d| {
                        let cell = x.floor() as i64 + d;
                        line(x - (cell as f64 + self.noise.between(0.12, 0.88, cell, 0, layer)), 0.04) > 0.0
                    })
                };
                if family(p.x, 9) || family(p.y, 10) { 1.4 } else { -0.15 }
            }
        }
    }
}
