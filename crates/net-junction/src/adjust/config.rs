use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Parameters of the net adjustment. Figures come from a prototype on path-traced pictures unless said otherwise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AdjustConfig {
    /// Least distance between parallel twines, px: smaller cells are left out.
    pub cell_min_px: f64,
    /// How far from its predicted place a twine is looked for, cells, pass by pass. The first bounds the prediction's error; beyond a
    /// third of a cell the neighbouring twine is as near.
    pub search_cells: Vec<f64>,
    /// Standard deviation of the picture's point spread, px.
    pub point_spread_px: f64,
    /// Twine diameters that are tried, m; the one that explains the picture best is taken.
    pub twines_m: Vec<f64>,
    /// Standard deviation of the difference of neighbouring nodes' displacements, cells.
    pub jitter_cells: f64,
    /// Standard deviation of a twine's bow between its knots, parts of its length.
    pub bow: f64,
    /// Log likelihood ratio, present to missing, above which a twine counts as present.
    pub present_llr: f64,
    /// Log likelihood ratio below which it looks missing: of twines that are there some in a thousand do, where they are faint some in a hundred.
    pub missing_llr: f64,
    /// Twines that look missing are, with those that share a mesh with them, when one of them is below this. One twine in some thousands is broken, and
    /// a picture has thousands. Nearer to zero: more holes, false ones too.
    pub hole_one_llr: f64,
    /// And its neighbourhood stands out by this many standard deviations.
    pub certain_contrast: f64,
    /// Or when at least three below -2 come to this together.
    pub hole_sum_llr: f64,
    /// How many standard deviations twine must stand out from control lines half a cell aside, for anything to be said at all.
    pub gate: f64,
}

impl Default for AdjustConfig {
    fn default() -> Self {
        Self {
            cell_min_px: 3.5,
            search_cells: vec![0.34, 0.2, 0.12],
            point_spread_px: 0.75,
            twines_m: vec![0.001, 0.0015, 0.002, 0.0025, 0.003, 0.0035, 0.0045],
            jitter_cells: 0.042,
            bow: 0.012,
            present_llr: 3.0,
            missing_llr: -1.5,
            hole_one_llr: -4.0,
            certain_contrast: 4.0,
            hole_sum_llr: -13.0,
            gate: 1.5,
        }
    }
}

impl AdjustConfig {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Value`] names the first parameter that is out of range.
    pub fn validate(&self) -> Result<()> {
        let within = |field, value: f64, low: f64, high: f64, expected| {
            if value >= low && value <= high { Ok(()) } else { Err(Error::Value { field, value, expected }) }
        };
        within("cell_min_px", self.cell_min_px, 3.0, 1e4, "a number from 3 to 10000")?;
        within("search_cells (count)", self.search_cells.len() as f64, 1.0, 20.0, "one to twenty passes")?;
        for &part in &self.search_cells {
            within("search_cells", part, 0.01, 0.5, "numbers from 0.01 to 0.5")?;
        }
        within("point_spread_px", self.point_spread_px, 0.1, 10.0, "a number from 0.1 to 10")?;
        within("twines_m (count)", self.twines_m.len() as f64, 1.0, 100.0, "one to a hundred diameters")?;
        for &twine in &self.twines_m {
            within("twines_m", twine, 1e-5, 1.0, "numbers from 0.00001 to 1")?;
        }
        within("jitter_cells", self.jitter_cells, 1e-4, 1.0, "a number from 0.0001 to 1")?;
        within("bow", self.bow, 0.0, 1.0, "a number from 0 to 1")?;
        within("gate", self.gate, 0.0, 100.0, "a number from 0 to 100")?;
        within("present_llr", self.present_llr, 0.0, 1e3, "a number from 0 to 1000")?;
        for (field, value) in [
            ("missing_llr", self.missing_llr),
            ("hole_one_llr", self.hole_one_llr),
            ("hole_sum_llr", self.hole_sum_llr),
        ] {
            within(field, value, -1e3, 0.0, "a number from -1000 to 0")?;
        }
        within("certain_contrast", self.certain_contrast, 0.0, 100.0, "a number from 0 to 100")?;
        Ok(())
    }
}
