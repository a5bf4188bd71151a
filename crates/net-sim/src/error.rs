/// What can be wrong with a scene that a caller hands in.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A number outside its range, or not finite.
    #[error("{field} is {value}: {expected}")]
    Value {
        /// The field, with the path to it.
        field: &'static str,
        /// The value that was given.
        value: f64,
        /// What would have been accepted.
        expected: &'static str,
    },
    /// A mesh, camera or plane that makes no sense.
    #[error(transparent)]
    Geometry(#[from] net_geometry::Error),
    /// A name that is in no list.
    #[error("no {what} is called {name:?}")]
    Name {
        /// The kind of thing that was looked for.
        what: &'static str,
        /// The name that was given.
        name: String,
    },
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Refuses numbers outside `[low, high]`, and NaN.
pub(crate) fn within(field: &'static str, value: f64, low: f64, high: f64, expected: &'static str) -> Result<()> {
    if value >= low && value <= high { Ok(()) } else { Err(Error::Value { field, value, expected }) }
}
