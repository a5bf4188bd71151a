//! Net adjustment against the truth of drawn nets.

#![allow(clippy::unwrap_used)] // shared by tests

mod scene;

use net_geometry::nalgebra::{Vector2, Vector3};
use net_geometry::{JunctionState, Mesh};
use net_image::View;
use net_junction::{AdjustConfig, LatticeMap, NetAdjuster, TwineState};
use scene::{HEIGHT, Scene, Score, WIDTH, scene, score, view};

fn adjust(scene: &Scene, predicted: &net_junction::ExpectedNet) -> Score {
    let picture = scene.draw();
    let mut adjuster = NetAdjuster::new(WIDTH, HEIGHT, &AdjustConfig::default()).unwrap();
    let junctions = adjuster.adjust(view(&picture), predicted).unwrap();
    score(junctions, &scene.nodes(-2.0), &scene.inner_nodes(1.0, 5.0), 2.0)
}

fn check(s: &Scene, rmse_allowed: f64) {
    let mut predicted = s.net.clone();
    // A fifth of a cell along the net: less than a third, beyond which the neighbouring twine is as near.
    predicted.pose.translation += s.net.pose.rotation * Vector3::new(0.01, -0.006, 0.0);
    let got = adjust(s, &predicted);
    let what = format!("cells of {:.1} px, contrast {}: {got:?}", s.cell_px(), s.contrast);
    println!("{what}, recall {:.4}", got.recall());
    assert!(got.recall() > 0.99, "{what}");
    assert_eq!(got.right, got.found, "{what}");
    assert_eq!(got.named_wrong, 0, "{what}");
    assert!(got.rmse < rmse_allowed, "{what}");
    // Drawn twine has no shading, for which sigma makes allowance.
    assert!(got.error_over_sigma < 1.2, "{what}");
}

#[test]
fn nodes_are_found_from_a_prediction_that_is_off() {
    for (range, tilt_x, tilt_y, contrast) in [
        (0.5, 0.0, 0.0, 60.0),
        (1.0, 0.0, 20.0, 60.0),
        (1.5, -35.0, 0.0, -60.0),
        (2.5, 0.0, 30.0, 60.0),
        (3.5, 0.0, 0.0, -40.0),
        (1.0, 20.0, 40.0, 25.0),
    ] {
        // 3 grey levels of noise: a tenth of a pixel on one twine of half a pixel's width, less on more.
        check(&Scene { contrast, background: 120.0, ..scene(range, tilt_x, tilt_y, 7.0) }, 0.13);
    }
}

#[test]
fn an_oblique_mesh() {
    let mut s = scene(1.2, 10.0, 20.0, 0.0);
    s.net.mesh = Mesh::oblique(0.05, 0.05, 65_f64.to_radians()).unwrap();
    check(&s, 0.13);
}

#[test]
fn the_grid_of_the_thesis_is_found_whole_and_nothing_beyond_its_end() {
    let mut s = scene(3.0, 0.0, 30.0, 0.0);
    s.extent = [(-24, 25), (-14, 15)];
    s.net.pose.translation = Vector3::new(0.0, 0.0, 3.0) - s.net.pose.rotation * Vector3::new(0.025, 0.025, 0.0);
    s.twine = 0.01;
    let picture = s.draw();
    let mut adjuster = NetAdjuster::new(WIDTH, HEIGHT, &AdjustConfig::default()).unwrap();
    let junctions = adjuster.adjust(view(&picture), &s.net).unwrap();
    let seen: Vec<_> = junctions.iter().filter(|j| j.state == JunctionState::Seen).copied().collect();
    let got = score(&seen, &s.nodes(0.0), &s.inner_nodes(0.99, 0.0), 2.0);
    println!("{} of 1344, {got:?}", got.inner_found);
    assert_eq!(got.inner_found, 1344);
    assert_eq!(got.named_wrong, 0);
    assert_eq!(got.right, got.found);
}

/// A prediction that knows nothing of the net beyond some cells.
struct Ending<'a>(&'a net_junction::ExpectedNet, f64);

impl LatticeMap for Ending<'_> {
    fn pixel(&self, i: f64, j: f64) -> Option<Vector2<f64>> {
        (i.abs().max(j.abs()) <= self.1).then(|| self.0.pixel(i, j)).flatten()
    }
    fn pixels_per_metre(&self, i: f64, j: f64) -> Option<f64> {
        self.0.pixels_per_metre(i, j)
    }
    fn seed(&self) -> Option<(i32, i32)> {
        self.0.seed()
    }
}

