/// What can be wrong with an image that a caller hands in.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
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
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;
