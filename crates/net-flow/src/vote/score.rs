//! How well each whole shift fits.

use net_image::widely;

use super::cell::dot;
use super::cells::{Cells, MIN_CELLS};

/// Blocks of the common cells, across and down: their median is deaf to a fish that covers two of them.
pub(super) const BLOCKS: (usize, usize) = (3, 2);
/// A block with fewer cells has no voice.
pub(super) const MIN_BLOCK: f32 = 4.0;
/// Bounds and weight of the two kinds of evidence: patches, and knots' brightness.
const MAX_PATCH_Z: f64 = 8.0;
const MAX_KNOT_Z: f64 = 4.0;
const KNOT_WEIGHT: f64 = 0.5;

/// Scores of all shifts. Owns its buffers.
#[derive(Debug)]
pub(super) struct Scores {
    reach: i32,
    patch: Vec<Option<f64>>,
    knot: Vec<Option<f64>>,
    /// Combined deviations of each shift; `None` where too few cells are common.
    z: Vec<Option<f64>>,
    sorted: Vec<f64>,
}

impl Scores {
    pub(super) fn new(reach: usize) -> Self {
        let n = (2 * reach + 1).pow(2);
        Self {
            reach: reach as i32,
            patch: Vec::with_capacity(n),
            knot: Vec::with_capacity(n),
            z: Vec::with_capacity(n),
            sorted: Vec::with_capacity(n),
        }
    }

    /// Deviations of each shift, row by row from `(-reach, -reach)`.
    pub(super) fn z(&self) -> &[Option<f64>] {
        &self.z
    }

    /// Compares `here`, moved by every shift, with `before`. Cells common at no shift.
    pub(super) fn compare(&mut self, before: &Cells, here: &Cells) -> usize {
        let compared = all(self, before, here);
        standardise(&mut self.patch, &mut self.sorted);
        standardise(&mut self.knot, &mut self.sorted);
        self.z.clear();
        let both = self.patch.iter().zip(&self.knot);
        self.z.extend(both.map(|(p, k)| {
            let sum = p.as_ref()?.min(MAX_PATCH_Z) + KNOT_WEIGHT * k.unwrap_or(0.0).min(MAX_KNOT_Z);
            Some(sum / (1.0 + KNOT_WEIGHT * KNOT_WEIGHT).sqrt())
        }));
        if self.z.iter().flatten().count() * 2 < self.z.len() { 0 } else { compared.max(1) }
    }
}

widely! {
    /// Compares at every shift. Cells common at none.
    fn all<'a>(scores: &'a mut Scores, before: &'a Cells, here: &'a Cells) -> usize {
        scores.patch.clear();
        scores.knot.clear();
        let mut compared = 0;
        for dj in -scores.reach..=scores.reach {
            for di in -scores.reach..=scores.reach {
                let (count, patch, knot) = one(before, here, (di, dj));
                if (di, dj) == (0, 0) {
                    compared = count;
                }
                scores.patch.push(patch);
                scores.knot.push(knot);
            }
        }
        compared
    }
}

/// Common cells, median over blocks of the mean correlation of patches, and correlation of the knots' brightness.
#[inline(always)]
fn one(before: &Cells, here: &Cells, shift: (i32, i32)) -> (usize, Option<f64>, Option<f64>) {
    let offset = |here: i32, shift: i32, before: i32| i64::from(here) + i64::from(shift) - i64::from(before);
    let offset = (offset(here.corner.0, shift.0, before.corner.0), offset(here.corner.1, shift.1, before.corner.1));
    let span = |offset: i64, a: usize, b: usize| (offset.max(0), (offset + b as i64).min(a as i64));
    let (i0, i1) = span(offset.0, before.columns, here.columns);
    let (j0, j1) = span(offset.1, before.rows, here.rows);
    if i1 - i0 < 2 || j1 - j0 < 2 {
        return (0, None, None);
    }
    let mut blocks = [(0.0f32, 0.0f32); BLOCKS.0 * BLOCKS.1];
    let (mut ab, mut aa, mut bb, mut count) = (0.0f64, 0.0f64, 0.0f64, 0usize);
    for j in j0..j1 {
        for i in i0..i1 {
            let a = j as usize * before.columns + i as usize;
            let b = (j - offset.1) as usize * here.columns + (i - offset.0) as usize;
            if !(before.valid[a] && here.valid[b]) {
                continue;
            }
            count += 1;
            let block = (j - j0) as usize * BLOCKS.1 / (j1 - j0) as usize * BLOCKS.0
                + (i - i0) as usize * BLOCKS.0 / (i1 - i0) as usize;
            blocks[block].0 += dot(&before.patches[a], &here.patches[b]);
            blocks[block].1 += 1.0;
            let (x, y) = (f64::from(before.knots[a]), f64::from(here.knots[b]));
            (ab, aa, bb) = (ab + x * y, aa + x * x, bb + y * y);
        }
    }
    if count < MIN_CELLS {
        return (count, None, None);
    }
    let mut means = [0.0f32; BLOCKS.0 * BLOCKS.1];
    let mut used = 0;
    for (sum, n) in blocks {
        if n >= MIN_BLOCK {
            means[used] = sum / n;
            used += 1;
        }
    }
    let means = &mut means[..used];
    means.sort_unstable_by(f32::total_cmp);
    let median = match used {
        0 => return (count, None, None),
        n if n % 2 == 1 => means[n / 2],
        n => 0.5 * (means[n / 2 - 1] + means[n / 2]),
    };
    (count, Some(f64::from(median)), Some(ab / (aa * bb).sqrt().max(1e-9)))
}

/// To deviations from the median over all shifts.
fn standardise(scores: &mut [Option<f64>], sorted: &mut Vec<f64>) {
    let centre = median(&mut scores.iter().flatten().copied(), sorted).unwrap_or(0.0);
    let spread = 1.4826 * median(&mut scores.iter().flatten().map(|s| (s - centre).abs()), sorted).unwrap_or(0.0);
    for score in scores.iter_mut().flatten() {
        *score = (*score - centre) / spread.max(1e-6);
    }
}

/// The middle one, the upper of two; `None` of nothing.
pub(super) fn median(values: &mut dyn Iterator<Item = f64>, sorted: &mut Vec<f64>) -> Option<f64> {
    sorted.clear();
    sorted.extend(values);
    let middle = sorted.len() / 2;
    (!sorted.is_empty()).then(|| *sorted.select_nth_unstable_by(middle, f64::total_cmp).1)
}
