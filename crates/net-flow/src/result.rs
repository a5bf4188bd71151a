//! What an update tells.

use crate::motion::Motion;
use crate::rivals::Rival;
use crate::tracks::Track;

/// How far a motion can be relied on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// The first frame, or the first after a loss: points are seeded, there is no motion yet.
    Started,
    /// One motion, and no rival left.
    Tracked,
    /// A motion, or the same and some cells more: see the rivals.
    Ambiguous,
    /// No motion that enough of the picture agrees on.
    Lost,
}

/// One estimate of motion: a step from frame to frame, or directly from the key frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate<'a> {
    /// How far it can be relied on.
    pub status: Status,
    /// Motion from the earlier frame's pixels to the later one's; `None` when lost. When ambiguous: the likeliest.
    pub motion: Option<Motion>,
    /// Points that were looked for.
    pub points: usize,
    /// Points found by their own match.
    pub matched: usize,
    /// Points that agree with the motion.
    pub agreed: usize,
    /// Robust standard deviation of the agreeing points' residuals per axis, px.
    pub spread_px: f64,
    /// Share of the twelve picture blocks with points that hold agreeing ones.
    pub coverage: f64,
    /// What else it could have been, the most dangerous first.
    pub rivals: &'a [Rival],
}

impl Estimate<'_> {
    /// Nothing known.
    pub(crate) fn none(status: Status, points: usize) -> Self {
        Estimate { status, motion: None, points, matched: 0, agreed: 0, spread_px: 0.0, coverage: 0.0, rivals: &[] }
    }
}

/// What an update tells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlowResult<'a> {
    /// How far `from_key` can be relied on: the worst of all steps since the key frame, unless a direct match with it has settled
    /// their doubts.
    pub status: Status,
    /// Number of this frame, from 0.
    pub frame: u64,
    /// The step from the frame before.
    pub step: Estimate<'a>,
    /// The direct match with the key frame; `None` in summed mode, and where it is the frame before itself.
    pub direct: Option<Estimate<'a>>,
    /// The frame that `direct` and `from_key` begin at.
    pub key_frame: u64,
    /// Motion from the key frame's pixels to this one's: direct where that succeeded, else summed. `None` when lost.
    pub from_key: Option<Motion>,
    /// All points that are followed.
    pub tracks: &'a [Track],
}
