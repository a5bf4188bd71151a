//! Junctions against the truth of drawn nets.

#![allow(clippy::unwrap_used)] // shared by tests

mod scene;

use net_geometry::Mesh;
use net_geometry::nalgebra::{Vector2, Vector3};
use net_junction::{CellArea, Config, Expectation, JunctionDetector};
use scene::{HEIGHT, Scene, Score, WIDTH, scene, score, view};

fn detect(scene: &Scene, config: &Config, expectation: Option<&Expectation>) -> Score {
    let picture = scene.draw();
    let mut detector = JunctionDetector::new(WIDTH, HEIGHT, config).unwrap();
    let junctions = detector.detect(view(&picture), expectation).unwrap();
    // Nodes whose four meshes are whole in the picture; for precision any node counts.
    score(junctions, &scene.nodes(-2.0), &scene.inner_nodes(1.2, 7.0), (0.2 * scene.cell_px()).clamp(1.5, 3.0))
}

fn with_pose(scene: &Scene) -> Score {
    detect(scene, &Config::default(), Some(&Expectation::Net(scene.net.clone())))
}

/// Root mean square error, px: twine of a pixel's width read to a sixth of a pixel (3 grey levels of noise; at 45 degrees of tilt the far twine
/// is half a pixel wide), and at the picture's cut border half a twine, which grows with the cells, that neighbours tell to a tenth.
fn rmse_allowed(scene: &Scene) -> f64 {
    0.16 + 0.003 * scene.cell_px()
}

fn check(s: &Scene, least_recall: f64) {
    let got = with_pose(s);
    let what = format!("{:.1} px cells, contrast {}: {got:?}", s.cell_px(), s.contrast);
    println!("{what}, recall {:.3}", got.recall());
    assert!(got.recall() >= least_recall, "recall {:.3}, {what}", got.recall());
    // A corner of an opening is no junction without a second one that says the same.
    assert!(got.precision() >= 0.995, "precision {:.3}, {what}", got.precision());
    assert!(got.rmse <= rmse_allowed(s), "{what}");
    // The claimed sigma is right to a factor of 1.5 either way, over pictures and distances.
    assert!((0.65..1.5).contains(&got.error_over_sigma), "{what}");
    assert_eq!(got.named_wrong, 0, "{what}");
    assert!(got.named_right as f64 >= 0.98 * got.right as f64, "{what}");
}

#[test]
fn one_configuration_for_cells_of_80_to_9_px_facing() {
    // 50 mm cells: 80 px to 8.8 px.
    for range in [0.375, 1.0, 2.0, 3.0, 3.4] {
        check(&scene(range, 0.0, 0.0, 7.0), 0.99);
    }
}

#[test]
fn tilted_nets_up_to_45_degrees() {
    for (range, tilt_x, tilt_y, least) in [
        (0.5, 0.0, 20.0, 0.99),
        (1.0, -35.0, 0.0, 0.99),
        (1.5, 0.0, 30.0, 0.95),
        (1.0, 20.0, 40.0, 0.85),
        (2.5, 30.0, 0.0, 0.85),
    ] {
        check(&scene(range, tilt_x, tilt_y, -11.0), least);
    }
}

#[test]
fn dark_twine_is_found_as_well_as_light_twine() {
    for (range, tilt_y) in [(0.6, 0.0), (1.5, 20.0), (3.0, 0.0)] {
        check(&Scene { contrast: -60.0, background: 120.0, ..scene(range, 0.0, tilt_y, 4.0) }, 0.95);
    }
}

#[test]
fn oblique_and_rectangular_meshes() {
    let mut s = scene(1.2, 10.0, 20.0, 0.0);
    s.net.mesh = Mesh::oblique(0.05, 0.05, 65_f64.to_radians()).unwrap();
    check(&s, 0.95);
    s.net.mesh = Mesh::rectangular(0.06, 0.04).unwrap();
    check(&s, 0.95);
}

/// The thesis's grid of 30 x 50 nodes at 3 m, 30 degrees: 28 x 48 have four meshes.
fn grid_of_the_thesis() -> Scene {
    let mut s = scene(3.0, 0.0, 30.0, 0.0);
    s.extent = [(-24, 25), (-14, 15)];
    let half_a_cell = Vector3::new(0.025, 0.025, 0.0);
    s.net.pose.translation = Vector3::new(0.0, 0.0, 3.0) - s.net.pose.rotation * half_a_cell;
    // Lines of 2 px as in the thesis's pictures.
    s.twine = 0.01;
    s
}

/// Inner junctions of that grid that were found, of 1344, and the score.
fn on_the_grid(config: &Config, expectation: impl Fn(&Scene) -> Option<Expectation>) -> Score {
    let s = grid_of_the_thesis();
    let inner = s.inner_nodes(0.99, 0.0);
    assert_eq!(inner.len(), 1344);
    let mut detector = JunctionDetector::new(WIDTH, HEIGHT, config).unwrap();
    let picture = s.draw();
    let junctions = detector.detect(view(&picture), expectation(&s).as_ref()).unwrap();
    let got = score(junctions, &s.nodes(0.0), &inner, 2.0);
    println!("{} of 1344 inner junctions, {got:?}, precision {:.4}", got.inner_found, got.precision());
    got
}

/// Algorithm 5, mended or printed, with the true cell on the axis.
fn area(s: &Scene, printed: bool) -> Option<Expectation> {
    let axis = s.net.basis_at(Vector2::new(424.0, 240.0)).unwrap().cell_area().abs();
    let plane = s.net.pose.plane();
    let area = if printed {
        CellArea::as_printed(axis, plane, &s.net.camera)
    } else {
        Some(CellArea::on_plane(axis, plane, s.net.camera))
    };
    Some(Expectation::Area(area.unwrap()))
}

#[test]
fn the_grid_of_the_thesis_with_a_pose() {
    let got = on_the_grid(&Config::default(), |s| Some(Expectation::Net(s.net.clone())));
    // The thesis: 878 or 1201, by its eps.
    assert!(got.inner_found > 1300);
    assert!(got.precision() > 0.99);
    assert!(got.rmse < 0.2);
    assert_eq!(got.named_wrong, 0);
}

#[test]
fn the_grid_of_the_thesis_with_less() {
    let mended = on_the_grid(&Config::default(), |s| area(s, false));
    let printed = on_the_grid(&Config::default(), |s| area(s, true));
    let nothing = on_the_grid(&Config::default(), |_| None);
    for got in [&mended, &printed, &nothing] {
        assert!(got.inner_found > 1250);
        assert!(got.precision() > 0.99);
    }
    // Fixed block, eps and rectangles.
    let thesis = on_the_grid(&Config::thesis(), |s| area(s, false));
    assert!(thesis.inner_found < mended.inner_found);
    assert!(thesis.precision() > 0.95);
}
