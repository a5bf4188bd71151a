//! Where the twines of a tile are, from several harmonics together.
//!
//! Thin twine is a comb: its harmonics are nearly as strong as its fundamental, while fish, shadows and clouds are mostly long waves. The harmonics
//! `z_h` of one family in one tile, demodulated at h times the predicted phase, peak together where the lattice is off by `e` cells:
//! `C(e) = sum_h w_h Re(z_h exp(-2 pi j h e))`, the matched filter for a comb in coloured noise.

use crate::lock::demodulate::TileSum;
use crate::numeric::median;

/// Harmonics that are summed.
pub(crate) const HARMONICS: usize = 4;
/// Steps of a cell in which the peak is looked for.
const STEPS: usize = 24;
/// Cosines and sines of each harmonic at those steps, which begin half a cell before the line.
const WAVES: [[[f64; STEPS]; 2]; HARMONICS] = waves();
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

/// All of them are steps round one circle.
const fn waves() -> [[[f64; STEPS]; 2]; HARMONICS] {
    // Cosine and sine of 15 degrees.
    const STEP: [f64; 2] = [0.965_925_826_289_068_3, 0.258_819_045_102_520_76];
    let (mut circle, mut k) = ([[1.0, 0.0]; STEPS], 1);
    while k < STEPS {
        let [c, s] = circle[k - 1];
        circle[k] = [c * STEP[0] - s * STEP[1], s * STEP[0] + c * STEP[1]];
        k += 1;
    }
    let (mut waves, mut h) = ([[[0.0; STEPS]; 2]; HARMONICS], 0);
    while h < HARMONICS {
        k = 0;
        while k < STEPS {
            let [c, s] = circle[(h + 1) * (k + STEPS / 2) % STEPS];
            (waves[h][0][k], waves[h][1][k]) = (c, s);
            k += 1;
        }
        h += 1;
    }
    waves
}

impl Comb {
    /// For twine of `width` cells along both families, in cells of `cell` px of the level. The power of each harmonic in the middle one of the tiles stands
    /// for that of the noise: where the net is strong it makes all harmonics count alike.
    ///
    /// `odd`: of each family 1 where the fundamental is highest on the sheet's lines, -1 where it is lowest (dark twine on the lines).
    pub(crate) fn new(
        sums: &[TileSum],
        width: [f64; 2],
        cell: f64,
        odd: [f64; 2],
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
                        0 => odd[f],
                        _ if k % 2 == 1 => odd[f] * looks[f],
                        _ => odd[f] * looks[f].abs(),
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
        let mut heights = [0.0; STEPS];
        for ((w, z), [cosines, sines]) in weight.iter().zip(z).zip(&WAVES) {
            for (height, (c, s)) in heights.iter_mut().zip(cosines.iter().zip(sines)) {
                *height += w * (z[0] * c + z[1] * s);
            }
        }
        let mut best = 0;
        for (k, height) in heights.iter().enumerate() {
            if *height > heights[best] {
                best = k;
            }
        }
        let (a, b, c) = (heights[(best + STEPS - 1) % STEPS], heights[best], heights[(best + 1) % STEPS]);
        let bend = a - 2.0 * b + c;
        let part = if bend < 0.0 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 };
        let mut off = (best as f64 + part) / STEPS as f64 - 0.5;
        off -= (off + 0.5).floor();
        let whole: f64 = weight.iter().map(|w| w * w).sum();
        let top = (b - 0.25 * (a - c) * part).max(0.0);
        (off, top * top / (0.5 * sum.power * whole + 1e-9))
    }
}
