//! Which bins of a spectrum are looked at, and how their magnitudes are measured.

use rustfft::num_complex::Complex32;

use crate::fft2::HalfSpectrum;

/// Which bins a [`crate::SpectrumImage`] shows.
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
#[inline(always)]
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_is_one() {
        for power in [0.0f32, 1e-3, 0.5, 1.0, 7.3, 1e4, 3.3e9, 1e20] {
            let expected = f64::from(power).ln_1p() / 2.0;
            // 1e-5 of the series, and single precision at the largest value (23).
            assert!((f64::from(log_magnitude(power)) - expected).abs() < 2e-5, "power {power}");
        }
    }
}
