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
        let names: Vec<&str> = hanging_names().collect();
        let (first, behind) = names.split_at(SHEARED_AND_BENT);
        Ok(Self(PosesCsv::create(&path(dir), &[first, &["layer", "followed"], behind].concat())?))
    }

    /// One frame; none of its rows says more than `poses.csv` where there is one net alone.
    pub fn write(&mut self, frame: &RawFrame, tracked: &Tracked) -> Result<()> {
        for (number, layer) in tracked.layers.iter().enumerate() {
            let hanging = hanging(&layer.net);
            let (first, behind) = hanging.split_at(SHEARED_AND_BENT);
            let which = [number as f64, f64::from(u8::from(layer.followed))];
            self.0.write(&PoseRow {
                frame: frame.index,
                file: frame.name.to_string(),
                timestamp_ns: frame.timestamp_ns,
                status: RowStatus::Ok,
                probability: Some(layer.probability),
                net: Some(columns(&layer.net)),
                junctions: layer.followed.then_some(tracked.junctions.len() as u64),
                latency_ms: Some(milliseconds(tracked.latency)),
                appended: [first, &which, behind].concat(),
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
