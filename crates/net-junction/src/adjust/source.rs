//! The picture, and mean grey values across lines through it.

use net_geometry::nalgebra::Vector2;
use net_image::{GrayView, Image};
use pulp::{Arch, Simd, WithSimd};

use crate::adjust::graph::bend;
use crate::adjust::lanes::LANES;

/// Part of a twine at each end that is left to the knots.
pub(crate) const END: f32 = 0.03;
/// Most distance between samples along the twine, px of the level: bilinear samples then touch nearly every pixel.
const ALONG_PX: f32 = 1.75;
/// A picture coordinate's unit, 1/65536 px.
const ONE: f32 = 65536.0;
/// Least samples of a bin that is measured, steps then being parts of a pixel, and most of any: bins of small cells are shorter than that distance, and one sample
/// of each leaves out too many pixels where light is low.
const SAMPLES_MIN: f32 = 2.0;
const SAMPLES_MAX: f32 = 16.0;
/// Values beyond whole vectors that are sampled one by one: a whole vector more takes as long.
const FEW: usize = 3;

/// A picture, ready for bilinear samples, and the same at half and a quarter of its size.
#[derive(Debug, Default)]
pub(crate) struct Source {
    levels: [Level; 3],
    arch: Arch,
}

/// A picture in which each pixel holds those to its right, below, and below to its right, too: four bytes, the lowest its own. At the
/// picture's end they are repeated.
#[derive(Debug, Default)]
struct Level {
    image: Image<u8>,
    squares: Image<u32>,
}

impl Source {
    /// Takes the picture in.
    pub fn load(&mut self, picture: GrayView) {
        let [first, ..] = &mut self.levels;
        first.image.resize(picture.width(), picture.height());
        for (v, row) in picture.rows().enumerate() {
            first.image.row_mut(v).copy_from_slice(row);
        }
        self.arch.dispatch(Join(first));
    }

    /// Makes the smaller pictures, down to pixels of this size.
    pub fn shrink(&mut self, step_px: f64) {
        let mut levels = self.levels.iter_mut();
        let Some(mut above) = levels.next() else { return };
        for level in levels.take(level_of(step_px)) {
            level.halve(&above.image);
            self.arch.dispatch(Join(level));
            above = level;
        }
    }

    /// Puts into each of `inside.len()` bins of `width` values, `step_px` apart, the mean picture across the line between two pixels, and says
    /// which bins lie inside the picture. From steps of two pixels on it is the smaller picture's.
    pub fn profiles(
        &self,
        ends: [Vector2<f64>; 2],
        bow: [f32; 2],
        step_px: f64,
        inside: &mut [bool],
        sums: &mut Vec<i32>,
        values: &mut [f32],
    ) {
        let level = level_of(step_px);
        let scale = (1 << level) as f64;
        // The first pixel of a smaller picture is the mean of the first two by two.
        let ends = ends.map(|p| ((p.add_scalar(0.5)) / scale).add_scalar(-0.5));
        let bow = bow.map(|b| b / scale as f32);
        let (level, step) = (&self.levels[level], (step_px / scale) as f32);
        self.arch.dispatch(Across { level, ends, bow, step, inside, sums, values });
    }
}

/// The smallest picture whose pixels are no larger than steps of this size.
fn level_of(step_px: f64) -> usize {
    if step_px >= 4.0 { 2 } else { usize::from(step_px >= 2.0) }
}

impl Level {
    /// Takes over the mean of each two by two pixels.
    fn halve(&mut self, image: &Image<u8>) {
        let (width, height) = ((image.width() / 2).max(1), (image.height() / 2).max(1));
        self.image.resize(width, height);
        for v in 0..height {
            let rows = [2 * v, (2 * v + 1).min(image.height() - 1)].map(|v| image.row(v));
            if image.width() < 2 {
                self.image.row_mut(v)[0] = rows[0][0];
                continue;
            }
            let [top, low] = rows.map(|row| row.chunks_exact(2));
            for ((out, a), b) in self.image.row_mut(v).iter_mut().zip(top).zip(low) {
                let sum = u16::from(a[0]) + u16::from(a[1]) + u16::from(b[0]) + u16::from(b[1]);
                *out = ((sum + 2) >> 2) as u8;
            }
        }
    }

    #[inline(always)]
    fn join(&mut self) {
        let (width, height) = (self.image.width(), self.image.height());
        self.squares.resize(width, height);
        for v in 0..height {
            let [top, low] = [v, (v + 1).min(height - 1)].map(|v| self.image.row(v));
            let row = self.squares.row_mut(v);
            for (out, (a, b)) in row.iter_mut().zip(top.windows(2).zip(low.windows(2))) {
                *out = u32::from(a[0]) | u32::from(a[1]) << 8 | u32::from(b[0]) << 16 | u32::from(b[1]) << 24;
            }
            let (a, b) = (u32::from(top[width - 1]), u32::from(low[width - 1]));
            row[width - 1] = a | a << 8 | b << 16 | b << 24;
        }
    }

