//! Fish, ropes, ladders, kelp: outlines at one depth, with a pattern inside.

use nalgebra::Vector2;

use super::profile::{EdgeSpread, REACH_SIGMA};
use super::water::Medium;
use crate::random::{Addressed, Stream};
use crate::scene::{Kind, Object};

/// Size of the tiles that are looked at first, px.
const TILE: usize = 16;

/// Draws objects; owns what that takes.
#[derive(Debug, Default)]
pub(crate) struct ObjectPainter {
    /// The outline being drawn, in the object's frame, m.
    outline: Vec<Vector2<f64>>,
    /// The same in the picture, px.
    pixels: Vec<Vector2<f64>>,
    /// Share of each pixel that the object drawn last hides, and the picture's width.
    hidden: Vec<f32>,
    width: usize,
}

/// An object and the frame it is described in: x along its long side, y across, m.
struct Frame<'a> {
    object: &'a Object,
    centre: Vector2<f64>,
    range_m: f64,
    along: Vector2<f64>,
    across: Vector2<f64>,
    /// How a swimming or swaying body bends now: phase, rad.
    phase: f64,
    noise: Addressed,
}

impl<'a> Frame<'a> {
    fn new(object: &'a Object, time_s: f64) -> Self {
        let moved = object.velocity_m_per_s.map(|v| v * time_s);
        let (sin, cos) = object.turn_deg.to_radians().sin_cos();
        let noise = Addressed::new(object.seed, Stream::Object);
        let tempo = if object.kind == Kind::Fish { 9.0 } else { 0.8 };
        Self {
            object,
            centre: Vector2::new(object.x_m + moved[0], object.y_m + moved[1]),
            range_m: object.range_m + moved[2],
            along: Vector2::new(cos, sin),
            across: Vector2::new(-sin, cos),
            phase: tempo * time_s + std::f64::consts::TAU * noise.uniform(0, 0, 0),
            noise,
        }
    }

    /// Position in the camera frame at depth `range_m`, m.
    fn out(&self, p: Vector2<f64>) -> Vector2<f64> {
        self.centre + self.along * p.x + self.across * p.y
    }

    /// A place at that depth in the object's frame.
    fn into(&self, p: Vector2<f64>) -> Vector2<f64> {
        let d = p - self.centre;
        Vector2::new(self.along.dot(&d), self.across.dot(&d))
    }

    /// Sideways bend of the middle line at `x`, m.
    fn bend(&self, x: f64) -> f64 {
        let o = self.object;
        match o.kind {
            Kind::Fish => {
                // Grows towards the tail (x > 0 is the tail's side).
                let s = (x / o.length_m + 0.5).clamp(0.0, 1.2);
                0.035 * o.length_m * s * s * (self.phase - 4.0 * s).sin()
            }
            Kind::Kelp => {
                let s = x / o.length_m;
                0.05 * o.length_m * ((5.0 * s + self.phase).sin() + 0.4 * (13.0 * s + 1.7 * self.phase).sin())
            }
            Kind::Rope | Kind::Ladder | Kind::Rod => 0.0,
        }
    }

    /// Half the body's height at `x`, m.
    fn half_height(&self, x: f64) -> f64 {
        let o = self.object;
        let s = (x / o.length_m + 0.5).clamp(0.0, 1.0);
        match o.kind {
            // A spindle, fullest at a third, that ends in the tail's root.
            Kind::Fish => {
                0.5 * o.width_m * ((std::f64::consts::PI * s.powf(0.62)).sin().max(0.0).powf(0.75) + 0.22 * s * s)
            }
            Kind::Kelp => {
                0.5 * o.width_m * (0.4 + 0.6 * (std::f64::consts::PI * s).sin()) * (1.0 + 0.15 * (40.0 * s).sin())
            }
            Kind::Rope | Kind::Ladder | Kind::Rod => 0.5 * o.width_m,
        }
    }

