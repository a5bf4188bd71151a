//! Plots of a run as SVG.

use std::collections::BTreeMap;

use plotters::chart::MeshStyle;
use plotters::coord::ranged1d::Ranged;
use plotters::prelude::*;

use crate::sink::poses::{NetColumns, PoseRow, RowStatus};

/// Size of a plot over time, px.
const SIZE: (u32, u32) = (960, 220);
/// Room around a plot, for the numbers left of it and below it, px.
const MARGIN: u32 = 8;
const LEFT: u32 = 64;
const BELOW: u32 = 34;
/// Points of a curve: more do not show, and make the page heavy.
const MOST_POINTS: usize = 1500;
/// Bars of a histogram.
const BARS: usize = 60;

const BLUE: RGBColor = RGBColor(25, 105, 175);
const ORANGE: RGBColor = RGBColor(215, 120, 20);
const GREY: RGBColor = RGBColor(120, 130, 140);
const PALE: RGBColor = RGBColor(190, 198, 206);
const RED: RGBColor = RGBColor(200, 50, 40);
const GREEN: RGBColor = RGBColor(40, 150, 80);
/// One for each count of cells.
const TRACKS: [RGBColor; 6] = [BLUE, ORANGE, GREEN, RGBColor(140, 70, 160), RGBColor(0, 150, 170), RED];

/// Typeface and size of the numbers at the axes, px.
const LABEL: (&str, u32) = ("sans-serif", 12);

/// What goes wrong in drawing: a formatting error, which memory does not give.
type Result<T> = std::result::Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// A plot and what it shows.
pub(super) struct Plot {
    pub(super) title: &'static str,
    /// Colour as CSS writes it, and what is drawn in it.
    pub(super) legend: Vec<(String, String)>,
    pub(super) note: &'static str,
    pub(super) svg: String,
}

/// The columns that are plotted. NaN where there is no value.
#[derive(Debug, Default)]
pub(super) struct Series {
    /// First time, ns.
    start_ns: Option<i64>,
    /// Time since the first, s.
    time: Vec<f64>,
    pub(super) status: Vec<RowStatus>,
    probability: Vec<f64>,
    pub(super) range: Vec<f64>,
    pub(super) sigma_range: Vec<f64>,
    distance: Vec<f64>,
    pub(super) tilt: Vec<f64>,
    tilt_x: Vec<f64>,
    tilt_y: Vec<f64>,
    pub(super) latency: Vec<f64>,
    /// The camera along the net, m, and the number of its count of cells.
    place: Vec<Option<(u32, [f64; 2])>>,
}

impl Series {
    /// `track` is the number of the row's count of cells, if it has one.
    pub(super) fn push(&mut self, row: &PoseRow, track: Option<u32>) {
        let start = *self.start_ns.get_or_insert(row.timestamp_ns.unwrap_or(0));
        let net = row.net.as_ref();
        let of_net = |value: fn(&NetColumns) -> f64| net.map_or(f64::NAN, value);
        self.time.push(row.timestamp_ns.map_or(f64::NAN, |t| t.saturating_sub(start) as f64 / 1e9));
        self.status.push(row.status);
        self.probability.push(row.probability.unwrap_or(f64::NAN));
        self.range.push(of_net(|n| n.range_m));
        self.sigma_range.push(of_net(|n| n.sigma_range_m));
        self.distance.push(of_net(|n| n.distance_m));
        self.tilt.push(of_net(|n| n.pose.plane().tilt().to_degrees()));
        self.tilt_x.push(of_net(|n| (-n.normal.y).atan2(n.normal.z).to_degrees()));
        self.tilt_y.push(of_net(|n| n.normal.x.atan2(n.normal.z).to_degrees()));
        self.latency.push(row.latency_ms.unwrap_or(f64::NAN));
        self.place.push(net.map(|n| {
            let centre = n.pose.camera_in_net();
            (track.unwrap_or(0), [centre.x, centre.y])
        }));
    }

    pub(super) fn total(&self) -> u64 {
        self.status.len() as u64
    }

    pub(super) fn count(&self, status: RowStatus) -> u64 {
        self.status.iter().filter(|&&s| s == status).count() as u64
    }

    /// From the first time to the last, s.
    pub(super) fn duration(&self) -> f64 {
        self.time.iter().copied().filter(|t| t.is_finite()).fold(0.0, f64::max)
    }

    /// Way along the net, m, over neighbouring frames of one count.
    pub(super) fn way(&self) -> f64 {
        let steps = self.place.windows(2).filter_map(|pair| match pair {
            [Some((a, from)), Some((b, to))] if a == b => Some((to[0] - from[0]).hypot(to[1] - from[1])),
            _ => None,
        });
        steps.sum()
    }

