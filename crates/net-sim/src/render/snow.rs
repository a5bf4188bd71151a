//! Marine snow: small bright particles, sharp at the focus and discs of light nearer by.

use nalgebra::Vector3;

use super::profile::{DiscSpread, EdgeSpread};
use super::spot::Spot;
use super::water::Medium;
use crate::random::{Addressed, Stream};

/// Particles live in a box of this size around the camera's view, m, and come back at the other end when they leave it.
const BOX_M: [f64; 3] = [3.0, 2.0, 2.0];
/// The most particles worth drawing.
const MOST: f64 = 30_000.0;

/// Draws the particles over what `picture` shows.
pub(crate) fn paint(medium: &Medium, disc: &DiscSpread, edge: &EdgeSpread, picture: &mut [f32]) {
    let (scene, camera) = (medium.scene(), medium.camera());
    let snow = &scene.snow;
    let count = (snow.density_per_m3 * BOX_M.iter().product::<f64>()).min(MOST) as i64;
    let random = Addressed::new(scene.seed, Stream::Snow);
    let focal_px = 0.5 * (camera.fx() + camera.fy());
    let width = camera.width() as usize;
    for k in 0..count {
        let place = |axis: usize| {
            let start = random.uniform(k, axis as i64, 0);
            // A slow swirl of its own on top of the common drift.
            let swirl = 0.01 * (scene.time_s * (0.5 + random.uniform(k, axis as i64, 1)) + 6.3 * start).sin();
            (start + (snow.drift_m_per_s[axis] * scene.time_s + swirl) / BOX_M[axis]).rem_euclid(1.0) * BOX_M[axis]
        };
        let point = Vector3::new(place(0) - 0.5 * BOX_M[0], place(1) - 0.5 * BOX_M[1], place(2));
        if point.z < 0.06 {
            continue;
        }
        let Some(pixel) = camera.pixel_from_point(point) else { continue };
        let radius_m = 0.5 * snow.size_m * (0.5 + 1.5 * random.uniform(k, 3, 0).powi(3));
        let radius_px = radius_m * focal_px / point.z;
        // Circle of confusion; its light is that of the particle, spread out.
        let blur_px = 0.5 * snow.aperture_m * focal_px * (1.0 / point.z - 1.0 / snow.focus_m).abs();
        let seen_px = radius_px.hypot(blur_px);
        let strength = (radius_px / seen_px).powi(2) as f32;
        let grey = medium.seen(snow.grey, point, pixel, point.xy()) as f32;
        Spot { pixel, radius_px: seen_px, grey, strength }.draw(disc, edge, scene.sensor.psf_px, width, picture);
    }
}
