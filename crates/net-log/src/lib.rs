//! Readers of camera logs and calibrations, writers of results.

mod calibration;
mod error;
mod frame;
mod log;
mod message;
mod picture;
mod sink;
mod source;
mod time_order;

pub use calibration::{read_camera, read_camera_of};
pub use error::{Error, Result};
pub use frame::{FrameError, RawFrame, read_image};
pub use log::{CameraInLog, Log, LogInfo, LogKind, OpenOptions, TimeBound, TimeSource, TopicInfo, inspect, open};
pub use sink::{
    AnnotatedMcap, CAMERA_YAML, DEFAULT_CAMERA_FRAME, Example, ImageFolderWriter, ImageMcapWriter, Junctions,
    JunctionsParquet, LogSummary, NetColumns, POSES_HEADER, PoseRow, PoseRows, PosesCsv, Resumed, RowStatus, RunFiles,
    RunPaths, RunSummary, Timing, TimingHistogram, TrajectoryTum, UnreadableFrame, png, read_junctions, read_poses,
    write_camera_yaml, write_report,
};
