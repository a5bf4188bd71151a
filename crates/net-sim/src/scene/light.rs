use serde::{Deserialize, Serialize};

use crate::error::{Result, within};

/// The light on nets and objects, and how the lens passes it on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Light {
    /// Where it comes from in the picture: angle from u towards v, degrees. Default -90: from above.
    pub from_deg: f64,
    /// How much more there is at that side of the picture than in the middle, and less at the other: share. Default 0.
    pub gradient: f64,
    /// Share of the light that the vehicle's own lamps give: brightest in the middle of the picture, falling off with the square
    /// of the distance from 1 m. Default 0.
    pub lamp: f64,
    /// Half width of the lamps' beam, degrees. Default 25.
    pub lamp_beam_deg: f64,
    /// Contrast of the moving light that waves focus onto the net. Default 0; near the surface 0.3 and more.
    pub caustic: f64,
    /// Size of that pattern, m. Default 0.25.
    pub caustic_m: f64,
    /// All light together swells and fades with time by this share. Default 0.
    pub flicker: f64,
    /// Share of the light that the lens loses in the corners of the picture, after all else. Default 0.
    pub vignette: f64,
}

impl Default for Light {
    fn default() -> Self {
        Self {
            from_deg: -90.0,
            gradient: 0.0,
            lamp: 0.0,
            lamp_beam_deg: 25.0,
            caustic: 0.0,
            caustic_m: 0.25,
            flicker: 0.0,
            vignette: 0.0,
        }
    }
}

impl Light {
    pub(crate) fn validate(&self) -> Result<()> {
        within("light.from_deg", self.from_deg, -360.0, 360.0, "degrees within ±360")?;
        within("light.gradient", self.gradient, -1.0, 1.0, "a share within ±1")?;
        within("light.lamp", self.lamp, 0.0, 1.0, "a share between 0 and 1")?;
        within("light.lamp_beam_deg", self.lamp_beam_deg, 1.0, 180.0, "degrees between 1 and 180")?;
        within("light.caustic", self.caustic, 0.0, 1.0, "a share between 0 and 1")?;
        within("light.caustic_m", self.caustic_m, 0.01, 100.0, "metres between 0.01 and 100")?;
        within("light.flicker", self.flicker, 0.0, 1.0, "a share between 0 and 1")?;
        within("light.vignette", self.vignette, 0.0, 1.0, "a share between 0 and 1")
    }
}
