//! `report.html`: one page that needs nothing beside it.

mod plots;

use std::path::Path;

use askama::Template;
use base64::Engine;

use crate::error::{Error, Result};
use crate::sink::poses::RowStatus;
use crate::sink::poses_reader::PoseRows;
use crate::sink::run::RunPaths;
use crate::sink::summary::{RunSummary, UnreadableFrame, replace};
use plots::{Plot, Series};

/// Unreadable frames that the page names.
const MAX_UNREADABLE: usize = 50;

/// A picture for the page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Example {
    /// What it shows.
    pub caption: String,
    /// A PNG file.
    pub png: Vec<u8>,
}

#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    summary: &'a RunSummary,
    warnings: Vec<String>,
    total: u64,
    /// Number and share by status.
    counts: Vec<(u64, String)>,
    medians: [String; 3],
    plots: Vec<Plot>,
    examples: Vec<Picture<'a>>,
    timings: Vec<(&'a str, [String; 5])>,
    unreadable: &'a [UnreadableFrame],
    more_unreadable: u64,
    command: String,
    config: String,
}

struct Picture<'a> {
    caption: &'a str,
    base64: String,
}

/// Writes `report.html` from the `poses.csv` in the run's folder.
///
/// # Errors
/// [`Error::Io`] names the path, [`Error::Table`] the line of `poses.csv`.
pub fn write_report(paths: &RunPaths, summary: &RunSummary, examples: &[Example]) -> Result<()> {
    let mut series = Series::default();
    for row in PoseRows::open(&paths.poses())?.into_iter().flatten() {
        series.push(&row?);
    }
    let html = page(&series, summary, examples).map_err(Error::io("write", &paths.report()))?;
    replace(&paths.report(), |temporary: &Path| std::fs::write(temporary, html).map_err(Error::io("write", temporary)))
}

fn page(series: &Series, summary: &RunSummary, examples: &[Example]) -> std::io::Result<String> {
    let statuses = [RowStatus::Ok, RowStatus::NoNet, RowStatus::Unreadable];
    let total = series.total();
    let share = |n: u64| if total == 0 { "-".to_owned() } else { format!("{:.1} %", 100.0 * n as f64 / total as f64) };
    let mut warnings = Vec::new();
    if !summary.finished {
        warnings.push("The run was stopped before the log's end; netpose run --resume goes on from here.".to_owned());
    }
    if summary.log.times.contains("made up") {
        warnings.push(format!("Times are made up: {}. Speeds and the time axis mean nothing else.", summary.log.times));
    }
    warnings.extend(summary.log.damage.iter().map(|d| format!("The log is damaged: {d}.")));
    let ms = |v: f64| format!("{v:.2}");
    let timings = summary
        .timing_ms
        .iter()
        .map(|(stage, t)| (stage.as_str(), [t.count.to_string(), ms(t.mean), ms(t.median), ms(t.p95), ms(t.max)]));
    let named = summary.unreadable.len().min(MAX_UNREADABLE);
    let picture = |e: &'_ Example| base64::engine::general_purpose::STANDARD.encode(&e.png);
    let both = serde_json::json!({ "camera": summary.camera, "config": summary.config });
    let page = Page {
        summary,
        warnings,
        total,
        counts: statuses.map(|s| series.count(s)).map(|n| (n, share(n))).into(),
        medians: series.medians(),
        plots: plots::all(series).map_err(std::io::Error::other)?,
        examples: examples.iter().map(|e| Picture { caption: &e.caption, base64: picture(e) }).collect(),
        timings: timings.collect(),
        unreadable: &summary.unreadable[..named],
        more_unreadable: series.count(RowStatus::Unreadable).saturating_sub(named as u64),
        command: summary.arguments.join(" "),
        config: serde_json::to_string_pretty(&both)?,
    };
    page.render().map_err(std::io::Error::other)
}