    /// The places of each count of cells, in order.
    fn counts(&self) -> BTreeMap<u32, Vec<(f64, f64)>> {
        let mut counts: BTreeMap<u32, Vec<(f64, f64)>> = BTreeMap::new();
        for (track, [x, y]) in self.place.iter().flatten() {
            counts.entry(*track).or_default().push((*x, *y));
        }
        counts
    }

    /// How many counts of cells there are.
    pub(super) fn number_of_counts(&self) -> usize {
        self.counts().len()
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

/// The values that are there, sorted.
fn sorted(values: &[f64]) -> Vec<f64> {
    let mut known: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    known.sort_unstable_by(f64::total_cmp);
    known
}

/// Least, middle and greatest value; `None` where there is none.
pub(super) fn extent(values: &[f64]) -> Option<[f64; 3]> {
    let known = sorted(values);
    Some([*known.first()?, *known.get(known.len() / 2)?, *known.last()?])
}

/// All plots of what was seen.
pub(super) fn all(series: &Series) -> Result<Vec<Plot>> {
    let css = |color: RGBColor| format!("rgb({},{},{})", color.0, color.1, color.2);
    let curves = |title, unit, note, curves: &[(&str, RGBColor, &[f64])], fixed| -> Result<Plot> {
        let legend = if curves.len() > 1 { curves } else { &[] };
        Ok(Plot {
            title,
            legend: legend.iter().map(|(name, color, _)| (css(*color), (*name).to_owned())).collect(),
            note,
            svg: over_time(series, curves, unit, fixed)?,
        })
    };
    let statuses = Plot {
        title: "What each frame shows",
        legend: [(GREEN, "ok: a net, pose valid"), (PALE, "no_net: none that can be vouched for"), (RED, "unreadable")]
            .map(|(color, name)| (css(color), name.to_owned()))
            .into(),
        note: "",
        svg: statuses(series)?,
    };
    let mut plots = vec![
        statuses,
        curves(
            "Distance to the net",
            "m",
            "",
            &[
                ("range along the optical axis", BLUE, &series.range),
                ("perpendicular distance", ORANGE, &series.distance),
            ],
            None,
        )?,
        curves(
            "How the net is turned",
            "degrees",
            "Angles between the net's normal and the optical axis. About x: positive where the net's upper edge is nearer than its lower one. \
             About y: positive where its right edge is nearer than its left one.",
            &[("about x (up and down)", BLUE, &series.tilt_x), ("about y (left and right)", ORANGE, &series.tilt_y)],
            None,
        )?,
        curves(
            "Probability",
            "",
            "That there is a net and that its pose is right: no wrong period, no wrong sign of the tilt.",
            &[("probability", BLUE, &series.probability)],
            Some((0.0, 1.02)),
        )?,
    ];
    let counts = series.counts();
    if !counts.is_empty() {
        let legend = if counts.len() > 1 {
            let shown = longest(&counts).into_iter().zip(TRACKS);
            shown
                .map(|((number, places), color)| (css(color), format!("count {number}, {} frames", places.len())))
                .collect()
        } else {
            Vec::new()
        };
        plots.push(Plot {
            title: "Way of the camera along the net",
            legend,
            note: "Metres in the plane of the net, x to the right, y down; ring: where it begins, dot: where it ends. Each count of cells has an \
                   origin of its own, a knot of the net: places can be compared within one count only.",
            svg: track(&counts)?,
        });
    }
    Ok(plots)
}

/// How long the frames took.
pub(super) fn latencies(series: &Series) -> Result<Plot> {
    let note = "From the decoded picture to its pose. The slowest hundredth is in the last bar.";
    Ok(Plot { title: "Time for a pose", legend: Vec::new(), note, svg: histogram(&series.latency)? })
}

/// The counts with the most places, at most as many as there are colours, in their order.
fn longest(counts: &BTreeMap<u32, Vec<(f64, f64)>>) -> Vec<(u32, &[(f64, f64)])> {
    let mut longest: Vec<(u32, &[(f64, f64)])> = counts.iter().map(|(&number, places)| (number, &places[..])).collect();
    longest.sort_by_key(|(number, places)| (std::cmp::Reverse(places.len()), *number));
    longest.truncate(TRACKS.len());
    longest.sort_by_key(|(number, _)| *number);
    longest
}

/// Places in the net's plane, equal scales, y down as in the picture.
fn track(counts: &BTreeMap<u32, Vec<(f64, f64)>>) -> Result<String> {
    const HEIGHT: u32 = 340;
    let shown = longest(counts);
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (SIZE.0, HEIGHT)).into_drawing_area();
        let places = || shown.iter().flat_map(|(_, places)| places.iter());
        let (xs, ys): (Vec<f64>, Vec<f64>) = places().copied().unzip();
        let ((x0, x1), (y0, y1)) = (span(xs.iter()), span(ys.iter()));
        // The plot without its margins and labels, px.
        let (across, down) = (f64::from(SIZE.0 - 2 * MARGIN - LEFT), f64::from(HEIGHT - 2 * MARGIN - BELOW));
        let metres_per_px = (((x1 - x0) / across).max((y1 - y0) / down)).max(0.05 / down);
        let around = |a: f64, b: f64, px: f64| {
            let (middle, half) = (0.5 * (a + b), 0.5 * px * metres_per_px);
            (middle - half, middle + half)
        };
        let ((x0, x1), (y0, y1)) = (around(x0, x1, across), around(y0, y1, down));
        let mut chart = ChartBuilder::on(&area)
            .margin(MARGIN)
            .x_label_area_size(BELOW)
            .y_label_area_size(LEFT)
            .build_cartesian_2d(x0..x1, y1..y0)?;
        grid(chart.configure_mesh().x_desc("x, m").y_desc("y, m")).draw()?;
        for ((_, places), color) in shown.iter().zip(TRACKS) {
            let step = places.len().div_ceil(MOST_POINTS).max(1);
            chart.draw_series(LineSeries::new(places.iter().step_by(step).copied(), color.stroke_width(2)))?;
            let (Some(&first), Some(&last)) = (places.first(), places.last()) else { continue };
            chart.draw_series([Circle::new(first, 5, color.stroke_width(2)), Circle::new(last, 4, color.filled())])?;
        }
        area.present()?;
    }
    Ok(svg)
}

