//! `run.json`: what was run, on what, and how it went.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::sink::poses::RowStatus;

/// Frames that are named one by one in [`RunSummary::unreadable`]; the rest is only counted.
const MAX_NAMED: usize = 1000;

/// Contents of `run.json`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct RunSummary {
    /// Version of netpose.
    pub version: String,
    /// Whether the log was read to its end: `false` while the run goes on, and after a stop.
    pub finished: bool,
    /// Command line, as it was given.
    pub arguments: Vec<String>,
    /// What was read.
    pub log: LogSummary,
    /// Camera: `width`, `height`, `fx`, ... as the caller puts it.
    pub camera: serde_json::Value,
    /// Mesh, in the words of `--cell`.
    pub mesh: String,
    /// The configuration in effect, every field of it.
    pub config: serde_json::Value,
    /// Frames by status.
    pub frames: BTreeMap<String, u64>,
    /// The first thousand frames that could not be read.
    pub unreadable: Vec<UnreadableFrame>,
    /// Time per frame by stage, ms.
    pub timing_ms: BTreeMap<String, Timing>,
    /// Wall-clock time of the run, s; of the last one, if it was resumed.
    pub elapsed_s: f64,
}

/// The log of a run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct LogSummary {
    /// The path that was given.
    pub path: String,
    /// What kind of log it is.
    pub kind: String,
    /// Image topic, of an MCAP.
    pub topic: Option<String>,
    /// Frames in the whole log, where it tells.
    pub frames: Option<u64>,
    /// Which part was read: `all`, or the bounds and the stride. A run is resumed only with the same.
    pub part: String,
    /// Where the times come from; says so if they are made up.
    pub times: String,
    /// What was wrong with the log itself.
    pub damage: Vec<String>,
}

/// A frame that could not be read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnreadableFrame {
    /// Number in the log.
    pub frame: u64,
    /// File or topic.
    pub file: String,
    /// Why.
    pub why: String,
}

/// How long something took, ms.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Timing {
    /// How often.
    pub count: u64,
    /// Mean.
    pub mean: f64,
    /// Half were faster.
    pub median: f64,
    /// 95 of 100 were faster.
    pub p95: f64,
    /// The slowest.
    pub max: f64,
}

impl RunSummary {
    /// Counts a frame.
    pub fn count(&mut self, status: RowStatus) {
        *self.frames.entry(status.as_str().to_owned()).or_default() += 1;
    }

    /// Frames of a status.
    pub fn frames_of(&self, status: RowStatus) -> u64 {
        self.frames.get(status.as_str()).copied().unwrap_or(0)
    }

    /// Names a frame that could not be read, unless a thousand are named already.
    pub fn name_unreadable(&mut self, frame: u64, file: &str, why: &dyn std::fmt::Display) {
        if self.unreadable.len() < MAX_NAMED {
            self.unreadable.push(UnreadableFrame { frame, file: file.to_owned(), why: why.to_string() });
        }
    }

    /// Writes `run.json` in one step: whoever reads it sees the old one or the new one.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self).map_err(|e| Error::io("write", path)(e.into()))?;
        replace(path, |temporary| std::fs::write(temporary, text + "\n").map_err(Error::io("write", temporary)))
    }

    /// Reads a `run.json`.
    ///
    /// # Errors
    /// [`Error::Io`] and [`Error::Damaged`] name the path.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Error::io("read", path))?;
        serde_json::from_str(&text).map_err(|e| Error::Damaged { path: path.to_owned(), why: e.to_string() })
    }
}

/// Writes a file beside `path`, then puts it in its place. Where that fails (a full disk), `path` stays as it was, and nothing beside it.
pub(crate) fn replace(path: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".new");
    let temporary = path.with_file_name(name);
    let done = write(&temporary).and_then(|()| std::fs::rename(&temporary, path).map_err(Error::io("write", path)));
    if done.is_err() {
        // It may never have been there; the first error is the one to tell.
        let _ = std::fs::remove_file(&temporary);
    }
    done
}

