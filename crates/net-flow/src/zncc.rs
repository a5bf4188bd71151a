//! Zero-mean normalised cross-correlation of one template with all integer shifts of a window.
//!
//! `score(d) = sum (T - mean T)(W(d) - mean W(d)) / sqrt(sum (T - mean T)^2 sum (W(d) - mean W(d))^2)`, in [-1, 1]: blind to gain and
//! offset of the light. The template is kept in sixteenths of a grey level as `i16`, so that products add up in integers (eight in one
//! instruction, the same on every machine); means and variances of the window come from running sums.

use nalgebra::{Matrix2, Vector2};
use net_image::GrayView;
use wide::{i16x8, i32x4};

use crate::lanes::{LANES, STEPS, correlate, push_rounded, sum_of};
use crate::patch::{WARP_STRIDE, sample_patch};

/// Largest half width of a template, px.
pub(crate) const MAX_HALF: usize = 31;
/// Largest search radius, px.
pub(crate) const MAX_RADIUS: usize = 24;
/// A template of less variance, grey levels squared, shows nothing.
const FLAT_VARIANCE: f64 = 0.5;

/// Template, window and scores; buffers of the largest size.
#[derive(Debug, Clone)]
pub(crate) struct Zncc {
    /// Template rows, each padded with zeros to whole lanes, zero mean up to rounding.
    template: Vec<i16x8>,
    /// The same before rounding, packed rows.
    exact: Vec<f32>,
    /// The part of the picture that a stretched template is sampled from.
    warp: Vec<f32>,
    /// Half width of the template, px.
    half: usize,
    /// Lanes per template row.
    row_lanes: usize,
    /// Sum of the rounded template.
    sum: i64,
    /// Sum of squares of the rounded template about its mean.
    energy: f64,
    /// Window rows of `stride` values, less 128.
    window: Vec<i16>,
    /// Values from one row of the window to the next.
    stride: usize,
    /// Column sums of the window over the template's rows.
    sums: Vec<i32>,
    /// Column sums of its squares.
    squares: Vec<i32>,
    /// Scores, rows of `2 radius + 1`; covariances while they are in the making.
    scores: Vec<f32>,
    /// Sum of squares of the window about its mean, of each shift.
    variances: Vec<f32>,
    /// Search radius of `scores`, px.
    radius: usize,
}

/// Best shift of a search, relative to its centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Peak {
    /// Shift with sub-pixel part, px.
    pub shift: Vector2<f64>,
    /// Score there.
    pub score: f32,
    /// Whether it lies on the border of the search, where more may lie beyond.
    pub on_border: bool,
}

impl Zncc {
    pub(crate) fn new() -> Self {
        let side = 2 * MAX_HALF + 1;
        let window = side + LANES + 2 * MAX_RADIUS;
        Self {
            template: Vec::with_capacity(side * side.div_ceil(LANES)),
            exact: Vec::with_capacity(side * side),
            warp: Vec::with_capacity((WARP_STRIDE + 1) * WARP_STRIDE),
            half: 0,
            row_lanes: 0,
            sum: 0,
            energy: 0.0,
            window: Vec::with_capacity(window * window),
            stride: 0,
            sums: Vec::with_capacity(window),
            squares: Vec::with_capacity(window),
            scores: Vec::with_capacity((2 * MAX_RADIUS + 1).pow(2)),
            variances: Vec::with_capacity((2 * MAX_RADIUS + 1).pow(2)),
            radius: 0,
        }
    }

    /// Cuts the template of half width `half` round `centre` of `image`, bilinear, stretched by `source_from_template` (the
    /// identity: as it is). False when there is nothing to see in it.
    pub(crate) fn cut(
        &mut self,
        image: GrayView<'_>,
        centre: Vector2<f64>,
        source_from_template: &Matrix2<f64>,
        half: usize,
    ) -> bool {
        let half = half.clamp(1, MAX_HALF);
        let side = 2 * half + 1;
        self.half = half;
        self.exact.clear();
        sample_patch(image, centre, source_from_template, half, &mut self.warp, &mut self.exact);
        let mean = sum_of(&self.exact) / (side * side) as f32;
        self.exact.iter_mut().for_each(|x| *x -= mean);
        self.row_lanes = side.div_ceil(LANES);
        self.template.clear();
        let (mut sum, mut squares) = (i32x4::ZERO, 0i64);
        let ones = i16x8::splat(1);
        for row in self.exact.chunks_exact(side) {
            push_rounded(row, &mut self.template);
            let mut row_squares = i32x4::ZERO;
            for lanes in self.template.iter().rev().take(self.row_lanes) {
                sum += lanes.dot(ones);
                row_squares += lanes.dot(*lanes);
            }
            // Eight products of at most 2 * 4080^2 = 3.3e7 a lane and row.
            squares += i64::from(row_squares.reduce_add());
        }
        let sum = i64::from(sum.reduce_add());
        let n = (side * side) as f64;
        self.sum = sum;
        self.energy = squares as f64 - (sum as f64).powi(2) / n;
        self.energy > FLAT_VARIANCE * n * f64::from(STEPS * STEPS)
    }

