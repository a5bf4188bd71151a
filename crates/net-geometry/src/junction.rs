//! Junctions (knots) of the net in the picture.

use nalgebra::Vector2;

/// What is known of a junction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum JunctionState {
    /// Measured in this picture.
    #[default]
    Seen,
    /// Behind a fish or another object.
    Hidden,
    /// Overgrown.
    Fouled,
    /// All its twines are gone.
    Missing,
    /// Too faint to be measured, between others that were: where these have it.
    Inferred,
}

impl JunctionState {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Seen, Self::Hidden, Self::Fouled, Self::Missing, Self::Inferred];

    /// The word used in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Seen => "seen",
            Self::Hidden => "hidden",
            Self::Fouled => "fouled",
            Self::Missing => "missing",
            Self::Inferred => "inferred",
        }
    }
}

/// A junction of the net: where it is in the picture, and which one it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Junction {
    /// Pixel `(u, v)` of the image as it was read, lens distortion included.
    pub pixel: Vector2<f64>,
    /// Lattice indices `(i, j)` in the net frame; `None` while no pose has given it a name.
    pub index: Option<(i32, i32)>,
    /// One standard deviation of the pixel, px, each axis.
    pub sigma_px: f64,
    /// What is known of it.
    pub state: JunctionState,
}