    /// Whether a place lies in the picture, and its neighbours, too.
    #[inline(always)]
    fn holds(&self, p: Vector2<f32>) -> bool {
        let (width, height) = (self.squares.width() as f32, self.squares.height() as f32);
        p.x > 1.0 && p.y > 1.0 && p.x < width - 2.0 && p.y < height - 2.0
    }

    /// Adds the picture's values at `start + k * step` to `out[k]`, in 65536ths of a grey level. All of them must lie in the picture.
    #[inline(always)]
    fn add_line(&self, start: Vector2<f32>, step: [i32; 2], out: &mut [i32]) {
        let [x, y] = [start.x, start.y].map(|at| (at * ONE) as i32);
        let along = |from: i32, step: i32, k: i32| from.wrapping_add(step.wrapping_mul(k));
        self.add_places(|k| [along(x, step[0], k), along(y, step[1], k)], out);
    }

    /// The same of places that may lie beyond the picture's end: it goes on as its last pixel.
    #[inline(always)]
    fn add_line_at_the_end(&self, start: Vector2<f32>, step: Vector2<f32>, out: &mut [i32]) {
        let (right, bottom) = ((self.squares.width() - 1) as f32, (self.squares.height() - 1) as f32);
        let along = |from: f32, step: f32, k: i32, last: f32| ((from + step * k as f32).clamp(0.0, last) * ONE) as i32;
        self.add_places(|k| [along(start.x, step.x, k, right), along(start.y, step.y, k, bottom)], out);
    }

    /// Adds the picture's values at places in 65536ths of a pixel. Bilinear, in whole numbers.
    #[inline(always)]
    fn add_places(&self, place: impl Fn(i32) -> [i32; 2], out: &mut [i32]) {
        let (whole, rest) = out.as_chunks_mut();
        let end = (whole.len() * LANES) as i32;
        for (first, out) in (0..).step_by(LANES).zip(whole) {
            self.add_vector(&place, first, out);
        }
        for (k, out) in (end..).zip(rest) {
            self.add_one(place(k), out);
        }
    }

    #[inline(always)]
    fn add_one(&self, [x, y]: [i32; 2], out: &mut i32) {
        let at = (y >> 16).wrapping_mul(self.squares.width() as i32).wrapping_add(x >> 16);
        let square = self.squares.data().get(at as u32 as usize).copied().unwrap_or(0);
        *out += within(square, (x >> 8) & 0xff, (y >> 8) & 0xff);
    }

    /// The same of as many as a vector holds, from the `first` place on.
    #[inline(always)]
    fn add_vector(&self, place: &impl Fn(i32) -> [i32; 2], first: i32, out: &mut [i32; LANES]) {
        let (width, squares) = (self.squares.width() as i32, self.squares.data());
        let Some(last) = squares.len().checked_sub(1) else { return };
        // One after the other, for the first and the last of these loops become vectors.
        let (mut found, mut part) = ([0; LANES], [[0; LANES]; 2]);
        for k in 0..LANES {
            let [x, y] = place(first + k as i32);
            found[k] = ((y >> 16).wrapping_mul(width).wrapping_add(x >> 16) as u32).min(last as u32);
            (part[0][k], part[1][k]) = ((x >> 8) & 0xff, (y >> 8) & 0xff);
        }
        for at in &mut found {
            *at = squares[(*at as usize).min(last)];
        }
        for k in 0..LANES {
            out[k] += within(found[k], part[0][k], part[1][k]);
        }
    }
}

/// A picture whose pixels are to be joined.
struct Join<'a>(&'a mut Level);

impl WithSimd for Join<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.0.join();
    }
}

/// A line across which profiles are to be taken, in pixels of a level.
struct Across<'a> {
    level: &'a Level,
    ends: [Vector2<f64>; 2],
    bow: [f32; 2],
    step: f32,
    inside: &'a mut [bool],
    sums: &'a mut Vec<i32>,
    values: &'a mut [f32],
}

