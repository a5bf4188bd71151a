//! The thesis's own way: four sections, each with its own choice (its errata mended).

#![allow(clippy::unwrap_used)] // a test may stop

mod scene;

use net_fft::{PlaneSource, ThesisConfig};
use scene::{Off, camera, draw, estimate, scene_of, square};

#[test]
fn a_facing_net_at_the_distances_it_was_made_for() {
    for plane in [PlaneSource::MostConfidentThree, PlaneSource::Svd] {
        let config = ThesisConfig { plane, ..ThesisConfig::thesis(false) };
        let (picture, truth) = draw(&camera(), &scene_of(&square(), 2.0, 0.0, 0.0, 3.0), 1);
        let found = estimate(&camera(), &square(), &config, &picture).unwrap();
        let off = Off::of(&found, &truth.unwrap());
        // Its Tables 5.3 to 5.5: 201.7 cm and 1.5 degrees.
        assert!(off.range_percent < 3.0 && off.normal_deg < 5.0, "{plane:?}: {off:?}");
    }
}

#[test]
fn sections_tell_the_sign_of_a_tilt() {
    for tilt in [-20.0, 20.0] {
        let (picture, truth) = draw(&camera(), &scene_of(&square(), 1.6, 0.0, tilt, 0.0), 1);
        let found = estimate(&camera(), &square(), &ThesisConfig::thesis(false), &picture).unwrap();
        assert_eq!(found.plane.normal.x.signum(), truth.unwrap().normal.x.signum(), "tilt {tilt}");
    }
}