/// Collects times in bounded memory: a histogram whose steps are 2 % wide, from 1 µs to about 3 hours.
#[derive(Debug, Clone, PartialEq)]
pub struct TimingHistogram {
    counts: Vec<u64>,
    count: u64,
    sum_ms: f64,
    max_ms: f64,
}

/// Width of a step of the histogram, as a ratio.
const STEP: f64 = 1.02;
/// Shortest time that is told from zero, ms.
const SHORTEST_MS: f64 = 1e-3;
/// Steps: 1e-3 ms * 1.02^1163 is 1e7 ms.
const STEPS: usize = 1164;

impl Default for TimingHistogram {
    fn default() -> Self {
        Self { counts: vec![0; STEPS], count: 0, sum_ms: 0.0, max_ms: 0.0 }
    }
}

impl TimingHistogram {
    /// Adds a time, ms. What is not finite or below zero is left out.
    pub fn add(&mut self, ms: f64) {
        if !(ms.is_finite() && ms >= 0.0) {
            return;
        }
        // Negative values become 0 in the conversion.
        let step = ((ms / SHORTEST_MS).ln() / STEP.ln()) as usize;
        self.counts[step.min(STEPS - 1)] += 1;
        self.count += 1;
        self.sum_ms += ms;
        self.max_ms = self.max_ms.max(ms);
    }

    /// The time that a share of all times stays below, ms, to within 1 %.
    pub fn quantile(&self, share: f64) -> f64 {
        let wanted = (share.clamp(0.0, 1.0) * self.count as f64).ceil().max(1.0) as u64;
        let mut seen = 0;
        let step = self.counts.iter().position(|&n| {
            seen += n;
            seen >= wanted
        });
        step.map_or(0.0, |s| (SHORTEST_MS * STEP.powf(s as f64 + 0.5)).min(self.max_ms))
    }

    /// Summary of all times.
    pub fn timing(&self) -> Timing {
        let mean = if self.count == 0 { 0.0 } else { self.sum_ms / self.count as f64 };
        Timing { count: self.count, mean, median: self.quantile(0.5), p95: self.quantile(0.95), max: self.max_ms }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_right_to_a_percent() {
        let mut histogram = TimingHistogram::default();
        (1..=1000).for_each(|i| histogram.add(f64::from(i) * 0.1));
        histogram.add(f64::NAN);
        histogram.add(-1.0);
        let timing = histogram.timing();
        assert_eq!((timing.count, timing.max), (1000, 100.0));
        assert!((timing.mean - 50.05).abs() < 1e-9, "{timing:?}");
        // Half of a step's width, which is 2 %, and a little for the value next to it.
        for (found, truth) in [(timing.median, 50.0), (timing.p95, 95.0), (histogram.quantile(0.0), 0.1)] {
            assert!((found / truth - 1.0).abs() < 0.012, "{found} {truth}");
        }
        let mut extremes = TimingHistogram::default();
        [0.0, 1e300].into_iter().for_each(|ms| extremes.add(ms));
        assert_eq!((extremes.quantile(1.0) > 9e6, extremes.quantile(0.5) <= 0.0011), (true, true));
        assert_eq!(TimingHistogram::default().timing(), Timing::default());
    }

    #[test]
    fn run_json_reads_back() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("run.json");
        let mut summary = RunSummary { version: "1.2.3".to_owned(), mesh: "50mm".to_owned(), ..RunSummary::default() };
        summary.count(RowStatus::Ok);
        summary.count(RowStatus::Unreadable);
        (0..2000).for_each(|i| summary.name_unreadable(i, "a.png", &"torn"));
        summary.config = serde_json::json!({"method": "thesis"});
        summary.write(&path).expect("written");
        let back = RunSummary::read(&path).expect("read");
        assert_eq!(back, summary);
        assert_eq!(
            (back.frames_of(RowStatus::Ok), back.frames_of(RowStatus::NoNet), back.unreadable.len()),
            (1, 0, 1000)
        );
        assert_eq!(std::fs::read_dir(dir.path()).expect("the folder").count(), 1, "nothing is left beside it");
        let text = summary.write(Path::new("/nowhere/run.json")).expect_err("no folder").to_string();
        assert!(text.starts_with("cannot write /nowhere/run.json"), "{text}");
    }
}
