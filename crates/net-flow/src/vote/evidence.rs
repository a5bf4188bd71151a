//! Evidence added up until it suffices.

use super::{LISTED, ShiftScore, Verdict, VoteConfig, VoteResult};

/// What a frame says of a shift for which it had too few common cells, deviations: against it.
const UNSEEN: f64 = -3.0;

/// How many times as far as a second that is beyond chance itself the best shift of several frames must stand out. Chance does not add up over frames: then something in the pictures repeats
/// with other steps than the net's, as another net behind does, and the best may be one of its.
const REPEATING_RATIO: f64 = 1.75;

/// Sums over undecided frames. Owns its buffers.
#[derive(Debug)]
pub(super) struct Evidence {
    reach: i32,
    min_z: f64,
    min_ratio: f64,
    memory: usize,
    /// Undecided frames that no longer fit the memory.
    dropped: u32,
    /// Deviations of the undecided frames, oldest first, `shifts` numbers each.
    frames: Vec<f64>,
    shifts: usize,
}

impl Evidence {
    pub(super) fn new(config: &VoteConfig) -> Self {
        let shifts = (2 * config.reach_cells + 1).pow(2);
        Self {
            reach: config.reach_cells as i32,
            min_z: config.min_z,
            min_ratio: config.min_ratio,
            memory: config.memory_frames,
            dropped: 0,
            frames: Vec::with_capacity(shifts * (config.memory_frames + 1)),
            shifts,
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    pub(super) fn clear(&mut self) {
        self.frames.clear();
        self.dropped = 0;
    }

    /// Adds a frame's deviations and judges all that are undecided.
    pub(super) fn add(&mut self, z: &[Option<f64>], compared: usize) -> VoteResult {
        if self.frames.len() == self.memory * self.shifts {
            // The oldest stays undecided for good.
            self.frames.drain(..self.shifts);
            self.dropped = self.dropped.saturating_add(1);
        }
        self.frames.extend(z.iter().map(|z| z.unwrap_or(UNSEEN)));
        let count = self.frames.len() / self.shifts;
        let mut best = [ShiftScore { cells: (0, 0), z: f64::NEG_INFINITY }; LISTED];
        let side = 2 * self.reach + 1;
        for k in 0..self.shifts {
            let sum: f64 = self.frames.iter().skip(k).step_by(self.shifts).sum();
            let cells = (k as i32 % side - self.reach, k as i32 / side - self.reach);
            let score = ShiftScore { cells, z: sum / (count as f64).sqrt() };
            let place = best.partition_point(|b| b.z >= score.z);
            if place < LISTED {
                best[place..].rotate_right(1);
                best[place] = score;
            }
        }
        let (first, second) = (best[0].z, best[1].z);
        let repeats = count > 1 && second > self.min_z;
        let ratio = if repeats { self.min_ratio.max(REPEATING_RATIO) } else { self.min_ratio };
        let decided = first > self.min_z && first > ratio * second;
        VoteResult {
            verdict: if decided { Verdict::Decided } else { Verdict::Ambiguous },
            frames: count as u32,
            dropped: self.dropped,
            shifts: best,
            log_odds: (first.max(0.0).powi(2) - second.max(0.0).powi(2)) / 2.0,
            compared,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deviations of a look: `best` for no shift, `second` for one, nothing for the others.
    fn look(shifts: usize, best: f64, second: f64) -> Vec<Option<f64>> {
        let mut z = vec![Some(0.0); shifts];
        (z[shifts / 2], z[shifts / 2 + 1]) = (Some(best), Some(second));
        z
    }

    #[test]
    fn what_repeats_with_other_steps_must_be_outdone_by_more() {
        let config = VoteConfig::default();
        let after = |best: f64, second: f64, looks: usize| {
            let mut evidence = Evidence::new(&config);
            let z = look(evidence.shifts, best, second);
            (0..looks).map(|_| evidence.add(&z, 200)).last().expect("a look at least").verdict
        };
        // A second as high as chance makes it.
        assert_eq!(after(5.2, 3.3, 1), Verdict::Decided);
        // Seven looks at a net with another behind it, whose aliases grow along: 11.3 to 7.4, and the best was one of them.
        let (best, second) = (11.3 / 7f64.sqrt(), 7.37 / 7f64.sqrt());
        assert_eq!(after(best, second, 1), Verdict::Ambiguous);
        assert_eq!(after(best, second, 7), Verdict::Ambiguous);
        assert_eq!(after(best, 0.45 * best, 7), Verdict::Decided);
    }
}
