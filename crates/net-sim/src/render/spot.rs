//! Discs: knots, tufts, particles.

use nalgebra::Vector2;

use super::profile::{DiscSpread, EdgeSpread, REACH_SIGMA};

/// A disc on the picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spot {
    pub(crate) pixel: Vector2<f64>,
    pub(crate) radius_px: f64,
    pub(crate) grey: f32,
    /// Share of what is behind it that it hides.
    pub(crate) strength: f32,
}

impl Spot {
    /// Draws it over what `picture` shows.
    pub(crate) fn draw(&self, disc: &DiscSpread, edge: &EdgeSpread, sigma: f64, width: usize, picture: &mut [f32]) {
        let height = picture.len() / width;
        let reach = self.radius_px + REACH_SIGMA * sigma;
        let span = |centre: f64, size: usize| {
            let low = (centre - reach).ceil().max(0.0);
            let high = (centre + reach).floor().min(size as f64 - 1.0);
            (low <= high).then_some(low as usize..high as usize + 1)
        };
        let (Some(columns), Some(rows)) = (span(self.pixel.x, width), span(self.pixel.y, height)) else { return };
        let radius = (self.radius_px / sigma) as f32;
        for v in rows {
            for u in columns.clone() {
                let distance = (Vector2::new(u as f64, v as f64) - self.pixel).norm() / sigma;
                let cover = self.strength * disc.coverage(distance as f32, radius, edge);
                let out = &mut picture[v * width + u];
                *out += cover * (self.grey - *out);
            }
        }
    }
}
