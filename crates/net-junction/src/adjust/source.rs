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
const SAMPLES_MAX: usize = 16;
/// So many squares hold what is around a twine of 100 px and more: a number below that needs no check.
const WINDOW: usize = 1 << 17;
/// How far off the picture lines go on in whole numbers, px.
const FAR_PX: (f32, f32) = (-16384.0, 32512.0);

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
    /// Row by row, and a window more.
    squares: Vec<u32>,
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
    /// which bins lie inside the picture. From steps of two pixels on it is the smaller picture's. Beyond the last bin `values` have room for a vector, which is written over.
    pub fn profiles(
        &self,
        ends: [Vector2<f64>; 2],
        bow: [f32; 2],
        step_px: f64,
        inside: &mut [bool],
        values: &mut [f32],
    ) {
        let level = level_of(step_px);
        let scale = (1 << level) as f64;
        // The first pixel of a smaller picture is the mean of the first two by two.
        let ends = ends.map(|p| ((p.add_scalar(0.5)) / scale).add_scalar(-0.5));
        let bow = bow.map(|b| b / scale as f32);
        let (level, step) = (&self.levels[level], (step_px / scale) as f32);
        self.arch.dispatch(Across { level, ends, bow, step, inside, values });
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
        self.squares.resize(width * height + WINDOW, 0);
        for (v, row) in self.squares.chunks_exact_mut(width).take(height).enumerate() {
            let [top, low] = [v, (v + 1).min(height - 1)].map(|v| self.image.row(v));
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
        let (width, height) = (self.image.width() as f32, self.image.height() as f32);
        p.x > 1.0 && p.y > 1.0 && p.x < width - 2.0 && p.y < height - 2.0
    }

    /// The squares from this row on, if they go on for a window and hold all down to another row.
    #[inline(always)]
    fn window(&self, first: usize, last: usize) -> Option<&[u32; WINDOW]> {
        let width = self.image.width();
        let whole = (last + 1).checked_sub(first)? * width <= WINDOW;
        self.squares.get(first * width..)?.first_chunk().filter(|_| whole)
    }
}

/// Adds what squares, in rows of `width`, have at the places of a vector, in 65536ths of a pixel: 65536ths of a grey level. Bilinear, in whole numbers. Squares beyond `most`, the
/// last one or an earlier one, are not read.
#[inline(always)]
fn add(place: impl Fn(usize) -> [i32; 2], width: i32, most: u32, squares: &[u32], out: &mut [i32; LANES]) {
    // One after the other, for the first and the last of these loops become vectors.
    let (mut found, mut part) = ([0; LANES], [[0; LANES]; 2]);
    for k in 0..LANES {
        let [x, y] = place(k);
        found[k] = ((y >> 16).wrapping_mul(width).wrapping_add(x >> 16) as u32).min(most);
        (part[0][k], part[1][k]) = ((x as u32 & 0xffff) >> 8, (y as u32 & 0xffff) >> 8);
    }
    for at in &mut found {
        *at = squares[(*at as usize).min(most as usize)];
    }
    for k in 0..LANES {
        out[k] += within(found[k], part[0][k], part[1][k]);
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
    values: &'a mut [f32],
}

impl WithSimd for Across<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { level, ends: [a, b], bow, step, inside, values } = self;
        let width = values.len().saturating_sub(LANES) / inside.len().max(1);
        let (a, chord) = (a.cast::<f32>(), (b - a).cast::<f32>());
        let length = chord.norm();
        let normal = Vector2::new(-chord.y, chord.x) / length;
        let share = (1.0 - 2.0 * END) / inside.len() as f32;
        let least = if step < 1.0 { SAMPLES_MIN } else { 1.0 };
        let samples = (length * share / ALONG_PX).ceil().clamp(least, SAMPLES_MAX as f32) as usize;
        let step = normal * step;
        let back = step * (width / 2) as f32;
        let weight = 1.0 / samples as f32;
        let unit = weight / ONE;
        let padded = width.next_multiple_of(LANES);
        // Bends take the line no farther than this.
        let bent = normal * (bow[0].abs() + bow[1].abs()) + step * (padded - width) as f32;
        let corners = [a - back, a + back, a + chord - back, a + chord + back];
        let around = corners.map(|c| [c - bent, c + bent]);
        let all_inside = around.as_flattened().iter().all(|c| level.holds(*c));
        let rows = around.as_flattened().iter().map(|c| c.y);
        let (top, bottom) = (rows.clone().fold(f32::MAX, f32::min) as usize, rows.fold(0.0, f32::max) as usize);
        let window = if all_inside { level.window(top, bottom) } else { None };
        let top = if window.is_some() { top as f32 } else { 0.0 };
        let fixed = |at: f32| (at * ONE) as i32;
        let step = [fixed(step.x), fixed(step.y)];
        let row = level.image.width() as i32;
        let last = [level.image.width(), level.image.height()].map(|side| (side.max(1) as i32 - 1) << 16);
        let Some(end) = level.squares.len().checked_sub(1) else { return };
        let mut starts = [[0; 2]; SAMPLES_MAX];
        for (bin, inside) in inside.iter_mut().enumerate() {
            for (s, start) in starts[..samples].iter_mut().enumerate() {
                let along = END + share * (bin as f32 + (s as f32 + 0.5) * weight);
                let [hump, s_bend] = bend(along);
                let middle = a + chord * along + normal * (hump * bow[0] + s_bend * bow[1]);
                let mut from = middle - back;
                if window.is_none() {
                    *inside &= level.holds(middle);
                    from = from.map(|at| at.clamp(FAR_PX.0, FAR_PX.1));
                }
                *start = [fixed(from.x), fixed(from.y - top)];
            }
            // Whole vectors, whose ends the next bin's are written over.
            for first in (0..padded).step_by(LANES) {
                let mut sums = [0; LANES];
                let ramps = step.map(|s| std::array::from_fn::<_, LANES, _>(|k| s.wrapping_mul((first + k) as i32)));
                for start in &starts[..samples] {
                    let along = |axis: usize, k: usize| start[axis].wrapping_add(ramps[axis][k]);
                    match window {
                        Some(window) => add(|k| [along(0, k), along(1, k)], row, WINDOW as u32 - 1, window, &mut sums),
                        None => {
                            // Beyond its end the picture goes on as its last pixels.
                            let limited = |k: usize| [0, 1].map(|axis| along(axis, k).max(0).min(last[axis]));
                            add(limited, row, end as u32, &level.squares, &mut sums);
                        }
                    }
                }
                if let Some(values) = values[bin * width + first..].first_chunk_mut::<LANES>() {
                    *values = sums.map(|sum| unit * sum as f32);
                }
            }
        }
    }
}