/// Lines and numbers of the axes.
fn grid<'m, 'c, 'b, 's: 'c, X: Ranged, Y: Ranged>(
    style: &'m mut MeshStyle<'c, 'b, X, Y, SVGBackend<'s>>,
) -> &'m mut MeshStyle<'c, 'b, X, Y, SVGBackend<'s>> {
    style.light_line_style(TRANSPARENT).bold_line_style(GREY.mix(0.2)).axis_style(GREY).label_style(LABEL)
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
fn over_time(
    series: &Series,
    curves: &[(&str, RGBColor, &[f64])],
    unit: &str,
    fixed: Option<(f64, f64)>,
) -> Result<String> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        let (t0, t1) = span(series.time.iter());
        let (y0, y1) = fixed.unwrap_or_else(|| span(curves.iter().flat_map(|c| c.2)));
        let mut chart = ChartBuilder::on(&area)
            .margin(MARGIN)
            .x_label_area_size(BELOW)
            .y_label_area_size(LEFT)
            .build_cartesian_2d(t0..t1, y0..y1)?;
        grid(chart.configure_mesh().x_desc("time, s").y_desc(unit)).draw()?;
        for (_, color, values) in curves {
            for run in series.curve(values) {
                if let [(t, y)] = run[..] {
                    chart.draw_series([Circle::new((t, y), 2, color.filled())])?;
                } else {
                    chart.draw_series(LineSeries::new(run, color.stroke_width(2)))?;
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
            .margin(MARGIN)
            .x_label_area_size(BELOW)
            .y_label_area_size(LEFT)
            .build_cartesian_2d(0.0..count.max(1) as f64, 0.0..1.0)?;
        chart
            .configure_mesh()
            .disable_mesh()
            .disable_y_axis()
            .x_label_formatter(&|x| format!("{x:.0}"))
            .x_desc("frame")
            .axis_style(GREY)
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
            RowStatus::NoNet => PALE,
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
        let known = sorted(values);
        // The slowest hundredth would squeeze all others into a corner: it goes into the last bar.
        let most = known.get(known.len().saturating_sub(1) * 99 / 100).copied().unwrap_or(1.0).max(1e-3) * 1.05;
        let mut counts = [0_u32; BARS];
        for value in &known {
            counts[((value / most * BARS as f64) as usize).min(BARS - 1)] += 1;
        }
        let top = counts.iter().copied().max().unwrap_or(0).max(1);
        let mut chart = ChartBuilder::on(&area)
            .margin(MARGIN)
            .x_label_area_size(BELOW)
            .y_label_area_size(LEFT)
            .build_cartesian_2d(0.0..most, 0..top)?;
        grid(chart.configure_mesh().x_desc("ms").y_desc("frames")).draw()?;
        let edge = |i: usize| most * i as f64 / BARS as f64;
        let bars = counts.iter().enumerate().filter(|(_, n)| **n > 0);
        chart.draw_series(
            bars.map(|(i, &n)| Rectangle::new([(edge(i), 0), (edge(i + 1), n)], BLUE.mix(0.8).filled())),
        )?;
        area.present()?;
    }
    Ok(svg)
}
