//! Which cells: what does not repeat in the picture has the last word on the count.

use net_flow::vote::{CellMap, CellVote, RecallConfig, Verdict, VoteConfig, VoteResult};
use net_geometry::nalgebra::Vector2;
use net_image::GrayView;

use crate::error::Result;
use crate::estimate::Connection;

/// How the nodes of a frame got their names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Naming {
    /// Where they were predicted, within a fraction of a cell.
    Sure,
    /// The likeliest; may be off by whole cells.
    Guess,
    /// Nothing to go by.
    New,
}

/// Times that a count begun anew is looked up in the map of the one before, and frames between.
const LOOK_UPS: u32 = 8;
const LOOK_UP_EVERY: u32 = 4;

/// What the count says of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Counted {
    /// To be added to the names that it came with.
    pub cells: (i32, i32),
    pub connection: Connection,
    /// Whether the vote was certain.
    pub proven: bool,
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
        })
    }

    /// Number of the present count.
    pub fn track(&self) -> u32 {
        self.track
    }

    /// The next frame with a pose: the cell at its optical axis, how its nodes were named, and where they are.
    pub fn update(
        &mut self,
        image: GrayView<'_>,
        middle: (i32, i32),
        naming: Naming,
        pixel_from_lattice: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>,
    ) -> Counted {
        if naming == Naming::New {
            self.vote.reset();
        }
        let vote = self.vote.update(image, middle, pixel_from_lattice);
        let proven = vote.verdict == Verdict::Decided;
        let counted = Counted { proven, ..self.judge(&vote, middle, naming) };
        if proven || counted.connection != Connection::Followed {
            // Frames in doubt have no place in the map.
            self.vote.remember(&mut self.map);
        }
        self.middle = (middle.0.saturating_add(counted.cells.0), middle.1.saturating_add(counted.cells.1));
        counted
    }

    fn judge(&mut self, vote: &VoteResult, middle: (i32, i32), naming: Naming) -> Counted {
        let told = |cells, connection| Counted { cells, connection, proven: false };
        match (naming, vote.correction()) {
            (Naming::New, _) => self.find_or_restart(minus(self.middle, middle)),
            (Naming::Guess, None) => self.find_or_restart((0, 0)),
            // Sure enough without a vote; or the frames before this one were numbered right, or are not in doubt.
            (Naming::Sure, None) | (_, Some((0, 0))) => self.look_up(),
            (Naming::Guess, Some(cells)) if vote.frames == 1 && vote.dropped == 0 => told(cells, Connection::Followed),
            // Numbers were given that now prove wrong by whole cells: those go under the old count, these under a new one.
            (_, Some(cells)) => {
                self.restart((0, 0));
                told(cells, Connection::Restarted)
            }
        }
    }

    /// The net was lost: the map recognises the place, or the count begins anew. `around`: what is to be added to the names by the best guess.
    fn find_or_restart(&mut self, around: (i32, i32)) -> Counted {
        if let Some(place) = self.vote.recall(&mut self.map, around).filter(|r| r.recognised) {
            self.vote.renumber(place.cells);
            return Counted { cells: place.cells, connection: Connection::Recognised, proven: false };
        }
        if let Some(before) = self.before
            && let Some(counted) = self.go_back(before)
        {
            self.before = None;
            return counted;
        }
        let first = self.next == 0;
        self.restart(around);
        let connection = if first { Connection::Started } else { Connection::Restarted };
        Counted { cells: (0, 0), connection, proven: false }
    }

    fn restart(&mut self, around: (i32, i32)) {
        if self.next > 0 && self.map.cells() > 0 {
            std::mem::swap(&mut self.map, &mut self.map_before);
            self.before = Some(Before { track: self.track, around, age: 0 });
        }
        self.map.clear();
        self.track = self.next;
        self.next = self.next.saturating_add(1);
    }

    /// A young count may be the one before.
    fn look_up(&mut self) -> Counted {
        let mut counted = Counted { cells: (0, 0), connection: Connection::Followed, proven: false };
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
        Some(Counted { cells: place.cells, connection: Connection::Recognised, proven: false })
    }
}

fn minus(a: (i32, i32), b: (i32, i32)) -> (i32, i32) {
    (a.0.saturating_sub(b.0), a.1.saturating_sub(b.1))
}
