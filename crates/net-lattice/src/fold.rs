//! All cells laid on top of each other: what the average cell looks like. Two families of twine make it a sum of a function of the first
//! coordinate and one of the second (but for the knots); bricks, scales, honeycombs and other lattices that are no net do not.

use crate::map::PhaseMap;
use crate::numeric::wrap;
use crate::view::{BLOCK, Level};

/// Bins along a side of the cell.
const BINS: usize = 12;
/// Bins along a side of two cells by two.
const WIDE: usize = 2 * BINS;

/// The average cell in numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Fold {
    /// Share of its variance that is a sum of functions of one coordinate each.
    pub separable: f64,
    /// Variance along the weaker family over that along the stronger.
    pub balance: f64,
    /// Share of the variance of two by two cells in which they differ: bricks, and lattices of which only every second line exists.
    pub unlike: f64,
    /// Variance over that of noise.
    pub snr: f64,
}

/// Folds the high-passed picture of a level. Two halves of the picture are folded apart and only what they have in common counts, so
/// noise adds nothing on average.
pub(crate) fn fold(level: &Level, map: &PhaseMap, gain: f32) -> Fold {
    let mut sums = [[0.0f64; WIDE * WIDE]; 2];
    let mut counts = [[0u32; WIDE * WIDE]; 2];
    let (bx, by) = level.blocks();
    let bin = |s: f32| (((wrap(0.5 * s) + 0.5) * WIDE as f32) as usize).min(WIDE - 1);
    for y in 0..by {
        for x in 0..bx {
            let Some([p, q]) = map.block(x, y) else { continue };
            let half = (x / 2 + y / 2) % 2;
            for r in 0..BLOCK {
                let row = &level.high.row(y * BLOCK + r)[x * BLOCK..][..BLOCK];
                let v = r as f32 - 1.5;
                for (c, i) in row.iter().enumerate() {
                    let u = c as f32 - 1.5;
                    let k = bin(p.s + p.du * u + p.dv * v) * WIDE + bin(q.s + q.du * u + q.dv * v);
                    sums[half][k] += f64::from((i * gain).clamp(-1.0, 1.0));
                    counts[half][k] += 1;
                }
            }
        }
    }
    let mut wide = [[0.0f64; WIDE * WIDE]; 2];
    let mut cell = [[0.0f64; BINS * BINS]; 2];
    for h in 0..2 {
        let (mut mean, mut filled) = (0.0, 0.0);
        for k in 0..WIDE * WIDE {
            if counts[h][k] > 0 {
                wide[h][k] = sums[h][k] / f64::from(counts[h][k]);
                mean += wide[h][k];
                filled += 1.0;
            }
        }
        let mean = mean / f64::max(filled, 1.0);
        for k in 0..WIDE * WIDE {
            wide[h][k] = if counts[h][k] > 0 { wide[h][k] - mean } else { 0.0 };
            cell[h][k / WIDE % BINS * BINS + k % BINS] += 0.25 * wide[h][k];
        }
    }
    let common = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / a.len() as f64;
    let all = common(&wide[0], &wide[1]);
    let n = (BINS * BINS) as f64;
    let total = cell[0].iter().zip(&cell[1]).map(|(a, b)| a * b).sum::<f64>() / n;
    let noise = cell[0].iter().zip(&cell[1]).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / (4.0 * n);
    let line = |h: usize, i: usize, first: bool| {
        (0..BINS).map(|j| cell[h][if first { i * BINS + j } else { j * BINS + i }]).sum::<f64>() / BINS as f64
    };
    let along = |first: bool| (0..BINS).map(|i| line(0, i, first) * line(1, i, first)).sum::<f64>() / BINS as f64;
    let (a, b) = (along(true).max(0.0), along(false).max(0.0));
    if total <= 0.0 {
        return Fold::default();
    }
    Fold {
        separable: (a + b) / total,
        unlike: (1.0 - total / all.max(1e-12)).max(0.0),
        balance: a.min(b) / a.max(b).max(1e-12),
        snr: total / noise.max(1e-12),
    }
}
