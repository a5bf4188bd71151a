//! From a picture to its spectrum: mean, window, transform (thesis 4.3.1, mended).

use net_image::View;

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
    /// Sum of the squares of all weights.
    squares: f64,
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
        let square = |weights: &[f32]| weights.iter().map(|&w| f64::from(w).powi(2)).sum::<f64>();
        let squares = square(&weights_u) * square(&weights_v);
        Ok(Self { fft: RealFft2::new(width, height)?, weights_u, weights_v, per_weight, squares })
    }

    /// Mean power of a bin (its squared magnitude) in pictures of nothing but noise of standard deviation `sigma`, from pixel to pixel independent.
    pub fn noise_power(&self, sigma: f64) -> f64 {
        sigma * sigma * self.squares
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

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use std::f64::consts::TAU;

    pub(crate) fn spectrum_of(width: usize, height: usize, value: impl Fn(f64, f64) -> f64) -> HalfSpectrum {
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
    fn noise_has_the_power_it_should() {
        let (width, height, sigma) = (96, 80, 3.0f64);
        let mut state = 0x0123_4567_89AB_CDEF_u64;
        let data: Vec<f32> = (0..width * height)
            .map(|_| {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                // Evenly spread over a unit: a variance of 1/12.
                (((state >> 40) as f64 / (1u64 << 24) as f64 - 0.5) * sigma * 12f64.sqrt()) as f32
            })
            .collect();
        let mut out = HalfSpectrum::default();
        let mut plan = SpectrumPlan::new(width, height, Window::Hann).unwrap();
        plan.transform(View::packed(&data, width, height).unwrap(), &mut out).unwrap();
        let bins = (5..40).flat_map(|kx| (-35..35).map(move |ky| (kx, ky)));
        let (sum, count) =
            bins.fold((0.0, 0.0), |(sum, count), (kx, ky)| (sum + f64::from(out.bin(kx, ky).norm_sqr()), count + 1.0));
        // The mean of 2450 bins, of which the window leaves one in two independent: 3 % is one standard deviation.
        assert!((sum / count / plan.noise_power(sigma) - 1.0).abs() < 0.1, "{}", sum / count);
    }
}
