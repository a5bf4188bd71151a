//! Counts steps that went to the right cell, to a wrong one, or were called ambiguous, over scenarios of the simulator.
//!
//! ```text
//! slips [--lattice] [--stride N] SCENARIO ...
//! ```
//! No prior is given, so that only the pictures can tell. With `--lattice` the true lattice of the earlier frame is.

use std::error::Error;

use nalgebra::{DMatrix, Matrix3, Vector2};
use net_flow::{Config, FlowTracker, Hints, Lattice, Status};
use net_sim::{Image, NodeTruth, Scenario, Simulator};

/// A step is right when it carries the knots to within this share of a cell in the median.
const RIGHT_SHARE: f64 = 0.25;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    let with_lattice = args.iter().any(|a| a == "--lattice");
    let stride = args.iter().position(|a| a == "--stride").and_then(|i| args.get(i + 1)?.parse().ok()).unwrap_or(1u32);
    args.retain(|a| !a.starts_with("--") && a.parse::<u32>().is_err());
    println!(
        "| scenario | largest step, cells | right | called ambiguous (right, wrong) | lost | wrong in silence | ms a frame |"
    );
    println!("|---|---|---|---|---|---|---|");
    for name in &args {
        let scenario = Scenario::by_name(name)?;
        let camera = scenario.camera()?;
        let mut tracker = FlowTracker::new(camera.width() as usize, camera.height() as usize, &Config::default())?;
        let mut simulator = Simulator::new(camera);
        let mut image = Image::default();
        let mut before: Vec<NodeTruth> = Vec::new();
        let (mut right, mut flagged, mut lost, mut wrong) = (0, [0, 0], 0, 0);
        let mut largest = 0.0f64;
        let mut time = 0.0;
        for k in (0..scenario.frames).step_by(stride as usize) {
            let frame = scenario.frame(k)?;
            let nodes = simulator.render(&frame.scene, frame.seed, &mut image)?.layers.first().map(|l| l.nodes.clone());
            let nodes = nodes.unwrap_or_default();
            let lattice = if with_lattice { plane(&before).map(Lattice::Plane) } else { None };
            let begin = std::time::Instant::now();
            let result = tracker.update(image.view().ok_or("no picture")?, &Hints { lattice, ..Hints::default() })?;
            time += begin.elapsed().as_secs_f64();
            let mut errors = Vec::new();
            let (mut cell, mut step) = (f64::INFINITY, 0.0f64);
            for a in &before {
                let Some(b) = nodes.iter().find(|b| b.index == a.index) else { continue };
                if let Some(neighbour) = before.iter().find(|n| n.index == (a.index.0 + 1, a.index.1)) {
                    cell = cell.min((neighbour.pixel - a.pixel).norm());
                }
                step = step.max((b.pixel - a.pixel).norm());
                errors.extend(result.step.motion.map(|m| (m.apply(a.pixel) - b.pixel).norm()));
            }
            errors.sort_by(f64::total_cmp);
            let median = errors.get(errors.len() / 2).copied().unwrap_or(f64::INFINITY);
            if cell.is_finite() {
                largest = largest.max(step / cell);
            }
            match result.step.status {
                Status::Started => {}
                Status::Lost => lost += 1,
                Status::Ambiguous => flagged[usize::from(median > RIGHT_SHARE * cell)] += 1,
                Status::Tracked if median > RIGHT_SHARE * cell => {
                    wrong += 1;
                    eprintln!(
                        "{name} {k}: off by {median:.1} px of {cell:.1}, rivals {:?}",
                        result.step.rivals.first()
                    );
                }
                Status::Tracked => right += 1,
            }
            before = nodes;
        }
        println!(
            "| {name} | {largest:.2} | {right} | {} ({}, {}) | {lost} | {wrong} | {:.1} |",
            flagged[0] + flagged[1],
            flagged[0],
            flagged[1],
            1e3 * time / f64::from(scenario.frames.div_ceil(stride))
        );
    }
    Ok(())
}

/// The homography from lattice indices to pixels, by linear least squares over all knots.
fn plane(nodes: &[NodeTruth]) -> Option<Matrix3<f64>> {
    if nodes.len() < 8 {
        return None;
    }
    let centre = nodes.iter().map(|n| n.pixel).sum::<Vector2<f64>>() / nodes.len() as f64;
    let mut a = DMatrix::zeros(2 * nodes.len(), 9);
    for (k, node) in nodes.iter().enumerate() {
        let (i, j) = (f64::from(node.index.0), f64::from(node.index.1));
        let p = (node.pixel - centre) / 300.0;
        for (r, x) in [i, j, 1.0].into_iter().enumerate() {
            a[(2 * k, r)] = x;
            a[(2 * k + 1, 3 + r)] = x;
            a[(2 * k, 6 + r)] = -p.x * x;
            a[(2 * k + 1, 6 + r)] = -p.y * x;
        }
    }
    let svd = (a.transpose() * &a).symmetric_eigen();
    let least = svd.eigenvalues.imin();
    let h = svd.eigenvectors.column(least);
    let h = Matrix3::from_row_slice(&h.iter().copied().collect::<Vec<_>>());
    let back = Matrix3::new(300.0, 0.0, centre.x, 0.0, 300.0, centre.y, 0.0, 0.0, 1.0);
    Some(back * h)
}
