//! Writers of results.

mod poses;

pub use poses::{NetColumns, POSES_HEADER, PoseRow, PosesCsv, Resumed, RowStatus, read_poses};
