use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// What the estimator may assume about nets, and when it speaks. The defaults are for knotted aquaculture nets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// One standard deviation, degrees, of the angle at which the sides cross, about the mesh's nominal angle. Default 10: square
    /// nets in five frames of a working pen hang at 78 to 85. Lower it where the mesh cannot shear (welded, coated); 0 fixes the angle.
    pub crossing_angle_sigma_deg: f64,
    /// One standard deviation, m, of the sheet's bumps about its tangent plane. Default 0.022 (rendered and real pen nets). Raising it
    /// lets the surface follow more, at the price of noise where few cells are in view.
    pub height_sigma_m: f64,
    /// Correlation length, m, of those bumps. Default 0.36, a curvature of 0.29 per metre with the default height. Lowering it allows sharper bends.
    pub height_length_m: f64,
    /// One standard deviation, 1/m, of the curvature of a twine within the sheet (shear that changes along it). Default 0.15.
    pub thread_bending_sigma_per_m: f64,
    /// Diameter of the twine, m. Default 0.002; a first value, refined per picture within a factor of two.
    pub twine_diameter_m: f64,
    /// One standard deviation of the ratio of the two sides against the mesh's, considered (never estimated) in the covariance. Default
    /// 0.003: bars of real meshes differ by a few tenths of a percent.
    pub side_ratio_sigma: f64,
    /// Probability from which an estimate should be acted on. Default 0.65: below it, strongly bent sheets were claimed with normals 5 to 7 degrees off. Raising it
    /// trades answers for safety.
    pub probability_threshold: f64,
    /// Largest working image, px. Larger pictures are averaged over whole-number blocks first. Default 1 100 000 (1280 x 720 is left as it is).
    pub working_pixels: usize,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            crossing_angle_sigma_deg: 10.0,
            height_sigma_m: 0.022,
            height_length_m: 0.36,
            thread_bending_sigma_per_m: 0.15,
            twine_diameter_m: 0.002,
            side_ratio_sigma: 0.003,
            probability_threshold: 0.65,
            working_pixels: 1_100_000,
        }
    }
}

impl Config {
    /// Refuses what makes no sense.
    ///
    /// # Errors
    /// [`Error::Parameter`] names the field.
    pub fn validate(&self) -> Result<()> {
        let check = |field, value: f64, ok: bool, expected| {
            if value.is_finite() && ok { Ok(()) } else { Err(Error::Parameter { field, value, expected }) }
        };
        let v = self.crossing_angle_sigma_deg;
        check("crossing_angle_sigma_deg", v, (0.0..=45.0).contains(&v), "degrees from 0 to 45")?;
        for (field, v) in [
            ("height_sigma_m", self.height_sigma_m),
            ("height_length_m", self.height_length_m),
            ("thread_bending_sigma_per_m", self.thread_bending_sigma_per_m),
            ("twine_diameter_m", self.twine_diameter_m),
        ] {
            check(field, v, v > 0.0, "above zero")?;
        }
        let v = self.side_ratio_sigma;
        check("side_ratio_sigma", v, (0.0..0.5).contains(&v), "from 0 to 0.5")?;
        let v = self.probability_threshold;
        check("probability_threshold", v, (0.0..=1.0).contains(&v), "from 0 to 1")?;
        check("working_pixels", self.working_pixels as f64, self.working_pixels >= 10_000, "10 000 or more")
    }
}
