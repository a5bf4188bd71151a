//! Twine as strokes: a strip of given width between two points, seen through a Gaussian point spread, in closed form.
//!
//! The strokes of a twine share the cut across each knot they meet at, so that every pixel belongs to one stroke of a twine and
//! coverage may be summed: of one twine nothing is counted twice, and of neighbouring twines the tails add up as light does.

use nalgebra::Vector2;

use super::profile::{EdgeSpread, REACH_SIGMA};

/// Coverage and light of one family of twines, and the size of the picture.
#[derive(Debug, Default)]
pub(crate) struct Family {
    /// Share of the pixel that twine covers; may exceed 1 where twines lie over each other.
    pub(crate) coverage: Vec<f32>,
    /// Coverage times brightness, grey levels.
    pub(crate) light: Vec<f32>,
    width: usize,
    height: usize,
}

impl Family {
    pub(crate) fn clear(&mut self, width: usize, height: usize) {
        for buffer in [&mut self.coverage, &mut self.light] {
            buffer.clear();
            buffer.resize(width * height, 0.0);
        }
        (self.width, self.height) = (width, height);
    }

    /// Coverage of the pixel nearest to `p`; nothing outside.
    pub(crate) fn at(&self, p: Vector2<f64>) -> f32 {
        let (u, v) = (p.x.round(), p.y.round());
        let inside = u >= 0.0 && v >= 0.0 && u < self.width as f64 && v < self.height as f64;
        if inside { self.coverage[v as usize * self.width + u as usize] } else { 0.0 }
    }
}

/// A point of a twine in the picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Vertex {
    /// Pixel of the twine's axis.
    pub(crate) pixel: Vector2<f64>,
    /// Apparent width across the twine, px.
    pub(crate) width_px: f64,
    /// Brightness as it arrives at the camera, grey levels.
    pub(crate) grey: f64,
}

/// How a stroke ends.
#[derive(Debug, Clone, Copy)]
pub(crate) enum End {
    /// The twine goes on: cut along the line through the vertex across this direction (the tangent there).
    Joint(Vector2<f64>),
    /// The twine ends here.
    Free,
}

/// A piece of twine.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stroke {
    pub(crate) from: Vertex,
    pub(crate) to: Vertex,
    /// How far the middle lies off the chord, px, to the right of the way from `from` to `to` (v is down); the stroke is a parabola.
    pub(crate) bow_px: f64,
    /// How much brighter its right side is than its middle, and darker its left: share.
    pub(crate) shade: f64,
    pub(crate) start: End,
    pub(crate) end: End,
}

/// Pixels `u` in `[first, last)` of one row.
#[derive(Clone, Copy)]
struct Span {
    first: f64,
    last: f64,
}

impl Span {
    /// Keeps the pixels at or ahead of the line through `point` across `direction` (`ahead`), or those before it. The two are
    /// complements to the last bit.
    fn cut(&mut self, v: f64, point: Vector2<f64>, direction: Vector2<f64>, ahead: bool) {
        let rise = (v - point.y) * direction.y;
        if direction.x == 0.0 {
            if (rise >= 0.0) != ahead {
                self.last = self.first;
            }
            return;
        }
        let crossing = point.x - rise / direction.x;
        if direction.x > 0.0 {
            let boundary = crossing.ceil();
            if ahead { self.first = self.first.max(boundary) } else { self.last = self.last.min(boundary) }
        } else {
            let boundary = crossing.floor() + 1.0;
            if ahead { self.last = self.last.min(boundary) } else { self.first = self.first.max(boundary) }
        }
    }
}

impl Stroke {
    /// Direction at the start and at the end, of unit length.
    pub(crate) fn tangents(&self) -> [Vector2<f64>; 2] {
        let chord = self.to.pixel - self.from.pixel;
        let length = chord.norm();
        if length < 1e-9 {
            return [Vector2::x(); 2];
        }
        // A parabola that leaves its chord by `bow` in the middle starts and ends with a slope of 4 bow / length.
        let lean = Vector2::new(-chord.y, chord.x) / length * (4.0 * self.bow_px);
        [(chord + lean).normalize(), (chord - lean).normalize()]
    }

