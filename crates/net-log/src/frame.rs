//! Frames as a log yields them: undecoded, in order, with index, name and time.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use net_image::Image;

use crate::message::ImageType;
use crate::picture;
use crate::source::TIMESTAMPS_CSV;

/// Why one frame can't be used. The log goes on behind it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// The file can't be read.
    #[error("cannot read it: {why}")]
    Read {
        /// What the system said.
        why: String,
    },
    /// The bytes are not a whole picture of a known format.
    #[error("{format}: {why}")]
    Decode {
        /// The format that the first bytes tell, or `unknown format`.
        format: &'static str,
        /// What the decoder said.
        why: String,
    },
    /// A picture so large that it is taken for damage.
    #[error("{width}x{height} px is beyond the limit of {} px a side and {} Mpx", picture::MAX_SIDE, picture::MAX_PIXELS / 1_000_000)]
    TooLarge {
        /// Width that the header names, px.
        width: u64,
        /// Height that the header names, px.
        height: u64,
    },
    /// A pixel encoding that is not known.
    #[error("image encoding {encoding:?} is not known; known are {known}")]
    Encoding {
        /// What the message says.
        encoding: String,
        /// All that would have been accepted.
        known: &'static str,
    },
    /// A raw image whose size, step and data do not fit together.
    #[error("{why}")]
    Layout {
        /// What does not fit, with the numbers.
        why: String,
    },
    /// A message that does not follow its schema.
    #[error("{schema}: {why}")]
    Message {
        /// The message type.
        schema: String,
        /// Where and how it ends or goes wrong.
        why: String,
    },
    /// The frame has no time.
    #[error("{why}")]
    NoTime {
        /// Where the time was looked for.
        why: String,
    },
    /// The frame's time does not come after that of the frame before it.
    #[error("its time, {timestamp_ns} ns{}, does not come after {previous_ns} ns, the time of frame {previous}", told_in(*line))]
    TimeOrder {
        /// This frame's time, ns.
        timestamp_ns: i64,
        /// Line of `timestamps.csv` that tells it, if it is told there.
        line: Option<u64>,
        /// The last frame that was in order.
        previous: u64,
        /// Its time, ns.
        previous_ns: i64,
    },
    /// The time is ahead of that of all frames around it.
    #[error("its time, {timestamp_ns} ns{}, is ahead of the frame after it, {next_ns} ns", told_in(*line))]
    TimeAhead {
        /// This frame's time, ns.
        timestamp_ns: i64,
        /// Line of `timestamps.csv` that tells it, if it is told there.
        line: Option<u64>,
        /// The time of the frame after it, ns.
        next_ns: i64,
    },
}

/// Where a time stands, in brackets behind it.
fn told_in(line: Option<u64>) -> String {
    line.map_or_else(String::new, |line| format!(" ({TIMESTAMPS_CSV}, line {line})"))
}

/// A frame that has been read or located, but not decoded: cheap to make in order, to be decoded in any thread.
#[derive(Debug, Clone)]
pub struct RawFrame {
    /// Number of the frame in the whole log, from 0; `from`, `to` and `stride` do not change it.
    pub index: u64,
    /// File name within an image folder, topic within an MCAP.
    pub name: Arc<str>,
    /// Time of exposure, ns since the Unix epoch. `None` only where [`RawFrame::decode`] fails.
    pub timestamp_ns: Option<i64>,
    /// Line of `timestamps.csv` that tells it.
    pub(crate) time_line: Option<u64>,
    pub(crate) payload: Payload,
}

/// Where a frame's picture is.
#[derive(Debug, Clone)]
pub(crate) enum Payload {
    /// An image file, not opened yet.
    File(PathBuf),
    /// A message.
    Message {
        /// What it is.
        kind: ImageType,
        /// Its bytes.
        data: Vec<u8>,
    },
    /// Already known not to be usable.
    Refused(FrameError),
}

impl RawFrame {
    /// Reads and decodes the picture to grey, 0 black to 255 white.
    ///
    /// # Errors
    /// [`FrameError`]: the frame is to be counted as unreadable, the log goes on.
    pub fn decode(&self) -> Result<Image<u8>, FrameError> {
        match &self.payload {
            Payload::File(path) => check_regular(path).map_err(failed).and_then(|()| read_image(path)),
            Payload::Message { kind, data } => kind.decode(data),
            Payload::Refused(error) => Err(error.clone()),
        }
    }

    /// Makes it unreadable, for a reason that only its neighbours could tell.
    pub(crate) fn refuse(&mut self, error: FrameError) {
        if !matches!(self.payload, Payload::Refused(_)) {
            self.payload = Payload::Refused(error);
        }
    }

    /// Whether it is known, without decoding it, that it can't be used.
    pub(crate) fn is_refused(&self) -> bool {
        matches!(self.payload, Payload::Refused(_))
    }
}

/// Reads and decodes one image file that belongs to no log, to grey, 0 black to 255 white.
///
/// # Errors
/// [`FrameError`] says what is wrong with the file; the caller knows its name.
pub fn read_image(path: &Path) -> Result<Image<u8>, FrameError> {
    picture::decode(&read(path)?)
}

/// A whole file, unless it is too large to be a picture.
fn read(path: &Path) -> Result<Vec<u8>, FrameError> {
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(failed)?;
    let length = file.metadata().map_err(failed)?.len();
    let too_long = |bytes: &str| FrameError::Read {
        why: format!("{bytes} bytes are more than the limit of {}", picture::MAX_BYTES),
    };
    if length > picture::MAX_BYTES {
        return Err(too_long(&length.to_string()));
    }
    // A pipe or a device tells no length.
    bytes.reserve(length as usize);
    file.take(picture::MAX_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > picture::MAX_BYTES { Err(too_long("its")) } else { Ok(bytes) }
}

fn failed(error: std::io::Error) -> FrameError {
    FrameError::Read { why: error.to_string() }
}

/// Refuses what is no regular file, unopened: to open a pipe waits for somebody who writes into it, and nothing can stop that.
pub(crate) fn check_regular(path: &Path) -> std::io::Result<()> {
    if std::fs::metadata(path)?.is_file() {
        return Ok(());
    }
    Err(std::io::Error::other("it is no regular file"))
}
