//! Which cells: what does not repeat in the picture has the last word on the count.

use net_flow::Pyramid;
use net_flow::vote::{CellMap, CellVote, RecallConfig, Verdict, VoteConfig, VoteResult};
use net_geometry::nalgebra::Vector2;

use crate::error::Result;
use crate::estimate::Connection;

/// How the nodes of a frame got their names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Naming {
    /// Where they were predicted, within a fraction of a cell.
    Sure,
    /// Where they were predicted by a velocity that is itself a guess: if it is off by some cells a frame, then by the same ones in every frame.
    Carried,
    /// The likeliest of this frame by itself; may be off by whole cells.
    Guess,
    /// Nothing to go by.
    New,
}

/// Times that a count begun anew is looked up in the map of the one before, and frames between.
const LOOK_UPS: u32 = 8;
const LOOK_UP_EVERY: u32 = 4;

/// Deviations by which one look of the vote refutes names that a velocity gave. Below, one of the two is wrong: a count begins anew with the names as they are, and the next look tells. Of
/// fourteen thousand simulated frames two looks were sure of a wrong shift, by 5.1 and 6.4.
const REFUTING_Z: f64 = 8.0;

/// What the count says of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Counted {
    /// To be added to the names that it came with.
    pub cells: (i32, i32),
    /// To be added to those of the frame before, for a velocity that is right.
    pub cells_before: (i32, i32),
    pub connection: Connection,
    /// Which frame of a doubt this is, from 1; 0 without.
    pub in_doubt: u32,
    /// Whether the vote was certain.
    pub proven: bool,
    /// What it said, of the names that the frame came with.
    pub vote: Option<VoteResult>,
}

/// The map of the count before, for a place that may be recognised.
#[derive(Debug, Clone, Copy)]
struct Before {
    track: u32,
    /// Cells to be added to the present names where the search begins.
    around: (i32, i32),
    /// Frames since.
    age: u32,
}

/// Frames in doubt: named by guess, each under a number of its own. The map stays that of the count before the doubt.
#[derive(Debug, Clone, Copy)]
struct Doubt {
    /// The count before.
    home: u32,
    frames: u32,
}

/// Counts cells from frame to frame, and recognises places.
#[derive(Debug)]
pub(super) struct CellCount {
    vote: CellVote,
    track: u32,
    /// Number of the next count.
    next: u32,
    /// Cell at the optical axis in the last frame.
    middle: (i32, i32),
    map: CellMap,
    map_before: CellMap,
    before: Option<Before>,
    doubt: Option<Doubt>,
}

impl CellCount {
    pub fn new() -> Result<Self> {
        let map = || CellMap::new(&RecallConfig::default());
        Ok(Self {
            vote: CellVote::new(&VoteConfig::default())?,
            track: 0,
            next: 0,
            middle: (0, 0),
            map: map()?,
            map_before: map()?,
            before: None,
            doubt: None,
        })
    }

    /// Number of the present count.
    pub fn track(&self) -> u32 {
        self.track
    }

    /// The next frame whose lattice is known, flattened: the cell at its optical axis, how its nodes were named, whether the lattice was known in the frame before as well, and where the nodes are.
    pub fn update(
        &mut self,
        picture: &Pyramid,
        middle: (i32, i32),
        naming: Naming,
        gapless: bool,
        pixel_from_lattice: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>,
    ) -> Counted {
        match naming {
            Naming::New => self.vote.reset(),
            // What is off by some cells once adds nothing to what was off by some in every frame.
            Naming::Guess => self.vote.drop_doubt(),
            Naming::Sure | Naming::Carried => {}
        }
        let vote = self.vote.update_flat(picture, middle, pixel_from_lattice);
        let refuted = weakly_refuted(&vote, naming);
        let mut counted = if let Some(other) = refuted {
            self.begin_as_named(other)
        } else {
            Counted { proven: vote.verdict == Verdict::Decided, ..self.judge(&vote, middle, naming, gapless) }
        };
        counted.vote = matches!(vote.verdict, Verdict::Decided | Verdict::Ambiguous).then_some(vote);
        // Frames in doubt have no place in the map, nor has one of which the vote and a velocity say different things.
        let certain = self.doubt.is_none() && refuted.is_none();
        if certain && (counted.proven || counted.connection != Connection::Followed) {
            self.vote.remember(&mut self.map);
        }
        self.middle = plus(middle, counted.cells);
        counted
    }

