//! Tracking over 99 flows, and round a loop: section 5.5.

use std::collections::HashMap;
use std::time::Instant;

use anyhow::{Context, Result};
use net_flow::{Config as FlowConfig, FlowTracker, Hints, Mode};
use net_geometry::nalgebra::Vector2;
use net_sim::Scenario;
use netpose::{GrayView, Tracker};

use super::Column;
use super::published::TRACKING;
use super::reading::{Picture, draw};
use super::table::Table;
use crate::eval::{Odometry, PoseError};
use crate::stats::{median, quantile};

/// Knots are tracked that stay this far inside the picture, px.
const MARGIN_PX: f64 = 40.0;

/// Drift of tracked knots in pixels, and of the poses' odometry in millimetres.
pub fn run(columns: &[Column]) -> Result<Vec<Table>> {
    let there = Scenario::by_name("tracking")?;
    let back = Scenario::by_name("tracking-loop")?;
    let draw_all = |scenario: &Scenario| (0..scenario.frames).map(|k| draw(scenario, k)).collect::<Result<Vec<_>>>();
    let (there_pictures, back_pictures) = (draw_all(&there)?, draw_all(&back)?);
    let points = flow_table(&there_pictures, &back_pictures)?;
    let odometry = odometry_table(columns, &[(&there, &there_pictures), (&back, &back_pictures)])?;
    Ok(vec![points, odometry])
}

fn flow_table(there: &[Picture], back: &[Picture]) -> Result<Table> {
    let mut table = Table::new(
        "Drift of tracked junctions (section 5.5)",
        [
            "",
            "thesis in print (optical flow by a network)",
            "ours, block matching: median",
            "p95",
            "knots followed",
            "ms per flow",
        ],
        "Distance between where a knot was tracked to and where it is, px. The thesis tracked one junction, in about 3 s per flow on a \
         CPU. \"At once\" is ours started from the summed track and settled against the first frame.",
    );
    let runs = [(there, Mode::Summed), (there, Mode::KeyFrame), (back, Mode::Summed)];
    for ((pictures, mode), (name, ended, should)) in runs.into_iter().zip(TRACKING) {
        let thesis = (Vector2::from(ended) - Vector2::from(should)).norm();
        let flow = follow(pictures, mode)?;
        table.row([
            name.to_owned(),
            format!("{thesis:.1} px"),
            format!("{:.2} px", median(&flow.errors_px)),
            format!("{:.2} px", quantile(&flow.errors_px, 0.95)),
            format!("{}/{}", flow.errors_px.len(), flow.points),
            format!("{:.1}", flow.ms),
        ]);
    }
    Ok(table)
}

/// Knots followed through a sequence.
struct Followed {
    points: usize,
    /// Of those that arrived, in the last picture.
    errors_px: Vec<f64>,
    /// Median time of an update.
    ms: f64,
}

fn follow(pictures: &[Picture], mode: Mode) -> Result<Followed> {
    let (first, last) = pictures.first().zip(pictures.last()).context("a sequence without pictures")?;
    let (width, height) = (first.image.width(), first.image.height());
    let inside = |p: Vector2<f64>| {
        (MARGIN_PX..width as f64 - MARGIN_PX).contains(&p.x) && (MARGIN_PX..height as f64 - MARGIN_PX).contains(&p.y)
    };
    let knots = |picture: &Picture| -> HashMap<(i32, i32), Vector2<f64>> {
        picture.net.nodes.iter().filter(|n| inside(n.pixel)).map(|n| (n.index, n.pixel)).collect()
    };
    let all: Vec<_> = pictures.iter().map(knots).collect();
    // In the truth's order, which is fixed, not the map's.
    let stay: Vec<(i32, i32)> =
        first.net.nodes.iter().map(|n| n.index).filter(|index| all.iter().all(|k| k.contains_key(index))).collect();
    let config = FlowConfig { mode, ..FlowConfig::default() };
    let mut tracker = FlowTracker::new(width, height, &config)?;
    tracker.update(view(first)?, &Hints::default())?;
    let starts: Vec<Vector2<f64>> = stay.iter().map(|index| all[0][index]).collect();
    let first_id = tracker.add_points(&starts).context("no knot stays in view")?;
    let mut times = Vec::new();
    for picture in &pictures[1..] {
        // The next frame's buffer is the caller's: only the update is timed.
        let start = Instant::now();
        tracker.update(view(picture)?, &Hints::default())?;
        times.push(1e3 * start.elapsed().as_secs_f64());
    }
    let ends = knots(last);
    let errors_px = tracker
        .tracks()
        .iter()
        .filter_map(|track| {
            let index = stay.get(usize::try_from(track.id.checked_sub(first_id)?).ok()?)?;
            Some((track.pixel - ends[index]).norm())
        })
        .collect();
    Ok(Followed { points: stay.len(), errors_px, ms: median(&times) })
}

fn view(picture: &Picture) -> Result<GrayView<'_>> {
    picture.image.view().context("a picture without pixels")
}

fn odometry_table(columns: &[Column], sequences: &[(&Scenario, &Vec<Picture>)]) -> Result<Table> {
    let mut head = vec![String::new()];
    for column in columns {
        let name = column.name;
        head.extend([
            format!("{name}: answered"),
            "wrong".into(),
            "last frame".into(),
            "p95".into(),
            "slips".into(),
            "restarts".into(),
        ]);
    }
    let mut table = Table::new(
        "Odometry along the net on the same frames",
        head,
        "Error of the camera's place along the net, mm, after one alignment by whole cells on the first pose of each count. Slip: it jumps by more than half a \
         cell.",
    );
    for (scenario, pictures) in sequences {
        let mut cells = vec![format!("{} frames", pictures.len())];
        for column in columns {
            cells.extend(odometry(column, scenario, pictures)?);
        }
        table.row(cells);
    }
    Ok(table)
}

fn odometry(column: &Column, scenario: &Scenario, pictures: &[Picture]) -> Result<[String; 6]> {
    let mesh = scenario.mesh()?;
    let mut tracker = Tracker::new(scenario.camera()?, mesh, &column.config)?;
    let mut odometry = Odometry::new(mesh);
    let (mut errors_mm, mut wrong) = (Vec::new(), 0);
    for picture in pictures {
        let estimate = tracker.update(view(picture)?, picture.timestamp_ns)?;
        let Some(net) = estimate.net else {
            odometry.gap();
            continue;
        };
        let truth = &picture.net;
        let range = truth.axis.map_or(f64::NAN, |axis| axis.range_m);
        wrong += usize::from(PoseError::new(&net.pose, net.range_m, &truth.pose, range, &mesh).is_wrong());
        let (position, _) = odometry.update(estimate.track, &net.pose, &truth.pose);
        errors_mm.push(1e3 * position.xy().norm());
    }
    let mm = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.1} mm"));
    let answered = errors_mm.len();
    Ok([
        format!("{answered}/{}", pictures.len()),
        wrong.to_string(),
        mm(errors_mm.last().copied()),
        mm((answered > 0).then(|| quantile(&errors_mm, 0.95))),
        odometry.slips.to_string(),
        odometry.restarts.to_string(),
    ])
}
