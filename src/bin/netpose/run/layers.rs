//! `layers.csv`: all nets of a frame, nearest first.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use net_log::{PoseRow, PosesCsv, RawFrame, RowStatus};

use super::folder::{columns, hanging, hanging_names, milliseconds};
use super::frames::Tracked;

/// Columns of a hanging net before `layer` and `followed`.
const SHEARED_AND_BENT: usize = 4;

/// Writes a row for each net of a frame.
pub struct LayersCsv(PosesCsv);

impl LayersCsv {
    /// A new file in the run's folder.
    pub fn create(dir: &Path) -> Result<Self> {
        let (first, behind): (Vec<_>, Vec<_>) = hanging_names().enumerate().partition(|(k, _)| *k < SHEARED_AND_BENT);
        let appended = first.into_iter().map(|(_, name)| name).chain(["layer", "followed"]);
        let appended: Vec<&str> = appended.chain(behind.into_iter().map(|(_, name)| name)).collect();
        Ok(Self(PosesCsv::create(&path(dir), &appended)?))
    }

    /// One frame; none of its rows says more than `poses.csv` where there is one net alone.
    pub fn write(&mut self, frame: &RawFrame, tracked: &Tracked) -> Result<()> {
        for (number, layer) in tracked.layers.iter().enumerate() {
            let mut appended = hanging(&layer.net).to_vec();
            let which = [number as f64, f64::from(u8::from(layer.followed))];
            appended.splice(SHEARED_AND_BENT..SHEARED_AND_BENT, which);
            self.0.write(&PoseRow {
                frame: frame.index,
                file: frame.name.to_string(),
                timestamp_ns: frame.timestamp_ns,
                status: RowStatus::Ok,
                probability: Some(layer.probability),
                net: Some(columns(&layer.net)),
                junctions: layer.followed.then_some(tracked.junctions.len() as u64),
                latency_ms: Some(milliseconds(tracked.latency)),
                appended,
            })?;
        }
        Ok(())
    }
}

/// Removes what an earlier run into the folder left.
pub fn forget(dir: &Path) -> Result<()> {
    let path = path(dir);
    match std::fs::remove_file(&path) {
        Err(why) if why.kind() != std::io::ErrorKind::NotFound => {
            Err(why).with_context(|| format!("cannot remove {}", path.display()))
        }
        _ => Ok(()),
    }
}

fn path(dir: &Path) -> PathBuf {
    dir.join("layers.csv")
}
