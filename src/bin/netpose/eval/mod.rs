//! `netpose eval`: a run against the truth.

mod errors;
mod table;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use net_log::{RunPaths, RunSummary};
use netpose::Mesh;
use serde::Serialize;

pub use errors::{Odometry, PoseError};

use crate::failure::Outcome;
use crate::stats::{median, quantile};

/// Errors of a run against a truth, with units.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A folder that `netpose run` wrote
    run_dir: PathBuf,
    /// True poses: a CSV with columns frame, file, tx, ty, tz, qw, qx, qy, qz (net to camera) and, where the net is bent, range_m
    #[arg(long, value_name = "FILE")]
    truth: PathBuf,
    /// The mesh, where run.json does not say it
    #[arg(long, value_name = "SIZE")]
    cell: Option<Mesh>,
    /// One JSON document instead of the table
    #[arg(long)]
    json: bool,
    /// A line for every frame, on standard error
    #[arg(short, long)]
    verbose: bool,
}

/// The middle and the bad end of one kind of error.
#[derive(Debug, Serialize)]
struct Spread {
    median: f64,
    p95: f64,
    max: f64,
}

impl Spread {
    fn of(values: &[f64]) -> Option<Self> {
        (!values.is_empty()).then(|| Self {
            median: median(values),
            p95: quantile(values, 0.95),
            max: quantile(values, 1.0),
        })
    }
}

/// What the evaluation found. Errors are of the frames with status `ok` and a true pose.
#[derive(Debug, Default, Serialize)]
struct Report {
    frames: usize,
    /// Frames whose truth has a net.
    with_net: usize,
    ok: usize,
    /// A net in the truth, no pose claimed.
    refused: usize,
    unreadable: usize,
    /// Claimed, and further off than 5 % in range or 5 degrees in normal or in-plane rotation.
    wrong: usize,
    /// Claimed where the truth has no net.
    false_alarms: usize,
    /// The camera's place in the net jumped by more than half a cell against the truth, and the run did not say so.
    slips: usize,
    /// The run said that it had lost the count of cells and started another, with an origin of its own.
    restarts: usize,
    range_percent: Option<Spread>,
    range_mm: Option<Spread>,
    normal_deg: Option<Spread>,
    inplane_deg: Option<Spread>,
    /// Camera position along the net, after one alignment by whole cells on the first pose of each count.
    lateral_mm: Option<Spread>,
    lateral_final_mm: Option<f64>,
    /// Range error over its claimed sigma.
    range_error_in_sigmas: Option<Spread>,
    latency_ms: Option<Spread>,
}

/// Runs the command.
pub fn main(args: &Args) -> Result<Outcome> {
    let mesh = match args.cell {
        Some(mesh) => mesh,
        None => mesh_of_run(&args.run_dir)?,
    };
    let rows = table::read(&args.run_dir.join("poses.csv"))?;
    let truths = table::read(&args.truth)?;
    let report = compare(&rows, &truths, &mesh, args.verbose)?;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        print!("{}", as_text(&report));
    }
    Ok(Outcome::Complete)
}

/// The mesh that a run was told, from its `run.json`.
fn mesh_of_run(run_dir: &Path) -> Result<Mesh> {
    let path = RunPaths::new(run_dir).summary();
    let run = RunSummary::read(&path)?;
    run.mesh.parse().with_context(|| format!("{} does not say the mesh; give it with --cell", path.display()))
}

