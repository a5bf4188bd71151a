/// What can be wrong with what a caller hands in. "No net" is a result, not an error.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// The image's size is not the camera's.
    #[error(transparent)]
    Geometry(#[from] net_geometry::Error),
    /// A parameter outside its range.
    #[error("{field} is {value}: {expected}")]
    Parameter {
        /// The field, as it is spelt in [`crate::Config`].
        field: &'static str,
        /// The value that was given.
        value: f64,
        /// What would have been accepted.
        expected: &'static str,
    },
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;
