//! Antialiased strokes on a picture.

use std::path::Path;

use anyhow::{Context, Result};
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use net_geometry::nalgebra::Vector2;
use net_image::GrayView;

/// Red, green, blue.
pub type Colour = [u8; 3];

/// A colour picture to draw on. Pixel centres lie at whole numbers, as in every picture here.
#[derive(Debug, Clone)]
pub struct Canvas {
    width: usize,
    height: usize,
    rgb: Vec<u8>,
}

impl Canvas {
    /// A copy of a grey picture.
    pub fn from_gray(gray: GrayView<'_>) -> Self {
        let rgb = gray.rows().flatten().flat_map(|&g| [g, g, g]).collect();
        Self { width: gray.width(), height: gray.height(), rgb }
    }

    /// A picture of one colour.
    pub fn filled(width: usize, height: usize, colour: Colour) -> Self {
        Self { width, height, rgb: colour.repeat(width * height) }
    }

    /// Width, px.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, px.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The colour at `(u, v)`.
    #[cfg(test)]
    pub fn pixel(&self, u: usize, v: usize) -> Colour {
        let at = 3 * (v * self.width + u);
        [self.rgb[at], self.rgb[at + 1], self.rgb[at + 2]]
    }

    /// Mixes `colour` into pixel `(u, v)`; `cover` 0 leaves it, 1 replaces it. Outside the picture nothing happens.
    pub fn blend(&mut self, u: i64, v: i64, colour: Colour, cover: f64) {
        let inside = (0..self.width as i64).contains(&u) && (0..self.height as i64).contains(&v);
        if !inside || cover <= 0.0 {
            return;
        }
        let at = 3 * (v as usize * self.width + u as usize);
        for (old, new) in self.rgb[at..at + 3].iter_mut().zip(colour) {
            *old = (f64::from(*old) + (f64::from(new) - f64::from(*old)) * cover.min(1.0)).round() as u8;
        }
    }

    /// A line from `a` to `b`, `width` px wide. Ends far outside the picture cost nothing.
    pub fn line(&mut self, a: Vector2<f64>, b: Vector2<f64>, width: f64, colour: Colour, opacity: f64) {
        let steep = (b.y - a.y).abs() > (b.x - a.x).abs();
        // Walk along the longer axis, and across the stroke at every step.
        let swap = |p: Vector2<f64>| if steep { p.yx() } else { p };
        let (mut p, mut q) = (swap(a), swap(b));
        if p.x > q.x {
            std::mem::swap(&mut p, &mut q);
        }
        let length = (q - p).norm();
        if !length.is_finite() || length == 0.0 {
            return;
        }
        let (along_size, across_size) = if steep { (self.height, self.width) } else { (self.width, self.height) };
        let slope = (q.y - p.y) / (q.x - p.x);
        let squeeze = (q.x - p.x) / length;
        let half = width / 2.0;
        let first = (p.x - half).floor().max(0.0) as i64;
        let last = (q.x + half).ceil().min(along_size as f64 - 1.0) as i64;
        for along in first..=last {
            let x = along as f64;
            let centre = p.y + (x - p.x) * slope;
            let reach = (half + 1.0) / squeeze;
            let low = (centre - reach).floor().max(0.0) as i64;
            let high = (centre + reach).ceil().min(across_size as f64 - 1.0) as i64;
            let end = (half + 0.5 - (p.x - x).max(x - q.x).max(0.0)).clamp(0.0, 1.0);
            for across in low..=high {
                let distance = (across as f64 - centre).abs() * squeeze;
                let cover = (half + 0.5 - distance).clamp(0.0, 1.0) * end * opacity;
                let (u, v) = if steep { (across, along) } else { (along, across) };
                self.blend(u, v, colour, cover);
            }
        }
    }

    /// A circle's outline, `width` px wide.
    pub fn ring(&mut self, centre: Vector2<f64>, radius: f64, width: f64, colour: Colour, opacity: f64) {
        let reach = radius + width;
        if !(centre.x.is_finite() && centre.y.is_finite() && reach.is_finite()) {
            return;
        }
        let (u0, u1) = ((centre.x - reach).max(0.0) as i64, (centre.x + reach).min(self.width as f64) as i64);
        let (v0, v1) = ((centre.y - reach).max(0.0) as i64, (centre.y + reach).min(self.height as f64) as i64);
        for v in v0..=v1 {
            for u in u0..=u1 {
                let distance = (Vector2::new(u as f64, v as f64) - centre).norm() - radius;
                self.blend(u, v, colour, (width / 2.0 + 0.5 - distance.abs()).clamp(0.0, 1.0) * opacity);
            }
        }
    }

    /// The picture as a PNG file.
    pub fn to_png(&self) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.encode(PngEncoder::new(&mut bytes))?;
        Ok(bytes)
    }

    /// Writes the picture as JPEG: overlays are looked at, not measured.
    pub fn write_jpeg(&self, path: &Path) -> Result<()> {
        let mut bytes = Vec::new();
        self.encode(JpegEncoder::new_with_quality(&mut bytes, 90))?;
        std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
    }

    fn encode(&self, encoder: impl ImageEncoder) -> Result<()> {
        let (width, height) = (self.width as u32, self.height as u32);
        encoder.write_image(&self.rgb, width, height, ExtendedColorType::Rgb8).context("cannot encode the overlay")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHITE: Colour = [255; 3];

    fn black(width: usize, height: usize) -> Canvas {
        Canvas { width, height, rgb: vec![0; 3 * width * height] }
    }

    /// Light that a stroke leaves is its area: length times width, whatever its direction.
    #[test]
    fn a_stroke_covers_its_length_times_its_width() {
        for (dx, dy) in [(40.0, 0.0), (0.0, 40.0), (28.0, 28.0), (35.0, -19.0), (-12.0, 37.0)] {
            let mut canvas = black(121, 121);
            let a = Vector2::new(60.3, 60.6);
            canvas.line(a, a + Vector2::new(dx, dy), 3.0, WHITE, 1.0);
            let area: f64 = canvas.rgb.iter().step_by(3).map(|&g| f64::from(g) / 255.0).sum();
            let expected = f64::hypot(dx, dy) * 3.0;
            // The blunt ends add up to one pixel of length each.
            assert!((area - expected).abs() < 0.12 * expected, "({dx}, {dy}): {area} for {expected}");
        }
    }

    #[test]
    fn strokes_outside_or_without_end_do_no_harm() {
        let mut canvas = black(9, 7);
        for end in [f64::NAN, f64::INFINITY, 1e300, -1e12] {
            canvas.line(Vector2::new(-50.0, -60.0), Vector2::new(end, -9.0), 2.0, WHITE, 1.0);
            canvas.ring(Vector2::new(end, 3.0), 2.0, 1.0, WHITE, 1.0);
        }
        assert!(canvas.rgb.iter().all(|&g| g == 0));
    }
}