    /// The template before rounding: rows of `2 half + 1`, zero mean.
    pub(crate) fn exact(&self) -> &[f32] {
        &self.exact
    }

    /// Scores all shifts up to `radius` round the whole pixel `centre` of `image`; edges repeated.
    pub(crate) fn search(&mut self, image: GrayView<'_>, centre: (i64, i64), radius: usize) {
        let radius = radius.min(MAX_RADIUS);
        let side = 2 * self.half + 1;
        let reach = (self.half + radius) as i64;
        let rows = side + 2 * radius;
        // The last shift still reads whole lanes.
        let stride = 2 * radius + self.row_lanes * LANES;
        (self.radius, self.stride) = (radius, stride);
        self.load_window(image, (centre.0 - reach, centre.1 - reach), rows, stride);
        self.sums.clear();
        self.sums.resize(rows, 0);
        self.squares.clear();
        self.squares.resize(rows, 0);
        let n = (side * side) as f64;
        for v in 0..side {
            self.add_row(v * stride, 0);
        }
        self.scores.clear();
        self.variances.clear();
        for dv in 0..=2 * radius {
            if dv > 0 {
                self.add_row((dv - 1) * stride, -1);
                self.add_row((dv + side - 1) * stride, 0);
            }
            let mut sum: i32 = self.sums[..side].iter().sum();
            // At most 63 * 63 * 128^2 = 6.5e7.
            let mut squares: i32 = self.squares[..side].iter().sum();
            for du in 0..=2 * radius {
                if du > 0 {
                    sum += self.sums[du + side - 1] - self.sums[du - 1];
                    squares += self.squares[du + side - 1] - self.squares[du - 1];
                }
                let product = correlate(&self.template, self.row_lanes, &self.window[dv * stride + du..], stride);
                let (sum, squares) = (f64::from(sum), f64::from(squares));
                self.scores.push((product as f64 - self.sum as f64 * sum / n) as f32);
                self.variances.push((squares - sum * sum / n) as f32);
            }
        }
        // Roots and quotients of all shifts at once: the compiler takes four at a time.
        let (scale, flat) = ((1.0 / self.energy.max(1.0).sqrt()) as f32, (FLAT_VARIANCE * n) as f32);
        for (score, &variance) in self.scores.iter_mut().zip(&self.variances) {
            // A flat window resembles nothing.
            let value = *score * scale / variance.max(flat).sqrt();
            *score = if variance > flat { value } else { 0.0 };
        }
    }

    /// Sum of products of `template` (laid out as this one) with the window of the last search at whole shift `(u, v)`, counted from the corner.
    pub(crate) fn product(&self, template: &[i16x8], u: usize, v: usize) -> i64 {
        self.window.get(v * self.stride + u..).map_or(0, |w| correlate(template, self.row_lanes, w, self.stride))
    }

    /// Half width of the template, px.
    pub(crate) fn half(&self) -> usize {
        self.half
    }

    /// Gain of the light from the window to the template at the best shift: regression of the one on the other.
    pub(crate) fn gain(&self, u: usize, v: usize) -> f64 {
        let i = v * (2 * self.radius + 1) + u;
        match (self.scores.get(i), self.variances.get(i)) {
            (Some(&score), Some(&variance)) if variance > 0.0 => {
                f64::from(score) * (self.energy / f64::from(variance)).sqrt()
            }
            _ => 0.0,
        }
    }

    /// Scores of the last search, rows of `2 radius + 1`.
    pub(crate) fn scores(&self) -> &[f32] {
        &self.scores
    }

    /// The best whole shift of the last search, counted from the corner.
    pub(crate) fn highest(&self) -> (usize, usize) {
        let (mut best, mut at) = (f32::NEG_INFINITY, 0);
        for (i, &s) in self.scores.iter().enumerate() {
            if s > best {
                (best, at) = (s, i);
            }
        }
        let side = 2 * self.radius + 1;
        (at % side, at / side)
    }

    /// Search radius of the last search, px.
    pub(crate) fn radius(&self) -> usize {
        self.radius
    }

