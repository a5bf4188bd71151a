/// What can be wrong with an image that a caller hands in.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// The buffer is too short for the size and stride.
    #[error("an image of {width}x{height} px with stride {stride} takes {expected} values, the buffer has {got}")]
    BufferLength {
        /// Width, px.
        width: usize,
        /// Height, px.
        height: usize,
        /// Values from one row to the next.
        stride: usize,
        /// Values that are needed.
        expected: usize,
        /// Values that were given.
        got: usize,
    },
    /// The stride is shorter than a row, or the size is zero or too large to address.
    #[error("an image of {width}x{height} px with stride {stride} makes no sense")]
    Size {
        /// Width, px.
        width: usize,
        /// Height, px.
        height: usize,
        /// Values from one row to the next.
        stride: usize,
    },
    /// An image of another size than the one prepared for.
    #[error("the image is {width}x{height} px, prepared for {expected_width}x{expected_height} px")]
    SourceSize {
        /// Width, px.
        width: usize,
        /// Height, px.
        height: usize,
        /// Width prepared for, px.
        expected_width: usize,
        /// Height prepared for, px.
        expected_height: usize,
    },
    /// A parameter outside its range.
    #[error("{field} is {value}: {expected}")]
    Value {
        /// The parameter.
        field: &'static str,
        /// The value that was given.
        value: f64,
        /// What would have been accepted.
        expected: &'static str,
    },
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;
