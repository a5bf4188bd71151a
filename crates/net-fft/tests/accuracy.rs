//! Poses against the simulator's truth, from 0.3 to 6 m, with one configuration.

#![allow(clippy::unwrap_used)] // a test may stop

mod scene;

use net_fft::{PlaneSource, Side, ThesisConfig};
use net_geometry::{Camera, Lens, Mesh};
use net_sim::Scene;
use scene::{Off, camera, draw, estimate, scene_of, square};

/// Of flat nets in clear water: the wave vectors of twenty waves, read to a fiftieth of a bin of some ten, say range and tilt to about so much.
const RANGE_PERCENT: f64 = 0.6;
const NORMAL_DEG: f64 = 1.0;

/// Draws, estimates, and holds against the truth.
fn check(what: &str, mesh: &Mesh, scene: &Scene, range_percent: f64, normal_deg: f64) -> Off {
    let camera = camera();
    let (picture, truth) = draw(&camera, scene, 3);
    let found = estimate(&camera, mesh, &ThesisConfig::default(), &picture).expect(what);
    let off = Off::of(&found, &truth.unwrap());
    println!("{what}: p {:.3}, {off:?}", found.probability);
    assert!(found.probability > 0.5, "{what}: refused at {:.3}, {off:?}", found.probability);
    assert!(off.range_percent < range_percent && off.normal_deg < normal_deg, "{what}: {off:?}");
    assert!(off.in_plane_deg < normal_deg, "{what}: {off:?}");
    off
}

#[test]
fn one_configuration_from_near_to_far() {
    for range in [0.3, 0.4, 0.6, 1.0, 2.0, 3.0, 4.0, 6.0] {
        check(&format!("{range} m"), &square(), &scene_of(&square(), range, 3.0, -5.0, 4.0), RANGE_PERCENT, NORMAL_DEG);
    }
}

#[test]
fn tilts_have_their_sign() {
    for (tilt_x, tilt_y) in [(20.0, 0.0), (-20.0, 0.0), (0.0, 40.0), (0.0, -40.0), (-30.0, 25.0), (0.0, 55.0)] {
        let what = format!("tilts {tilt_x} and {tilt_y} degrees");
        // Where the net recedes fastest the waves are read in half of the sections.
        check(&what, &square(), &scene_of(&square(), 1.2, tilt_x, tilt_y, -9.0), 2.0 * RANGE_PERCENT, NORMAL_DEG);
    }
}

#[test]
fn rolls_through_all_labels() {
    for roll in [-80.0, -44.0, -20.0, 30.0, 46.0, 75.0] {
        let scene = scene_of(&square(), 1.5, 12.0, -18.0, roll);
        check(&format!("roll {roll} degrees"), &square(), &scene, RANGE_PERCENT, NORMAL_DEG);
    }
}

#[test]
fn dark_nets_on_light_water() {
    for range in [0.5, 1.5, 3.0] {
        let mut scene = scene_of(&square(), range, 0.0, 20.0, 5.0);
        scene.layers[0].net.twine.grey = 20.0;
        scene.water.veil_grey = 150.0;
        check(&format!("dark twine at {range} m"), &square(), &scene, RANGE_PERCENT, NORMAL_DEG);
    }
}

#[test]
fn rectangular_and_diamond_meshes_keep_their_sides_apart() {
    let rectangle = Mesh::rectangular(0.06, 0.04).unwrap();
    for (roll, side) in [(5.0, Side::First), (85.0, Side::Second), (-60.0, Side::Second), (-30.0, Side::First)] {
        let scene = scene_of(&rectangle, 1.2, 10.0, 15.0, roll);
        check(&format!("60 x 40 mm at {roll} degrees"), &rectangle, &scene, RANGE_PERCENT, NORMAL_DEG);
        let (picture, _) = draw(&camera(), &scene, 3);
        let found = estimate(&camera(), &rectangle, &ThesisConfig::default(), &picture).unwrap();
        assert_eq!(found.x_side, side, "at {roll} degrees");
        let first = if side == Side::First { 0.06 } else { 0.04 };
        assert_eq!(found.mesh.side1(), first);
    }
    let diamond = Mesh::oblique(0.05, 0.05, 70f64.to_radians()).unwrap();
    check("diamond", &diamond, &scene_of(&diamond, 1.2, 0.0, 25.0, 10.0), RANGE_PERCENT, NORMAL_DEG);
}

#[test]
fn square_nets_that_hang_askew() {
    for shear in [-18.0, 12.0] {
        let mut scene = scene_of(&square(), 1.1, 10.0, 15.0, 5.0);
        scene.layers[0].net.shear_deg = shear;
        let off =
            check(&format!("sheared by {shear} degrees"), &square(), &scene, 2.0 * RANGE_PERCENT, 1.5 * NORMAL_DEG);
        assert!(off.angle_deg < 1.5, "crossing angle: {off:?}");
    }
}

