//! The vote: by how many whole cells has the net moved, judged by what does *not* repeat.
//!
//! The picture is laid out cell by cell in lattice coordinates, the lattice itself is subtracted, that of a second net cut down, and what is left (bow and jitter of the twine, growth,
//! broken meshes) is compared with the frame before, moved by every whole shift in reach. The right shift stands out from the others by many of their deviations.
//! Where it does not, evidence is added up over frames, since a velocity that is wrong by a cell a frame is wrong by the same cell every time; until it
//! suffices the answer is *ambiguous*, with the rivals.
//!
//! A frame in which too few cells can be laid out is *blind*; the next one is compared with the last that was not. A [`CellMap`] keeps what was seen of each cell, to
//! recognise a place when the net was lost on the way.

mod cell;
mod cells;
mod evidence;
mod recall;
mod sample;
mod score;
mod second_lattice;

use nalgebra::Vector2;
use net_image::{GrayView, Pyramid};
use serde::{Deserialize, Serialize};

use crate::block_match::SMALLEST_SIDE_PX;
use crate::error::{Result, in_range};
use crate::flatten::Flatten;
use cells::{Cells, Layout};
use evidence::Evidence;
pub use recall::{CellMap, Recall, RecallConfig};
use score::Scores;

/// Levels of the pyramid of a picture: cells of some 100 px still have about a sample a pixel.
pub(crate) const LEVELS: usize = 4;
/// Radius over which the light's slow changes are taken away, px.
const FLATTEN_PX: usize = 20;

/// Parameters of the vote.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VoteConfig {
    /// Cells compared on either side of the middle along the first lattice direction, 3 to 32. Default 9.
    pub half_columns: usize,
    /// The same along the second, 3 to 32. Default 6.
    pub half_rows: usize,
    /// Largest shift tried, cells either way, 1 to 8. Default 4.
    pub reach_cells: usize,
    /// Combined deviations by which the best shift must stand out, 3 to 100. Default 5.
    pub min_z: f64,
    /// And so many times as far as the second, 1 to 10; over several frames 1.75 times at least where the second stands out by `min_z` as well. Default 1.5.
    pub min_ratio: f64,
    /// Undecided frames whose evidence is added up, 1 to 32. Default 16: more than a fish takes to pass.
    pub memory_frames: usize,
}

impl Default for VoteConfig {
    fn default() -> Self {
        Self { half_columns: 9, half_rows: 6, reach_cells: 4, min_z: 5.0, min_ratio: 1.5, memory_frames: 16 }
    }
}

impl VoteConfig {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`crate::Error::Value`] names the field and the value.
    pub fn validate(&self) -> Result<()> {
        in_range("half_columns", self.half_columns as f64, 3.0, 32.0, "3 to 32 cells")?;
        in_range("half_rows", self.half_rows as f64, 3.0, 32.0, "3 to 32 cells")?;
        in_range("reach_cells", self.reach_cells as f64, 1.0, 8.0, "1 to 8 cells")?;
        in_range("min_z", self.min_z, 3.0, 100.0, "3 to 100")?;
        in_range("min_ratio", self.min_ratio, 1.0, 10.0, "1 to 10")?;
        in_range("memory_frames", self.memory_frames as f64, 1.0, 32.0, "1 to 32")
    }
}

/// What the vote says of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing to compare with: the first frame, none in common with the one before, or too long ago.
    Started,
    /// The shift is certain.
    Decided,
    /// It is not: keep the prediction, and say so.
    Ambiguous,
    /// Too few cells can be laid out in this frame: it says nothing, and the next is compared with an earlier one.
    Blind,
}

/// One shift and how far it stands out.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ShiftScore {
    /// Cells to add to this frame's lattice coordinates to agree with the frame before.
    pub cells: (i32, i32),
    /// Deviations above the median shift, evidence of undecided frames added up.
    pub z: f64,
}

/// Number of shifts that a result lists.
pub const LISTED: usize = 4;

/// What the vote says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoteResult {
    /// How certain it is.
    pub verdict: Verdict,
    /// Frames in a row whose evidence is in this verdict, this one included. When decided for a shift k with m frames: each of them was off by k more than the
    /// one before, so this one's coordinates are to be moved by m k, the one before's by (m - 1) k, and so on.
    pub frames: u32,
    /// Undecided frames before those, too old for the memory. Unless it is zero the count of cells is broken: how this frame's numbers go on from those
    /// before the doubt is not known, whatever the verdict, and the caller has to say so.
    pub dropped: u32,
    /// The likeliest shifts *per frame*, best first.
    pub shifts: [ShiftScore; LISTED],
    /// Natural logarithm of the odds of the best shift to the second.
    pub log_odds: f64,
    /// Cells that were compared at no shift.
    pub compared: usize,
}

impl VoteResult {
    fn without_scores(verdict: Verdict) -> Self {
        Self { verdict, frames: 0, dropped: 0, shifts: [ShiftScore::default(); LISTED], log_odds: 0.0, compared: 0 }
    }

