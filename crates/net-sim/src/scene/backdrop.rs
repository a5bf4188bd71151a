use serde::{Deserialize, Serialize};

use super::NetPose;
use crate::error::{Result, within};

/// A patterned plane behind everything, seen through the water: what could be taken for a net and is none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Backdrop {
    /// Its pattern. Default the seabed.
    pub texture: Texture,
    /// Where it is.
    pub pose: NetPose,
    /// Size of the pattern's repeat or grain, m. Default 0.05.
    pub scale_m: f64,
    /// Brightness on average, grey levels. Default 100.
    pub grey: f64,
    /// Contrast: about the standard deviation of a noise, or half the step of a sharp pattern, grey levels. Default 30.
    pub contrast_grey: f64,
    /// Which one of its kind it is. Default 0.
    pub seed: u64,
}

/// Patterns that are no net. The last five have what nets have in one respect and lack it in another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Texture {
    /// Sand, gravel and stones.
    #[default]
    Seabed,
    /// Noise of one grain size.
    Noise,
    /// Noise of one wavelength and no direction: a ring in the spectrum.
    Band,
    /// Bars of one direction: planks, corrugated sheet. One family of a net.
    Stripes,
    /// Bricks in running bond, twice as long as high.
    Bricks,
    /// Overlapping scales.
    Scales,
    /// Cells of random shape (Voronoi): foam, cracked mud.
    Cells,
    /// Six-sided meshes: a net, but of no mesh with two families of twines.
    Hexagons,
    /// Thin straight lines of all directions and places.
    Sticks,
    /// Gaussian noise with the spectrum of a square net: the right wave vectors and harmonics, but their phases wander
    /// independently.
    LatticeNoise,
    /// Two families of twines, each at random spacings.
    RandomGrid,
}

impl Texture {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Seabed,
        Self::Noise,
        Self::Band,
        Self::Stripes,
        Self::Bricks,
        Self::Scales,
        Self::Cells,
        Self::Hexagons,
        Self::Sticks,
        Self::LatticeNoise,
        Self::RandomGrid,
    ];
}

impl Default for Backdrop {
    fn default() -> Self {
        let pose = NetPose { range_m: 1.5, ..NetPose::default() };
        Self { texture: Texture::Seabed, pose, scale_m: 0.05, grey: 100.0, contrast_grey: 30.0, seed: 0 }
    }
}

impl Backdrop {
    pub(crate) fn validate(&self) -> Result<()> {
        self.pose.validate()?;
        within("backdrop.scale_m", self.scale_m, 1e-3, 100.0, "metres between 0.001 and 100")?;
        within("backdrop.grey", self.grey, 0.0, 1000.0, "grey levels between 0 and 1000")?;
        within("backdrop.contrast_grey", self.contrast_grey, -1000.0, 1000.0, "grey levels within ±1000")
    }
}
