//! Plots of a run as SVG.

use plotters::prelude::*;

use crate::sink::poses::{PoseRow, RowStatus};

/// Size of a plot over time, px.
const SIZE: (u32, u32) = (960, 220);
/// Points of a curve: more do not show, and make the page heavy.
const MOST_POINTS: usize = 1500;
/// Bars of a histogram.
const BARS: usize = 60;

const BLUE: RGBColor = RGBColor(25, 105, 175);
const GREY: RGBColor = RGBColor(120, 130, 140);
const RED: RGBColor = RGBColor(200, 50, 40);
const GREEN: RGBColor = RGBColor(40, 150, 80);

/// Typeface and size of the numbers at the axes, px.
const LABEL: (&str, u32) = ("sans-serif", 12);

/// What goes wrong in drawing: a formatting error, which memory does not give.
type Result<T> = std::result::Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// A plot and what it shows.
pub(super) struct Plot {
    pub(super) caption: String,
    pub(super) svg: String,
}

/// The columns that are plotted.
#[derive(Debug, Default)]
pub(super) struct Series {
    /// First time, ns.
    start_ns: Option<i64>,
    /// Time since the first, s; NaN for a frame without a time.
    time: Vec<f64>,
    status: Vec<RowStatus>,
    /// NaN where there is no value.
    probability: Vec<f64>,
    range: Vec<f64>,
    distance: Vec<f64>,
    tilt: Vec<f64>,
    latency: Vec<f64>,
}

impl Series {
    pub(super) fn push(&mut self, row: &PoseRow) {
        let start = *self.start_ns.get_or_insert(row.timestamp_ns.unwrap_or(0));
        let net = row.net.as_ref();
        self.time.push(row.timestamp_ns.map_or(f64::NAN, |t| t.saturating_sub(start) as f64 / 1e9));
        self.status.push(row.status);
        self.probability.push(row.probability.unwrap_or(f64::NAN));
        self.range.push(net.map_or(f64::NAN, |n| n.range_m));
        self.distance.push(net.map_or(f64::NAN, |n| n.distance_m));
        self.tilt.push(net.map_or(f64::NAN, |n| n.pose.plane().tilt().to_degrees()));
        self.latency.push(row.latency_ms.unwrap_or(f64::NAN));
    }

    pub(super) fn total(&self) -> u64 {
        self.status.len() as u64
    }

    pub(super) fn count(&self, status: RowStatus) -> u64 {
        self.status.iter().filter(|&&s| s == status).count() as u64
    }

    /// Range, tilt and latency.
    pub(super) fn medians(&self) -> [String; 3] {
        let text = |values: &[f64], unit: &str, digits: usize| {
            median(values).map_or_else(|| "-".to_owned(), |m| format!("{m:.digits$} {unit}"))
        };
        [text(&self.range, "m", 3), text(&self.tilt, "°", 1), text(&self.latency, "ms", 1)]
    }

    /// Points of a curve, a gap where a value is missing. Of many points in one column of the picture the least and the greatest stay.
    fn curve(&self, values: &[f64]) -> Vec<Vec<(f64, f64)>> {
        let bucket = (2 * values.len()).div_ceil(MOST_POINTS).max(1);
        let points: Vec<(f64, f64)> = self.time.iter().copied().zip(values.iter().copied()).collect();
        let mut runs = vec![Vec::new()];
        for chunk in points.chunks(bucket) {
            let known = || chunk.iter().filter(|p| p.0.is_finite() && p.1.is_finite());
            let least = known().min_by(|a, b| a.1.total_cmp(&b.1));
            let greatest = known().max_by(|a, b| a.1.total_cmp(&b.1));
            match (least, greatest) {
                (Some(&a), Some(&b)) => {
                    let (first, second) = if a.0 <= b.0 { (a, b) } else { (b, a) };
                    let run = runs.last_mut().map(|run| {
                        run.push(first);
                        if second != first {
                            run.push(second);
                        }
                    });
                    debug_assert!(run.is_some());
                }
                _ if runs.last().is_some_and(|run| !run.is_empty()) => runs.push(Vec::new()),
                _ => {}
            }
        }
        runs
    }
}

fn median(values: &[f64]) -> Option<f64> {
    let mut known: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    known.sort_unstable_by(f64::total_cmp);
    known.get(known.len() / 2).copied()
}

