//! Camera logs in, results out: the only crate that knows files.
//!
//! # Reading a log
//! [`open`] tells the kind of log by what is there and yields [`RawFrame`]s in order: index, name and time, not decoded yet.
//! [`RawFrame::decode`] may run in any thread, and gives grey pixels, 0 black to 255 white. Memory does not grow with the log.
//!
//! ```no_run
//! let mut log = net_log::open("dive.mcap".as_ref(), &net_log::OpenOptions::default())?;
//! for frame in log.by_ref() {
//!     match frame.decode() {
//!         Ok(image) => println!("{} {}x{}", frame.index, image.width(), image.height()),
//!         Err(why) => println!("{} {}: {why}", frame.index, frame.name),
//!     }
//! }
//! log.damage().iter().for_each(|d| eprintln!("{d}"));
//! # Ok::<(), net_log::Error>(())
//! ```
//!
//! # What is read, from where, how it fails
//! A log that can't be opened is an [`Error`]. A frame that can't be used is an item whose `decode` returns a [`FrameError`]: its index,
//! name and, if known, time stay, and the frames around it stand. What is wrong with the log itself is told by [`Log::damage`].
//!
//! | what | from | fails |
//! |---|---|---|
//! | frames of a folder | files that are images by ending or first bytes, in natural order, and those that `timestamps.csv` names | a file that is gone, cut off, no regular file, outside the folder, of unknown format or beyond 100 Mpx: that frame. No image at all: error |
//! | their times | `timestamps.csv` (`file,timestamp_ns`); or names that are whole nanoseconds; or frame number over `fps`, which [`TimeSource::MadeUp`] says | a line without a time, a file without a line, two times for a file: that frame. A table without the two columns, or that is no regular file: error |
//! | frames of an MCAP, or of a folder of them | ROS 2 and ROS 1 `Image`, `CompressedImage`; Foxglove `RawImage`, `CompressedImage` (protobuf, JSON); chunks zstd, lz4 or plain; messages zstd; with or without a summary | a message that does not parse, an encoding that is not known: that frame. A chunk whose checksum is wrong: its frames. A file cut off: read to its last whole message. Several image topics and none chosen: error that lists them |
//! | their times | the message's header; the time of logging where the header's is zero | beyond 2262: that frame |
//! | order of times | every kind of log | a time that does not come after that of the frame before: that frame; where one frame is ahead of all around it, it is that one |
//! | pictures | JPEG, PNG, TIFF, BMP, WebP, told by their bytes; 8 and 16 bits, grey, colour, alpha; raw pixels with any row step | cut off, or a size that is beyond the limit, before memory is asked for: that frame |
//! | cameras | ROS `camera_info` and Kalibr YAML ([`read_camera`]); `CameraInfo` and `CameraCalibration` in the log ([`LogInfo::camera`]), with binning, window and rectified images | unknown model, wrong number of coefficients, NaN, skew, zero focal length, a lens that takes nothing into the picture, never calibrated, several cameras: [`Error::Calibration`] names file or topic, field and value |
//! | results | `poses.csv`, `junctions.parquet`, `twines.parquet`, `run.json` ([`read_poses`], [`read_junctions`], [`read_twines`], [`RunSummary::read`]) | a row that does not parse: [`Error::Table`] with its line. A last line that was never finished is left out |
//!
//! # Writing results
//! [`RunFiles`] writes the folder of a run frame by frame, and goes on with one that was stopped. `poses.csv` is whole after every frame,
//! `junctions.parquet` and `twines.parquet` after every 256 at the most; [`RunFiles::finish`] derives `annotated.mcap`, [`write_report`] the page, and
//! [`RunSummary`] is `run.json`. `docs/files.md` describes them column by column. [`ImageFolderWriter`] and [`ImageMcapWriter`] write
//! logs that [`open`] reads back. Errors name the path.
//!
//! # Inside
//! A file's way: `source` (folder, MCAP) finds frames, `time_order` refuses those out of order, `log` selects; then, in any thread,
//! `message` takes the picture out of a message and `picture` or `message::raw` makes it grey. `calibration` is where every camera
//! passes, `sink` where results leave.

mod calibration;
mod error;
mod frame;
mod log;
mod message;
mod picture;
mod sink;
mod source;
mod time_order;

pub use calibration::{CAMERA_YAML, camera_beside, read_camera, read_camera_of};
pub use error::{Error, Result};
pub use frame::{FrameError, RawFrame, read_image};
pub use log::{CameraInLog, Log, LogInfo, LogKind, OpenOptions, TimeBound, TimeSource, TopicInfo, inspect, open};
pub use sink::{
    AnnotatedMcap, DEFAULT_CAMERA_FRAME, Example, FrameRow, Frames, FramesParquet, GrowthParquet, GrowthRow,
    ImageFolderWriter, ImageMcapWriter, Junctions, JunctionsParquet, Knots, LogSummary, NetColumns, POSES_HEADER,
    PoseRow, PoseRows, PosesCsv, Resumed, RowStatus, RunFiles, RunPaths, RunSummary, Timing, TimingHistogram,
    TrajectoryTum, Twines, TwinesParquet, UnreadableFrame, png, read_junctions, read_poses, read_twines,
    write_camera_yaml, write_report,
};