#[test]
fn bent_nets_are_read_where_the_optical_axis_meets_them() {
    for curvature_per_m in [[0.1, 0.0, 0.1], [-0.1, 0.05, 0.0], [0.0, 0.0, -0.15]] {
        let mut scene = scene_of(&square(), 1.5, 5.0, 20.0, 5.0);
        scene.layers[0].net.surface.curvature_per_m = curvature_per_m;
        // A sheet that bends by centimetres over the view is no parabola to better than this.
        let what = format!("bent by {curvature_per_m:?}");
        check(&what, &square(), &scene, 2.0 * RANGE_PERCENT, NORMAL_DEG);
    }
}

#[test]
fn strongly_bent_nets_are_right_or_refused() {
    for curvature_per_m in [[0.25, 0.0, 0.1], [-0.25, 0.0, 0.0], [0.3, 0.1, -0.2], [0.0, 0.0, 0.4]] {
        let mut scene = scene_of(&square(), 1.5, 5.0, 20.0, 5.0);
        scene.layers[0].net.surface.curvature_per_m = curvature_per_m;
        let (picture, truth) = draw(&camera(), &scene, 3);
        let Some(found) = estimate(&camera(), &square(), &ThesisConfig::default(), &picture) else { continue };
        let off = Off::of(&found, &truth.unwrap());
        assert!(off.is_right() || found.probability < 0.5, "{curvature_per_m:?}: {} {off:?}", found.probability);
    }
}

#[test]
fn through_a_lens() {
    let lens = Lens::PlumbBob([-0.25, 0.08, 0.0005, -0.0003, 0.0]);
    let bent = Camera::new(600.0, 590.0, 430.0, 235.0, 848, 480, lens).unwrap();
    let (picture, truth) = draw(&bent, &scene_of(&square(), 1.3, 15.0, -20.0, 7.0), 5);
    let found = estimate(&bent, &square(), &ThesisConfig::default(), &picture).unwrap();
    let off = Off::of(&found, &truth.unwrap());
    assert!(off.range_percent < 2.0 * RANGE_PERCENT && off.normal_deg < NORMAL_DEG, "{off:?}");
}

#[test]
fn planes_through_places_come_close_to_the_plane_of_the_waves() {
    let (picture, truth) = draw(&camera(), &scene_of(&square(), 1.5, 10.0, 20.0, 5.0), 5);
    let truth = truth.unwrap();
    let found = estimate(&camera(), &square(), &ThesisConfig::default(), &picture).unwrap();
    // A peak's place is biased towards the near edge of its section, by 3 % at this tilt. Three places do not average, and stretch it up to the optical axis: the thesis's own
    // tables show up to 10 %.
    const ALL_PERCENT: f64 = 3.0;
    const THREE_PERCENT: f64 = 10.0;
    for (what, plane, percent) in [
        ("all", found.plane_of_all, ALL_PERCENT),
        ("three", found.plane_of_three, THREE_PERCENT),
        ("closed form", found.plane_of_waves, ALL_PERCENT),
    ] {
        let off = 100.0 * (plane.expect(what).range().unwrap() / truth.range_m - 1.0).abs();
        assert!(off < percent, "{what}: range off by {off} %");
    }
    for (plane, percent) in [(PlaneSource::Svd, ALL_PERCENT), (PlaneSource::MostConfidentThree, THREE_PERCENT)] {
        let config = ThesisConfig { plane, ..ThesisConfig::default() };
        let off = Off::of(&estimate(&camera(), &square(), &config, &picture).unwrap(), &truth);
        assert!(off.range_percent < percent, "{plane:?}: {off:?}");
        assert!(plane != PlaneSource::Svd || off.normal_deg < 8.0 && off.in_plane_deg < 3.0, "{plane:?}: {off:?}");
    }
}

#[test]
fn the_covariance_knows_its_errors() {
    let (mut range, mut tilt, mut count) = (0.0, 0.0, 0.0);
    for (seed, (ahead, tilt_y, jitter)) in
        [(0.8, 10.0, 0.02), (1.2, 25.0, 0.01), (1.6, -20.0, 0.02), (2.2, 0.0, 0.0), (0.6, 30.0, 0.03)]
            .into_iter()
            .enumerate()
    {
        let mut scene = scene_of(&square(), ahead, 5.0, tilt_y, 3.0);
        scene.layers[0].net.jitter = jitter;
        let (picture, truth) = draw(&camera(), &scene, seed as u64);
        let found = estimate(&camera(), &square(), &ThesisConfig::default(), &picture).unwrap();
        let off = Off::of(&found, &truth.unwrap());
        range += (off.range_percent / 100.0 * found.range() / found.covariance.sigma_range(&found.pose)).powi(2);
        tilt += (off.normal_deg.to_radians() / found.covariance.sigma_tilt(&found.pose)).powi(2);
        count += 1.0;
        assert!(found.covariance.sigma_xy(&found.pose) > 0.01, "the place in a cell is open");
        assert!(found.covariance.matrix.cholesky().is_some(), "a covariance is positive definite");
    }
    // One over five pictures: a factor of 2.5 either way is chance.
    for (what, mean) in [("range", range / count), ("tilt", tilt / count)] {
        assert!(mean.sqrt() < 2.5, "{what}: errors are {:.2} sigma", mean.sqrt());
    }
}
