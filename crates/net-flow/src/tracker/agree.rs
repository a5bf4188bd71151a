//! Points matched, and what they agree on.

use nalgebra::Vector2;

use super::{FlowTracker, Outcome, Pictures};
use crate::block_match::{Guess, MatchState, Reach};
use crate::motion::Motion;
use crate::result::Status;

impl FlowTracker {
    /// Matches the points in `scratch` and finds what they agree on. Twice when the first motion shows that the points' search began too far off.
    pub(super) fn match_and_agree(&mut self, pictures: Pictures, guess: &Motion, reach: Reach) -> Outcome {
        let mut outcome = self.match_once(pictures, guess, reach);
        if pictures == Pictures::Step
            && let Some(fit) = outcome.fit
            && (fit.agreed as f64) < 0.8 * outcome.points as f64
        {
            let again = Reach { level: reach.level.min(1), radius: self.config.matching.fine_search_px };
            let second = self.match_once(pictures, &fit.motion, again);
            if second.fit.map_or(0, |f| f.agreed) >= fit.agreed {
                outcome = second;
            } else {
                // Its buffers are those of the second try.
                outcome = self.match_once(pictures, guess, reach);
            }
        }
        outcome
    }

    fn match_once(&mut self, pictures: Pictures, guess: &Motion, reach: Reach) -> Outcome {
        let s = &mut self.scratch;
        let (prev, start) = match pictures {
            Pictures::Step => (&self.prev, Guess::Motion(guess)),
            Pictures::Direct => (&self.key, Guess::PixelsAlong(&s.expected, guess)),
        };
        // Equal sizes and lengths by construction, so there is no error to lose; an empty list would be lost.
        if self.matcher.match_within(prev, &self.next, &s.points, start, reach, &mut s.matches).is_err() {
            s.matches.clear();
        }
        s.from.clear();
        s.to.clear();
        s.which.clear();
        for (i, m) in s.matches.iter().enumerate().filter(|(_, m)| m.state == MatchState::Found) {
            s.from.push(s.points[i]);
            s.to.push(m.pixel);
            s.which.push(i);
        }
        s.agreed.clear();
        s.agreed.resize(s.points.len(), false);
        let points = s.matches.iter().filter(|m| m.state != MatchState::Outside).count();
        let fit = self.consensus.fit(&s.from, &s.to, Some(guess));
        let (mut tried, mut held) = ([false; 12], [false; 12]);
        for (m, p) in s.matches.iter().zip(&s.points) {
            if m.state != MatchState::Outside {
                tried[block(*p, self.width, self.height)] = true;
            }
        }
        if fit.is_some() {
            for (&i, &agrees) in s.which.iter().zip(self.consensus.agrees()) {
                s.agreed[i] = agrees;
                held[block(s.points[i], self.width, self.height)] |= agrees;
            }
        }
        let count = |blocks: &[bool]| blocks.iter().filter(|&&b| b).count() as f64;
        let coverage = count(&held) / count(&tried).max(1.0);
        let enough = fit.is_some_and(|f| f.agreed as f64 >= self.config.min_agreed * points as f64)
            && coverage >= self.config.min_coverage;
        let status = if enough { Status::Tracked } else { Status::Lost };
        Outcome { status, fit, points, matched: s.which.len(), coverage }
    }
}

/// Which of 4 x 3 blocks of the picture.
fn block(p: Vector2<f64>, width: usize, height: usize) -> usize {
    let u = (p.x / width as f64 * 4.0) as usize;
    let v = (p.y / height as f64 * 3.0) as usize;
    v.min(2) * 4 + u.min(3)
}
