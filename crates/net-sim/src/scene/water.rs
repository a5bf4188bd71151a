use serde::{Deserialize, Serialize};

use crate::error::{Result, within};

/// The water: what is seen where there is nothing, and what it does to light on its way (Jaffe 1990, McGlamery 1980, without
/// forward scatter, which is [`super::Sensor`]'s blur): `seen = grey exp(-c r) + veil (1 - exp(-c r))` at range `r`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Water {
    /// Brightness of open water in the middle of the picture, grey levels. Default 90.
    pub veil_grey: f64,
    /// Beam attenuation `c`, 1/m. Default 0: air. A visibility of `V` metres (2 % contrast) is `c = 3.9 / V`.
    pub attenuation_per_m: f64,
    /// How much brighter open water is at the top of the picture than at the bottom, grey levels. Default 0.
    pub gradient_grey: f64,
    /// Cloudiness of open water: standard deviation, grey levels. Default 0.
    pub mottle_grey: f64,
    /// Size of the clouds, px. Default 90.
    pub mottle_px: f64,
    /// Shafts of light in open water: standard deviation, grey levels. Default 0.
    pub rays_grey: f64,
    /// Glow of the vehicle's own lamps in the water: grey levels added in the middle of the picture. Default 0.
    pub glow_grey: f64,
}

impl Default for Water {
    fn default() -> Self {
        Self {
            veil_grey: 90.0,
            attenuation_per_m: 0.0,
            gradient_grey: 0.0,
            mottle_grey: 0.0,
            mottle_px: 90.0,
            rays_grey: 0.0,
            glow_grey: 0.0,
        }
    }
}

impl Water {
    /// Attenuation of water with this visibility, m: the range at which contrast has fallen to 2 %.
    pub fn attenuation_of_visibility(visibility_m: f64) -> f64 {
        3.9 / visibility_m
    }

    pub(crate) fn validate(&self) -> Result<()> {
        within("water.veil_grey", self.veil_grey, 0.0, 1000.0, "grey levels between 0 and 1000")?;
        within("water.attenuation_per_m", self.attenuation_per_m, 0.0, 1e3, "per metre between 0 and 1000")?;
        within("water.gradient_grey", self.gradient_grey, -1000.0, 1000.0, "grey levels within ±1000")?;
        within("water.mottle_grey", self.mottle_grey, 0.0, 1000.0, "grey levels between 0 and 1000")?;
        within("water.mottle_px", self.mottle_px, 16.0, 1e5, "pixels between 16 and 100000")?;
        within("water.rays_grey", self.rays_grey, 0.0, 1000.0, "grey levels between 0 and 1000")?;
        within("water.glow_grey", self.glow_grey, 0.0, 1000.0, "grey levels between 0 and 1000")
    }
}

/// Marine snow: particles that drift through the view.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Snow {
    /// Particles per cubic metre. Default 0; clear water has some 100, murky water thousands.
    pub density_per_m3: f64,
    /// Diameter of a particle, m, on average. Default 0.0012.
    pub size_m: f64,
    /// Brightness, grey levels. Default 230.
    pub grey: f64,
    /// Distance at which the camera is focused, m: nearer particles are discs of light. Default 1.5.
    pub focus_m: f64,
    /// Aperture, m: how large those discs are. Default 0.001.
    pub aperture_m: f64,
    /// Drift in the camera frame, m/s. Default a slow fall to the left.
    pub drift_m_per_s: [f64; 3],
}

impl Default for Snow {
    fn default() -> Self {
        Self {
            density_per_m3: 0.0,
            size_m: 0.0012,
            grey: 230.0,
            focus_m: 1.5,
            aperture_m: 0.001,
            drift_m_per_s: [-0.03, 0.02, 0.005],
        }
    }
}

impl Snow {
    pub(crate) fn validate(&self) -> Result<()> {
        within("snow.density_per_m3", self.density_per_m3, 0.0, 1e5, "per cubic metre between 0 and 100000")?;
        within("snow.size_m", self.size_m, 1e-5, 0.1, "metres between 0.00001 and 0.1")?;
        within("snow.grey", self.grey, 0.0, 1000.0, "grey levels between 0 and 1000")?;
        within("snow.focus_m", self.focus_m, 0.05, 1e3, "metres between 0.05 and 1000")?;
        within("snow.aperture_m", self.aperture_m, 0.0, 0.1, "metres between 0 and 0.1")?;
        self.drift_m_per_s.iter().try_for_each(|&v| within("snow.drift_m_per_s", v, -10.0, 10.0, "m/s within ±10"))
    }
}
