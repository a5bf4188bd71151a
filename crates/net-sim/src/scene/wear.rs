use serde::{Deserialize, Serialize};

use crate::error::{Result, within};

/// A torn place: every twine whose middle is inside this ellipse is broken. Stubs of random length dangle from the knots that stay.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Hole {
    /// Centre along the first mesh direction, cells. Default 0.5: the middle of cell `(0, 0)`.
    pub i: f64,
    /// Centre along the second mesh direction, cells. Default 0.5.
    pub j: f64,
    /// Half axis along the first mesh direction, cells. Default 1: up to 4 twines.
    pub radius_i: f64,
    /// Half axis along the second mesh direction, cells. Default 1.
    pub radius_j: f64,
}

impl Default for Hole {
    fn default() -> Self {
        Self { i: 0.5, j: 0.5, radius_i: 1.0, radius_j: 1.0 }
    }
}

impl Hole {
    /// Whether `(i, j)`, cells, is inside.
    pub(crate) fn contains(&self, i: f64, j: f64) -> bool {
        ((i - self.i) / self.radius_i).powi(2) + ((j - self.j) / self.radius_j).powi(2) < 1.0
    }

    pub(crate) fn validate(&self) -> Result<()> {
        within("net.holes.i", self.i, -1e5, 1e5, "cells within ±100000")?;
        within("net.holes.j", self.j, -1e5, 1e5, "cells within ±100000")?;
        within("net.holes.radius_i", self.radius_i, 0.1, 1e4, "cells between 0.1 and 10000")?;
        within("net.holes.radius_j", self.radius_j, 0.1, 1e4, "cells between 0.1 and 10000")
    }
}

/// What grows on a net: tufts of weed and mussels on the twines, in patches.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Growth {
    /// Share of twine pieces that carry a tuft, on average. Default 0.
    pub density: f64,
    /// Diameter of a tuft, m, on average. Default 0.012.
    pub size_m: f64,
    /// Brightness, grey levels. Default 45: brown weed.
    pub grey: f64,
    /// How uneven it is: 0 evenly spread, 1 in patches with clean net between. Default 0.7.
    pub patchiness: f64,
    /// Size of a patch, m. Default 0.4.
    pub patch_m: f64,
}

impl Default for Growth {
    fn default() -> Self {
        Self { density: 0.0, size_m: 0.012, grey: 45.0, patchiness: 0.7, patch_m: 0.4 }
    }
}

impl Growth {
    pub(crate) fn validate(&self) -> Result<()> {
        within("net.growth.density", self.density, 0.0, 1.0, "a share between 0 and 1")?;
        within("net.growth.size_m", self.size_m, 1e-4, 1.0, "metres between 0.0001 and 1")?;
        within("net.growth.grey", self.grey, 0.0, 1000.0, "grey levels between 0 and 1000")?;
        within("net.growth.patchiness", self.patchiness, 0.0, 1.0, "between 0 and 1")?;
        within("net.growth.patch_m", self.patch_m, 0.01, 100.0, "metres between 0.01 and 100")
    }
}