/// All plots of the page.
pub(super) fn all(series: &Series) -> Result<Vec<Plot>> {
    let plot = |caption: &str, svg| Plot { caption: caption.to_owned(), svg };
    let range = [("range", BLUE, &series.range[..]), ("distance", GREY, &series.distance[..])];
    Ok(vec![
        plot(
            "Range along the optical axis (blue) and perpendicular distance (grey), m.",
            over_time(series, &range, None)?,
        ),
        plot(
            "Angle between the net's normal and the optical axis, degrees.",
            over_time(series, &[("tilt", BLUE, &series.tilt)], None)?,
        ),
        plot(
            "Probability that there is a net and that its pose is right.",
            over_time(series, &[("probability", BLUE, &series.probability)], Some((0.0, 1.0)))?,
        ),
        plot("Status of each frame: ok, no_net, unreadable.", statuses(series)?),
        plot("Time from the decoded picture to its result, ms: number of frames.", histogram(&series.latency)?),
    ])
}

/// Least and greatest value with a little room, or a span that can be drawn.
fn span<'a>(values: impl Iterator<Item = &'a f64>) -> (f64, f64) {
    let finite = values.copied().filter(|v| v.is_finite());
    let (least, greatest) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    if least > greatest {
        return (0.0, 1.0);
    }
    let room = (0.05 * (greatest - least)).max(1e-3 * greatest.abs()).max(1e-6);
    (least - room, greatest + room)
}

/// Curves over time.
fn over_time(series: &Series, curves: &[(&str, RGBColor, &[f64])], fixed: Option<(f64, f64)>) -> Result<String> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        let (t0, t1) = span(series.time.iter());
        let (y0, y1) = fixed.unwrap_or_else(|| span(curves.iter().flat_map(|c| c.2)));
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .x_label_area_size(28)
            .y_label_area_size(52)
            .build_cartesian_2d(t0..t1, y0..y1)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GREY.mix(0.2))
            .x_desc("s")
            .label_style(LABEL)
            .draw()?;
        for (_, color, values) in curves {
            for run in series.curve(values) {
                if let [(t, y)] = run[..] {
                    chart.draw_series([Circle::new((t, y), 2, color.filled())])?;
                } else {
                    chart.draw_series(LineSeries::new(run, color))?;
                }
            }
        }
        area.present()?;
    }
    Ok(svg)
}

/// A band of colour over time: the worst status of the frames in each column wins.
fn statuses(series: &Series) -> Result<String> {
    const HEIGHT: u32 = 70;
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (SIZE.0, HEIGHT)).into_drawing_area();
        let (count, columns) = (series.status.len(), series.status.len().clamp(1, MOST_POINTS / 2));
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .x_label_area_size(28)
            .y_label_area_size(52)
            .build_cartesian_2d(0.0..count.max(1) as f64, 0.0..1.0)?;
        chart
            .configure_mesh()
            .disable_mesh()
            .disable_y_axis()
            .x_label_formatter(&|x| format!("{x:.0}"))
            .x_desc("frame")
            .label_style(LABEL)
            .draw()?;
        let mut bands: Vec<(f64, f64, RowStatus)> = Vec::new();
        for column in 0..columns {
            let (a, b) = (column * count / columns, (column + 1) * count / columns);
            let Some(&worst) = series.status[a..b].iter().max() else { continue };
            match bands.last_mut() {
                Some(band) if band.2 == worst => band.1 = b as f64,
                _ => bands.push((a as f64, b as f64, worst)),
            }
        }
        let color = |status| match status {
            RowStatus::Ok => GREEN,
            RowStatus::NoNet => GREY,
            RowStatus::Unreadable => RED,
        };
        chart.draw_series(bands.iter().map(|&(a, b, s)| Rectangle::new([(a, 0.0), (b, 1.0)], color(s).filled())))?;
        area.present()?;
    }
    Ok(svg)
}

/// How often each value occurs.
fn histogram(values: &[f64]) -> Result<String> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        let mut known: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        known.sort_unstable_by(f64::total_cmp);
        // The slowest hundredth would squeeze all others into a corner: it goes into the last bar.
        let most = known.get(known.len().saturating_sub(1) * 99 / 100).copied().unwrap_or(1.0).max(1e-3) * 1.05;
        let mut counts = [0_u32; BARS];
        for value in &known {
            counts[((value / most * BARS as f64) as usize).min(BARS - 1)] += 1;
        }
        let top = counts.iter().copied().max().unwrap_or(0).max(1);
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .x_label_area_size(28)
            .y_label_area_size(52)
            .build_cartesian_2d(0.0..most, 0..top)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GREY.mix(0.2))
            .x_desc("ms")
            .label_style(LABEL)
            .draw()?;
        let edge = |i: usize| most * i as f64 / BARS as f64;
        let bars = counts.iter().enumerate().filter(|(_, n)| **n > 0);
        chart.draw_series(
            bars.map(|(i, &n)| Rectangle::new([(edge(i), 0), (edge(i + 1), n)], BLUE.mix(0.8).filled())),
        )?;
        area.present()?;
    }
    Ok(svg)
}
