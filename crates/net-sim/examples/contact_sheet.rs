//! Draws a frame of every scenario, or of those named, onto one sheet: `cargo run -p net-sim --example contact_sheet -- sheet.png [name ...]`.

use image::{GrayImage, imageops};
use net_sim::{Image, Scenario, Simulator};

/// Scenarios side by side.
const COLUMNS: u32 = 6;
/// Size of one, px.
const TILE: (u32, u32) = (424, 240);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or("usage: contact_sheet FILE.png [SCENARIO ...]")?;
    let names: Vec<String> = arguments.collect();
    let named: Result<Vec<_>, _> = names.iter().map(|name| Scenario::by_name(name)).collect();
    let chosen = if names.is_empty() { Scenario::all() } else { named? };
    let columns = COLUMNS.min(chosen.len() as u32).max(1);
    let rows = (chosen.len() as u32).div_ceil(columns);
    let mut sheet = GrayImage::new(columns * TILE.0, rows * TILE.1);
    let mut image = Image::default();
    for (k, scenario) in (0u32..).zip(chosen) {
        let frame = scenario.frame(scenario.frames / 2)?;
        let mut simulator = Simulator::new(scenario.camera()?);
        let start = std::time::Instant::now();
        let truth = simulator.render(&frame.scene, frame.seed, &mut image)?;
        let (column, row) = (k % columns, k / columns);
        let knots: usize = truth.layers.iter().map(|l| l.nodes.len()).sum();
        println!(
            "row {} column {}: {:18} {:4} ms {:6} knots  {}",
            row + 1,
            column + 1,
            scenario.name,
            start.elapsed().as_millis(),
            knots,
            scenario.description
        );
        let picture = GrayImage::from_raw(image.width() as u32, image.height() as u32, image.data().to_vec());
        let picture = picture.ok_or("the picture has its size")?;
        let small = imageops::resize(&picture, TILE.0, TILE.1, imageops::FilterType::Triangle);
        imageops::replace(&mut sheet, &small, i64::from(column * TILE.0), i64::from(row * TILE.1));
    }
    sheet.save(file)?;
    Ok(())
}