#[test]
fn knots_lead_on_where_the_prediction_ends() {
    let s = scene(1.2, 10.0, 25.0, 5.0);
    let picture = s.draw();
    let mut adjuster = NetAdjuster::new(WIDTH, HEIGHT, &AdjustConfig::default()).unwrap();
    let junctions = adjuster.adjust(view(&picture), &Ending(&s.net, 6.0)).unwrap();
    let seen: Vec<_> = junctions.iter().filter(|j| j.state == JunctionState::Seen).copied().collect();
    let got = score(&seen, &s.nodes(-2.0), &s.inner_nodes(1.0, 5.0), 2.0);
    println!("{got:?}, recall {:.4}", got.recall());
    // 13 x 13 knots are predicted.
    assert!(got.truth > 500, "{got:?}");
    assert!(got.recall() > 0.98, "{got:?}");
    assert_eq!(got.named_wrong, 0, "{got:?}");
    assert_eq!(got.right, got.found, "{got:?}");
}

#[test]
fn knots_too_faint_to_be_measured_lie_between_those_that_are() {
    let s = Scene { contrast: 17.0, ..scene(2.0, 5.0, 10.0, 6.0) };
    let (mut picture, water) = (s.draw(), Scene { contrast: 0.0, ..s.clone() }.draw());
    // Towards a place beside the middle twine fades into the same noise, over ten cells, as shaded twine does where it turns from light to dark.
    let (middle, radius) = (Vector2::new(WIDTH as f64 * 0.35, HEIGHT as f64 * 0.5), 10.0 * s.cell_px());
    for (k, (p, water)) in picture.iter_mut().zip(water).enumerate() {
        let away = Vector2::new((k % WIDTH) as f64, (k / WIDTH) as f64) - middle;
        let share = (away.norm() / radius).clamp(0.05, 1.0);
        *p = (share * f64::from(*p) + (1.0 - share) * f64::from(water)).round() as u8;
    }
    let mut adjuster = NetAdjuster::new(WIDTH, HEIGHT, &AdjustConfig::default()).unwrap();
    let junctions = adjuster.adjust(view(&picture), &s.net).unwrap();
    let inferred: Vec<_> = junctions.iter().filter(|j| j.state == JunctionState::Inferred).copied().collect();
    let got = score(&inferred, &s.nodes(-2.0), &s.inner_nodes(1.0, 5.0), 2.0);
    println!("{got:?}");
    // Within three cells some thirty knots have less than a third of the contrast; of the others one in a hundred may be too faint.
    let near = inferred.iter().filter(|j| (j.pixel - middle).norm() < radius).count();
    assert!(near > 8 && (got.found - near) * 100 < got.truth, "{near} of {got:?}");
    assert_eq!((got.right, got.named_wrong), (got.found, 0), "{got:?}");
    // Drawn knots wander less from their neighbours than real ones, for which sigma makes allowance.
    assert!(got.error_over_sigma < 1.2, "{got:?}");
}

#[test]
fn water_has_no_nodes() {
    for noise in [0.0, 3.0, 15.0] {
        let s = Scene { contrast: 0.0, noise, ..scene(1.0, 0.0, 20.0, 0.0) };
        let picture = s.draw();
        let mut adjuster = NetAdjuster::new(WIDTH, HEIGHT, &AdjustConfig::default()).unwrap();
        let junctions = adjuster.adjust(view(&picture), &s.net).unwrap();
        let seen = junctions.iter().filter(|j| j.state == JunctionState::Seen).count();
        // A net at that place has some 450.
        assert!(seen < 5, "{seen} nodes seen in water, noise {noise}");
    }
}

/// The twine from (2, 1) to (3, 1) and where the water beside it is.
struct Twine {
    ends: [Vector2<f64>; 2],
    aside: Vector2<f64>,
}

impl Twine {
    fn of(s: &Scene) -> Self {
        let at = |i: f64, j: f64| s.net.pixel_at(Vector2::new(i, j)).unwrap();
        Self { ends: [at(2.06, 1.0), at(2.94, 1.0)], aside: at(2.5, 1.5) - at(2.5, 1.0) }
    }

    /// Paints along the twine, from and to these parts of it, and 4 px to both sides, `shift` px further down: what `grey` makes of the drawn picture there and
    /// of the water beside.
    fn paint(&self, drawn: &[u8], picture: &mut [u8], (from, to): (f64, f64), shift: f64, grey: impl Fn(u8, u8) -> u8) {
        let pixel = |p: Vector2<f64>| p.y.round() as usize * WIDTH + p.x.round() as usize;
        let [a, b] = self.ends;
        for k in 0..=200 {
            let p = a + (b - a) * (from + (to - from) * f64::from(k) / 200.0);
            for q in -4..=4 {
                let at = p + Vector2::new(0.0, f64::from(q));
                picture[pixel(at + Vector2::new(0.0, shift))] = grey(drawn[pixel(at)], drawn[pixel(at + self.aside)]);
            }
        }
    }
}

/// The twine's state, after all others were found not to be missing.
fn state_of_the_twine(s: &Scene, picture: &[u8]) -> TwineState {
    let mut adjuster = NetAdjuster::new(WIDTH, HEIGHT, &AdjustConfig::default()).unwrap();
    adjuster.adjust(view(picture), &s.net).unwrap();
    let mut state = TwineState::Unknown;
    for twine in adjuster.twines() {
        if twine.index == (2, 1) && twine.direction == 0 {
            state = twine.state;
        } else {
            assert_ne!(twine.state, TwineState::Missing, "{twine:?}");
        }
    }
    state
}

