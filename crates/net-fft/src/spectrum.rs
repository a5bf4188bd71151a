//! From a picture to the grey image of its spectrum (thesis 4.3.1, mended).

use net_image::{Image, View};
use rustfft::num_complex::Complex32;

use crate::error::{Error, Result};
use crate::fft2::{HalfSpectrum, RealFft2};

/// What multiplies the picture before the transform.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Window {
    /// Nothing, as in the thesis: the picture's borders draw a bright cross through the spectrum.
    None,
    /// Raised cosine along u times the same along v (von Hann). A peak is four bins wide and falls off steeply beside them.
    #[default]
    Hann,
}

impl Window {
    /// Weight of pixel `at` of `length`: symmetric about the centre, zero just outside.
    pub fn weight(self, at: usize, length: usize) -> f64 {
        match self {
            Self::None => 1.0,
            Self::Hann => (std::f64::consts::PI * (at as f64 + 0.5) / length as f64).sin().powi(2),
        }
    }
}

/// Mean removal, window and transform for pictures of one size.
#[derive(Debug)]
pub struct SpectrumPlan {
    fft: RealFft2,
    weights_u: Vec<f32>,
    weights_v: Vec<f32>,
    /// 1 / (sum of `weights_u` x sum of `weights_v`).
    per_weight: f64,
}

impl SpectrumPlan {
    /// Plans for pictures of `width` x `height` px.
    ///
    /// # Errors
    /// [`Error::EmptySize`] if either is zero.
    pub fn new(width: usize, height: usize, window: Window) -> Result<Self> {
        let weights = |n: usize| (0..n).map(|i| window.weight(i, n) as f32).collect::<Vec<_>>();
        let (weights_u, weights_v) = (weights(width), weights(height));
        let sum = |weights: &[f32]| weights.iter().map(|&w| f64::from(w)).sum::<f64>();
        let per_weight = 1.0 / (sum(&weights_u) * sum(&weights_v));
        Ok(Self { fft: RealFft2::new(width, height)?, weights_u, weights_v, per_weight })
    }

    /// Spectrum of `picture` less its weighted mean (so that the constant bin vanishes), times the window.
    /// The sample times its weight enters unscaled: a wave of amplitude `a` gives a peak of `a / 2` times the sum of the weights.
    ///
    /// # Errors
    /// [`Error::Size`] if the picture has another size than planned.
    pub fn transform<T: Copy + Into<f32>>(&mut self, picture: View<'_, T>, out: &mut HalfSpectrum) -> Result<()> {
        let (width, height) = (self.fft.width(), self.fft.height());
        if (picture.width(), picture.height()) != (width, height) {
            return Err(Error::Size {
                expected_width: width,
                expected_height: height,
                width: picture.width(),
                height: picture.height(),
            });
        }
        let mut sum = 0.0;
        for (row, &weight) in picture.rows().zip(&self.weights_v) {
            sum += f64::from(weight) * f64::from(weighted_sum(row, &self.weights_u));
        }
        let mean = (sum * self.per_weight) as f32;
        let (weights_u, weights_v) = (&self.weights_u, &self.weights_v);
        let fill = |v: usize, row: &mut [f32]| {
            let weight_v = weights_v[v];
            for ((to, &from), &weight) in row.iter_mut().zip(picture.row(v)).zip(weights_u) {
                *to = (from.into() - mean) * (weight * weight_v);
            }
        };
        self.fft.forward_rows(fill, out);
        Ok(())
    }
}

/// Sum of products in eight lanes, which the compiler makes vectors of.
fn weighted_sum<T: Copy + Into<f32>>(row: &[T], weights: &[f32]) -> f32 {
    let mut lanes = [0.0f32; 8];
    let (chunks, weight_chunks) = (row.chunks_exact(8), weights.chunks_exact(8));
    let tail: f32 =
        chunks.remainder().iter().zip(weight_chunks.remainder()).map(|(&x, &w)| Into::<f32>::into(x) * w).sum();
    for (values, weights) in chunks.zip(weight_chunks) {
        for ((lane, &x), &w) in lanes.iter_mut().zip(values).zip(weights) {
            *lane += x.into() * w;
        }
    }
    lanes.iter().sum::<f32>() + tail
}

/// Which bins a [`SpectrumImage`] shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bins {
    /// All: as large as the picture, the constant bin at `(width / 2, height / 2)` (NumPy's `fftshift`).
    All,
    /// `-left..=right` cycles per width, `-vertical..=vertical` cycles per height, cut to what there is.
    /// One half of the plane tells all (eq. 4.4, 4.5); we keep the right one, since the real transform computes it.
    Half {
        /// Bins left of the constant one: padding for the filters.
        left: usize,
        /// Bins right of the constant one.
        right: usize,
        /// Bins above and below the constant one.
        vertical: usize,
    },
}

