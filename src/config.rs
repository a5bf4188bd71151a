use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// How the pose is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// One lattice on one bent sheet, fitted to the whole picture and followed from frame to frame.
    #[default]
    Lattice,
    /// Spectra of sections, junctions of contours, motion by block matching: Strandenes 2023, the baseline of the literature.
    Thesis,
}

impl std::str::FromStr for Method {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name {
            "lattice" => Ok(Self::Lattice),
            "thesis" => Ok(Self::Thesis),
            _ => Err(Error::Method { name: name.to_owned() }),
        }
    }
}

/// Everything that can be set. Every field has a default that serves from 0.3 to 6 m.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// How the pose is found.
    pub method: Method,
    /// Look for a second net, before or behind the first, in every picture that shows one ([`crate::Estimate::layers`]). Default false: it
    /// takes as long as a cold start, in every frame. Of [`Method::Lattice`] alone.
    pub layers: bool,
    /// Of [`Method::Lattice`].
    pub lattice: net_lattice::Config,
    /// Of [`Method::Thesis`].
    pub thesis: net_fft::ThesisConfig,
}

impl Config {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`crate::Error`] names the field and the value.
    pub fn validate(&self) -> Result<()> {
        if self.layers && self.method == Method::Thesis {
            return Err(Error::LatticeOnly { field: "layers" });
        }
        self.lattice.validate()?;
        Ok(self.thesis.validate()?)
    }
}
