//! A log opened from a path, whatever its kind.

use std::num::NonZeroU64;
use std::path::{Path, PathBuf};

use net_geometry::Camera;

use crate::error::{Error, Result};
use crate::frame::RawFrame;
use crate::source::{self, Source};
use crate::time_order::TimeOrder;

/// What to read of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenOptions {
    /// Image topic of an MCAP; needed only where there are several, and refused for a folder of images, which has none.
    pub topic: Option<String>,
    /// Frames per second of an image folder that has no times, Hz. Default 10, as the command line promises.
    pub fps: f64,
    /// First time to read. Default: the log's start.
    pub from: Option<TimeBound>,
    /// Last time to read, included. Default: the log's end.
    pub to: Option<TimeBound>,
    /// Every how-manieth frame of those within `from` and `to` is read. Default 1: all.
    pub stride: NonZeroU64,
}

impl Default for OpenOptions {
    fn default() -> Self {
        Self { topic: None, fps: 10.0, from: None, to: None, stride: NonZeroU64::MIN }
    }
}

/// A time given by the user: `12.5` or `12.5s` are seconds after the log's first frame, a whole number of 16 digits or more,
/// or one with `ns` behind it, is ns since the Unix epoch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeBound {
    /// After the log's first frame that has a time, ns.
    AfterStart(i64),
    /// Since the Unix epoch, ns.
    Epoch(i64),
}

impl TimeBound {
    /// The bound as ns since the Unix epoch in a log that starts at `start_ns`.
    fn epoch_ns(self, start_ns: i64) -> i64 {
        match self {
            Self::AfterStart(ns) => start_ns.saturating_add(ns),
            Self::Epoch(ns) => ns,
        }
    }
}

impl std::str::FromStr for TimeBound {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = || Error::Value {
            field: "time",
            value: format!("{text:?}"),
            expected: "seconds after the first frame (12.5 or 12.5s), or nanoseconds since 1970 (1700000000123456789 or 5000000000ns)",
        };
        let trimmed = text.trim();
        if let Some(digits) = trimmed.strip_suffix("ns") {
            return digits.trim().parse().map(Self::Epoch).map_err(|_| wrong());
        }
        if trimmed.len() >= 16 && trimmed.bytes().all(|b| b.is_ascii_digit()) {
            return trimmed.parse().map(Self::Epoch).map_err(|_| wrong());
        }
        let seconds: f64 = trimmed.strip_suffix('s').unwrap_or(trimmed).parse().map_err(|_| wrong())?;
        if !(seconds.is_finite() && (0.0..9e9).contains(&seconds)) {
            return Err(wrong());
        }
        Ok(Self::AfterStart((seconds * 1e9).round() as i64))
    }
}

/// What kind of log it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LogKind {
    /// A folder of images.
    ImageFolder,
    /// One MCAP file, or a folder of them read as one.
    Mcap,
}

impl LogKind {
    /// The words used on screen.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::ImageFolder => "image folder",
            Self::Mcap => "MCAP",
        }
    }
}

/// Where the frames' times come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TimeSource {
    /// The file `timestamps.csv` beside the images.
    TimestampsCsv,
    /// File names that are whole nanoseconds.
    FileNames,
    /// Made up: frame number over this rate, Hz. To be said wherever results are shown.
    MadeUp {
        /// Frames per second.
        fps: f64,
    },
    /// The messages' headers; the time of logging where a header's is zero.
    Messages,
}

/// One topic of a log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TopicInfo {
    /// Its name.
    pub name: String,
    /// Message type, such as `sensor_msgs/msg/Image`.
    pub schema: String,
    /// Message encoding, such as `cdr`, `ros1`, `protobuf`, `json`.
    pub encoding: String,
    /// Number of messages, where the log tells it.
    pub messages: Option<u64>,
    /// Whether frames can be read from it.
    pub is_image: bool,
}

impl TopicInfo {
    /// `--topic NAME    # 250 x sensor_msgs/msg/Image`, to be pasted into a command line.
    pub fn option_line(&self) -> String {
        let count = self.messages.map_or_else(String::new, |n| format!("{n} x "));
        format!("  --topic {}    # {count}{}", self.name, self.schema)
    }
}

/// The camera that a log carries.
#[derive(Debug)]
pub struct CameraInLog {
    /// The topic it was found in.
    pub topic: String,
    /// The camera, or why what was found can't be used.
    pub camera: Result<Camera>,
}

/// What is known of a log before its frames are read.
#[derive(Debug)]
pub struct LogInfo {
    /// The path that was opened.
    pub path: PathBuf,
    /// What kind of log it is.
    pub kind: LogKind,
    /// All topics in order of their names; empty for an image folder.
    pub topics: Vec<TopicInfo>,
    /// The image topic that is read, `None` for an image folder or while none was chosen.
    pub topic: Option<String>,
    /// Number of frames in the whole log, where it tells it. `from`, `to` and `stride` are not considered.
    pub frames: Option<u64>,
    /// First and last time of the frames, ns since the Unix epoch, where the log tells them.
    pub span_ns: Option<(i64, i64)>,
    /// Where the times come from.
    pub times: TimeSource,
    /// Camera in the log, of the chosen topic's namespace first. `None` if there is none.
    pub camera: Option<CameraInLog>,
    /// A file `camera.yaml` beside the images, not read: for telling the user of it.
    pub camera_file: Option<PathBuf>,
}

