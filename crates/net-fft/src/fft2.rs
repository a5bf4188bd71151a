//! Two-dimensional discrete Fourier transform of a real image of any size.

use net_image::View;
use rustfft::num_complex::Complex32;

use crate::error::{Error, Result};
use crate::line_fft::{LineFft, LineScratch};

/// Plans and scratch for images of one size. See the crate's manual for normalization and output order.
///
/// Rows are transformed two at a time, as the real and the imaginary part of one: the halves of the picture, one on top of the other. They are told apart by the symmetry of a
/// real row's transform, a few columns at a time, and each column is transformed while it is at hand.
pub struct RealFft2 {
    width: usize,
    height: usize,
    row_plan: LineFft,
    column_plan: LineFft,
    /// Two rows of the image, in and out of the caller's hands.
    rows: [Vec<f32>; 2],
    /// Pairs of rows transformed, pair by pair.
    pairs: Vec<Complex32>,
    scratch: LineScratch,
}

impl std::fmt::Debug for RealFft2 {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RealFft2").field("width", &self.width).field("height", &self.height).finish_non_exhaustive()
    }
}

impl RealFft2 {
    /// Plans for images of `width` x `height` px.
    ///
    /// # Errors
    /// [`Error::EmptySize`] if either is zero.
    pub fn new(width: usize, height: usize) -> Result<Self> {
        if width == 0 || height == 0 {
            return Err(Error::EmptySize { width, height });
        }
        let (row_plan, column_plan) = (LineFft::new(width), LineFft::new(height));
        let scratch = LineScratch::of(&[&row_plan, &column_plan]);
        let pairs = vec![Complex32::default(); width * height.div_ceil(2)];
        Ok(Self { width, height, rows: [vec![0.0; width], vec![0.0; width]], pairs, scratch, row_plan, column_plan })
    }

    /// Width of the images it was planned for, px.
    pub fn width(&self) -> usize {
        self.width
    }
    /// Height of the images it was planned for, px.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Transforms `image`.
    ///
    /// # Errors
    /// [`Error::Size`] if it has another size than planned.
    pub fn forward<T: Copy + Into<f32>>(&mut self, image: View<'_, T>, out: &mut HalfSpectrum) -> Result<()> {
        if (image.width(), image.height()) != (self.width, self.height) {
            return Err(Error::Size {
                expected_width: self.width,
                expected_height: self.height,
                width: image.width(),
                height: image.height(),
            });
        }
        self.forward_rows(|v, row| row.iter_mut().zip(image.row(v)).for_each(|(to, &from)| *to = from.into()), out);
        Ok(())
    }

    /// Transforms the image whose row `v` is what `fill(v, row)` writes into `row`: lets a window be applied on the way. Rows are not asked for in their order.
    pub fn forward_rows(&mut self, mut fill: impl FnMut(usize, &mut [f32]), out: &mut HalfSpectrum) {
        out.resize(self.width, self.height);
        let half = self.height.div_ceil(2);
        let [upper, lower] = &mut self.rows;
        for (v, pair) in self.pairs.chunks_exact_mut(self.width).enumerate() {
            fill(v, upper);
            if v + half < self.height {
                fill(v + half, lower);
            } else {
                lower.fill(0.0);
            }
            for ((to, &re), &im) in pair.iter_mut().zip(&*upper).zip(&*lower) {
                *to = Complex32::new(re, im);
            }
            self.row_plan.process(pair, &mut self.scratch);
        }
        for (block, columns) in out.data.chunks_mut(BLOCK * self.height).enumerate() {
            self.split_rows(block * BLOCK, columns);
            for column in columns.chunks_exact_mut(self.height) {
                self.column_plan.process(column, &mut self.scratch);
            }
        }
    }

    /// Tells the transforms of paired rows apart, for bins `first` and on along the rows, into columns.
    fn split_rows(&self, first: usize, columns: &mut [Complex32]) {
        let half = self.height.div_ceil(2);
        for (kx, column) in (first..).zip(columns.chunks_exact_mut(self.height)) {
            let mirror = if kx == 0 { 0 } else { self.width - kx };
            let (upper, lower) = column.split_at_mut(half);
            let (mut pairs, mut upper) = (self.pairs.chunks_exact(self.width), upper.iter_mut());
            // Z = A + iB, and a real row's transform is its own mirror image, conjugated.
            let of_a = |z: Complex32, m: Complex32| Complex32::new(0.5 * (z.re + m.re), 0.5 * (z.im - m.im));
            let of_b = |z: Complex32, m: Complex32| Complex32::new(0.5 * (z.im + m.im), 0.5 * (m.re - z.re));
            for (b, (a, pair)) in lower.iter_mut().zip((&mut upper).zip(&mut pairs)) {
                let (z, m) = (pair[kx], pair[mirror]);
                (*a, *b) = (of_a(z, m), of_b(z, m));
            }
            // The last row of an odd number of rows has no partner.
            if let Some((a, pair)) = upper.zip(pairs).next() {
                *a = of_a(pair[kx], pair[mirror]);
            }
        }
    }
}

