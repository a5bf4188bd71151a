//! Where the twines of a tile are, from several harmonics together.
//!
//! Thin twine is a comb: its harmonics are nearly as strong as its fundamental, while fish, shadows and clouds are mostly long waves. The harmonics
//! `z_h` of one family in one tile, demodulated at h times the predicted phase, peak together where the lattice is off by `e` cells:
//! `C(e) = sum_h w_h Re(z_h exp(-2 pi j h e))`, the matched filter for a comb in coloured noise.

use crate::lockin::TileSum;
use crate::numeric::{median, sin_cos_cycles};

/// Harmonics that are summed.
pub(crate) const HARMONICS: usize = 4;
/// Steps of a cell in which the peak is looked for.
const STEPS: usize = 24;
/// Highest frequency, cycles per px of the level, at which a harmonic is measured.
const HIGHEST: f64 = 0.42;
/// Blur of an ordinary picture, px of the level, one standard deviation.
const BLUR_PX: f64 = 0.9;

/// How each family looks: the sign of its even harmonics beside the odd ones. 1 where twine is bright and thin or dark and wide (blurred over more than
/// half a cell), -1 for dark and thin or bright and wide, 0 where only the fundamental is to be relied on: real twine is braided, shaded and fouled.
/// Motion blurs one family and not the other.
pub(crate) type Looks = [f64; 2];
/// All that a family may have.
pub(crate) const LOOKS: [f64; 3] = [1.0, -1.0, 0.0];

/// Weights of the harmonics for one picture and sheet.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Comb {
    weight: [[f64; HARMONICS]; 2],
}

impl Comb {
    /// For twine of `width` cells along both families, in cells of `cell` px of the level. The power of each harmonic in the middle one of the tiles stands
    /// for that of the noise: where the net is strong it makes all harmonics count alike.
    ///
    /// `odd`: 1 where the fundamental is highest on the sheet's lines, -1 where it is lowest (dark twine on the lines).
    pub(crate) fn new(
        sums: &[TileSum],
        width: [f64; 2],
        cell: f64,
        odd: f64,
        looks: Looks,
        scratch: &mut Vec<f64>,
    ) -> Self {
        let weight = std::array::from_fn(|f| {
            std::array::from_fn(|k| {
                let h = (k + 1) as f64;
                if h > HIGHEST * cell {
                    return 0.0;
                }
                scratch.clear();
                let power = |s: &TileSum| (s.z[f][k][0].powi(2) + s.z[f][k][1].powi(2)) / (0.5 * s.power + 1e-9);
                scratch.extend(sums.iter().filter(|s| s.power > 0.0).map(power));
                let noise = median(scratch).max(0.5);
                let bar = std::f64::consts::PI * h * width[f];
                let blur = std::f64::consts::TAU * h * BLUR_PX / cell;
                let shape = bar.sin() / bar.max(1e-9) * (-0.5 * blur * blur).exp();
                shape.max(0.0) / noise
                    * match k {
                        0 => odd,
                        _ if k % 2 == 1 => odd * looks[f],
                        _ => odd * looks[f].abs(),
                    }
            })
        });
        Self { weight }
    }

    /// Cells by which family `f` of a tile is off, in [-0.5, 0.5), and the power of that peak against the mean of noise; `k` is the length of the wave
    /// vector, cells per px of the level.
    pub(crate) fn peak(&self, f: usize, sum: &TileSum, k: f64) -> (f64, f64) {
        let resolved = ((HIGHEST / k) as usize).clamp(1, HARMONICS);
        let (weight, z) = (&self.weight[f][..resolved], &sum.z[f]);
        let height = |e: f32| {
            let (s1, c1) = sin_cos_cycles(e);
            let (mut s, mut c) = (s1, c1);
            let mut sum = 0.0;
            for (w, z) in weight.iter().zip(z) {
                sum += w * (z[0] * f64::from(c) + z[1] * f64::from(s));
                (s, c) = (s * c1 + c * s1, c * c1 - s * s1);
            }
            sum
        };
        let step = 1.0 / STEPS as f32;
        let mut best = (f64::NEG_INFINITY, 0);
        for k in 0..STEPS {
            let h = height(k as f32 * step - 0.5);
            if h > best.0 {
                best = (h, k);
            }
        }
        let middle = best.1 as f32 * step - 0.5;
        let (a, b, c) = (height(middle - step), best.0, height(middle + step));
        let bend = a - 2.0 * b + c;
        let part = if bend < 0.0 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 };
        let mut off = f64::from(middle) + part * f64::from(step);
        off -= (off + 0.5).floor();
        let whole: f64 = weight.iter().map(|w| w * w).sum();
        let top = (b - 0.25 * (a - c) * part).max(0.0);
        (off, top * top / (0.5 * sum.power * whole + 1e-9))
    }
}
