//! Pictures with what was found: junctions and twines by state, true missing twines in white.

use std::path::Path;

use image::{Rgb, RgbImage};
use net_geometry::JunctionState;
use net_geometry::nalgebra::Vector2;
use net_junction::{NetAdjuster, TwineState};

use crate::Result;
use crate::sample::Sample;

/// Pixels of the overlay per pixel of the picture.
const SCALE: f64 = 2.0;

fn line(canvas: &mut RgbImage, a: Vector2<f64>, b: Vector2<f64>, colour: [u8; 3]) {
    let (a, b) = (a * SCALE, b * SCALE);
    let steps = (b - a).amax().ceil().clamp(1.0, 5000.0) as usize;
    for k in 0..=steps {
        let p = a + (b - a) * (k as f64 / steps as f64) + Vector2::repeat(0.5 * SCALE);
        if p.x >= 0.0 && p.y >= 0.0 && (p.x as u32) < canvas.width() && (p.y as u32) < canvas.height() {
            canvas.put_pixel(p.x as u32, p.y as u32, Rgb(colour));
        }
    }
}

pub fn draw(folder: &Path, sample: &Sample, adjuster: &NetAdjuster, suffix: &str) -> Result<()> {
    std::fs::create_dir_all(folder)?;
    let (width, height) = (sample.image.width() as u32, sample.image.height() as u32);
    let scale = SCALE as u32;
    let mut canvas = RgbImage::from_fn(width * scale, height * scale, |x, y| {
        Rgb([sample.image.data()[((y / scale) * width + x / scale) as usize]; 3])
    });
    let pixel = |index| adjuster.junctions().iter().find(|j| j.index == Some(index)).map(|j| j.pixel);
    for twine in adjuster.twines() {
        let (i, j) = twine.index;
        let other = if twine.direction == 0 { (i + 1, j) } else { (i, j + 1) };
        let (Some(a), Some(b)) = (pixel(twine.index), pixel(other)) else { continue };
        let colour = match twine.state {
            TwineState::Present => continue,
            TwineState::Unknown => [255, 140, 0],
            TwineState::Doubtful => [255, 0, 255],
            TwineState::Missing => [255, 0, 0],
            TwineState::Hidden => [80, 80, 255],
            TwineState::Fouled => [0, 160, 60],
        };
        line(&mut canvas, a + (b - a) * 0.15, b + (a - b) * 0.15, colour);
    }
    for ((i, j), direction) in &sample.missing {
        let other = if *direction == 0 { (i + 1, *j) } else { (*i, j + 1) };
        let at = |index| sample.knots.iter().find(|k| k.index == index).map(|k| k.pixel);
        if let (Some(a), Some(b)) = (at((*i, *j)), at(other)) {
            line(&mut canvas, a + (b - a) * 0.4, b + (a - b) * 0.4, [255, 255, 255]);
        }
    }
    for junction in adjuster.junctions() {
        let colour = match junction.state {
            JunctionState::Seen => [255, 255, 0],
            JunctionState::Hidden => [80, 80, 255],
            JunctionState::Fouled => [0, 160, 60],
            JunctionState::Missing => [255, 0, 0],
            JunctionState::Inferred => [160, 160, 0],
        };
        for arm in [Vector2::new(1.5, 0.0), Vector2::new(0.0, 1.5)] {
            line(&mut canvas, junction.pixel - arm, junction.pixel + arm, colour);
        }
    }
    let name: String = sample.name.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
    canvas.save(folder.join(format!("{name}{suffix}.png")))?;
    Ok(())
}
