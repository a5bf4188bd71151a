//! Drawn grids without any noise, as the thesis has them: nothing hides what is a thousand times weaker than the net's waves, and nothing of that may be taken for them.

#![allow(clippy::unwrap_used)] // a test may stop

mod scene;

use net_fft::ThesisConfig;
use net_sim::Scenario;
use scene::{Off, draw, estimate};

/// From which on the thesis's method vouches for a pose.
const CLAIMED: f64 = 0.7;
/// The rounding to 256 levels is all that blurs the place of a peak.
const RANGE_PERCENT: f64 = 0.1;
const NORMAL_DEG: f64 = 0.2;

#[test]
fn the_thesiss_grids_are_read_and_claimed() {
    // Straight ahead at 0.6, 3, 4 and 6 m (figures 5.3 to 5.5), and at 3 m and 30 degrees (5.6).
    for name in ["fig-5.3", "fig-5.4", "fig-5.5", "far-6m", "fig-5.6"] {
        let scenario = Scenario::by_name(name).unwrap();
        let (camera, mesh, frame) = (scenario.camera().unwrap(), scenario.mesh().unwrap(), scenario.frame(0).unwrap());
        let (picture, truth) = draw(&camera, &frame.scene, frame.seed);
        let found = estimate(&camera, &mesh, &ThesisConfig::default(), &picture).expect(name);
        let off = Off::of(&found, &truth.unwrap());
        println!("{name}: p {:.3}, {off:?}", found.probability);
        assert!(off.range_percent < RANGE_PERCENT && off.normal_deg < NORMAL_DEG, "{name}: {off:?}");
        assert!(off.in_plane_deg < NORMAL_DEG, "{name}: {off:?}");
        assert!(found.probability > CLAIMED, "{name}: refused at {:.3}", found.probability);
    }
}