/// A log, as an iterator over its frames in order. Bounded memory, however long the log.
pub struct Log {
    info: LogInfo,
    frames: TimeOrder<Box<dyn Source>>,
    selection: Selection,
}

impl std::fmt::Debug for Log {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Log").field("info", &self.info).finish_non_exhaustive()
    }
}

/// Opens the log at `path`; its kind is told by what is there.
///
/// # Errors
/// [`Error::NotALog`] and [`Error::Io`] name the path; [`Error::SeveralTopics`] lists the topics to choose from;
/// [`Error::Value`] for a frame rate that is not above zero, or a topic of a folder of images.
pub fn open(path: &Path, options: &OpenOptions) -> Result<Log> {
    let (info, source) = source::open(path, options)?;
    let selection = Selection { options: options.clone(), bounds: None, in_range: options.from.is_none(), taken: 0 };
    Ok(Log { info, frames: TimeOrder::new(source), selection })
}

/// What is in the log at `path`, without choosing a topic.
///
/// # Errors
/// As [`open`], but several image topics are not an error.
pub fn inspect(path: &Path, options: &OpenOptions) -> Result<LogInfo> {
    source::inspect(path, options)
}

impl Log {
    /// What is known of the log.
    pub fn info(&self) -> &LogInfo {
        &self.info
    }

    /// About how many frames will come, where the log tells it: for a progress bar.
    pub fn frames_expected(&self) -> Option<u64> {
        let OpenOptions { from, to, stride, .. } = &self.selection.options;
        let (first, last) = self.info.span_ns.unwrap_or((0, 0));
        let share = |b: &Option<TimeBound>, default: i64| {
            let time = b.map_or(default, |b| b.epoch_ns(first)).clamp(first, last);
            (time.abs_diff(first)) as f64 / last.abs_diff(first).max(1) as f64
        };
        let part = (share(to, last) - share(from, first)).max(0.0);
        // Without bounds the number is exact. Between them lie so many steps, and one frame more.
        let bounded = |n: u64| (n.saturating_sub(1) as f64 * part).round() as u64 + u64::from(n > 0);
        let frames = |n: u64| if from.is_none() && to.is_none() { n } else { bounded(n) };
        self.info.frames.map(|n| frames(n).div_ceil(stride.get()))
    }

    /// What was wrong with the log itself, as far as it has been read: cut off, a chunk that fails its checksum.
    /// Complete after the last frame. To be shown to the user.
    pub fn damage(&self) -> &[String] {
        self.frames.source().damage()
    }
}

impl Iterator for Log {
    type Item = RawFrame;

    fn next(&mut self) -> Option<RawFrame> {
        loop {
            let frame = self.frames.next()?;
            if let Some(from) = self.selection.set_bounds(&frame) {
                self.frames.source_mut().skip_before(from);
            }
            match self.selection.judge(&frame) {
                Choice::Take => return Some(frame),
                Choice::Skip => {}
                Choice::End => return None,
            }
        }
    }
}

/// `from`, `to` and `stride`.
struct Selection {
    options: OpenOptions,
    /// First and last time to take, ns, once the first time is known.
    bounds: Option<(i64, i64)>,
    /// Whether the last frame with a time lay within the bounds: frames without a time follow it.
    in_range: bool,
    /// Frames within the bounds so far.
    taken: u64,
}

enum Choice {
    Take,
    Skip,
    End,
}

impl Selection {
    /// Sets the bounds by the first frame that has a time; returns the first time to take then, if one was asked for.
    fn set_bounds(&mut self, frame: &RawFrame) -> Option<i64> {
        let time = frame.timestamp_ns.filter(|_| self.bounds.is_none())?;
        let bound = |b: Option<TimeBound>| b.map(|b| b.epoch_ns(time));
        let (from, to) = (bound(self.options.from), bound(self.options.to));
        self.bounds = Some((from.unwrap_or(i64::MIN), to.unwrap_or(i64::MAX)));
        from
    }

    fn judge(&mut self, frame: &RawFrame) -> Choice {
        if let (Some(time), Some((from, to))) = (frame.timestamp_ns, self.bounds) {
            self.in_range = (from..=to).contains(&time);
            // Times in order grow; one out of order says nothing of what follows.
            if time > to && !frame.is_refused() {
                return Choice::End;
            }
        }
        if !self.in_range {
            return Choice::Skip;
        }
        self.taken += 1;
        if (self.taken - 1).is_multiple_of(self.options.stride.get()) { Choice::Take } else { Choice::Skip }
    }
}
