//! `report.html`: one page that needs nothing beside it.

mod plots;

use std::path::Path;

use askama::Template;
use base64::Engine;

use crate::error::{Error, Result};
use crate::sink::poses::{POSES_HEADER, RowStatus};
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
    /// Last part of the log's path.
    name: &'a str,
    warnings: Vec<String>,
    /// What it is, its value, and a remark.
    figures: Vec<(&'static str, String, String)>,
    camera: String,
    plots: Vec<Plot>,
    examples: Vec<Picture<'a>>,
    timings: Vec<(&'a str, [String; 5])>,
    latencies: Plot,
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
    if let Some(rows) = PoseRows::open(&paths.poses())? {
        let track = rows.header().iter().skip(POSES_HEADER.split(',').count()).position(|name| name == "track");
        for row in rows {
            let row = row?;
            let track = track.and_then(|at| row.appended.get(at)).filter(|t| t.is_finite()).map(|&t| t as u32);
            series.push(&row, track);
        }
    }
    let html = page(&series, summary, examples).map_err(Error::io("write", &paths.report()))?;
    replace(&paths.report(), |temporary: &Path| std::fs::write(temporary, html).map_err(Error::io("write", temporary)))
}

fn page(series: &Series, summary: &RunSummary, examples: &[Example]) -> std::io::Result<String> {
    let mut warnings = Vec::new();
    if !summary.finished {
        warnings.push("The run was stopped before the log's end; netpose run --resume goes on from here.".to_owned());
    }
    if summary.log.times.contains("made up") {
        warnings.push(format!("Times are made up: {}. Speeds and the time axis mean nothing else.", summary.log.times));
    }
    warnings.extend(summary.log.damage.iter().map(|d| format!("The log is damaged: {d}.")));
    let counts = series.number_of_counts();
    if counts > 1 {
        warnings.push(format!(
            "The count of cells was started anew {}: places along the net can be compared within one count only.",
            if counts == 2 { "once".to_owned() } else { format!("{} times", counts - 1) }
        ));
    }
    let ms = |v: f64| format!("{v:.2}");
    let timings = summary.timing_ms.iter().map(|(stage, t)| {
        (stage_in_words(stage), [t.count.to_string(), ms(t.mean), ms(t.median), ms(t.p95), ms(t.max)])
    });
    let named = summary.unreadable.len().min(MAX_UNREADABLE);
    let picture = |e: &'_ Example| base64::engine::general_purpose::STANDARD.encode(&e.png);
    let both = serde_json::json!({ "camera": summary.camera, "config": summary.config });
    let name = summary.log.path.trim_end_matches(['/', '\\']);
    let page = Page {
        summary,
        name: name.rsplit(['/', '\\']).next().unwrap_or(name),
        warnings,
        figures: figures(series),
        camera: camera_in_words(&summary.camera),
        plots: plots::all(series).map_err(std::io::Error::other)?,
        latencies: plots::latencies(series).map_err(std::io::Error::other)?,
        examples: examples.iter().map(|e| Picture { caption: &e.caption, base64: picture(e) }).collect(),
        timings: timings.collect(),
        unreadable: &summary.unreadable[..named],
        more_unreadable: series.count(RowStatus::Unreadable).saturating_sub(named as u64),
        command: summary.arguments.join(" "),
        config: serde_json::to_string_pretty(&both)?,
    };
    page.render().map_err(std::io::Error::other)
}

/// The run in a few figures.
fn figures(series: &Series) -> Vec<(&'static str, String, String)> {
    let total = series.total();
    let share = |status| {
        let n = series.count(status);
        let percent = if total == 0 { "-".to_owned() } else { format!("{:.1} %", 100.0 * n as f64 / total as f64) };
        (n.to_string(), percent)
    };
    let spread = |values: &[f64], unit: &str, digits: usize| {
        let text = |v: f64| format!("{v:.digits$}");
        plots::extent(values).map_or_else(
            || ("-".to_owned(), String::new()),
            |[least, middle, most]| {
                (format!("{} {unit}", text(middle)), format!("median; {} to {} {unit}", text(least), text(most)))
            },
        )
    };
    let millimetres: Vec<f64> = series.sigma_range.iter().map(|s| 1e3 * s).collect();
    let (ok, no_net, unreadable) = (share(RowStatus::Ok), share(RowStatus::NoNet), share(RowStatus::Unreadable));
    let (range, sigma, tilt) =
        (spread(&series.range, "m", 3), spread(&millimetres, "mm", 2), spread(&series.tilt, "°", 1));
    let latency = spread(&series.latency, "ms", 1);
    let along = format!("along the net, in {}", if series.number_of_counts() == 1 { "one count" } else { "pieces" });
    vec![
        ("Frames", total.to_string(), format!("over {:.1} s", series.duration())),
        ("With a pose", ok.0, ok.1),
        ("Without a net", no_net.0, no_net.1),
        ("Unreadable", unreadable.0, unreadable.1),
        ("Range", range.0, range.1),
        ("Sigma of the range", sigma.0, sigma.1),
        ("Tilt", tilt.0, tilt.1),
        ("Way", if ok_any(series) { format!("{:.2} m", series.way()) } else { "-".to_owned() }, along),
        ("Time for a pose", latency.0, latency.1),
    ]
}

fn ok_any(series: &Series) -> bool {
    series.count(RowStatus::Ok) > 0
}

/// `848 x 480 px, fx 600.0 px, plumb_bob`, as far as `run.json` tells.
fn camera_in_words(camera: &serde_json::Value) -> String {
    let mut words = Vec::new();
    if let (Some(width), Some(height)) = (camera["width"].as_u64(), camera["height"].as_u64()) {
        words.push(format!("{width} × {height} px"));
    }
    if let Some(fx) = camera["fx"].as_f64() {
        words.push(format!("focal length {fx:.1} px"));
    }
    words.extend(camera["distortion_model"].as_str().map(|model| format!("lens {model}")));
    words.join(", ")
}

/// A stage of `run.json` in words.
fn stage_in_words(stage: &str) -> &str {
    match stage {
        "decode" => "read and decode the picture",
        "track" => "find the net and its pose",
        "write" => "write the results",
        other => other,
    }
}
