//! Light to numbers: vignette, exposure, noise and eight bits.

use net_image::Image;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::random::{Addressed, Stream};
use crate::scene::{Scene, Sensor};

/// What the lens loses towards the corners and the exposure makes of the rest.
pub(crate) fn expose(picture: &mut [f32], scene: &Scene, width: usize, height: usize) {
    let (gain, loss) = (scene.sensor.gain as f32, scene.light.vignette as f32);
    if gain == 1.0 && loss == 0.0 {
        return;
    }
    let (cx, cy) = (0.5 * (width as f32 - 1.0), 0.5 * (height as f32 - 1.0));
    let corner = (cx * cx + cy * cy).max(1.0);
    for (v, row) in picture.chunks_exact_mut(width).enumerate() {
        let dy = v as f32 - cy;
        for (u, p) in row.iter_mut().enumerate() {
            let dx = u as f32 - cx;
            *p *= gain * (1.0 - loss * (dx * dx + dy * dy) / corner);
        }
    }
}

/// Adds noise and rounds to whole grey levels.
pub(crate) fn read_out(picture: &[f32], sensor: &Sensor, seed: u64, image: &mut Image<u8>) {
    let mut rng = ChaCha8Rng::seed_from_u64(Addressed::new(seed, Stream::Noise).bits(0, 0, 0));
    let read2 = (sensor.read_noise_grey * sensor.read_noise_grey) as f32;
    let shot = if sensor.full_well_e > 0.0 { (255.0 / sensor.full_well_e) as f32 } else { 0.0 };
    let noisy = read2 > 0.0 || shot > 0.0;
    for (out, &grey) in image.data_mut().iter_mut().zip(picture) {
        let noise = if noisy {
            let normal: f32 = StandardNormal.sample(&mut rng);
            normal * (read2 + shot * grey.max(0.0)).sqrt()
        } else {
            0.0
        };
        // The cast saturates, which is what a sensor does at both ends.
        *out = (grey + noise).round() as u8;
    }
}
