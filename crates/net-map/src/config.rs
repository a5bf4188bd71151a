use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Parameters of the map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Tiles of 32 x 32 cells in memory, 4 to 4096; each takes a third of a megabyte. Default 64: more than one view holds.
    pub tiles_in_memory: usize,
    /// Distance, cells, by which the camera must have moved for a look at a twine to count as another one, 0.1 to 100. Default 1. Frames in between are averaged:
    /// what disturbs them (fish, haze, a net behind) is the same.
    pub look_cells: f64,
    /// Frames after which it counts as another one even so, 1 to 100000. Default 20.
    pub look_frames: u32,
    /// Most that one look may say for or against a twine, log likelihood ratio, 1 to 100. Default 8.
    pub look_max: f64,
    /// A twine is missing below this log likelihood ratio of all its looks, -100 to 0. Default -1.5.
    pub missing_llr: f64,
    /// One that no frame calls overgrown is missing below this, -100 to 0, if up to three in a row lie between parallel ones that are missing. Default -0.75.
    pub bridge_llr: f64,
    /// Missing twines are a hole when one of them is below this, -1000 to 0. Default -6.
    pub hole_one_llr: f64,
    /// Or when at least three below -2 come to this together, -1000 to 0. Default -13.
    pub hole_sum_llr: f64,
    /// Least neighbourhood contrast, deviations, of a look that may call a twine missing for certain (the first of the two rules), 0 to 100. Default 3.
    pub certain_contrast: f64,
    /// Shortest twine, px between its knots, that a look may call missing, 0 to 1000. Default 16: below, a tuft of weed that hides a part of the twine looks like a gap.
    pub missing_min_px: f64,
    /// Smallest cells, px, in which growth is measured, 4 to 1000. Default 12: below, twine and growth are one blur.
    pub growth_min_px: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            tiles_in_memory: 64,
            look_cells: 1.0,
            look_frames: 20,
            look_max: 8.0,
            missing_llr: -1.5,
            bridge_llr: -0.75,
            hole_one_llr: -6.0,
            hole_sum_llr: -13.0,
            certain_contrast: 3.0,
            missing_min_px: 16.0,
            growth_min_px: 12.0,
        }
    }
}

impl Config {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Value`] names the field and the value.
    pub fn validate(&self) -> Result<()> {
        let within = |field, value: f64, low: f64, high: f64, expected| {
            if value >= low && value <= high { Ok(()) } else { Err(Error::Value { field, value, expected }) }
        };
        within("tiles_in_memory", self.tiles_in_memory as f64, 4.0, 4096.0, "4 to 4096 tiles")?;
        within("look_cells", self.look_cells, 0.1, 100.0, "0.1 to 100 cells")?;
        within("look_frames", f64::from(self.look_frames), 1.0, 1e5, "1 to 100000 frames")?;
        within("look_max", self.look_max, 1.0, 100.0, "1 to 100")?;
        within("missing_llr", self.missing_llr, -100.0, 0.0, "-100 to 0")?;
        within("bridge_llr", self.bridge_llr, -100.0, 0.0, "-100 to 0")?;
        within("hole_one_llr", self.hole_one_llr, -1000.0, 0.0, "-1000 to 0")?;
        within("hole_sum_llr", self.hole_sum_llr, -1000.0, 0.0, "-1000 to 0")?;
        within("certain_contrast", self.certain_contrast, 0.0, 100.0, "0 to 100 deviations")?;
        within("missing_min_px", self.missing_min_px, 0.0, 1000.0, "0 to 1000 px")?;
        within("growth_min_px", self.growth_min_px, 4.0, 1000.0, "4 to 1000 px")
    }
}
