//! Pictures of sizes that no camera has, and of some that few have.

#![allow(clippy::unwrap_used)] // a test may stop

use net_fft::{Error, ThesisConfig, ThesisEstimator};
use net_geometry::{Camera, Lens, Mesh};
use net_image::View;

fn estimator(focal: f64, width: u32, height: u32) -> Result<ThesisEstimator, Error> {
    let (cx, cy) = (0.5 * f64::from(width), 0.5 * f64::from(height));
    let camera = Camera::new(focal, focal, cx, cy, width, height, Lens::None).unwrap();
    ThesisEstimator::new(&camera, &Mesh::square(0.05).unwrap(), &ThesisConfig::default())
}

#[test]
fn a_line_of_pixels_cannot_be_quartered_and_is_refused() {
    for (width, height) in [(60_000, 1), (1, 60_000), (60_000, 2)] {
        let error = estimator(600.0, width, height).unwrap_err();
        assert!(matches!(error, Error::EmptySize { .. }), "{width}x{height}: {error}");
    }
    // Four lines can: there is nothing in them, and no harm done.
    let mut estimator = estimator(600.0, 60_000, 4).unwrap();
    let found = estimator.estimate(View::packed(&vec![90; 240_000], 60_000, 4).unwrap()).unwrap();
    assert!(found.is_none_or(|found| found.probability < 0.5));
}

#[test]
fn a_picture_of_64_megapixels_is_read_like_a_small_one() {
    const SIDE: usize = 8192;
    // A cell of 0.05 m at 1 m is 290.7 px, its twine 18: prime to all powers of two.
    let (focal, period, twine) = (5814.0, 290.7, 18.0);
    let mut estimator = estimator(focal, SIDE as u32, SIDE as u32).unwrap();
    let is_twine: Vec<bool> = (0..SIDE).map(|u| u as f64 % period < twine).collect();
    let picture: Vec<u8> = is_twine
        .iter()
        .flat_map(|&row| is_twine.iter().map(move |&column| if row || column { 200 } else { 60 }))
        .collect();
    let found = estimator.estimate(View::packed(&picture, SIDE, SIDE).unwrap()).unwrap().unwrap();
    // The edges are not smoothed: half a pixel in eight that make one of the reduced picture.
    assert!((found.range() - 1.0).abs() < 0.005, "range {}", found.range());
    assert!(found.plane.normal.xy().norm() < 0.01, "normal {}", found.plane.normal);
    assert!(found.probability > 0.7, "probability {}", found.probability);
}