    /// Brightness at `p` of the object's frame, relative to the object's.
    fn pattern(&self, p: Vector2<f64>) -> f64 {
        let o = self.object;
        let c = o.contrast;
        let half = self.half_height(p.x).max(1e-6);
        let y = ((p.y - self.bend(p.x)) / half).clamp(-1.0, 1.0);
        let round = 1.0 - 0.35 * y * y;
        match o.kind {
            Kind::Fish => {
                let body = 2.0 * p.x / o.length_m;
                // Back up: the belly is on the side that hangs down in the picture.
                let down = if self.across.y >= 0.0 { y } else { -y };
                let belly = 1.0 / (1.0 + (-6.0 * (down - 0.1)).exp());
                let spots = self.noise.smooth(p.x * 90.0, p.y * 90.0, 1) + self.noise.smooth(p.x * 40.0, p.y * 40.0, 2);
                let spotted = if down < 0.25 && spots > 1.9 { -0.5 } else { 0.0 };
                let eye = (Vector2::new(body + 0.86, y + 0.25).component_mul(&Vector2::new(1.0, 0.35))).norm() < 0.045;
                let scales = 0.06 * self.noise.smooth(p.x * 220.0, p.y * 220.0, 3);
                if eye { 1.0 - c } else { (1.0 + c * (1.9 * belly - 0.35 + spotted + scales)) * round }
            }
            Kind::Rope => {
                let strands = (std::f64::consts::TAU * (p.x / (1.1 * o.width_m) + 0.5 * y)).sin();
                (1.0 + 0.6 * c * strands) * round
            }
            Kind::Kelp => (1.0 + 0.4 * c * self.noise.smooth(p.x * 25.0, y * 2.0, 1)) * round,
            Kind::Ladder | Kind::Rod => 1.0 - 0.5 * c * y * y,
        }
    }
}

impl ObjectPainter {
    /// Share of the pixel nearest to `p` that the object drawn last hides.
    pub(crate) fn cover(&self, p: Vector2<f64>) -> f32 {
        let (u, v) = (p.x.round(), p.y.round());
        if u < 0.0 || v < 0.0 || u >= self.width as f64 {
            return 0.0;
        }
        self.hidden.get(v as usize * self.width + u as usize).copied().unwrap_or(0.0)
    }

    /// Draws an object over what `picture` shows; its outlines in the picture go to `outlines`.
    pub(crate) fn paint(
        &mut self,
        object: &Object,
        medium: &Medium,
        edge: &EdgeSpread,
        picture: &mut [f32],
        outlines: &mut Vec<Vec<Vector2<f64>>>,
    ) {
        self.hidden.clear();
        self.hidden.resize(picture.len(), 0.0);
        self.width = medium.camera().width() as usize;
        let frame = Frame::new(object, medium.scene().time_s);
        if frame.range_m < 0.05 {
            return;
        }
        let (length, width) = (object.length_m, object.width_m);
        match object.kind {
            Kind::Ladder => {
                let rail = 0.09 * width;
                for y in [-0.5 * width, 0.5 * width] {
                    self.bar(
                        &frame,
                        [Vector2::new(-0.5 * length, y), Vector2::new(0.5 * length, y)],
                        rail,
                        medium,
                        edge,
                        picture,
                        outlines,
                    );
                }
                // Rungs 0.8 widths apart, as long as the width.
                let count = (length / (0.8 * width)).floor() as i32;
                for k in 0..count.min(200) {
                    let x = -0.5 * length + (f64::from(k) + 0.5) * 0.8 * width;
                    self.bar(
                        &frame,
                        [Vector2::new(x, -0.5 * width), Vector2::new(x, 0.5 * width)],
                        0.8 * rail,
                        medium,
                        edge,
                        picture,
                        outlines,
                    );
                }
            }
            Kind::Rope | Kind::Rod => {
                let ends = [Vector2::new(-0.5 * length, 0.0), Vector2::new(0.5 * length, 0.0)];
                self.bar(&frame, ends, width, medium, edge, picture, outlines);
            }
            Kind::Fish | Kind::Kelp => {
                self.body(&frame);
                self.fill(&frame, medium, edge, picture, outlines);
            }
        }
    }

    /// Outline of a body around its bending middle line; a fish's with tail and fins.
    fn body(&mut self, frame: &Frame) {
        const STEPS: i32 = 28;
        let (length, width) = (frame.object.length_m, frame.object.width_m);
        let x = |k: i32| length * (f64::from(k) / f64::from(STEPS) - 0.5);
        let side = |k: i32, sign: f64| Vector2::new(x(k), frame.bend(x(k)) + sign * frame.half_height(x(k)));
        self.outline.clear();
        let fish = frame.object.kind == Kind::Fish;
        let upper = if frame.across.y >= 0.0 { -1.0 } else { 1.0 };
        for k in 0..=STEPS {
            let mut p = side(k, upper);
            // The dorsal fin, a little behind the middle.
            if fish && (13..=16).contains(&k) {
                p.y += upper * width * [0.0, 0.34, 0.28, 0.12][(k - 13) as usize];
            }
            self.outline.push(p);
        }
        if fish {
            let root = 0.5 * length;
            let swing = frame.bend(root * 1.15);
            for (dx, dy) in [(0.17, 0.52), (0.11, 0.0), (0.17, -0.52)] {
                self.outline.push(Vector2::new(root + dx * length, swing + upper * dy * width));
            }
        }
        for k in (0..=STEPS).rev() {
            let mut p = side(k, -upper);
            if fish && [9, 17].contains(&k) {
                p.y -= upper * 0.2 * width;
                p.x += 0.02 * length;
            }
            self.outline.push(p);
        }
    }

