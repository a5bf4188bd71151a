//! Writers of results, and readers of what they wrote.

mod annotated;
mod frames;
mod growth;
mod image_log;
mod poses;
mod poses_reader;
mod report;
mod run;
mod summary;
mod trajectory;

pub use annotated::{AnnotatedMcap, DEFAULT_CAMERA_FRAME, Knots};
pub use frames::{
    FrameRow, Frames, FramesParquet, Junctions, JunctionsParquet, Twines, TwinesParquet, read_junctions, read_twines,
};
pub use growth::{GrowthParquet, GrowthRow};
pub use image_log::{ImageFolderWriter, ImageMcapWriter, png, write_camera_yaml};
pub use poses::{NetColumns, POSES_HEADER, PoseRow, PosesCsv, Resumed, RowStatus};
pub use poses_reader::{PoseRows, read_poses};
pub use report::{Example, write_report};
pub use run::{RunFiles, RunPaths};
pub use summary::{LogSummary, RunSummary, Timing, TimingHistogram, UnreadableFrame};
pub use trajectory::TrajectoryTum;
