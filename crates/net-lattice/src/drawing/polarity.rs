//! Bright twine or dark.

/// Bright twine on dark water, or dark twine on bright water.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Polarity {
    /// Twine brighter than what is behind it.
    Bright,
    /// Twine darker than what is behind it.
    Dark,
}

impl Polarity {
    /// Both families alike, as they nearly always are.
    pub(crate) const ALIKE: [[Self; 2]; 2] = [[Self::Bright; 2], [Self::Dark; 2]];

    /// Cells from where the lock-in has a twine, as if it were bright, to where it is.
    pub(crate) fn offset(self) -> f32 {
        match self {
            Self::Bright => 0.0,
            Self::Dark => 0.5,
        }
    }

    pub(crate) fn sign(self) -> f32 {
        match self {
            Self::Bright => 1.0,
            Self::Dark => -1.0,
        }
    }
}

/// Contrast of both families, and how much of it is lost where they cross: twines alike are one there, a bright and a dark one nothing.
#[inline]
pub(crate) fn contrasts(polarity: [Polarity; 2]) -> ([f32; 2], f32) {
    let sign = polarity.map(Polarity::sign);
    (sign, 0.5 * (sign[0] + sign[1]))
}
