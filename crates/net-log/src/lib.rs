//! Readers of camera logs and calibrations, writers of results.

mod calibration;
mod error;
mod frame;
mod log;
mod picture;
mod sink;
mod source;
mod time_order;

pub use calibration::read_camera;
pub use error::{Error, Result};
pub use frame::{FrameError, RawFrame, read_image};
pub use log::{CameraInLog, Log, LogInfo, LogKind, OpenOptions, TimeBound, TimeSource, TopicInfo, inspect, open};
pub use sink::{NetColumns, POSES_HEADER, PoseRow, PosesCsv, Resumed, RowStatus, read_poses};
