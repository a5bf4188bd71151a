/// What stops an estimate. A picture without a net is not an error: see [`crate::Status`].
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Camera, mesh or picture size.
    #[error(transparent)]
    Geometry(#[from] net_geometry::Error),
    /// The image buffer.
    #[error(transparent)]
    Image(#[from] net_image::Error),
    /// A method that does not exist.
    #[error("method {name:?}: there is thesis")]
    Method {
        /// The name that was given.
        name: String,
    },
    /// A parameter out of its range.
    #[error("configuration: {field} is {value}: {expected}")]
    Config {
        /// The parameter, with the section it is in.
        field: &'static str,
        /// The value that was given.
        value: f64,
        /// What would have been accepted.
        expected: &'static str,
    },
    /// A time that does not come after the one before.
    #[error("frame time {timestamp_ns} ns does not come after the frame before, {previous_ns} ns")]
    TimeOrder {
        /// The time that was given, ns.
        timestamp_ns: i64,
        /// The time of the frame before, ns.
        previous_ns: i64,
    },
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;
