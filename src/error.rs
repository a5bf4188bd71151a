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
    #[error("method {name:?}: there are lattice and thesis")]
    Method {
        /// The name that was given.
        name: String,
    },
    /// Something that only the lattice can tell was asked of another method.
    #[error("{field} goes with method lattice only, and method is thesis")]
    LatticeOnly {
        /// What was asked for.
        field: &'static str,
    },
    /// The lattice estimator.
    #[error(transparent)]
    Lattice(#[from] net_lattice::Error),
    /// The thesis's estimator.
    #[error(transparent)]
    Thesis(#[from] net_fft::Error),
    /// The block-matching tracker.
    #[error(transparent)]
    Flow(#[from] net_flow::Error),
    /// The junction detectors.
    #[error(transparent)]
    Junction(#[from] net_junction::Error),
    /// A prior that is no motion.
    #[error("prior: {what}")]
    Prior {
        /// What is wrong with it.
        what: String,
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