/// Bilinear value within a square of pixels at a fraction of 256ths, in 65536ths of a grey level.
#[inline(always)]
fn within(square: u32, fu: u32, fv: u32) -> i32 {
    // Two numbers of 16 bits in each: on the left and on the right.
    let (left, right) = (square & 0x00ff_00ff, square >> 8 & 0x00ff_00ff);
    let across = left * (256 - fu) + right * fu;
    ((across & 0xffff) * (256 - fv) + (across >> 16) * fv) as i32
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
        let reference = |u: f32, v: f32| 3.0 * u.clamp(0.0, 19.0) + 10.0 * v.clamp(0.0, 9.0);
        for (start, step) in [
            ((4.3, 2.2), (0.4, 0.3)),
            ((2.3, 3.2), (0.6, 0.1)),
            ((-2.0, 5.0), (0.5, 0.1)),
            ((17.0, 8.0), (0.3, 0.4)),
            ((1e9, -1e9), (0.5, 0.0)),
        ] {
            let (start, step) = (Vector2::new(start.0, start.1), Vector2::new(step.0, step.1));
            // Across a line that is next to no longer than a point.
            let mut values = [0.0; 33 + LANES];
            let chord = Vector2::new(step.y, -step.x).cast::<f64>() * 1e-3;
            let middle = (start + step * 16.0).cast::<f64>();
            let ends = [middle - chord, middle + chord];
            source.profiles(ends, [0.0; 2], f64::from(step.norm()), &mut [true], &mut values);
            for (k, value) in values[..33].iter().enumerate() {
                // Fractions are cut to 1/256 px, of 3 grey levels along u and 10 along v.
                let at = start + step * k as f32;
                assert!((value - reference(at.x, at.y)).abs() < 13.5 / 256.0, "{value} at {at:?}");
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
            let mut values = [0.0; 3 + LANES];
            source.profiles([a, b], [0.0; 2], step_px, &mut [true], &mut values);
            // Means are rounded to whole grey levels, twice, and fractions to 1/256 px.
            let expected = 3.0 * middle.x + 10.0 * middle.y;
            assert!((f64::from(values[1]) - expected).abs() < 1.1, "{values:?} in steps of {step_px} px");
        }
    }
}
