/// What can be wrong with what a caller hands in, and how a solve can end badly.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A parameter outside its range.
    #[error("{field} is {value}: {expected}")]
    Parameter {
        /// The parameter, as the configuration calls it.
        field: &'static str,
        /// The value that was given.
        value: f64,
        /// What would have been accepted.
        expected: &'static str,
    },
    /// A sample that makes no sense.
    #[error("sample {index}: {field} is {value}: {expected}")]
    Sample {
        /// Which sample, from 0.
        index: usize,
        /// Which part of it.
        field: &'static str,
        /// The value that was given.
        value: f64,
        /// What would have been accepted.
        expected: &'static str,
    },
    /// Times that do not grow.
    #[error(
        "sample {index}: timestamp_ns is {timestamp_ns}: later than that of the sample before, which is {previous_ns}"
    )]
    TimeOrder {
        /// Which sample, from 0.
        index: usize,
        /// Its time, ns.
        timestamp_ns: i64,
        /// The time of the one before, ns.
        previous_ns: i64,
    },
    /// The convex program could not be solved: no result is better than a doubtful one.
    #[error("samples {first} to {last}: the convex program ended with {status}")]
    Solver {
        /// First sample of the window.
        first: usize,
        /// Its last.
        last: usize,
        /// How the solver put it.
        status: String,
    },
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;