    fn judge(&mut self, vote: &VoteResult, middle: (i32, i32), naming: Naming, gapless: bool) -> Counted {
        let doubt = self.doubt.take();
        let doubt = doubt.filter(|d| {
            let undecided = vote.verdict == Verdict::Ambiguous;
            let goes_on =
                naming == Naming::Carried && if vote.dropped == 0 { vote.frames == d.frames + 1 } else { undecided };
            if !goes_on {
                // The last frame in doubt is where the count goes on from.
                self.put_aside(d.home, (0, 0));
            }
            goes_on
        });
        let step = vote.shifts[0].cells;
        let frames_before = i32::try_from(vote.frames).unwrap_or(i32::MAX).saturating_sub(1);
        let cells_before = (step.0.saturating_mul(frames_before), step.1.saturating_mul(frames_before));
        if let (Some(doubt), Some(cells)) = (doubt, vote.correction()) {
            // All frames in doubt are explained by one velocity that was wrong, or right: the count before goes on.
            self.track = doubt.home;
            return Counted { cells_before, in_doubt: vote.frames, ..told(cells, Connection::Settled) };
        }
        match (naming, vote.correction()) {
            (Naming::New, _) => self.find_or_restart(minus(self.middle, middle)),
            (Naming::Guess | Naming::Carried, None) => self.find_or_doubt(vote, doubt, gapless),
            // Sure enough without a vote; or the frames before this one were numbered right, or are not in doubt.
            (Naming::Sure, None) | (_, Some((0, 0))) => self.look_up(),
            (Naming::Guess, Some(cells)) if vote.frames == 1 && vote.dropped == 0 => told(cells, Connection::Followed),
            // Numbers were given that now prove wrong by whole cells: those go under the old count, these under a new one.
            (_, Some(cells)) => {
                self.restart((0, 0));
                Counted { cells_before, ..told(cells, Connection::Restarted) }
            }
        }
    }

    /// Either the names or the vote that gives `other` ones are wrong: a new count with the names as they are, and nothing is proven.
    fn begin_as_named(&mut self, other: (i32, i32)) -> Counted {
        if let Some(doubt) = self.doubt.take() {
            self.put_aside(doubt.home, (0, 0));
        }
        self.vote.renumber(minus((0, 0), other));
        self.restart((0, 0));
        told((0, 0), Connection::Restarted)
    }

    /// Names are a guess, and the vote is in doubt: the map recognises the place, or more frames have to tell.
    fn find_or_doubt(&mut self, vote: &VoteResult, doubt: Option<Doubt>, gapless: bool) -> Counted {
        if let Some(counted) = self.find((0, 0)) {
            self.track = doubt.map_or(self.track, |d| d.home);
            return counted;
        }
        let home = doubt.map_or(self.track, |d| d.home);
        let frames = doubt.map_or(0, |d| d.frames) + 1;
        if !gapless {
            // What a velocity is off by adds up over a gap: more than in each of the frames after it, whose evidence would not tell.
            self.vote.drop_doubt();
        } else if vote.verdict == Verdict::Ambiguous && vote.dropped == 0 && vote.frames == frames {
            self.doubt = Some(Doubt { home, frames });
            self.begin();
            return Counted { in_doubt: frames, ..told((0, 0), Connection::Doubted) };
        }
        if doubt.is_some() {
            // It outlasts the vote's memory: how these frames go on from those before it will not be known, unless the map recognises the place.
            self.doubt = doubt;
        } else {
            self.put_aside(home, (0, 0));
        }
        self.begin();
        told((0, 0), Connection::Restarted)
    }

    /// The net was lost: the map recognises the place, or the count begins anew. `around`: what is to be added to the names by the best guess.
    fn find_or_restart(&mut self, around: (i32, i32)) -> Counted {
        if let Some(counted) = self.find(around) {
            return counted;
        }
        let first = self.next == 0;
        self.restart(around);
        told((0, 0), if first { Connection::Started } else { Connection::Restarted })
    }

