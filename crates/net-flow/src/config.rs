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
    /// Search radius, px of the full picture, round the expectation. Default 24. Above half a cell a point alone can no longer tell
    /// which cell it went to; consensus and the test of rivals then have to.
    pub search_px: f64,
    /// Search radius at levels below the coarsest, px of the level, 1 to 24. Default 2: the error that a coarser level leaves.
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
            search_px: 24.0,
            fine_search_px: 2,
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