    /// Cells by which this frame's coordinates are to be moved; `None` while undecided. See also [`VoteResult::dropped`].
    pub fn correction(&self) -> Option<(i32, i32)> {
        let m = i32::try_from(self.frames).unwrap_or(i32::MAX);
        let (i, j) = self.shifts[0].cells;
        (self.verdict == Verdict::Decided).then(|| (i.saturating_mul(m), j.saturating_mul(m)))
    }
}

/// Compares each frame with the one before. Owns its buffers.
#[derive(Debug)]
pub struct CellVote {
    flatten: Flatten,
    pyramid: Pyramid,
    frames: Frames,
}

/// The frames that are compared.
#[derive(Debug)]
struct Frames {
    config: VoteConfig,
    layout: Layout,
    /// The last frame that was laid out, and the one before it.
    here: Cells,
    before: Cells,
    /// Blind frames since.
    gap: usize,
    scores: Scores,
    evidence: Evidence,
}

impl CellVote {
    /// A vote without a frame yet.
    ///
    /// # Errors
    /// [`crate::Error::Value`] for a parameter out of range.
    pub fn new(config: &VoteConfig) -> Result<Self> {
        config.validate()?;
        let (columns, rows) = (2 * config.half_columns, 2 * config.half_rows);
        let frames = Frames {
            config: config.clone(),
            layout: Layout::new(columns, rows),
            here: Cells::new(columns, rows),
            before: Cells::new(columns, rows),
            gap: 0,
            scores: Scores::new(config.reach_cells),
            evidence: Evidence::new(config),
        };
        Ok(Self { flatten: Flatten::new(FLATTEN_PX)?, pyramid: Pyramid::new(LEVELS), frames })
    }

    /// Forgets the frames so far.
    pub fn reset(&mut self) {
        self.frames.reset();
    }

    /// Forgets what undecided frames said: the next is judged by itself.
    pub fn drop_doubt(&mut self) {
        self.frames.evidence.clear();
    }

    /// The next frame. `middle` is the cell to lay out round (the one at the optical axis), `pixel_from_lattice` tells where a lattice coordinate (cycles along
    /// the two directions, knots at whole numbers) lies in this picture, `None` where it does not. Numbers continue those of the frame before, corrected as
    /// its result said.
    pub fn update(
        &mut self,
        view: GrayView<'_>,
        middle: (i32, i32),
        pixel_from_lattice: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>,
    ) -> VoteResult {
        self.pyramid.build(self.flatten.apply(view), SMALLEST_SIDE_PX);
        self.frames.update(&self.pyramid, middle, pixel_from_lattice)
    }

    /// [`CellVote::update`] of a picture that is prepared already: less the light's slow changes, and halved again and again, as [`crate::FlowTracker::picture`].
    pub fn update_flat(
        &mut self,
        picture: &Pyramid,
        middle: (i32, i32),
        pixel_from_lattice: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>,
    ) -> VoteResult {
        self.frames.update(picture, middle, pixel_from_lattice)
    }

    /// Adds the frame of the last update to a map, by the numbers that its result gave. Only frames whose numbers are certain belong there.
    pub fn remember(&self, map: &mut CellMap) {
        if self.frames.gap == 0 {
            map.add(&self.frames.here);
        }
    }

    /// Looks for the frame of the last update in a map. `around`: cells to be added to its numbers where the search begins. `None` if the frame or the map is empty, or they have
    /// too little in common.
    pub fn recall(&self, map: &mut CellMap, around: (i32, i32)) -> Option<Recall> {
        if self.frames.gap == 0 { map.find(&self.frames.here, around) } else { None }
    }

    /// Moves the numbers of the last frame, for a caller that learned better.
    pub fn renumber(&mut self, by: (i32, i32)) {
        self.frames.here.renumber(by);
        self.frames.evidence.clear();
    }
}

impl Frames {
    fn reset(&mut self) {
        self.here.clear();
        self.before.clear();
        self.evidence.clear();
        self.gap = 0;
    }

    fn update(
        &mut self,
        picture: &Pyramid,
        middle: (i32, i32),
        pixel_from_lattice: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>,
    ) -> VoteResult {
        let corner = (
            middle.0.saturating_sub(self.config.half_columns as i32),
            middle.1.saturating_sub(self.config.half_rows as i32),
        );
        if !self.layout.fill(picture, corner, pixel_from_lattice, &mut self.before) {
            self.before.clear();
            self.gap += 1;
            if !self.evidence.is_empty() || self.gap > self.config.memory_frames {
                // Doubt cannot be followed over a gap, and a long one may hide any step.
                self.reset();
            }
            return VoteResult::without_scores(Verdict::Blind);
        }
        std::mem::swap(&mut self.here, &mut self.before);
        let gap = std::mem::take(&mut self.gap) > 0;
        let compared = if self.before.is_empty() { 0 } else { self.scores.compare(&self.before, &self.here) };
        if compared == 0 {
            self.evidence.clear();
            return VoteResult::without_scores(Verdict::Started);
        }
        let result = self.evidence.add(self.scores.z(), compared);
        if let Some(correction) = result.correction() {
            self.here.renumber(correction);
            self.evidence.clear();
        } else if gap {
            // What happened in the gap happened once, not in every frame: one look has to decide.
            self.evidence.clear();
            return VoteResult::without_scores(Verdict::Started);
        }
        result
    }
}
