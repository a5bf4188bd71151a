//! How a twine looks across itself: a bar, blurred, repeated every cell. Tabulated, so that pixel loops need no error function.

use crate::numeric::{erf, log2_rough};

/// Positions from the middle of a twine (0) to half a cell.
const POSITIONS: usize = 256;
/// Blurs, a twentieth of an octave apart.
const BLURS: usize = 150;
const PER_OCTAVE: f32 = 20.0;
/// Smallest blur, cells (base-2 logarithm).
const LOWEST: f32 = -7.9;

/// Coverage and its derivative by position, for one width.
#[derive(Debug, Default)]
pub(crate) struct Profile {
    width: f64,
    /// Blur by position: coverage, derivative per cell.
    table: Vec<[f32; 2]>,
}

impl Profile {
    /// Prepares twine of `width` cells; keeps the table if nothing changes.
    pub(crate) fn prepare(&mut self, width: f64) {
        let width = width.clamp(0.002, 0.9);
        if self.width == width {
            return;
        }
        self.width = width;
        self.table.clear();
        for b in 0..BLURS {
            let s = f64::from(LOWEST + b as f32 / PER_OCTAVE).exp2();
            for k in 0..=POSITIONS {
                let q = 0.5 * k as f64 / POSITIONS as f64;
                let (mut p, mut d) = (0.0, 0.0);
                for m in -2..=2 {
                    let hi = (q + f64::from(m) + 0.5 * width) / s;
                    let lo = (q + f64::from(m) - 0.5 * width) / s;
                    if lo > 6.0 || hi < -6.0 {
                        continue;
                    }
                    p += 0.5 * (erf(hi * std::f64::consts::FRAC_1_SQRT_2) - erf(lo * std::f64::consts::FRAC_1_SQRT_2));
                    d += 0.398_942_28 * ((-0.5 * hi * hi).exp() - (-0.5 * lo * lo).exp()) / s;
                }
                self.table.push([p as f32, d as f32]);
            }
        }
    }

    /// The row of the table for a blur of `s` cells.
    #[inline]
    pub(crate) fn row(&self, s: f32) -> &[[f32; 2]; POSITIONS + 1] {
        let b = ((log2_rough(s.max(1e-5)) - LOWEST) * PER_OCTAVE + 0.5).clamp(0.0, (BLURS - 1) as f32) as usize;
        let row = self.table.get(b * (POSITIONS + 1)..(b + 1) * (POSITIONS + 1)).and_then(|r| r.try_into().ok());
        row.unwrap_or(&[[0.0; 2]; POSITIONS + 1])
    }
}

/// Coverage and derivative at `q` cells from a twine, |q| <= 1/2.
#[inline]
pub(crate) fn look_up(row: &[[f32; 2]; POSITIONS + 1], q: f32) -> (f32, f32) {
    let (value, slope) = look_up_all(row, &[q]);
    (value[0], slope[0])
}

/// The same for many places.
#[inline(always)]
pub(crate) fn look_up_all<const N: usize>(row: &[[f32; 2]; POSITIONS + 1], q: &[f32; N]) -> ([f32; N], [f32; N]) {
    // The steps of the table and what is left of them first, then what stands there, then the line between: the first and the last side by side.
    let (mut step, mut part) = ([0; N], [0.0; N]);
    for k in 0..N {
        let x = q[k].abs() * (2 * POSITIONS) as f32;
        step[k] = (x as i32).clamp(0, POSITIONS as i32 - 1);
        part[k] = x - step[k] as f32;
    }
    let (mut from, mut to) = ([[0.0; 2]; N], [[0.0; 2]; N]);
    for k in 0..N {
        (from[k], to[k]) = (row[step[k] as usize], row[step[k] as usize + 1]);
    }
    let (mut value, mut slope) = ([0.0; N], [0.0; N]);
    for k in 0..N {
        value[k] = from[k][0] + part[k] * (to[k][0] - from[k][0]);
        slope[k] = (from[k][1] + part[k] * (to[k][1] - from[k][1])).copysign(from[k][1] * q[k]);
    }
    (value, slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coverage_integrates_to_the_width_and_its_derivative_fits() {
        let mut profile = Profile::default();
        profile.prepare(0.06);
        for s in [0.006f32, 0.03, 0.12] {
            let row = profile.row(s);
            let n = 2000;
            let mean: f32 = (0..n).map(|k| look_up(row, k as f32 / n as f32 - 0.5).0).sum::<f32>() / n as f32;
            // the table's steps of 0.002 cells
            assert!((mean - 0.06).abs() < 1e-3, "{s}: {mean}");
            for q in [-0.31f32, -0.04, 0.02, 0.11] {
                let e = 2e-3;
                let slope = (look_up(row, q + e).0 - look_up(row, q - e).0) / (2.0 * e);
                let d = look_up(row, q).1;
                assert!((slope - d).abs() < 0.12 * (1.0 / s).min(12.0) + 0.05 * d.abs(), "{s} {q}: {slope} {d}");
            }
        }
    }
}