impl WithSimd for Across<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { level, ends: [a, b], bow, step, inside, sums, values } = self;
        let width = values.len() / inside.len().max(1);
        let (a, chord) = (a.cast::<f32>(), (b - a).cast::<f32>());
        let length = chord.norm();
        let normal = Vector2::new(-chord.y, chord.x) / length;
        let share = (1.0 - 2.0 * END) / inside.len() as f32;
        let least = if step < 1.0 { SAMPLES_MIN } else { 1.0 };
        let samples = (length * share / ALONG_PX).ceil().clamp(least, SAMPLES_MAX) as usize;
        let step = normal * step;
        let back = step * (width / 2) as f32;
        let weight = 1.0 / samples as f32;
        let unit = weight / ONE;
        let padded = if width % LANES > FEW { width.next_multiple_of(LANES) } else { width };
        let whole_step = [step.x, step.y].map(|at| (at * ONE) as i32);
        // Bends take the line no farther than this.
        let bent = normal * (bow[0].abs() + bow[1].abs()) + step * (padded - width) as f32;
        let corners = [a - back, a + back, a + chord - back, a + chord + back];
        let all_inside = corners.into_iter().all(|c| level.holds(c - bent) && level.holds(c + bent));
        sums.resize(padded, 0);
        for (bin, (profile, inside)) in values.chunks_exact_mut(width).zip(inside).enumerate() {
            sums.fill(0);
            for s in 0..samples {
                let along = END + share * (bin as f32 + (s as f32 + 0.5) * weight);
                let [hump, s_bend] = bend(along);
                let middle = a + chord * along + normal * (hump * bow[0] + s_bend * bow[1]);
                if all_inside {
                    level.add_line(middle - back, whole_step, sums);
                } else {
                    *inside &= level.holds(middle);
                    level.add_line_at_the_end(middle - back, step, sums);
                }
            }
            profile.iter_mut().zip(sums.iter()).for_each(|(p, &s)| *p = unit * s as f32);
        }
    }
}

/// Bilinear value within a square of pixels at a fraction of 256ths, in 65536ths of a grey level.
#[inline(always)]
fn within(square: u32, fu: i32, fv: i32) -> i32 {
    let corner = |k: u32| ((square >> (8 * k)) & 0xff) as i32;
    let between = |a: i32, b: i32, part: i32| (a << 8) + part * (b - a);
    between(between(corner(0), corner(1), fu), between(corner(2), corner(3), fu), fv)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(width: usize, height: usize) -> Source {
        let mut image = Image::new(width, height);
        for v in 0..height {
            for u in 0..width {
                image.row_mut(v)[u] = (3 * u + 10 * v) as u8;
            }
        }
        let mut source = Source::default();
        if let Some(view) = image.view() {
            source.load(view);
        }
        source
    }

    #[test]
    fn a_ramp_is_sampled_exactly_and_goes_on_beyond_the_end() {
        let source = ramp(20, 10);
        let at = |u: f32, v: f32| 3.0 * u.clamp(0.0, 19.0) + 10.0 * v.clamp(0.0, 9.0);
        for (start, step) in [
            ((4.3, 2.2), (0.4, 0.3)),
            ((2.3, 3.2), (0.6, 0.1)),
            ((-2.0, 5.0), (0.5, 0.1)),
            ((17.0, 8.0), (0.3, 0.4)),
            ((1e9, -1e9), (0.5, 0.0)),
        ] {
            let (start, step) = (Vector2::new(start.0, start.1), Vector2::new(step.0, step.1));
            let check = |out: &[i32]| {
                for (k, value) in out.iter().enumerate() {
                    let (u, v) = (start.x + step.x * k as f32, start.y + step.y * k as f32);
                    // Fractions are cut to 1/256 px, of 3 grey levels along u and 10 along v.
                    assert!((*value as f32 / ONE - 1.0 - at(u, v)).abs() < 13.5 / 256.0, "at ({u}, {v})");
                }
            };
            let mut out = [65536_i32; 4 * LANES + 3];
            source.levels[0].add_line_at_the_end(start, step, &mut out);
            check(&out);
            let mut out = [65536_i32; 9];
            if source.levels[0].holds(start) && source.levels[0].holds(start + step * 9.0) {
                source.levels[0].add_line(start, [(step.x * ONE) as i32, (step.y * ONE) as i32], &mut out);
                check(&out);
            }
        }
    }

    #[test]
    fn the_smaller_pictures_lie_where_the_picture_lies() {
        let mut source = ramp(40, 13);
        source.shrink(4.0);
        let (a, b) = (Vector2::new(12.0, 4.0), Vector2::new(22.0, 6.0));
        let middle = (a + b) * 0.5;
        for step_px in [0.5, 1.0, 2.0, 4.0] {
            let (mut values, mut sums) = ([0.0; 3], Vec::new());
            source.profiles([a, b], [0.0; 2], step_px, &mut [true], &mut sums, &mut values);
            // Means are rounded to whole grey levels, twice, and fractions to 1/256 px.
            let expected = 3.0 * middle.x + 10.0 * middle.y;
            assert!((f64::from(values[1]) - expected).abs() < 1.1, "{values:?} in steps of {step_px} px");
        }
    }
}
