//! Whitened spectra as the search looks things up in them: coarse, so that a hypothesis near the truth finds its harmonics.

use crate::search::spectra::{COLUMNS, SIZE};

/// Whitened power is clipped here: one strong peak must not outvote the other tiles.
const CAP: f32 = 12.0;

/// Variance of a blurred, clipped, whitened bin.
pub(crate) const VARIANCE: f64 = 0.45;

/// 3 x 3 binomial blur (about a bin), clipped, less 1.
#[inline(always)]
pub(crate) fn blur_clip(power: &[f32], out: &mut [f32], line: &mut [f32]) {
    for x in 0..COLUMNS {
        let mid = &power[x * SIZE..][..SIZE];
        let left = &power[if x == 0 { 1 } else { x - 1 } * SIZE..][..SIZE];
        let right = &power[(x + 1).min(COLUMNS - 1) * SIZE..][..SIZE];
        for (((l, m), a), b) in line.iter_mut().zip(mid).zip(left).zip(right) {
            *l = 0.25 * (a + b) + 0.5 * m;
        }
        let out = &mut out[x * SIZE..][..SIZE];
        for y in 1..SIZE - 1 {
            out[y] = (0.25 * (line[y - 1] + line[y + 1]) + 0.5 * line[y]).min(CAP) - 1.0;
        }
        out[0] = 0.0;
        out[SIZE - 1] = 0.0;
    }
}

/// Puts the highest of the neighbourhood in place of bins far from the middle, less what that is on average, with the same variance.
#[inline(always)]
pub(crate) fn pool(coarse: &mut [f32], far: &[bool], pooled: &mut Vec<f32>) {
    highest(coarse, pooled);
    let (mut n, mut sum, mut square) = (0.0f64, 0.0f64, 0.0f64);
    for (p, _) in pooled.iter().zip(far).filter(|(_, far)| **far) {
        n += 1.0;
        sum += f64::from(*p);
        square += f64::from(p * p);
    }
    let mean = sum / n.max(1.0);
    let scale = f64::sqrt(VARIANCE / (square / n.max(1.0) - mean * mean).max(1e-6)).min(1.0) as f32;
    for ((c, p), _) in coarse.iter_mut().zip(pooled.iter()).zip(far).filter(|(_, far)| **far) {
        *c = (p - mean as f32) * scale;
    }
}

/// The highest of 3 x 3 bins.
#[inline(always)]
fn highest(from: &[f32], to: &mut Vec<f32>) {
    to.clear();
    to.resize(from.len(), 0.0);
    for x in 0..COLUMNS {
        let column = |x: usize| &from[x * SIZE..][..SIZE];
        let (a, b, c) = (column(if x == 0 { 1 } else { x - 1 }), column(x), column((x + 1).min(COLUMNS - 1)));
        let out = &mut to[x * SIZE..][..SIZE];
        let mut across = [0.0f32; SIZE];
        for (((m, a), b), c) in across.iter_mut().zip(a).zip(b).zip(c) {
            *m = larger(larger(*a, *b), *c);
        }
        for y in 1..SIZE - 1 {
            out[y] = larger(larger(across[y - 1], across[y]), across[y + 1]);
        }
        out[0] = larger(across[0], across[1]);
        out[SIZE - 1] = larger(across[SIZE - 2], across[SIZE - 1]);
    }
}

/// The larger of two numbers, in one instruction: neither is NaN.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
