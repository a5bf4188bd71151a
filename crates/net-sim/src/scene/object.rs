use serde::{Deserialize, Serialize};

use crate::error::{Result, within};

/// Something in the water besides nets: a flat outline that faces the camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Object {
    /// What it is. Default a fish.
    pub kind: Kind,
    /// Depth along the optical axis, m; it hides what is deeper. Default 0.8.
    pub range_m: f64,
    /// Its middle in the camera frame, m to the right. Default 0.
    pub x_m: f64,
    /// Its middle in the camera frame, m down. Default 0.
    pub y_m: f64,
    /// Direction of its long side in the picture, from u towards v, degrees. Default 0.
    pub turn_deg: f64,
    /// Long side, m. Default 0.45.
    pub length_m: f64,
    /// Short side, m; of a ladder its width, of a rope its diameter. Default 0.11.
    pub width_m: f64,
    /// Brightness, grey levels. Default 60.
    pub grey: f64,
    /// Contrast of its pattern: share. Default 0.5.
    pub contrast: f64,
    /// How it moves in the camera frame, m/s. Default still.
    pub velocity_m_per_s: [f64; 3],
    /// Which one of its kind it is: bends and spots follow from it. Default 0.
    pub seed: u64,
}

/// What an object is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A salmon: dark back, light belly, spots; it swims by bending.
    #[default]
    Fish,
    /// A laid rope with its diagonal strands.
    Rope,
    /// Two rails and rungs.
    Ladder,
    /// A blade of kelp that sways.
    Kelp,
    /// A plain straight rod or cable.
    Rod,
}

impl Default for Object {
    fn default() -> Self {
        Self {
            kind: Kind::Fish,
            range_m: 0.8,
            x_m: 0.0,
            y_m: 0.0,
            turn_deg: 0.0,
            length_m: 0.45,
            width_m: 0.11,
            grey: 60.0,
            contrast: 0.5,
            velocity_m_per_s: [0.0; 3],
            seed: 0,
        }
    }
}

impl Object {
    pub(crate) fn validate(&self) -> Result<()> {
        within("objects.range_m", self.range_m, 0.05, 1e3, "metres between 0.05 and 1000")?;
        within("objects.x_m", self.x_m, -1e3, 1e3, "metres within ±1000")?;
        within("objects.y_m", self.y_m, -1e3, 1e3, "metres within ±1000")?;
        within("objects.turn_deg", self.turn_deg, -360.0, 360.0, "degrees within ±360")?;
        within("objects.length_m", self.length_m, 1e-3, 1e3, "metres between 0.001 and 1000")?;
        within("objects.width_m", self.width_m, 1e-4, 1e3, "metres between 0.0001 and 1000")?;
        within("objects.grey", self.grey, 0.0, 1000.0, "grey levels between 0 and 1000")?;
        within("objects.contrast", self.contrast, 0.0, 1.0, "a share between 0 and 1")?;
        self.velocity_m_per_s
            .iter()
            .try_for_each(|&v| within("objects.velocity_m_per_s", v, -10.0, 10.0, "m/s within ±10"))
    }
}
