//! From the key frame directly, starting from the sum.

use super::{FlowTracker, Hints, Outcome, Pictures};
use crate::block_match::Reach;
use crate::result::Status;
use crate::rivals::{Candidates, Expectation, Lattice};
use crate::tracks::TrackState;

impl FlowTracker {
    /// From the key frame directly, starting from the sum.
    pub(super) fn direct(&mut self, hints: &Hints<'_>) -> Outcome {
        self.scratch.points.clear();
        self.scratch.expected.clear();
        for track in &self.tracks.list {
            let Some(key) = track.key_pixel else { continue };
            self.scratch.points.push(key);
            self.scratch.expected.push(track.pixel);
        }
        let reach = Reach { level: 0, radius: self.config.direct_search_px };
        let guess = self.from_key;
        let mut outcome = self.match_and_agree(Pictures::Direct, &guess, reach);
        let Some(fit) = outcome.fit.filter(|_| outcome.status != Status::Lost) else { return outcome };
        let expectation = Expectation::default();
        if let Some(lattice) = self.lattice_of_key(hints) {
            self.compare(Pictures::Direct, &fit.motion, Candidates::Lattice(&lattice), &expectation);
        } else if self.unsettled {
            let peaks = self.rival_peaks(Pictures::Direct, &fit.motion, self.config.matching.search_px);
            self.compare(Pictures::Direct, &fit.motion, Candidates::Peaks(&peaks), &expectation);
        }
        outcome = self.judge(outcome, Pictures::Direct);
        // Only rivals that were named and beaten settle anything.
        let settled = outcome.status == Status::Tracked && !self.direct_rivals.list().is_empty();
        self.unsettled &= !settled;
        if self.unsettled {
            outcome.status = Status::Ambiguous;
        }
        let worst = self.direct_rivals.list().first().map_or(f64::INFINITY, |r| r.log_odds);
        if worst < -self.config.min_log_odds {
            // The key frame says that the sum has slipped: believe neither.
            outcome.status = Status::Ambiguous;
            self.unsettled = true;
            return outcome;
        }
        self.from_key = fit.motion;
        let mut k = 0;
        for track in &mut self.tracks.list {
            let Some(key) = track.key_pixel else { continue };
            if self.scratch.agreed[k] {
                track.pixel = self.scratch.matches[k].pixel;
                track.score = self.scratch.matches[k].score;
                (track.state, track.carried) = (TrackState::Seen, 0);
            } else {
                // The sum would drift where the key frame is not seen.
                track.pixel = fit.motion.apply(key);
            }
            k += 1;
        }
        outcome
    }

    /// The lattice in the key frame, from the one in the frame before: on to this frame by the last step, back by the motion since.
    fn lattice_of_key(&self, hints: &Hints<'_>) -> Option<Lattice> {
        let key_from_prev = self.velocity.then(&self.from_key.inverse()?)?;
        hints.lattice.map(|lattice| lattice.carried(&key_from_prev, self.width, self.height))
    }
}
