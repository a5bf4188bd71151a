//! Stage 2c: which shifts of the whole picture fit, summed over points.
//!
//! One point of a net fits the next picture equally well at every knot. The mean of many points' correlation surfaces has its highest peak where
//! also what does *not* repeat fits (jitter of the twine, growth, broken meshes), and its other peaks are the rivals one must know of.

use nalgebra::Vector2;
use net_image::Pyramid;

use crate::block_match::{Matcher, Reach};
use crate::motion::Motion;
use crate::zncc::quadratic_peak;

/// Most peaks kept.
const MAX_PEAKS: usize = 9;

/// A peak of the mean surface.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct SurfacePeak {
    /// Shift on top of the expected motion, px of the full picture.
    pub shift: Vector2<f64>,
    /// Mean normalised correlation there.
    pub score: f32,
}

/// The mean surface. Owns its buffers.
#[derive(Debug, Clone, Default)]
pub(crate) struct Surface {
    mean: Vec<f32>,
    sorted: Vec<f32>,
    peaks: Vec<SurfacePeak>,
    /// Radius of the surface, px of its level.
    radius: usize,
}

impl Surface {
    /// Sums the surfaces of up to `most` of `points` (spread evenly over the list). False if no point shows anything.
    pub(crate) fn sum(
        &mut self,
        matcher: &mut Matcher,
        prev: &Pyramid,
        next: &Pyramid,
        points: &[Vector2<f64>],
        most: usize,
        expected: &Motion,
        reach: Reach,
    ) -> bool {
        let side = 2 * reach.radius + 1;
        self.radius = reach.radius;
        self.mean.clear();
        self.mean.resize(side * side, 0.0);
        self.peaks.clear();
        let mut used = 0usize;
        for point in spread(points.len(), most).map(|i| points[i]) {
            if let Some(scores) = matcher.surface(prev, next, point, expected, reach) {
                self.mean.iter_mut().zip(scores).for_each(|(sum, &s)| *sum += s);
                used += 1;
            }
        }
        if used == 0 {
            return false;
        }
        self.mean.iter_mut().for_each(|s| *s /= used as f32);
        self.find_peaks(f64::from(1u32 << reach.level));
        !self.peaks.is_empty()
    }

    /// Peaks, highest first; those inside the search's border.
    pub(crate) fn peaks(&self) -> &[SurfacePeak] {
        &self.peaks
    }

    /// How far the highest peak stands above the surface's median, in its median absolute deviations (scaled to a standard deviation).
    pub(crate) fn prominence(&mut self) -> f64 {
        let Some(best) = self.peaks.first() else { return 0.0 };
        let middle = self.mean.len() / 2;
        self.sorted.clear();
        self.sorted.extend_from_slice(&self.mean);
        let median = *self.sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
        self.sorted.iter_mut().for_each(|s| *s = (*s - median).abs());
        let mad = 1.4826 * *self.sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
        f64::from((best.score - median) / mad.max(1e-6))
    }

    /// Local maxima of the surface.
    fn find_peaks(&mut self, scale: f64) {
        let side = 2 * self.radius + 1;
        for v in 1..side.saturating_sub(1) {
            for u in 1..side - 1 {
                let at =
                    |du: isize, dv: isize| self.mean[(v as isize + dv) as usize * side + (u as isize + du) as usize];
                let s = at(0, 0);
                // Ties go to the first in reading order.
                let before = [(-1, -1), (0, -1), (1, -1), (-1, 0)].iter().all(|&(du, dv)| s > at(du, dv));
                let after = [(1, 0), (-1, 1), (0, 1), (1, 1)].iter().all(|&(du, dv)| s >= at(du, dv));
                if !(before && after) {
                    continue;
                }
                let (offset, gain) = quadratic_peak(at);
                let whole = Vector2::new(u as f64 - self.radius as f64, v as f64 - self.radius as f64);
                let peak = SurfacePeak { shift: (whole + offset) * scale, score: s + gain };
                let place = self.peaks.partition_point(|p| p.score >= peak.score);
                if place < MAX_PEAKS {
                    self.peaks.truncate(MAX_PEAKS - 1);
                    self.peaks.insert(place, peak);
                }
            }
        }
    }
}

/// At most `most` indices of `0..n`, evenly spread.
pub(crate) fn spread(n: usize, most: usize) -> impl Iterator<Item = usize> {
    let count = n.min(most);
    (0..count).map(move |k| k * n / count)
}
