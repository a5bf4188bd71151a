use net_geometry as geometry;

/// What can be wrong with what a caller hands in. A picture without a net is not an error.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A size that cannot be transformed.
    #[error("a transform of {width}x{height} px makes no sense: both must be at least 1")]
    EmptySize {
        /// Width, px.
        width: usize,
        /// Height, px.
        height: usize,
    },
    /// An image of another size than the one that was planned for.
    #[error("planned for {expected_width}x{expected_height} px, got {width}x{height} px")]
    Size {
        /// Width that was planned for, px.
        expected_width: usize,
        /// Height that was planned for, px.
        expected_height: usize,
        /// Width that was given, px.
        width: usize,
        /// Height that was given, px.
        height: usize,
    },
    /// A parameter outside its range.
    #[error("{field} is {value}: {expected}")]
    Parameter {
        /// The parameter.
        field: &'static str,
        /// The value that was given.
        value: f64,
        /// What would have been accepted.
        expected: &'static str,
    },
    /// An image that makes no sense.
    #[error(transparent)]
    Image(#[from] net_image::Error),
    /// Geometry that does not work out: parallel wave vectors, a camera of another image size.
    #[error(transparent)]
    Geometry(#[from] geometry::Error),
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;