impl Bins {
    /// First and last `kx`, first and last `ky` for a picture of `width` x `height` px, which is not empty.
    pub(crate) fn ranges(self, width: usize, height: usize) -> [isize; 4] {
        let (lowest_x, lowest_y) = (-(width as isize / 2), -(height as isize / 2));
        let (highest_x, highest_y) = (lowest_x + width as isize - 1, lowest_y + height as isize - 1);
        match self {
            Self::All => [lowest_x, highest_x, lowest_y, highest_y],
            Self::Half { left, right, vertical } => {
                let cut = |n: usize| n.min(isize::MAX as usize) as isize;
                let (left, right, vertical) = (cut(left), cut(right), cut(vertical));
                [(-left).max(lowest_x), right.min(highest_x), (-vertical).max(lowest_y), vertical.min(highest_y)]
            }
        }
    }
}

/// Calls `map` on the bins `(kx, y0), (kx, y0 + 1), ..` in one or two runs, and puts what it makes of them into `out` in that order. `y0` is not positive.
pub(crate) fn map_column<T>(
    spectrum: &HalfSpectrum,
    kx: isize,
    y0: isize,
    out: &mut [T],
    map: impl Fn(&[Complex32], &mut [T]),
) {
    // Bins ky < 0 of a column lie at its end; column -kx is column kx upside down.
    let column = spectrum.column(kx.unsigned_abs());
    let (upper, lower) = out.split_at_mut(-y0 as usize);
    if kx >= 0 {
        map(&column[(column.len() - upper.len()) % column.len()..][..upper.len()], upper);
        map(&column[..lower.len()], lower);
    } else {
        map(&column[1..][..upper.len()], upper);
        upper.reverse();
        map(&column[..1], &mut lower[..1]);
        let rest = lower.len() - 1;
        map(&column[column.len() - rest..], &mut lower[1..]);
        lower[1..].reverse();
    }
}

/// How magnitudes become grey levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SpectrumImageConfig {
    /// Logarithm of the magnitude (the thesis leaves it out in print; its figures only make sense with it). Default true.
    pub logarithm: bool,
    /// Binomial blur over 3 x 3 bins against speckle. Default true.
    pub blur: bool,
}

impl Default for SpectrumImageConfig {
    fn default() -> Self {
        Self { logarithm: true, blur: true }
    }
}

/// The spectrum as a grey picture: (log) magnitude, 0 for the weakest bin of the whole spectrum and 255 for the strongest.
///
/// Columns are cycles per width (rising to the right), rows cycles per height (rising downwards, like v); [`Self::constant_bin`] says where
/// zero lies. The constant bin itself, which mean removal empties, does not count for the weakest.
#[derive(Debug, Clone, Default)]
pub struct SpectrumImage {
    image: Image<u8>,
    constant_bin: (usize, usize),
    per_level: f32,
    /// Columns of the spectrum as rows: grey levels, then blurred.
    columns: Vec<u8>,
    blurred: Vec<u8>,
}

impl SpectrumImage {
    /// Draws `bins` of `spectrum`.
    pub fn draw(&mut self, spectrum: &HalfSpectrum, bins: Bins, config: SpectrumImageConfig) {
        if spectrum.width() == 0 {
            return self.image.resize(0, 0);
        }
        let [x0, x1, y0, y1] = bins.ranges(spectrum.width(), spectrum.height());
        self.constant_bin = (-x0 as usize, -y0 as usize);
        let (columns, rows) = ((x1 - x0 + 1) as usize, (y1 - y0 + 1) as usize);

        let scale = Scale::of(spectrum, config.logarithm);
        self.per_level = scale.per_level();
        self.columns.resize(columns * rows, 0);
        for (kx, to) in (x0..=x1).zip(self.columns.chunks_exact_mut(rows)) {
            map_column(spectrum, kx, y0, to, |bins, levels| scale.levels(bins, levels));
        }
        if config.blur {
            blur(&self.columns, rows, &mut self.blurred);
            std::mem::swap(&mut self.columns, &mut self.blurred);
        }
        self.image.resize(columns, rows);
        transpose::transpose(&self.columns, self.image.data_mut(), rows, columns);
    }

