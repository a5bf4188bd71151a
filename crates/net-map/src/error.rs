/// What can be wrong with what a caller hands in, or with the tiles it keeps.
#[derive(Debug, thiserror::Error)]
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
    /// Frames that do not come in order.
    #[error("frame {frame} comes after frame {previous}")]
    Order {
        /// The frame that was given.
        frame: u32,
        /// The one before it.
        previous: u32,
    },
    /// Bytes that are no tile.
    #[error("{length} bytes are no tile of this version, which has {expected}")]
    Tile {
        /// Their number.
        length: usize,
        /// What it should be.
        expected: usize,
    },
    /// The store could not keep or fetch a tile.
    #[error("tile {key}: {source}")]
    Store {
        /// Which tile.
        key: crate::TileKey,
        /// Why.
        source: std::io::Error,
    },
    /// More missing twines than can be joined in memory: a net whose end was taken for a hole.
    #[error("more than {limit} missing twines")]
    TooManyMissing {
        /// The most that are joined.
        limit: usize,
    },
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;
