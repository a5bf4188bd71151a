use std::path::{Path, PathBuf};

/// What stops the reading of a log or the writing of results. A single frame that can't be read is a [`crate::FrameError`].
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was tried: `read`, `write`, `create`.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The path is neither a folder of images, nor an MCAP file, nor a folder of MCAP files.
    #[error("{} is not a log: {why}", path.display())]
    NotALog {
        /// The path that was given.
        path: PathBuf,
        /// What was found there instead.
        why: String,
    },
    /// The file is damaged beyond reading.
    #[error("{}: {why}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// A log of several cameras, and none was chosen.
    #[error("{} has {} image topics; choose one:\n{}", path.display(), lines.len(), lines.join("\n"))]
    SeveralTopics {
        /// The log.
        path: PathBuf,
        /// One ready-to-paste line `--topic NAME` for each, with what it holds after a `#`.
        lines: Vec<String>,
    },
    /// The topic that was asked for is not there, or holds no images.
    #[error("{} has no image topic {topic:?}{}{}", path.display(), if lines.is_empty() { "; it has none at all" } else { "; it has:\n" }, lines.join("\n"))]
    NoSuchTopic {
        /// The log.
        path: PathBuf,
        /// The topic that was asked for.
        topic: String,
        /// As in [`Error::SeveralTopics`].
        lines: Vec<String>,
    },
    /// A line of a table that can't be read.
    #[error("{}, line {line}: {why}", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// Counted from 1, the header included.
        line: u64,
        /// What is wrong with it.
        why: String,
    },
    /// A camera calibration that can't be used.
    #[error("{place}: {field} is {value}: {expected}")]
    Calibration {
        /// The file or topic.
        place: String,
        /// The field, as the file calls it.
        field: String,
        /// What it holds.
        value: String,
        /// What would have been accepted.
        expected: String,
    },
    /// An option or a value to be written is out of its range.
    #[error("{field} is {value}: {expected}")]
    Value {
        /// The option or column.
        field: &'static str,
        /// The value that was given.
        value: String,
        /// What would have been accepted.
        expected: &'static str,
    },
}

impl Error {
    /// For `map_err`: puts the path and what was tried to the system's error.
    pub(crate) fn io<'a>(action: &'static str, path: &'a Path) -> impl FnOnce(std::io::Error) -> Self + use<'a> {
        move |source| Self::Io { action, path: path.to_owned(), source }
    }
}

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;
