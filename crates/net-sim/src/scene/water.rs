use serde::{Deserialize, Serialize};

use crate::error::{Result, within};

/// The water: what is seen where there is nothing, and what it does to light on its way (Jaffe 1990, McGlamery 1980, without
/// forward scatter, which is [`super::Sensor`]'s blur): `seen = grey exp(-c r) + veil (1 - exp(-c r))` at range `r`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Water {
    /// Brightness of open water, grey levels. Default 90.
    pub veil_grey: f64,
}

impl Default for Water {
    fn default() -> Self {
        Self { veil_grey: 90.0 }
    }
}

impl Water {
    pub(crate) fn validate(&self) -> Result<()> {
        within("water.veil_grey", self.veil_grey, 0.0, 1000.0, "grey levels between 0 and 1000")
    }
}
