//! From the frame before to the coming one.

use super::{FlowTracker, Hints, Outcome, Pictures};
use crate::block_match::Reach;
use crate::motion::Motion;
use crate::result::Status;
use crate::rivals::{Candidates, Expectation};

/// Standard deviations that a prior may be off.
const PRIOR_REACH: f64 = 4.0;
/// Times that a rival may take the winner's place before it is left at that.
const MAX_SWITCHES: usize = 3;
/// A summed surface is believed when its peak is this high, or stands out this far.
const SURFACE_SCORE: f32 = 0.35;
const SURFACE_PROMINENCE: f64 = 6.0;

impl FlowTracker {
    /// From the frame before to the coming one.
    pub(super) fn step(&mut self, hints: &Hints<'_>) -> Outcome {
        let expectation =
            Expectation { prior: hints.prior.map(|p| (p.motion, p.sigma_px)), max_step_px: self.config.max_step_px };
        self.scratch.points.clear();
        self.scratch.points.extend(self.tracks.list.iter().map(|t| t.pixel));
        let predicted = hints.prior.map_or(self.velocity, |p| p.motion);
        let search =
            self.config.matching.search_px.min(hints.prior.map_or(f64::INFINITY, |p| PRIOR_REACH * p.sigma_px + 1.0));
        let (mut guess, reach) = self.common_shift(&predicted, search);
        let mut switches = 0;
        loop {
            let outcome = self.match_and_agree(Pictures::Step, &guess, reach);
            let Some(fit) = outcome.fit.filter(|_| outcome.status != Status::Lost) else { return outcome };
            let mut known = false;
            if let Some(lattice) = &hints.lattice {
                self.compare(Pictures::Step, &fit.motion, Candidates::Lattice(lattice), &expectation);
                // A lattice that makes no sense has no neighbours to name.
                known = !self.step_rivals.list().is_empty();
            }
            if !known {
                let peaks = self.rival_peaks(Pictures::Step, &fit.motion, search);
                self.compare(Pictures::Step, &fit.motion, Candidates::Peaks(&peaks), &expectation);
            }
            if let Some(worst) = self.step_rivals.list().first()
                && worst.log_odds < -1.0
                && switches < MAX_SWITCHES
            {
                switches += 1;
                guess = fit.motion.shifted(worst.shift_px);
                continue;
            }
            return self.judge(outcome, Pictures::Step);
        }
    }

    /// Where the whole picture went, as far as the summed surface tells: the start of the points' own search, and how far that goes.
    fn common_shift(&mut self, predicted: &Motion, search_px: f64) -> (Motion, Reach) {
        let fine = self.config.matching.fine_search_px;
        if search_px <= fine as f64 + 1.0 {
            return (*predicted, Reach { level: 0, radius: fine + 1 });
        }
        let top = self.config.matching.full_reach(self.next.len());
        for level in (0..=top.level).rev() {
            let scale = f64::from(1u32 << level);
            let radius = ((search_px / scale).ceil() as usize + 1).min(top.radius.max(12));
            let reach = Reach { level, radius };
            let most = self.config.vote_points;
            let points = &self.scratch.points;
            if !self.surface.sum(&mut self.matcher, &self.prev, &self.next, points, most, predicted, reach) {
                continue;
            }
            let Some(&best) = self.surface.peaks().first() else { continue };
            if best.score >= SURFACE_SCORE || self.surface.prominence() >= SURFACE_PROMINENCE {
                return (predicted.shifted(best.shift), Reach { level, radius: 3 });
            }
        }
        (*predicted, self.config.matching.full_reach(self.next.len()))
    }
}
