use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, within};

/// What the camera does to the light it gets.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sensor {
    /// Point spread of lens and pixel together where in focus: standard deviation of a Gaussian, px. Default 0.6, a good lens
    /// (a pixel's own aperture is 0.29). Below 0.4 thin twine aliases.
    pub psf_px: f64,
    /// More blur, of all the picture: defocus, a dirty dome, scatter in the water. Standard deviation, px; it adds to `psf_px` in
    /// squares. Default 0.
    pub defocus_px: f64,
    /// Exposure: all light is multiplied by this. Default 1.
    pub gain: f64,
    /// Electrons of a pixel at grey level 255, for the noise of light itself; 0 for none. Default 0; small sensors have 5000.
    pub full_well_e: f64,
    /// Noise that does not depend on brightness: standard deviation, grey levels. Default 2.
    pub read_noise_grey: f64,
    /// Quality of a JPEG that the picture has been through, 1 to 100 as in libjpeg. Default none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jpeg_quality: Option<u8>,
    /// Time that the shutter is open, s, during which the camera moves ([`super::Motion`]). Default 0.
    pub exposure_s: f64,
}

impl Default for Sensor {
    fn default() -> Self {
        Self {
            psf_px: 0.6,
            defocus_px: 0.0,
            gain: 1.0,
            full_well_e: 0.0,
            read_noise_grey: 2.0,
            jpeg_quality: None,
            exposure_s: 0.0,
        }
    }
}

impl Sensor {
    /// Standard deviation of the noise where the light has this brightness, grey levels.
    pub fn noise_grey(&self, light_grey: f64) -> f64 {
        // Light of g grey levels is g/255 of a full well, and counts vary by their square root.
        let shot = if self.full_well_e > 0.0 { light_grey.max(0.0) * 255.0 / self.full_well_e } else { 0.0 };
        (self.read_noise_grey.powi(2) + shot).sqrt()
    }

    pub(crate) fn validate(&self) -> Result<()> {
        within("sensor.psf_px", self.psf_px, 0.2, 50.0, "pixels between 0.2 and 50")?;
        within("sensor.defocus_px", self.defocus_px, 0.0, 50.0, "pixels between 0 and 50")?;
        within("sensor.gain", self.gain, 0.0, 1e3, "between 0 and 1000")?;
        within("sensor.full_well_e", self.full_well_e, 0.0, 1e9, "electrons between 0 (no shot noise) and 1e9")?;
        within("sensor.read_noise_grey", self.read_noise_grey, 0.0, 1000.0, "grey levels between 0 and 1000")?;
        within("sensor.exposure_s", self.exposure_s, 0.0, 10.0, "seconds between 0 and 10")?;
        match self.jpeg_quality {
            Some(quality) if !(1..=100).contains(&quality) => {
                let value = f64::from(quality);
                Err(Error::Value { field: "sensor.jpeg_quality", value, expected: "between 1 and 100" })
            }
            _ => Ok(()),
        }
    }
}

/// How the camera moves while the shutter is open; the scene's pose is that of the middle of the exposure.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Motion {
    /// Of the camera's centre, m/s along its own axes. Default still.
    pub linear_m_per_s: [f64; 3],
    /// Of the camera about its own axes, degrees/s. Default still.
    pub angular_deg_per_s: [f64; 3],
}

impl Motion {
    pub(crate) fn validate(&self) -> Result<()> {
        for v in self.linear_m_per_s {
            within("motion.linear_m_per_s", v, -100.0, 100.0, "m/s within ±100")?;
        }
        for v in self.angular_deg_per_s {
            within("motion.angular_deg_per_s", v, -1e4, 1e4, "degrees/s within ±10000")?;
        }
        Ok(())
    }
}
