//! The winner against its rivals.

use nalgebra::Vector2;

use super::{FlowTracker, Outcome, Pictures};
use crate::block_match::Reach;
use crate::motion::Motion;
use crate::result::Status;
use crate::rivals::{Candidates, Evidence, Expectation, MAX_RIVALS, Rival};
use crate::surface::SurfacePeak;

/// A secondary peak below this share of the highest is no rival.
const RIVAL_PEAK_SHARE: f32 = 0.4;
/// Peaks nearer than this are one, px of their level.
const MAIN_LOBE_PX: f64 = 1.5;

/// Rivals found on the surfaces.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct RivalPeaks {
    peaks: [SurfacePeak; MAX_RIVALS],
    count: usize,
}

impl RivalPeaks {
    /// Adds a peak that is neither the winner's own nor, within `lobe_px`, one that is there already.
    fn add(&mut self, peak: SurfacePeak, lobe_px: f64) {
        let apart = |shift: Vector2<f64>| (peak.shift - shift).norm() > lobe_px;
        if self.count < MAX_RIVALS && apart(Vector2::zeros()) && self.iter().all(|p| apart(p.shift)) {
            self.peaks[self.count] = peak;
            self.count += 1;
        }
    }
}

impl std::ops::Deref for RivalPeaks {
    type Target = [SurfacePeak];
    fn deref(&self) -> &[SurfacePeak] {
        &self.peaks[..self.count]
    }
}

impl FlowTracker {
    /// Tests `winner` against rivals.
    pub(super) fn compare(
        &mut self,
        pictures: Pictures,
        winner: &Motion,
        candidates: Candidates<'_>,
        expectation: &Expectation,
    ) {
        let s = &self.scratch;
        let evidence = Evidence {
            from: &s.from,
            to: &s.to,
            agrees: self.consensus.agrees(),
            threshold_px: self.config.consensus.threshold_px,
            most: self.config.vote_points,
        };
        let (earlier, rivals) = match pictures {
            Pictures::Step => (&self.prev, &mut self.step_rivals),
            Pictures::Direct => (&self.key, &mut self.direct_rivals),
        };
        rivals.compare(&mut self.matcher, earlier, &self.next, winner, &evidence, candidates, expectation);
    }

    /// Other peaks of the summed surfaces round `winner`, of all levels: each shows cells of its own size.
    pub(super) fn rival_peaks(&mut self, pictures: Pictures, winner: &Motion, search_px: f64) -> RivalPeaks {
        let mut found = RivalPeaks::default();
        let earlier = match pictures {
            Pictures::Step => &self.prev,
            Pictures::Direct => &self.key,
        };
        let top = self.config.matching.full_reach(self.next.len());
        for level in 0..=top.level {
            let scale = f64::from(1u32 << level);
            let radius = ((search_px / scale).ceil() as usize + 1).clamp(2, top.radius.max(12));
            let reach = Reach { level, radius };
            let (points, most) = (&self.scratch.points, self.config.vote_points.div_ceil(2));
            if !self.surface.sum(&mut self.matcher, earlier, &self.next, points, most, winner, reach) {
                continue;
            }
            let peaks = self.surface.peaks();
            let highest = peaks.first().map_or(0.0, |p| p.score);
            for peak in peaks.iter().filter(|p| p.score >= RIVAL_PEAK_SHARE * highest) {
                found.add(*peak, MAIN_LOBE_PX * scale);
            }
        }
        found
    }

    /// Tracked, or ambiguous where a rival is not ruled out.
    pub(super) fn judge(&self, mut outcome: Outcome, pictures: Pictures) -> Outcome {
        let rivals = if pictures == Pictures::Step { &self.step_rivals } else { &self.direct_rivals };
        let agreed = outcome.fit.map_or(0, |f| f.agreed);
        let alive =
            |r: &Rival| r.log_odds < self.config.min_log_odds || (r.log_odds.is_finite() && 2 * r.support > agreed);
        if rivals.list().iter().any(alive) {
            outcome.status = Status::Ambiguous;
        }
        outcome
    }
}