    /// The best shift of the last search with its sub-pixel part.
    pub(crate) fn peak(&self) -> Peak {
        let side = 2 * self.radius + 1;
        let (u, v) = self.highest();
        let best = self.scores[v * side + u];
        let whole = Vector2::new(u as f64 - self.radius as f64, v as f64 - self.radius as f64);
        if u == 0 || v == 0 || u == side - 1 || v == side - 1 {
            return Peak { shift: whole, score: best, on_border: true };
        }
        let (offset, gain) =
            quadratic_peak(|du, dv| self.scores[(v as isize + dv) as usize * side + (u as isize + du) as usize]);
        Peak { shift: whole + offset, score: (best + gain).min(1.0), on_border: false }
    }

    /// Adds (`sign` 0) or takes away (`sign` -1) the window's row that starts at `start` to the column sums.
    fn add_row(&mut self, start: usize, sign: i32) {
        let row = &self.window[start..][..self.sums.len()];
        for ((s, q), &x) in self.sums.iter_mut().zip(&mut self.squares).zip(row) {
            // 128^2 fits 16 bits, and 16-bit products are what every machine has in vector form.
            let square = (x as u16).wrapping_mul(x as u16);
            *s += (i32::from(x) ^ sign) - sign;
            *q += (i32::from(square) ^ sign) - sign;
        }
    }

    /// Copies rows of the picture, edges repeated, zeros in the padding.
    fn load_window(&mut self, image: GrayView<'_>, corner: (i64, i64), rows: usize, stride: usize) {
        let (width, height) = (image.width() as i64, image.height() as i64);
        // The padding meets zeros of the template: its values do not matter.
        self.window.resize(rows * stride + LANES, 0);
        let inside = corner.0 >= 0 && corner.0 + rows as i64 <= width;
        for (v, out) in (corner.1..).zip(self.window.chunks_exact_mut(stride).take(rows)) {
            let source = image.row(v.clamp(0, height - 1) as usize);
            if inside {
                let source = &source[corner.0 as usize..][..rows];
                out.iter_mut().zip(source).for_each(|(out, &x)| *out = i16::from(x) - 128);
            } else {
                let at = |u: i64| i16::from(source[(corner.0 + u).clamp(0, width - 1) as usize]) - 128;
                out.iter_mut().take(rows).zip(0..).for_each(|(out, u)| *out = at(u));
            }
        }
    }
}

/// Least-squares quadratic through the nine scores `at(-1..=1, -1..=1)`: offset of its maximum, px, at most one half a pixel away
/// along each axis, and its height above `at(0, 0)`. Falls back to an axis each where the quadratic has no maximum.
pub(crate) fn quadratic_peak(at: impl Fn(isize, isize) -> f32) -> (Vector2<f64>, f32) {
    let z = |u, v| f64::from(at(u, v));
    let column = |u| z(u, -1) + z(u, 0) + z(u, 1);
    let row = |v| z(-1, v) + z(0, v) + z(1, v);
    let gradient = Vector2::new(column(1) - column(-1), row(1) - row(-1)) / 6.0;
    let uu = (column(1) - 2.0 * column(0) + column(-1)) / 3.0;
    let vv = (row(1) - 2.0 * row(0) + row(-1)) / 3.0;
    let uv = (z(1, 1) + z(-1, -1) - z(1, -1) - z(-1, 1)) / 4.0;
    let hessian = Matrix2::new(uu, uv, uv, vv);
    let fitted = (uu < 0.0 && hessian.determinant() > 0.0).then(|| hessian.try_inverse()).flatten();
    let axis = |a: f64, b: f64, c: f64| {
        let bend = a - 2.0 * b + c;
        if bend < -1e-12 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 }
    };
    let offset = match fitted.map(|inverse| -inverse * gradient) {
        Some(offset) if offset.amax() <= 1.0 => offset.map(|x| x.clamp(-0.5, 0.5)),
        _ => Vector2::new(axis(z(-1, 0), z(0, 0), z(1, 0)), axis(z(0, -1), z(0, 0), z(0, 1))),
    };
    let gain = gradient.dot(&offset) + 0.5 * offset.dot(&(hessian * offset));
    (offset, gain.clamp(0.0, 0.2) as f32)
}

#[cfg(test)]
mod tests {
    use net_image::Image;

    use super::*;

    fn picture(width: usize, height: usize) -> Image<u8> {
        let value = |i: usize| {
            let (u, v) = ((i % width) as f64, (i / width) as f64);
            (128.0 + 60.0 * (u * 0.31).sin() + 50.0 * (v * 0.23 + u * 0.11).cos()) as u8
        };
        Image::from_vec((0..width * height).map(value).collect(), width, height).expect("right length")
    }