    /// Draws a straight bar.
    fn bar(
        &mut self,
        frame: &Frame,
        [a, b]: [Vector2<f64>; 2],
        width_m: f64,
        medium: &Medium,
        edge: &EdgeSpread,
        picture: &mut [f32],
        outlines: &mut Vec<Vec<Vector2<f64>>>,
    ) {
        let along = (b - a).try_normalize(1e-12).unwrap_or(Vector2::x());
        let across = Vector2::new(-along.y, along.x) * (0.5 * width_m);
        self.outline.clear();
        // Cut into pieces: a lens bends a long bar.
        let count = 24;
        let at = |k: i32| a + (b - a) * (f64::from(k) / f64::from(count));
        self.outline.extend((0..=count).map(|k| at(k) + across));
        self.outline.extend((0..=count).rev().map(|k| at(k) - across));
        self.fill(frame, medium, edge, picture, outlines);
    }

    /// Draws the outline filled with the object's pattern.
    fn fill(
        &mut self,
        frame: &Frame,
        medium: &Medium,
        edge: &EdgeSpread,
        picture: &mut [f32],
        outlines: &mut Vec<Vec<Vector2<f64>>>,
    ) {
        let camera = medium.camera();
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        self.pixels.clear();
        for &p in &self.outline {
            let q = frame.out(p);
            let Some(pixel) = camera.pixel_from_point(q.push(frame.range_m)) else { return };
            self.pixels.push(pixel);
        }
        let sigma = medium.scene().sensor.psf_px;
        let reach = REACH_SIGMA * sigma;
        let bounds = |of: fn(&Vector2<f64>) -> f64, size: usize| {
            let low = self.pixels.iter().map(of).fold(f64::INFINITY, f64::min) - reach;
            let high = self.pixels.iter().map(of).fold(f64::NEG_INFINITY, f64::max) + reach;
            let (low, high) = (low.ceil().max(0.0), high.floor().min(size as f64 - 1.0));
            (low <= high).then_some(low as usize..high as usize + 1)
        };
        let (Some(columns), Some(rows)) = (bounds(|p| p.x, width), bounds(|p| p.y, height)) else { return };
        outlines.push(self.pixels.clone());
        // Tiles that the outline does not come near are inside or outside as a whole.
        for top in rows.clone().step_by(TILE) {
            for left in columns.clone().step_by(TILE) {
                let half = 0.5 * (TILE as f64 - 1.0);
                let centre = Vector2::new(left as f64 + half, top as f64 + half);
                let clear = reach + half * std::f64::consts::SQRT_2;
                let depth = inside_by(&self.pixels, centre, clear);
                if depth <= -clear {
                    continue;
                }
                let whole = depth >= clear;
                for v in top..(top + TILE).min(rows.end) {
                    for u in left..(left + TILE).min(columns.end) {
                        let pixel = Vector2::new(u as f64, v as f64);
                        let cover = if whole {
                            1.0
                        } else {
                            edge.below((inside_by(&self.pixels, pixel, reach) / sigma) as f32)
                        };
                        let Some(ray) = camera.ray_from_pixel(pixel).filter(|_| cover > 0.0) else { continue };
                        let point = ray * frame.range_m;
                        let grey = frame.object.grey * frame.pattern(frame.into(point.xy()));
                        let seen = medium.seen(grey, point, pixel, point.xy()) as f32;
                        let k = v * width + u;
                        picture[k] += cover * (seen - picture[k]);
                        self.hidden[k] = 1.0 - (1.0 - self.hidden[k]) * (1.0 - cover);
                    }
                }
            }
        }
    }
}

/// Signed distance of `p` from the outline, positive inside, px; cut off at `reach`.
fn inside_by(outline: &[Vector2<f64>], p: Vector2<f64>, reach: f64) -> f64 {
    let (mut nearest, mut inside) = (reach * reach, false);
    let mut a = outline[outline.len() - 1];
    for &b in outline {
        if (a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y) {
            inside = !inside;
        }
        let (side, way) = (b - a, p - a);
        let t = (way.dot(&side) / side.norm_squared().max(1e-12)).clamp(0.0, 1.0);
        nearest = nearest.min((way - side * t).norm_squared());
        a = b;
    }
    if inside { nearest.sqrt() } else { -nearest.sqrt() }
}