    /// The grey picture; `None` before the first [`Self::draw`].
    pub fn view(&self) -> Option<View<'_, u8>> {
        self.image.view()
    }

    /// The grey picture.
    pub fn image(&self) -> &Image<u8> {
        &self.image
    }

    /// Column and row of the constant bin.
    pub fn constant_bin(&self) -> (usize, usize) {
        self.constant_bin
    }

    /// What one grey level is worth: nats of magnitude with the logarithm, magnitude without.
    pub fn per_level(&self) -> f32 {
        self.per_level
    }
}

/// From a bin to its grey level.
struct Scale {
    logarithm: bool,
    weakest: f32,
    levels_per_unit: f32,
}

impl Scale {
    fn of(spectrum: &HalfSpectrum, logarithm: bool) -> Self {
        let (mut low, mut high) = (f32::INFINITY, 0.0f32);
        for kx in 0..=spectrum.width() / 2 {
            let column = spectrum.column(kx);
            for bin in &column[usize::from(kx == 0)..] {
                let power = bin.norm_sqr();
                low = if power < low { power } else { low };
                high = if power > high { power } else { high };
            }
        }
        let unit = |power: f32| if logarithm { log_magnitude(power) } else { power.sqrt() };
        let (weakest, strongest) = (unit(low.min(high)), unit(high));
        let range = strongest - weakest;
        let levels_per_unit = if range > 0.0 && range.is_finite() { 255.0 / range } else { 0.0 };
        Self { logarithm, weakest, levels_per_unit }
    }

    fn per_level(&self) -> f32 {
        if self.levels_per_unit > 0.0 { self.levels_per_unit.recip() } else { 0.0 }
    }

    fn levels(&self, bins: &[Complex32], levels: &mut [u8]) {
        let level = |x: f32| ((x - self.weakest) * self.levels_per_unit + 0.5) as u8;
        if self.logarithm {
            bins.iter().zip(levels).for_each(|(bin, to)| *to = level(log_magnitude(bin.norm_sqr())));
        } else {
            bins.iter().zip(levels).for_each(|(bin, to)| *to = level(bin.norm_sqr().sqrt()));
        }
    }
}

/// `½ ln(1 + power)`: the logarithm of the magnitude, level at zero where the logarithm has no bottom.
#[inline(always)]
pub(crate) fn log_magnitude(power: f32) -> f32 {
    let bits = (1.0 + power).to_bits();
    let exponent = (bits >> 23) as i32 - 127;
    let mantissa = f32::from_bits(bits & 0x007F_FFFF | 0x3F80_0000);
    // ln m = 2 artanh z, z = (m - 1) / (m + 1) at most 1/3: four terms leave 1e-5.
    let z = (mantissa - 1.0) / (mantissa + 1.0);
    let square = z * z;
    let artanh = z * (1.0 + square * (1.0 / 3.0 + square * (0.2 + square * (1.0 / 7.0))));
    exponent as f32 * (0.5 * std::f32::consts::LN_2) + artanh
}

