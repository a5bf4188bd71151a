//! Everything that can be set.

use crate::error::{Error, Result};
use crate::fit::ShapeConfig;
use crate::search::SearchConfig;
use crate::section::SectionConfig;
use crate::sections::GridConfig;

/// Who picks the wave vectors of a section.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Selection {
    /// All sections together: those vectors that agree on one net.
    #[default]
    Together,
    /// Each section for itself, by the values of Algorithm 3, as in the thesis.
    EachSection,
}

/// Where the plane comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlaneSource {
    /// The lattice fitted to the waves of all sections. With [`Selection::EachSection`]: as [`Self::Svd`].
    #[default]
    Waves,
    /// The places of the three most confident sections (eq. 4.24).
    MostConfidentThree,
    /// The places of all sections (eq. 4.30 to 4.35).
    Svd,
}

/// Everything that can be set. The defaults serve from 0.3 to 6 m.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ThesisConfig {
    /// Sections of the picture, of the picture at half the size, at a quarter, and so on. Default 2 x 4, 1 x 2 and 1 x 1: the coarse ones see the fundamental of a net so near that in a fine one it
    /// lies beside the constant bin. The thesis has 2 x 2 of the whole size.
    pub grids: Vec<GridConfig>,
    /// Pictures higher than one and a half times this are halved first, as often as it takes, px. Default 480 (thesis). Larger: smaller meshes are seen, at a cost that grows with the number of pixels.
    pub working_height_px: u32,
    /// From a section to its candidates.
    pub section: SectionConfig,
    /// Who picks the wave vectors of a section.
    pub selection: Selection,
    /// Where the plane comes from.
    pub plane: PlaneSource,
    /// How hard to look for vectors that agree.
    pub search: SearchConfig,
    /// How well the shape of the mesh is known.
    pub shape: ShapeConfig,
}

impl Default for ThesisConfig {
    fn default() -> Self {
        Self {
            grids: vec![
                GridConfig { rows: 2, columns: 4, overlap: 0.16 },
                GridConfig { rows: 1, columns: 2, overlap: 0.3 },
                GridConfig { rows: 1, columns: 1, overlap: 0.05 },
            ],
            working_height_px: 480,
            section: SectionConfig::default(),
            selection: Selection::default(),
            plane: PlaneSource::default(),
            search: SearchConfig::default(),
            shape: ShapeConfig::default(),
        }
    }
}

impl ThesisConfig {
    /// The thesis's method: four sections side by side, no window, each with its own choice, the plane by the three most confident. Its errata are mended all the same. `near`: the values that it uses
    /// by hand at 1.2 m and below.
    pub fn thesis(near: bool) -> Self {
        Self {
            grids: vec![GridConfig::default()],
            section: SectionConfig::thesis(near),
            selection: Selection::EachSection,
            plane: PlaneSource::MostConfidentThree,
            search: SearchConfig { min_angle_deg: 55.0, ..SearchConfig::default() },
            ..Self::default()
        }
    }

    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Parameter`] names the field.
    pub fn validate(&self) -> Result<()> {
        if self.grids.is_empty() || self.grids.len() > 5 {
            let value = self.grids.len() as f64;
            return Err(Error::Parameter { field: "number of grids", value, expected: "1 to 5" });
        }
        self.grids.iter().try_for_each(GridConfig::validate)?;
        if self.working_height_px < 16 {
            let value = f64::from(self.working_height_px);
            return Err(Error::Parameter { field: "working_height_px", value, expected: "16 px or more" });
        }
        self.section.validate()?;
        self.search.validate()?;
        self.shape.validate()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_pass_and_values_out_of_range_are_named() {
        assert!(ThesisConfig::default().validate().is_ok());
        assert!(ThesisConfig::thesis(true).validate().is_ok() && ThesisConfig::thesis(false).validate().is_ok());
        let refused = |change: fn(&mut ThesisConfig), field: &str| {
            let mut config = ThesisConfig::default();
            change(&mut config);
            let message = config.validate().unwrap_err().to_string();
            assert!(message.starts_with(field), "{message}");
        };
        refused(|c| c.grids.clear(), "number of grids is 0");
        refused(|c| c.grids[0].overlap = 1.0, "overlap is 1");
        refused(|c| c.working_height_px = 0, "working_height_px is 0");
        refused(|c| c.section.filter.radius_cycles_per_px = 0.6, "radius_cycles_per_px is 0.6");
        refused(|c| c.section.score.peak_weight = f64::NAN, "peak_weight is NaN");
        refused(|c| c.section.score.max_peaks = 0, "max_peaks is 0");
        refused(|c| c.search.max_tilt_deg = 90.0, "max_tilt_deg is 90");
        refused(|c| c.search.candidates_per_section = 0, "candidates_per_section is 0");
        refused(|c| c.search.pairs_per_section = 0, "pairs_per_section is 0");
        refused(|c| c.search.pairs = 0, "pairs is 0: 1 or more");
        refused(|c| c.search.fits = 0, "fits is 0: 1 or more");
        refused(|c| c.shape.sigma_ratio = 0.0, "sigma_ratio is 0");
    }
}
