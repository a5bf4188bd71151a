//! Reliability and risk-coverage curves as SVG.

use anyhow::{Result, anyhow};
use plotters::prelude::*;

use super::curves;
use super::scene::Examined;

/// Size of a plot, px.
const SIZE: (u32, u32) = (640, 480);
const BLUE: RGBColor = RGBColor(25, 105, 175);
const GREY: RGBColor = RGBColor(120, 130, 140);
const RED: RGBColor = RGBColor(200, 50, 40);
/// Typeface and size of titles and of the numbers at the axes, px.
const TITLE: (&str, u32) = ("sans-serif", 16);
const LABEL: (&str, u32) = ("sans-serif", 13);

/// Share of right answers over the probability given, with 95 % intervals; dots grow with the number of scenes.
pub fn reliability(scenes: &[Examined]) -> Result<String> {
    let bins = curves::reliability(scenes);
    let title = format!("Reliability: {} scenes, Brier score {:.4}", scenes.len(), curves::brier(scenes));
    drawn(|svg| {
        let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .margin(12)
            .caption(title, TITLE)
            .x_label_area_size(40)
            .y_label_area_size(52)
            .build_cartesian_2d(0.0..1.0, 0.0..1.0)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GREY.mix(0.2))
            .x_desc("probability given")
            .y_desc("share that is right")
            .label_style(LABEL)
            .draw()?;
        chart.draw_series(LineSeries::new([(0.0, 0.0), (1.0, 1.0)], GREY.stroke_width(1)))?;
        for bin in &bins {
            let [low, high] = bin.interval;
            chart.draw_series(LineSeries::new(
                [(bin.claimed, low), (bin.claimed, high)],
                BLUE.mix(0.5).stroke_width(2),
            ))?;
        }
        chart.draw_series(LineSeries::new(bins.iter().map(|b| (b.claimed, b.right)), BLUE.stroke_width(1)))?;
        let size = |count: usize| (2.0 + (count as f64).log10() * 2.5).round() as i32;
        chart.draw_series(bins.iter().map(|b| Circle::new((b.claimed, b.right), size(b.count), BLUE.filled())))?;
        Ok(area.present()?)
    })
}

/// Share of wrong answers over the share of visible nets answered, as the threshold sinks; a mark where it is `threshold`.
pub fn risk_coverage(scenes: &[Examined], threshold: f64) -> Result<String> {
    let choices = curves::risk_coverage(scenes);
    let chosen = curves::at(&choices, threshold);
    let most = choices.iter().map(|c| c.risk).fold(0.0, f64::max);
    let top = (1.1 * most).clamp(0.02, 1.0);
    let title = format!(
        "At probability {threshold}: {:.1} % of visible nets answered, {} of {} answers wrong",
        100.0 * chosen.coverage,
        chosen.wrong,
        chosen.answers
    );
    drawn(|svg| {
        let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .margin(12)
            .caption(title, TITLE)
            .x_label_area_size(40)
            .y_label_area_size(60)
            .build_cartesian_2d(0.0..1.0, 0.0..top)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GREY.mix(0.2))
            .x_desc("coverage: share of visible nets answered")
            .y_desc("risk: share of answers that are wrong")
            .label_style(LABEL)
            .draw()?;
        chart.draw_series(LineSeries::new(choices.iter().map(|c| (c.coverage, c.risk)), BLUE.stroke_width(2)))?;
        chart.draw_series([Circle::new((chosen.coverage, chosen.risk), 5, RED.filled())])?;
        Ok(area.present()?)
    })
}

/// What goes wrong in drawing: a formatting error, which memory does not give.
type Drawing = std::result::Result<(), Box<dyn std::error::Error + Send + Sync>>;

fn drawn(draw: impl FnOnce(&mut String) -> Drawing) -> Result<String> {
    let mut svg = String::new();
    draw(&mut svg).map_err(|e| anyhow!("cannot draw: {e}"))?;
    Ok(svg)
}
