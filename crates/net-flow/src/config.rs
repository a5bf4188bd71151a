//! Parameters.

use serde::{Deserialize, Serialize};

use crate::block_match::Reach;
use crate::error::{Error, Result, in_range};
use crate::zncc::{MAX_HALF, MAX_RADIUS};

/// Parameters of block matching.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MatchConfig {
    /// Levels of the pyramid, full size included, 1 to 6. Default 3: a quarter size still shows cells of 30 px. More levels reach
    /// farther at the same cost and lose small cells.
    pub levels: usize,
    /// Half width of the square template at full size, px, 2 to 31; a fifth smaller at each coarser level, but not below 7.
    /// Default 15: one knot and the halves of its twines at cells of 30 px. Larger windows are steadier and follow bends less.
    pub half_window_px: usize,
    /// Search radius, px of the full picture, round the expectation. Default 40. Above half a cell a point alone can no longer tell
    /// which cell it went to; consensus and the test of rivals then have to.
    pub search_px: f64,
    /// Search radius at levels below the coarsest, px of the level, 1 to 24. Default 1: the error that a coarser level leaves. A peak on the border of
    /// the last search is followed a little beyond it.
    pub fine_search_px: usize,
    /// Least normalised correlation of a match, -1 to 1. Default 0.5. Higher refuses more points in noise.
    pub min_score: f64,
    /// Largest distance between a point and where the way back ends, px. Default 0.7 (as usual with Lucas-Kanade).
    pub max_round_trip_px: f64,
    /// Gauss-Newton steps after the quadratic peak, 0 to 20. Default 3; 0 keeps the quadratic's peak.
    pub refine_iterations: usize,
}

impl Default for MatchConfig {
    fn default() -> Self {
        Self {
            levels: 3,
            half_window_px: 15,
            search_px: 40.0,
            fine_search_px: 1,
            min_score: 0.5,
            max_round_trip_px: 0.7,
            refine_iterations: 3,
        }
    }
}

impl MatchConfig {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Value`] names the field and the value.
    pub fn validate(&self) -> Result<()> {
        in_range("levels", self.levels as f64, 1.0, 6.0, "1 to 6")?;
        in_range("half_window_px", self.half_window_px as f64, 2.0, MAX_HALF as f64, "2 to 31 px")?;
        in_range("search_px", self.search_px, 1.0, 500.0, "1 to 500 px")?;
        let coarsest = (self.search_px / f64::from(1u32 << (self.levels - 1))).ceil();
        if coarsest > MAX_RADIUS as f64 {
            let expected = "at most 24 px of the coarsest level; more levels allow more";
            return Err(Error::Value { field: "search_px", value: self.search_px, expected });
        }
        in_range("fine_search_px", self.fine_search_px as f64, 1.0, MAX_RADIUS as f64, "1 to 24 px")?;
        in_range("min_score", self.min_score, -1.0, 1.0, "-1 to 1")?;
        in_range("max_round_trip_px", self.max_round_trip_px, 0.0, 1e3, "0 to 1000 px")?;
        in_range("refine_iterations", self.refine_iterations as f64, 0.0, 20.0, "0 to 20")
    }

    /// Half width of the template at `level`, px of the level.
    pub(crate) fn half_window(&self, level: usize) -> usize {
        let shrunk = (self.half_window_px as f64 * 0.8f64.powi(level as i32)).round() as usize;
        shrunk.max(self.half_window_px.min(7))
    }

    /// The whole search of a pyramid of `levels` levels.
    pub(crate) fn full_reach(&self, levels: usize) -> Reach {
        let level = levels.clamp(1, self.levels) - 1;
        Reach { level, radius: ((self.search_px / f64::from(1u32 << level)).ceil() as usize).clamp(1, MAX_RADIUS) }
    }
}

/// What kind of motion the points are to agree on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Model {
    /// Shift, turn and scale: a net seen square on, or very little motion.
    Similarity,
    /// A plane seen from two places.
    #[default]
    Homography,
}

/// Parameters of the consensus.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConsensusConfig {
    /// What kind of motion. Default homography; with fewer than 12 points a similarity all the same.
    pub model: Model,
    /// Points nearer than this to where the motion carries them agree, px. Default 1.5. A bent net needs more; it must stay well below
    /// half a cell, or points on the neighbouring cell agree.
    pub threshold_px: f64,
    /// Fewest points that make a consensus, at least 4. Default 12.
    pub min_points: usize,
    /// Most minimal samples drawn, 1 to 100000. Default 400: enough for four inliers in a row at 40 % of inliers.
    pub max_samples: usize,
    /// Seed of the samples. Default 1. The same seed gives the same result.
    pub seed: u64,
}

impl Default for ConsensusConfig {
    fn default() -> Self {
        Self { model: Model::Homography, threshold_px: 1.5, min_points: 12, max_samples: 400, seed: 1 }
    }
}

impl ConsensusConfig {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Value`] names the field and the value.
    pub fn validate(&self) -> Result<()> {
        in_range("threshold_px", self.threshold_px, 0.01, 100.0, "0.01 to 100 px")?;
        in_range("min_points", self.min_points as f64, 4.0, 1e6, "at least 4")?;
        in_range("max_samples", self.max_samples as f64, 1.0, 1e5, "1 to 100000")
    }
}

