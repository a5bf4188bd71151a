/// What can be wrong with what a caller hands in. A picture that cannot be followed is no error: see [`crate::Status`].
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A parameter outside its range.
    #[error("{field} is {value}: {expected}")]
    Value {
        /// The parameter, as the configuration calls it.
        field: &'static str,
        /// The value that was given.
        value: f64,
        /// What would have been accepted.
        expected: &'static str,
    },
    /// A picture of another size than the tracker, or its partner, was made for.
    #[error("the picture is {width}x{height} px, expected {expected_width}x{expected_height} px")]
    ImageSize {
        /// Width that was given, px.
        width: usize,
        /// Height that was given, px.
        height: usize,
        /// Width that was expected, px.
        expected_width: usize,
        /// Height that was expected, px.
        expected_height: usize,
    },
    /// Two lists that belong together, of unequal length.
    #[error("{what}: expected {expected} values, got {got}")]
    Length {
        /// Which list.
        what: &'static str,
        /// Values that were expected.
        expected: usize,
        /// Values that were given.
        got: usize,
    },
    /// An image buffer that makes no sense.
    #[error(transparent)]
    Image(#[from] net_image::Error),
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Refuses numbers outside `low..=high`, and NaN.
pub(crate) fn in_range(field: &'static str, value: f64, low: f64, high: f64, expected: &'static str) -> Result<()> {
    if value >= low && value <= high { Ok(()) } else { Err(Error::Value { field, value, expected }) }
}