#[test]
fn a_cut_twine_is_called_missing_and_its_neighbours_present() {
    let s = scene(1.0, 0.0, 15.0, 5.0);
    let (drawn, mut picture) = (s.draw(), s.draw());
    // Painted over with the water beside it.
    Twine::of(&s).paint(&drawn, &mut picture, (0.0, 1.0), 0.0, |_, water| water);
    assert_eq!(state_of_the_twine(&s, &picture), TwineState::Missing);
}

#[test]
fn a_twine_beside_its_place_is_not_called_missing() {
    let s = scene(1.0, 0.0, 15.0, 5.0);
    // Nearer and farther off than the last search goes, 0.12 cells.
    for cells in [0.1, 0.17, 0.23] {
        let (drawn, mut picture) = (s.draw(), s.draw());
        Twine::of(&s).paint(&drawn, &mut picture, (0.0, 1.0), 0.0, |_, water| water);
        Twine::of(&s).paint(&drawn, &mut picture, (0.0, 1.0), cells * s.cell_px(), |twine, _| twine);
        assert_ne!(state_of_the_twine(&s, &picture), TwineState::Missing, "{cells} cells off");
    }
}

#[test]
fn a_twine_under_a_tuft_is_overgrown_and_not_missing() {
    let s = scene(1.0, 0.0, 15.0, 5.0);
    let (drawn, mut picture) = (s.draw(), s.draw());
    // Half of it gives way to something darker than the water by twice the noise of a pixel, of which hundreds are averaged.
    Twine::of(&s).paint(&drawn, &mut picture, (0.25, 0.75), 0.0, |_, water| water.saturating_sub(6));
    assert_eq!(state_of_the_twine(&s, &picture), TwineState::Fouled);
}

#[test]
fn nothing_is_allocated_after_warm_up_and_nothing_is_remembered() {
    let scenes: Vec<_> = [(1.0, 20.0), (2.0, 0.0)].map(|(range, tilt)| scene(range, 0.0, tilt, 5.0)).into();
    let pictures: Vec<_> = scenes.iter().map(Scene::draw).collect();
    let mut adjuster = NetAdjuster::new(WIDTH, HEIGHT, &AdjustConfig::default()).unwrap();
    let first = adjuster.adjust(view(&pictures[0]), &scenes[0].net).unwrap().to_vec();
    assert!(first.len() > 300);
    adjuster.adjust(view(&pictures[1]), &scenes[1].net).unwrap();
    let allocations = allocation_counter::measure(|| {
        adjuster.adjust(view(&pictures[0]), &scenes[0].net).unwrap();
        adjuster.adjust(view(&pictures[1]), &scenes[1].net).unwrap();
    });
    assert_eq!(allocations.count_total, 0);
    assert_eq!(adjuster.adjust(view(&pictures[0]), &scenes[0].net).unwrap(), first);
}

#[test]
fn bad_input_gives_an_error_or_nothing() {
    let s = scene(1.0, 0.0, 0.0, 0.0);
    let picture = s.draw();
    let mut adjuster = NetAdjuster::new(WIDTH, HEIGHT, &AdjustConfig::default()).unwrap();
    for translation in [
        Vector3::new(0.0, 0.0, f64::NAN),
        Vector3::zeros(),
        Vector3::new(0.0, 0.0, -1.0),
        Vector3::new(0.0, 0.0, 1e9),
        Vector3::new(1e9, 0.0, 1.0),
        Vector3::new(f64::INFINITY, 0.0, 1.0),
        Vector3::new(0.0, 0.0, 0.01),
    ] {
        let mut net = s.net.clone();
        net.pose.translation = translation;
        let junctions = adjuster.adjust(view(&picture), &net).unwrap();
        assert!(junctions.iter().all(|j| j.pixel.x.is_finite() && j.sigma_px.is_finite()));
    }
    let small = [0_u8; 12];
    assert!(adjuster.adjust(View::packed(&small, 4, 3).unwrap(), &s.net).is_err());
    let mut tiny = NetAdjuster::new(1, 1, &AdjustConfig::default()).unwrap();
    assert!(tiny.adjust(View::packed(&small[..1], 1, 1).unwrap(), &s.net).unwrap().is_empty());
    for grey in [0, 255] {
        let flat = vec![grey; WIDTH * HEIGHT];
        let junctions = adjuster.adjust(view(&flat), &s.net).unwrap();
        assert!(junctions.iter().all(|j| j.state != JunctionState::Seen));
    }
    let config = AdjustConfig { search_cells: Vec::new(), ..AdjustConfig::default() };
    assert!(NetAdjuster::new(10, 10, &config).is_err());
    assert!(NetAdjuster::new(0, 10, &AdjustConfig::default()).is_err());
}