/// How a track's position comes about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// From frame to frame, steps summed: errors add up.
    Summed,
    /// Summed, then matched directly with the key frame, starting from the sum: no drift while the key frame serves.
    #[default]
    KeyFrame,
}

/// Parameters of [`crate::FlowTracker`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Block matching.
    pub matching: MatchConfig,
    /// Consensus.
    pub consensus: ConsensusConfig,
    /// How positions come about. Default key frame.
    pub mode: Mode,
    /// Side of the squares that each hold a point, px, 8 to 1000. Default 40: about 300 points at 848 x 480. Smaller is steadier and slower.
    pub seed_spacing_px: f64,
    /// The light's slow changes over the picture (shading, backscatter, vignette) stay with the camera and would hold points back: the mean over
    /// squares of twice this and one pixels is taken away first. Default 20 px; 0 leaves the picture as it is.
    pub flatten_radius_px: usize,
    /// Most points that vote for the common shift and for or against rival shifts, 16 to 10000. Default 64.
    pub vote_points: usize,
    /// Share of the points in view that must agree, 0 to 1, else the frame is lost. Default 0.3: fish may cover two thirds.
    pub min_agreed: f64,
    /// Share of the twelve picture blocks with points that must hold agreeing ones, 0 to 1, else the frame is lost. Default 0.4: one large fish alone is no
    /// net.
    pub min_coverage: f64,
    /// Frames that a point may be carried along by the others without being seen itself. Default 50.
    pub max_carried_frames: u32,
    /// Search radius of the match with the key frame, px of the full picture, 1 to 24. Default 2. Must stay below half a cell.
    pub direct_search_px: usize,
    /// A new key frame when fewer than this share of the points agree with the old one, 0 to 1. Default 0.4.
    pub min_key_share: f64,
    /// Most px that the picture can move between two frames, if the vehicle's speed bounds it: rival motions beyond it are out of the
    /// question. Default none: only the picture itself, or a prior, can decide between cells.
    pub max_step_px: Option<f64>,
    /// Natural logarithm of the odds against every rival that a frame needs in order not to be called ambiguous, 1 to 1000. Default 12.5: five
    /// standard deviations.
    pub min_log_odds: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            matching: MatchConfig::default(),
            consensus: ConsensusConfig::default(),
            mode: Mode::KeyFrame,
            seed_spacing_px: 40.0,
            flatten_radius_px: 20,
            vote_points: 64,
            min_agreed: 0.3,
            min_coverage: 0.4,
            max_carried_frames: 50,
            direct_search_px: 2,
            min_key_share: 0.4,
            max_step_px: None,
            min_log_odds: 12.5,
        }
    }
}

impl Config {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Value`] names the field and the value.
    pub fn validate(&self) -> Result<()> {
        self.matching.validate()?;
        self.consensus.validate()?;
        in_range("seed_spacing_px", self.seed_spacing_px, 8.0, 1000.0, "8 to 1000 px")?;
        in_range("flatten_radius_px", self.flatten_radius_px as f64, 0.0, 500.0, "0 to 500 px")?;
        in_range("vote_points", self.vote_points as f64, 16.0, 1e4, "16 to 10000")?;
        in_range("min_agreed", self.min_agreed, 0.0, 1.0, "0 to 1")?;
        in_range("min_coverage", self.min_coverage, 0.0, 1.0, "0 to 1")?;
        in_range("direct_search_px", self.direct_search_px as f64, 1.0, MAX_RADIUS as f64, "1 to 24 px")?;
        in_range("min_key_share", self.min_key_share, 0.0, 1.0, "0 to 1")?;
        in_range("max_step_px", self.max_step_px.unwrap_or(1.0), 0.0, 1e6, "a distance of 0 to 1e6 px")?;
        in_range("min_log_odds", self.min_log_odds, 1.0, 1000.0, "1 to 1000")
    }
}
