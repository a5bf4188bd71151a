//! The spectrum as a grey picture (thesis 4.3.1).

use net_image::{Image, View};
use rustfft::num_complex::Complex32;

use crate::bins::{Bins, log_magnitude, map_column};
use crate::fft2::HalfSpectrum;

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
    /// The widest vectors that the processor has.
    arch: pulp::Arch,
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

        self.arch.dispatch(DrawColumns { picture: self, spectrum, columns: (x0, x1), first_row: y0, rows, config });
        self.image.resize(columns, rows);
        transpose::transpose(&self.columns, self.image.data_mut(), rows, columns);
    }

    /// Draws columns `x0` to `x1` of the spectrum as rows, from bin `y0` on.
    #[inline(always)]
    fn draw_columns(
        &mut self,
        spectrum: &HalfSpectrum,
        (x0, x1): (isize, isize),
        y0: isize,
        rows: usize,
        config: SpectrumImageConfig,
    ) {
        let scale = Scale::of(spectrum, config.logarithm);
        self.per_level = scale.per_level();
        self.columns.resize((x1 - x0 + 1) as usize * rows, 0);
        for (kx, to) in (x0..=x1).zip(self.columns.chunks_exact_mut(rows)) {
            map_column(spectrum, kx, y0, to, |bins, levels| scale.levels(bins, levels));
        }
        if config.blur {
            blur(&self.columns, rows, &mut self.blurred);
            std::mem::swap(&mut self.columns, &mut self.blurred);
        }
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

/// [`SpectrumImage::draw_columns`] as a task for the widest vectors that the processor has.
struct DrawColumns<'a> {
    picture: &'a mut SpectrumImage,
    spectrum: &'a HalfSpectrum,
    columns: (isize, isize),
    first_row: isize,
    rows: usize,
    config: SpectrumImageConfig,
}

impl pulp::WithSimd for DrawColumns<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.picture.draw_columns(self.spectrum, self.columns, self.first_row, self.rows, self.config);
    }
}

/// From a bin to its grey level.
struct Scale {
    logarithm: bool,
    weakest: f32,
    levels_per_unit: f32,
}

impl Scale {
    #[inline(always)]
    fn of(spectrum: &HalfSpectrum, logarithm: bool) -> Self {
        // In lanes, which the compiler makes vectors of: one comparison does not wait for the one before.
        let (mut lows, mut highs) = ([f32::INFINITY; 8], [0.0f32; 8]);
        for kx in 0..=spectrum.width() / 2 {
            for bins in spectrum.column(kx)[usize::from(kx == 0)..].chunks(lows.len()) {
                for ((low, high), bin) in lows.iter_mut().zip(&mut highs).zip(bins) {
                    let power = bin.norm_sqr();
                    *low = if power < *low { power } else { *low };
                    *high = if power > *high { power } else { *high };
                }
            }
        }
        let (low, high) = (lows.into_iter().fold(f32::INFINITY, f32::min), highs.into_iter().fold(0.0, f32::max));
        let unit = |power: f32| if logarithm { log_magnitude(power) } else { power.sqrt() };
        let (weakest, strongest) = (unit(low.min(high)), unit(high));
        let range = strongest - weakest;
        let levels_per_unit = if range > 0.0 && range.is_finite() { 255.0 / range } else { 0.0 };
        Self { logarithm, weakest, levels_per_unit }
    }

    fn per_level(&self) -> f32 {
        if self.levels_per_unit > 0.0 { self.levels_per_unit.recip() } else { 0.0 }
    }

    #[inline(always)]
    fn levels(&self, bins: &[Complex32], levels: &mut [u8]) {
        // Rounded: the digits after the point do not fit beside 2^23. (A cast minds values out of range one by one.)
        let level = |x: f32| {
            let level = ((x - self.weakest) * self.levels_per_unit).clamp(0.0, 255.0);
            (level + 8_388_608.0).to_bits() as u8
        };
        if self.logarithm {
            bins.iter().zip(levels).for_each(|(bin, to)| *to = level(log_magnitude(bin.norm_sqr())));
        } else {
            bins.iter().zip(levels).for_each(|(bin, to)| *to = level(bin.norm_sqr().sqrt()));
        }
    }
}

/// Weights 1 2 1 along both directions, borders repeated.
#[inline(always)]
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
    use crate::spectrum::tests::spectrum_of;

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
