//! `netpose image`: single images, each on its own.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use netpose::{Camera, Config, Estimate, Mesh, NetPose, Tracker};
use serde_json::{Value, json};

use crate::draw::{Overlay, Shown};
use crate::failure::Outcome;
use crate::options::Setup;

/// Where the net is in single images, each on its own.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Image files: PNG, JPEG, TIFF, BMP, WebP
    #[arg(required = true)]
    images: Vec<PathBuf>,
    #[command(flatten)]
    setup: Setup,
    /// One JSON document for each image, each on a line of its own, instead of the table
    #[arg(long)]
    json: bool,
    /// Folder for two pictures of each image: the frame with lattice, junctions, axes and status, and its spectrum with peaks and wave vectors
    #[arg(long, value_name = "DIR")]
    overlay: Option<PathBuf>,
}

/// Runs the command.
pub fn main(args: &Args) -> Result<Outcome> {
    let mesh = args.setup.mesh()?;
    let config = args.setup.config()?;
    let cameras = args.setup.cameras_of(&args.images)?;
    if let Some(dir) = &args.overlay {
        let mut drawn = std::collections::HashMap::new();
        for path in &args.images {
            if let Some(other) = drawn.insert(path.file_stem(), path) {
                bail!("--overlay: {} and {} would be drawn into one file", other.display(), path.display());
            }
        }
        std::fs::create_dir_all(dir).with_context(|| format!("cannot create {}", dir.display()))?;
    }
    let mut out = std::io::stdout().lock();
    if !args.json {
        writeln!(out, "{HEAD}")?;
    }
    let mut outcome = Outcome::Complete;
    for (path, &camera) in args.images.iter().zip(&cameras) {
        match estimate(path, &camera, &mesh, &config, args.overlay.as_deref(), args.json) {
            Ok(line) => writeln!(out, "{line}")?,
            Err(why) => {
                outcome = Outcome::Partial;
                let line = if args.json { unreadable_json(path, &why) } else { unreadable_row(path) };
                writeln!(out, "{line}")?;
                eprintln!("{}: {why:#}", path.display());
            }
        }
    }
    Ok(outcome)
}

const HEAD: &str =
    "status      prob   range_m  distance_m   normal_x  normal_y  normal_z  tilt_deg  junctions        ms  file";

/// One image, as a row or as JSON.
fn estimate(
    path: &Path,
    camera: &Camera,
    mesh: &Mesh,
    config: &Config,
    overlay: Option<&Path>,
    as_json: bool,
) -> Result<String> {
    let image = net_log::read_image(path)?;
    let view = image.view().context("it has no pixels")?;
    let mut tracker = Tracker::new(*camera, *mesh, config)?;
    let start = Instant::now();
    let estimate = tracker.update(view, 0)?;
    let latency_ms = 1e3 * start.elapsed().as_secs_f64();
    if let Some(dir) = overlay {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        let shown = Shown {
            status: estimate.status,
            probability: estimate.probability,
            net: estimate.net.as_ref(),
            junctions: estimate.junctions,
            twines: estimate.twines,
            latency_ms,
        };
        let stem = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy();
        Overlay { camera: *camera, mesh: *mesh }.write(view, &name, &shown, dir, &stem)?;
    }
    Ok(if as_json { json_line(path, &estimate, latency_ms) } else { row(path, &estimate, latency_ms) })
}

fn row(path: &Path, estimate: &Estimate<'_>, latency_ms: f64) -> String {
    let pose = estimate.net.map_or_else(
        || format!("{:>10}{:>12}{:>11}{:>10}{:>10}{:>10}", "-", "-", "-", "-", "-", "-"),
        |net| {
            let n = net.normal;
            let tilt = n.xy().norm().atan2(n.z).to_degrees();
            format!("{:>10.4}{:>12.4}{:>11.4}{:>10.4}{:>10.4}{tilt:>10.2}", net.range_m, net.distance_m, n.x, n.y, n.z)
        },
    );
    format!(
        "{:10}{:>6.3}{pose}{:>11}{latency_ms:>10.1}  {}",
        estimate.status.as_str(),
        estimate.probability,
        estimate.junctions.len(),
        path.display()
    )
}

fn unreadable_row(path: &Path) -> String {
    format!(
        "{:10}{:>6}{:>10}{:>12}{:>11}{:>10}{:>10}{:>10}{:>11}{:>10}  {}",
        "unreadable",
        "-",
        "-",
        "-",
        "-",
        "-",
        "-",
        "-",
        "-",
        "-",
        path.display()
    )
}

fn json_line(path: &Path, estimate: &Estimate<'_>, latency_ms: f64) -> String {
    let junctions: Vec<Value> = estimate
        .junctions
        .iter()
        .map(|j| json!({ "u": j.pixel.x, "v": j.pixel.y, "i": j.index.map(|k| k.0), "j": j.index.map(|k| k.1), "sigma_px": j.sigma_px, "state": j.state.as_str() }))
        .collect();
    let mut line = json!({
        "file": path, "status": estimate.status.as_str(), "probability": estimate.probability,
        "junctions": junctions, "latency_ms": latency_ms,
    });
    if let Some(net) = &estimate.net {
        describe(net, &mut line);
    }
    if !estimate.layers.is_empty() {
        let layers = estimate.layers.iter().map(|layer| {
            let mut value = json!({ "probability": layer.probability, "followed": layer.followed });
            describe(&layer.net, &mut value);
            value
        });
        line["layers"] = layers.collect();
    }
    line.to_string()
}

/// Adds a pose and what goes with it.
fn describe(net: &NetPose, line: &mut Value) {
    let rows = |m: &dyn Fn(usize, usize) -> f64, n: usize| -> Vec<Vec<f64>> {
        (0..n).map(|r| (0..n).map(|c| m(r, c)).collect()).collect()
    };
    let (pose, covariance) = (net.pose.matrix(), net.covariance);
    line["range_m"] = json!(net.range_m);
    line["distance_m"] = json!(net.distance_m);
    line["normal"] = json!(net.normal.as_slice());
    // Net to camera, row by row.
    line["pose"] = json!(rows(&|r, c| pose[(r, c)], 4));
    // Rotation (rad) then translation (m), perturbation in the camera frame.
    line["covariance"] = json!(rows(&|r, c| covariance[(r, c)], 6));
    line["sigma_range_m"] = json!(net.sigma_range_m);
    line["sigma_tilt_deg"] = json!(net.sigma_tilt.to_degrees());
    line["sigma_xy_m"] = json!(net.sigma_xy_m);
    if let Some(sheet) = &net.sheet {
        line["crossing_angle_deg"] = json!(sheet.crossing_angle.to_degrees());
        line["sigma_crossing_angle_deg"] = json!(sheet.sigma_crossing_angle.map(f64::to_degrees));
        line["curvatures_per_m"] = json!(sheet.curvatures_per_m);
        line["sigma_curvatures_per_m"] = json!(sheet.sigma_curvatures_per_m);
        line["mean_normal"] = json!(sheet.mean_plane.normal.as_slice());
        line["mean_distance_m"] = json!(sheet.mean_plane.distance);
        line["cell_margin"] = json!(sheet.cell_margin);
    }
}

fn unreadable_json(path: &Path, why: &anyhow::Error) -> String {
    json!({ "file": path, "status": "unreadable", "error": format!("{why:#}") }).to_string()
}