    /// The definition, in f64.
    fn naive(template: &[f32], image: GrayView<'_>, centre: (i64, i64), half: i64) -> f64 {
        let at = |u: i64, v: i64| {
            let u = (centre.0 + u).clamp(0, image.width() as i64 - 1) as usize;
            f64::from(image.row((centre.1 + v).clamp(0, image.height() as i64 - 1) as usize)[u])
        };
        let mut values = Vec::new();
        for v in -half..=half {
            values.extend((-half..=half).map(|u| at(u, v)));
        }
        let n = values.len() as f64;
        let mean_w = values.iter().sum::<f64>() / n;
        let mean_t = template.iter().map(|&x| f64::from(x)).sum::<f64>() / n;
        let (mut tw, mut tt, mut ww) = (0.0, 0.0, 0.0);
        for (&t, &w) in template.iter().zip(&values) {
            let (t, w) = (f64::from(t) - mean_t, w - mean_w);
            tw += t * w;
            tt += t * t;
            ww += w * w;
        }
        tw / (tt * ww).sqrt()
    }

    #[test]
    fn scores_equal_the_definition() {
        let picture = picture(90, 70);
        let image = picture.view().expect("pixels");
        let mut zncc = Zncc::new();
        // Templates of every number of lanes, in the middle and over the edge of the picture.
        for (half, centre) in
            [(1, (40, 30)), (4, (2, 3)), (7, (45, 33)), (10, (80, 60)), (15, (44, 35)), (31, (44, 35))]
        {
            assert!(zncc.cut(image, Vector2::new(41.3, 32.7), &Matrix2::identity(), half));
            let template = zncc.exact().to_vec();
            zncc.search(image, centre, 3);
            for (i, &score) in zncc.scores().iter().enumerate() {
                let shifted = (centre.0 + i as i64 % 7 - 3, centre.1 + i as i64 / 7 - 3);
                let expected = naive(&template, image, shifted, half as i64);
                // The template is rounded to a sixteenth of a grey level, the contrast here is some tens of them.
                assert!((f64::from(score) - expected).abs() < 2e-3, "{half} {i}: {score} {expected}");
            }
        }
    }

    #[test]
    fn no_overflow_at_full_contrast() {
        let data = (0..128 * 128).map(|i| if (i / 7 + i / (128 * 5)) % 2 == 0 { 255 } else { 0 }).collect();
        let image = Image::from_vec(data, 128, 128).expect("right length");
        let image = image.view().expect("pixels");
        let mut zncc = Zncc::new();
        assert!(zncc.cut(image, Vector2::new(64.0, 64.0), &Matrix2::identity(), MAX_HALF));
        let template = zncc.exact().to_vec();
        zncc.search(image, (64, 64), 1);
        for (i, &score) in zncc.scores().iter().enumerate() {
            let expected = naive(&template, image, (63 + i as i64 % 3, 63 + i as i64 / 3), MAX_HALF as i64);
            // Rounding as above, on a contrast of 255 levels.
            assert!((f64::from(score) - expected).abs() < 1e-4, "{i}: {score} {expected}");
        }
    }

    #[test]
    fn flat_templates_and_windows_match_nothing() {
        let flat = Image::from_vec(vec![77u8; 64 * 64], 64, 64).expect("right length");
        let flat = flat.view().expect("pixels");
        let seen = picture(64, 64);
        let mut zncc = Zncc::new();
        assert!(!zncc.cut(flat, Vector2::new(30.0, 30.0), &Matrix2::identity(), 7));
        assert!(zncc.cut(seen.view().expect("pixels"), Vector2::new(30.0, 30.0), &Matrix2::identity(), 7));
        zncc.search(flat, (30, 30), 2);
        assert!(zncc.scores().iter().all(|&s| s == 0.0));
    }

    #[test]
    fn quadratic_finds_the_top_of_a_quadratic() {
        let top = Vector2::new(0.21, -0.37);
        let height = |u: isize, v: isize| {
            let d = Vector2::new(u as f64, v as f64) - top;
            (0.9 - 0.05 * d.x * d.x - 0.04 * d.y * d.y - 0.02 * d.x * d.y) as f32
        };
        let (offset, gain) = quadratic_peak(height);
        // f32 scores.
        assert!((offset - top).norm() < 1e-5, "{offset}");
        assert!((height(0, 0) + gain - 0.9).abs() < 1e-6);
    }
}
