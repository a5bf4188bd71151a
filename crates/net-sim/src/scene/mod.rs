//! What is in front of the camera, as plain data.
//!
//! Brightness is in grey levels, 0 black to 255 white; lengths in metres; angles in degrees (this is a file format), in the name.

mod net;
mod pose;
mod sensor;
mod water;

pub use net::{Extent, Layer, Net, Twine};
pub use pose::NetPose;
pub use sensor::Sensor;
pub use water::Water;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Everything in front of the camera at one moment, and how the sensor sees it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scene {
    /// The nets, nearest first. Empty: a picture without a net.
    pub layers: Vec<Layer>,
    /// The water between and behind them.
    pub water: Water,
    /// Blur and noise.
    pub sensor: Sensor,
}

impl Default for Scene {
    /// One light planar net that fills the view of the thesis's camera, 1.2 m away.
    fn default() -> Self {
        Self { layers: vec![Layer::default()], water: Water::default(), sensor: Sensor::default() }
    }
}

impl Scene {
    /// Refuses what cannot be drawn.
    ///
    /// # Errors
    /// [`Error::Value`] or [`Error::Geometry`] with the first field that is out of range.
    pub fn validate(&self) -> Result<()> {
        if self.layers.len() > 8 {
            let value = self.layers.len() as f64;
            return Err(Error::Value { field: "layers", value, expected: "at most 8 nets" });
        }
        for layer in &self.layers {
            layer.validate()?;
        }
        self.water.validate()?;
        self.sensor.validate()
    }
}