    /// Adds the stroke to its family.
    pub(crate) fn draw(&self, family: &mut Family, edge: &EdgeSpread, sigma: f64) {
        let (p0, p1) = (self.from.pixel, self.to.pixel);
        let chord = p1 - p0;
        let length = chord.norm();
        if !(length > 1e-9 && length < 1e5) {
            return;
        }
        let along = chord / length;
        let across = Vector2::new(-along.y, along.x);
        let spread = REACH_SIGMA * sigma;
        let reach = 0.5 * self.from.width_px.max(self.to.width_px) + spread + self.bow_px.abs();
        // How far the strip goes beyond its end points: a slanted cut reaches further than a straight one.
        let overhang = |end: End| match end {
            End::Joint(tangent) => {
                let slope = across.dot(&tangent) / along.dot(&tangent).max(0.3);
                reach * slope.abs() + 1.0
            }
            End::Free => spread,
        };
        let (back, front) = (overhang(self.start), overhang(self.end));
        let (a, b) = (p0 - along * back, p1 + along * front);
        let v_low = (a.y.min(b.y) - reach * across.y.abs()).ceil().max(0.0);
        let v_high = (a.y.max(b.y) + reach * across.y.abs()).floor().min(family.height as f64 - 1.0);
        let u_low = (a.x.min(b.x) - reach * across.x.abs()).ceil().max(0.0);
        let u_high = (a.x.max(b.x) + reach * across.x.abs()).floor().min(family.width as f64 - 1.0);
        if !(v_low <= v_high && u_low <= u_high) {
            return;
        }
        let inverse_sigma = 1.0 / sigma;
        let shade = self.shade as f32;
        let (half0, half1) = (0.5 * self.from.width_px * inverse_sigma, 0.5 * self.to.width_px * inverse_sigma);
        for v in v_low as usize..=v_high as usize {
            let y = v as f64;
            let mut span = Span { first: u_low, last: u_high + 1.0 };
            span.cut(y, p0 - across * reach, across, true);
            span.cut(y, p0 + across * reach, across, false);
            match self.start {
                End::Joint(tangent) => span.cut(y, p0, tangent, true),
                End::Free => span.cut(y, a, along, true),
            }
            match self.end {
                End::Joint(tangent) => span.cut(y, p1, tangent, false),
                End::Free => span.cut(y, b, along, false),
            }
            if span.first >= span.last {
                continue;
            }
            let (first, last) = (span.first as usize, span.last as usize);
            let row = v * family.width;
            let coverage = &mut family.coverage[row + first..row + last];
            let light = &mut family.light[row + first..row + last];
            for (k, (c, l)) in coverage.iter_mut().zip(light).enumerate() {
                let offset = Vector2::new((first + k) as f64 - p0.x, y - p0.y);
                let s = along.dot(&offset);
                let t = (s / length).clamp(0.0, 1.0);
                let d = across.dot(&offset) - self.bow_px * 4.0 * t * (1.0 - t);
                let (x, half) = ((d * inverse_sigma) as f32, (half0 + (half1 - half0) * t) as f32);
                let mut share = edge.strip(x, half);
                let mut lit = if shade == 0.0 { share } else { share + shade * edge.ramp(x, half) };
                for (end, way) in [(self.start, s), (self.end, length - s)] {
                    if matches!(end, End::Free) {
                        let inside = edge.below((way * inverse_sigma) as f32);
                        share *= inside;
                        lit *= inside;
                    }
                }
                *c += share;
                *l += lit * (self.from.grey + (self.to.grey - self.from.grey) * t) as f32;
            }
        }
    }
}