fn compare(rows: &[table::Row], truths: &[table::Row], mesh: &Mesh, verbose: bool) -> Result<Report> {
    let by_file: HashMap<&str, &table::Row> =
        truths.iter().filter(|t| !t.file.is_empty()).map(|t| (t.file.as_str(), t)).collect();
    // Frames of an MCAP are all called by their topic: that names none of them.
    let by_file = if by_file.len() == truths.len() { by_file } else { HashMap::new() };
    let by_frame: HashMap<u64, &table::Row> = truths.iter().map(|t| (t.frame, t)).collect();
    let mut report = Report::default();
    let (mut range, mut range_mm, mut normal, mut inplane, mut lateral, mut sigmas) =
        (vec![], vec![], vec![], vec![], vec![], vec![]);
    let mut odometry = Odometry::new(*mesh);
    for row in rows {
        // The file's name where the truth knows it (a run may skip frames), else the frame's number.
        let Some(truth) = by_file.get(row.file.as_str()).or_else(|| by_frame.get(&row.frame)) else { continue };
        report.frames += 1;
        report.unreadable += usize::from(row.status.as_deref() == Some("unreadable"));
        let true_pose = truth.pose().filter(|_| truth.is_ok());
        let pose = row.pose().filter(|_| row.is_ok());
        report.with_net += usize::from(true_pose.is_some());
        report.ok += usize::from(row.is_ok());
        let (pose, true_pose) = match (pose, true_pose) {
            (Some(pose), Some(true_pose)) => (pose, true_pose),
            (claimed, net) => {
                report.false_alarms += usize::from(claimed.is_some());
                report.refused += usize::from(net.is_some());
                odometry.gap();
                continue;
            }
        };
        let (Some(z), Some(true_z)) = (row.range(), truth.range()) else { continue };
        let error = PoseError::new(&pose, z, &true_pose, true_z, mesh);
        let (position, slipped) = odometry.update(row.track.map_or(0, |track| track as u32), &pose, &true_pose);
        report.wrong += usize::from(error.is_wrong());
        range.push(error.range_percent.abs());
        range_mm.push(1e3 * error.range_m.abs());
        normal.push(error.normal_deg);
        inplane.push(error.inplane_deg);
        lateral.push(1e3 * position.xy().norm());
        sigmas.extend(row.sigma_range_m.filter(|&s| s > 0.0).map(|s| error.range_m.abs() / s));
        if verbose {
            let note = if error.is_wrong() {
                "  WRONG"
            } else if slipped {
                "  SLIP"
            } else {
                ""
            };
            eprintln!(
                "{:>6} {:24} range {:+8.3} %  normal {:6.2} deg  in-plane {:6.2} deg  lateral {:8.2} mm  p {:.2}{note}",
                row.frame,
                row.file,
                error.range_percent,
                error.normal_deg,
                error.inplane_deg,
                1e3 * position.xy().norm(),
                row.probability.unwrap_or(f64::NAN),
            );
        }
    }
    ensure!(report.frames > 0, "no frame of the run is in the truth: neither file names nor frame numbers agree");
    (report.slips, report.restarts) = (odometry.slips, odometry.restarts);
    report.lateral_final_mm = lateral.last().copied();
    report.range_percent = Spread::of(&range);
    report.range_mm = Spread::of(&range_mm);
    report.normal_deg = Spread::of(&normal);
    report.inplane_deg = Spread::of(&inplane);
    report.lateral_mm = Spread::of(&lateral);
    report.range_error_in_sigmas = Spread::of(&sigmas);
    report.latency_ms = Spread::of(&rows.iter().filter_map(|r| r.latency_ms).collect::<Vec<_>>());
    Ok(report)
}

fn as_text(report: &Report) -> String {
    use std::fmt::Write;
    let mut text = format!(
        "{} frames: {} with a net in the truth, {} ok, {} refused, {} unreadable\n\
         {} wrong claims (over 5 % in range or 5 deg in normal or in-plane), {} false alarms\n\
         {} cells slipped in silence, {} counts of cells started anew\n\n",
        report.frames,
        report.with_net,
        report.ok,
        report.refused,
        report.unreadable,
        report.wrong,
        report.false_alarms,
        report.slips,
        report.restarts,
    );
    let _ = writeln!(text, "{:34}{:>10}{:>10}{:>10}", "error", "median", "p95", "max");
    for (name, spread) in [
        ("range, %", &report.range_percent),
        ("range, mm", &report.range_mm),
        ("normal, deg", &report.normal_deg),
        ("in-plane rotation, deg", &report.inplane_deg),
        ("camera along the net, mm", &report.lateral_mm),
        ("range error / its sigma", &report.range_error_in_sigmas),
        ("latency, ms", &report.latency_ms),
    ] {
        let _ = match spread {
            Some(s) => writeln!(text, "{name:34}{:>10.3}{:>10.3}{:>10.3}", s.median, s.p95, s.max),
            None => writeln!(text, "{name:34}{:>10}{:>10}{:>10}", "-", "-", "-"),
        };
    }
    if let Some(last) = report.lateral_final_mm {
        let _ = writeln!(text, "camera along the net, last frame: {last:.2} mm");
    }
    text
}