    /// The place in the map, or in that of the count before.
    fn find(&mut self, around: (i32, i32)) -> Option<Counted> {
        if let Some(place) = self.vote.recall(&mut self.map, around).filter(|r| r.recognised) {
            self.vote.renumber(place.cells);
            return Some(told(place.cells, Connection::Recognised));
        }
        let before = self.before?;
        let counted = self.go_back(before)?;
        self.before = None;
        Some(counted)
    }

    fn restart(&mut self, around: (i32, i32)) {
        self.put_aside(self.track, around);
        self.begin();
    }

    /// A new number.
    fn begin(&mut self) {
        self.track = self.next;
        self.next = self.next.saturating_add(1);
    }

    /// The map is that of an earlier count from now on.
    fn put_aside(&mut self, track: u32, around: (i32, i32)) {
        if self.next > 0 && self.map.cells() > 0 {
            std::mem::swap(&mut self.map, &mut self.map_before);
            self.before = Some(Before { track, around, age: 0 });
        }
        self.map.clear();
    }

    /// A young count may be the one before.
    fn look_up(&mut self) -> Counted {
        let mut counted = told((0, 0), Connection::Followed);
        let Some(mut before) = self.before.take() else { return counted };
        before.age += 1;
        if before.age.is_multiple_of(LOOK_UP_EVERY)
            && let Some(found) = self.go_back(before)
        {
            counted = found;
        } else if before.age < LOOK_UPS * LOOK_UP_EVERY {
            self.before = Some(before);
        }
        counted
    }

    /// To the count before, if its map recognises the place.
    fn go_back(&mut self, before: Before) -> Option<Counted> {
        let place = self.vote.recall(&mut self.map_before, before.around).filter(|r| r.recognised)?;
        self.vote.renumber(place.cells);
        std::mem::swap(&mut self.map, &mut self.map_before);
        self.track = before.track;
        Some(told(place.cells, Connection::Recognised))
    }
}

/// The other names that one look gives to what a velocity has named, if it is sure of them and no more than that.
fn weakly_refuted(vote: &VoteResult, naming: Naming) -> Option<(i32, i32)> {
    let weak = vote.frames == 1 && vote.shifts[0].z < REFUTING_Z;
    let other = vote.correction().filter(|cells| *cells != (0, 0));
    other.filter(|_| weak && matches!(naming, Naming::Sure | Naming::Carried))
}

fn told(cells: (i32, i32), connection: Connection) -> Counted {
    Counted { cells, cells_before: (0, 0), connection, in_doubt: 0, proven: false, vote: None }
}

fn plus(a: (i32, i32), b: (i32, i32)) -> (i32, i32) {
    (a.0.saturating_add(b.0), a.1.saturating_add(b.1))
}

fn minus(a: (i32, i32), b: (i32, i32)) -> (i32, i32) {
    (a.0.saturating_sub(b.0), a.1.saturating_sub(b.1))
}

#[cfg(test)]
mod tests {
    use net_flow::vote::ShiftScore;

    use super::*;

    #[test]
    fn one_weak_look_does_not_rename_what_a_velocity_named() {
        let vote = |z: f64, frames: u32, cells: (i32, i32)| VoteResult {
            verdict: Verdict::Decided,
            frames,
            dropped: 0,
            shifts: [ShiftScore { cells, z }; net_flow::vote::LISTED],
            log_odds: 0.0,
            compared: 200,
        };
        // Looks that were sure of a wrong shift had 6.4 and 5.1 deviations.
        let weak = vote(6.4, 1, (0, -1));
        assert_eq!(weakly_refuted(&weak, Naming::Sure), Some((0, -1)));
        assert_eq!(weakly_refuted(&weak, Naming::Carried), Some((0, -1)));
        assert_eq!(weakly_refuted(&weak, Naming::Guess), None, "a guess may be renamed");
        assert_eq!(weakly_refuted(&vote(8.5, 1, (0, -1)), Naming::Sure), None, "a strong look");
        assert_eq!(weakly_refuted(&vote(6.4, 3, (0, -1)), Naming::Carried), None, "three looks");
        assert_eq!(weakly_refuted(&vote(6.4, 1, (0, 0)), Naming::Sure), None, "confirmed");
        let undecided = VoteResult { verdict: Verdict::Ambiguous, ..weak };
        assert_eq!(weakly_refuted(&undecided, Naming::Sure), None);
    }
}