/// Weights 1 2 1 along both directions, borders repeated.
fn blur(image: &[u8], width: usize, out: &mut Vec<u8>) {
    let height = image.len() / width;
    out.resize(image.len(), 0);
    let row = |v: usize| &image[v * width..][..width];
    for (v, to) in out.chunks_exact_mut(width).enumerate() {
        let (above, here, below) = (row(v.saturating_sub(1)), row(v), row((v + 1).min(height - 1)));
        let column = |u: usize| u16::from(above[u]) + 2 * u16::from(here[u]) + u16::from(below[u]);
        let mut border = |u: usize| {
            let sum = column(u.saturating_sub(1)) + 2 * column(u) + column((u + 1).min(width - 1));
            to[u] = ((sum + 8) / 16) as u8;
        };
        border(0);
        border(width - 1);
        let inner = to.iter_mut().skip(1).take(width.saturating_sub(2));
        for (((to, above), here), below) in inner.zip(above.windows(3)).zip(here.windows(3)).zip(below.windows(3)) {
            let column = |i: usize| u16::from(above[i]) + 2 * u16::from(here[i]) + u16::from(below[i]);
            *to = ((column(0) + 2 * column(1) + column(2) + 8) / 16) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn spectrum_of(width: usize, height: usize, value: impl Fn(f64, f64) -> f64) -> HalfSpectrum {
        let data: Vec<f32> =
            (0..width * height).map(|i| value((i % width) as f64, (i / width) as f64) as f32).collect();
        let mut out = HalfSpectrum::default();
        let mut plan = SpectrumPlan::new(width, height, Window::Hann).expect("a size above zero");
        plan.transform(View::packed(&data, width, height).expect("a whole image"), &mut out).expect("the planned size");
        out
    }

    #[test]
    fn a_wave_peaks_in_its_bin_with_half_its_amplitude_times_the_weights() {
        let (width, height, amplitude) = (96, 80, 3.0);
        let out =
            spectrum_of(width, height, |u, v| 50.0 + amplitude * (TAU * (12.0 * u / 96.0 - 7.0 * v / 80.0)).cos());
        // The Hann weights of n pixels sum to n / 2.
        let expected = amplitude / 2.0 * (width * height) as f64 / 4.0;
        let peak = f64::from(out.bin(12, -7).norm());
        assert!((peak / expected - 1.0).abs() < 1e-4, "peak {peak}, expected {expected}");
        assert!(f64::from(out.bin(0, 0).norm()) < 1e-3 * expected, "the mean is removed");
        assert!(f64::from(out.bin(20, 20).norm()) < 1e-4 * expected, "nothing leaks far from the peak");
    }

    #[test]
    fn the_picture_of_all_bins_is_shifted_and_symmetric() {
        for (width, height) in [(48usize, 40usize), (47, 31), (1, 1), (2, 3)] {
            let out = spectrum_of(width, height, |u, v| (u * 1.7).sin() + (v * v * 0.3).cos() + (u * v).sin());
            let mut image = SpectrumImage::default();
            image.draw(&out, Bins::All, SpectrumImageConfig { logarithm: true, blur: false });
            assert_eq!(image.constant_bin(), (width / 2, height / 2));
            let (cx, cy) = ((width / 2) as isize, (height / 2) as isize);
            for (v, row) in image.view().expect("drawn").rows().enumerate() {
                for (u, &level) in row.iter().enumerate() {
                    let bin = out.bin(u as isize - cx, v as isize - cy);
                    let scale = Scale::of(&out, true);
                    let expected = (f64::from(bin.norm_sqr()).ln_1p() / 2.0 - f64::from(scale.weakest))
                        * f64::from(scale.levels_per_unit);
                    let error = (f64::from(level) - expected.clamp(0.0, 255.0)).abs();
                    // Half a level of rounding and the logarithm's 1e-5 nats.
                    assert!(error < 0.51, "{width}x{height} at {u},{v}: {level} for {expected}");
                }
            }
        }
    }

    #[test]
    fn the_half_plane_is_a_crop_of_all() {
        let out = spectrum_of(60, 50, |u, v| (u * 1.7).sin() + (v * 0.3).cos() * u);
        let (mut all, mut half) = (SpectrumImage::default(), SpectrumImage::default());
        let config = SpectrumImageConfig { logarithm: true, blur: false };
        all.draw(&out, Bins::All, config);
        half.draw(&out, Bins::Half { left: 3, right: 20, vertical: 100 }, config);
        assert_eq!(half.constant_bin(), (3, 25));
        assert_eq!((half.image().width(), half.image().height()), (24, 50));
        for v in 0..50 {
            assert_eq!(half.image().row(v), &all.image().row(v)[27..51], "row {v}");
        }
    }

    #[test]
    fn pictures_without_content_are_black_not_a_panic() {
        for (width, height) in [(1, 1), (1, 9), (30, 20)] {
            let out = spectrum_of(width, height, |_, _| 200.0);
            let mut image = SpectrumImage::default();
            image.draw(&out, Bins::All, SpectrumImageConfig::default());
            assert_eq!(image.image().data().len(), width * height);
            image.draw(
                &out,
                Bins::Half { left: usize::MAX, right: usize::MAX, vertical: usize::MAX },
                SpectrumImageConfig::default(),
            );
            assert_eq!(image.image().data().len(), width * height);
        }
    }

    #[test]
    fn the_logarithm_is_one() {
        for power in [0.0f32, 1e-3, 0.5, 1.0, 7.3, 1e4, 3.3e9, 1e20] {
            let expected = f64::from(power).ln_1p() / 2.0;
            // 1e-5 of the series, and single precision at the largest value (23).
            assert!((f64::from(log_magnitude(power)) - expected).abs() < 2e-5, "power {power}");
        }
    }

    #[test]
    fn the_blur_keeps_a_constant_and_spreads_a_dot() {
        let mut out = Vec::new();
        blur(&[9; 12], 4, &mut out);
        assert_eq!(out, [9; 12]);
        let mut dot = [0u8; 25];
        dot[12] = 160;
        blur(&dot, 5, &mut out);
        assert_eq!(&out[5..20], &[0, 10, 20, 10, 0, 0, 20, 40, 20, 0, 0, 10, 20, 10, 0]);
        blur(&[7], 1, &mut out);
        assert_eq!(out, [7]);
    }
}
