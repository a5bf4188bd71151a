use serde::{Deserialize, Serialize};

use crate::error::Result;

/// How the pose is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Spectra of sections, junctions of contours: Strandenes 2023.
    #[default]
    Thesis,
}

/// Everything that can be set. Every field has a default that serves from 0.3 to 6 m.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// How the pose is found.
    pub method: Method,
}

impl Config {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`crate::Error::Config`] names the field and the value.
    pub fn validate(&self) -> Result<()> {
        Ok(())
    }
}
