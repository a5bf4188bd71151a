use serde::{Deserialize, Serialize};

use crate::error::{Result, within};

/// What the camera does to the light it gets.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sensor {
    /// Point spread of lens and pixel together where in focus: standard deviation of a Gaussian, px. Default 0.6, a good lens
    /// (a pixel's own aperture is 0.29). Below 0.4 thin twine aliases.
    pub psf_px: f64,
    /// Noise that does not depend on brightness: standard deviation, grey levels. Default 2.
    pub read_noise_grey: f64,
}

impl Default for Sensor {
    fn default() -> Self {
        Self { psf_px: 0.6, read_noise_grey: 2.0 }
    }
}

impl Sensor {
    pub(crate) fn validate(&self) -> Result<()> {
        within("sensor.psf_px", self.psf_px, 0.2, 50.0, "pixels between 0.2 and 50")?;
        within("sensor.read_noise_grey", self.read_noise_grey, 0.0, 1000.0, "grey levels between 0 and 1000")
    }
}
