//! What is in front of the camera, as plain data: every struct has a default, says its units in its names, and reads from TOML or
//! JSON with any part left out.
//!
//! Brightness is in grey levels, 0 black to 255 white; lengths in metres; angles in degrees, since this is a file format.

mod backdrop;
mod light;
mod net;
mod object;
mod pose;
mod sensor;
mod surface;
mod water;
mod wear;

pub use backdrop::{Backdrop, Texture};
pub use light::Light;
pub use net::{Extent, Layer, Net, Twine};
pub use object::{Kind, Object};
pub use pose::NetPose;
pub use sensor::{Motion, Sensor};
pub use surface::{Surface, Wave};
pub use water::{Snow, Water};
pub use wear::{Growth, Hole};

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, within};

/// Everything in front of the camera at one moment, and how the sensor sees it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scene {
    /// The nets, nearest first. Empty: a picture without a net.
    pub layers: Vec<Layer>,
    /// A patterned plane behind everything. Default none: open water.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub backdrop: Option<Backdrop>,
    /// Fish, ropes and the like.
    pub objects: Vec<Object>,
    /// The water between and behind them.
    pub water: Water,
    /// Particles in it.
    pub snow: Snow,
    /// The light on them.
    pub light: Light,
    /// Blur and noise.
    pub sensor: Sensor,
    /// How the camera moves during the exposure.
    pub motion: Motion,
    /// When it is, s: fish, snow and flickering light move with it. Default 0.
    pub time_s: f64,
    /// Which water it is: clouds, snow and caustics follow from it. Default 0.
    pub seed: u64,
}

impl Default for Scene {
    /// One light planar net that fills the view, 1.2 m away, in clear calm water.
    fn default() -> Self {
        Self { layers: vec![Layer::default()], ..Self::empty() }
    }
}

impl Scene {
    /// Clear calm water without anything in it.
    pub fn empty() -> Self {
        Self {
            layers: Vec::new(),
            backdrop: None,
            objects: Vec::new(),
            water: Water::default(),
            snow: Snow::default(),
            light: Light::default(),
            sensor: Sensor::default(),
            motion: Motion::default(),
            time_s: 0.0,
            seed: 0,
        }
    }

    /// Refuses what cannot be drawn.
    ///
    /// # Errors
    /// [`Error::Value`] or [`Error::Geometry`] with the first field that is out of range.
    pub fn validate(&self) -> Result<()> {
        if self.layers.len() > 8 {
            let value = self.layers.len() as f64;
            return Err(Error::Value { field: "layers", value, expected: "at most 8 nets" });
        }
        if self.objects.len() > 1000 {
            let value = self.objects.len() as f64;
            return Err(Error::Value { field: "objects", value, expected: "at most 1000 objects" });
        }
        self.layers.iter().try_for_each(Layer::validate)?;
        self.backdrop.iter().try_for_each(Backdrop::validate)?;
        self.objects.iter().try_for_each(Object::validate)?;
        self.water.validate()?;
        self.snow.validate()?;
        self.light.validate()?;
        self.sensor.validate()?;
        self.motion.validate()?;
        within("time_s", self.time_s, -1e9, 1e9, "seconds within ±1e9")
    }
}