/// Columns that are gathered together: as many as a cache line of a row holds.
const BLOCK: usize = 8;

/// Half of the transform of a real image; the other half is its complex conjugate. Reused between transforms.
#[derive(Debug, Clone, Default)]
pub struct HalfSpectrum {
    width: usize,
    height: usize,
    data: Vec<Complex32>,
}

impl HalfSpectrum {
    fn resize(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.data.resize((width / 2 + 1) * height, Complex32::default());
    }

    /// Width of the image it came from, px.
    pub fn width(&self) -> usize {
        self.width
    }
    /// Height of the image it came from, px.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Column `kx` in `0..=width / 2`: the bins `ky = 0, 1, .. height - 1` (those past `height / 2` are `ky - height`).
    ///
    /// # Panics
    /// If `kx` is above `width / 2`.
    #[inline]
    pub fn column(&self, kx: usize) -> &[Complex32] {
        &self.data[kx * self.height..][..self.height]
    }

    /// The bin of `kx` cycles per width and `ky` cycles per height, any integers (the transform is periodic). Zero before the first transform.
    pub fn bin(&self, kx: isize, ky: isize) -> Complex32 {
        if self.data.is_empty() {
            return Complex32::default();
        }
        let (kx, ky) = (kx.rem_euclid(self.width as isize) as usize, ky.rem_euclid(self.height as isize) as usize);
        if kx <= self.width / 2 {
            self.column(kx)[ky]
        } else {
            self.column(self.width - kx)[(self.height - ky) % self.height].conj()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Single precision, unit-sized values, transforms of up to some hundred points: rounding stays below this.
    const ROUNDING: f64 = 2e-4;

    fn noise(count: usize, seed: u64) -> Vec<f32> {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        (0..count)
            .map(|_| {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                (state >> 40) as f32 / (1u64 << 24) as f32 - 0.5
            })
            .collect()
    }

    /// The definition, in double precision.
    fn naive(image: &[f32], width: usize, height: usize, kx: isize, ky: isize) -> (f64, f64) {
        let (mut re, mut im) = (0.0, 0.0);
        for (i, &value) in image.iter().enumerate() {
            let (u, v) = ((i % width) as f64, (i / width) as f64);
            let angle = -TAU * (kx as f64 * u / width as f64 + ky as f64 * v / height as f64);
            re += f64::from(value) * angle.cos();
            im += f64::from(value) * angle.sin();
        }
        (re, im)
    }

    #[test]
    fn equals_the_definition_for_even_odd_prime_and_tiny_sizes() {
        // 104, 424 and 776 have a prime factor that is multiplied out, 53 and 808 become convolutions.
        for (width, height) in [
            (1, 1),
            (2, 1),
            (1, 5),
            (3, 2),
            (8, 6),
            (7, 11),
            (15, 10),
            (13, 17),
            (24, 9),
            (53, 4),
            (104, 3),
            (2, 424),
            (776, 1),
            (808, 1),
        ] {
            let image = noise(width * height, (width * 100 + height) as u64);
            let mut out = HalfSpectrum::default();
            let mut plan = RealFft2::new(width, height).expect("a size above zero");
            plan.forward(View::packed(&image, width, height).expect("a whole image"), &mut out)
                .expect("the planned size");
            for ky in -(height as isize)..=height as isize {
                for kx in -(width as isize)..=width as isize {
                    let (re, im) = naive(&image, width, height, kx, ky);
                    let got = out.bin(kx, ky);
                    let error = (f64::from(got.re) - re).hypot(f64::from(got.im) - im);
                    assert!(error < ROUNDING, "{width}x{height} bin {kx},{ky}: off by {error}");
                }
            }
        }
    }

    #[test]
    fn energy_is_kept_at_the_sizes_in_use() {
        for (width, height) in [(848, 480), (424, 240), (211, 127)] {
            let image = noise(width * height, 7);
            let mut out = HalfSpectrum::default();
            let mut plan = RealFft2::new(width, height).expect("a size above zero");
            plan.forward(View::packed(&image, width, height).expect("a whole image"), &mut out)
                .expect("the planned size");
            let mut energy = 0.0;
            for ky in 0..height as isize {
                for kx in 0..width as isize {
                    energy += f64::from(out.bin(kx, ky).norm_sqr());
                }
            }
            let expected: f64 = image.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>() * (width * height) as f64;
            assert!((energy / expected - 1.0).abs() < 1e-5, "Parseval at {width}x{height}: {}", energy / expected);
        }
    }

    #[test]
    fn wrong_sizes_are_errors() {
        assert_eq!(RealFft2::new(0, 4).err(), Some(Error::EmptySize { width: 0, height: 4 }));
        let mut plan = RealFft2::new(4, 4).expect("a size above zero");
        let image = [0.0f32; 12];
        let view = View::packed(&image, 4, 3).expect("a whole image");
        let error = plan.forward(view, &mut HalfSpectrum::default()).expect_err("three rows are not four");
        assert_eq!(error.to_string(), "planned for 4x4 px, got 4x3 px");
    }
}
