//! Light to numbers: noise and eight bits.

use net_image::Image;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::scene::Sensor;

/// Adds noise and rounds to whole grey levels.
pub(crate) fn expose(picture: &[f32], sensor: &Sensor, seed: u64, image: &mut Image<u8>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let read = sensor.read_noise_grey as f32;
    for (out, &grey) in image.data_mut().iter_mut().zip(picture) {
        let noise: f32 = StandardNormal.sample(&mut rng);
        // The cast saturates, which is what a sensor does at both ends.
        *out = (grey + read * noise).round() as u8;
    }
}
