//! Cold starts on flat nets drawn here by supersampling, with a drawing method that the estimator does not share.

use net_geometry::nalgebra::{Rotation3, Vector2, Vector3};
use net_geometry::{Camera, Lens, Mesh};
use net_image::GrayView;
use net_lattice::{Config, LatticeEstimate, LatticeEstimator, Polarity};

const WIDTH: usize = 424;
const HEIGHT: usize = 320;

fn camera() -> Camera {
    Camera::new(320.0, 320.0, 211.5, 159.5, WIDTH as u32, HEIGHT as u32, Lens::None).expect("fixed and sound")
}

/// A repeatable stream of numbers in [0, 1).
struct Stream(u64);
impl Stream {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
    fn gauss(&mut self) -> f64 {
        (-2.0 * (1.0 - self.next()).ln()).sqrt() * (std::f64::consts::TAU * self.next()).cos()
    }
}

struct Scene {
    rotation: Rotation3<f64>,
    range: f64,
    /// Net coordinates where the optical axis meets the net, m.
    offset: Vector2<f64>,
    mesh: Mesh,
    twine: f64,
    /// Grey levels that twine adds to the background of 100: lines of constant first coordinate, and of constant second.
    contrast: [f64; 2],
    /// Noise, grey levels.
    noise: f64,
    seed: u64,
}

impl Scene {
    fn flat(tilt_deg: f64, azimuth_deg: f64, roll_deg: f64, range: f64, mesh: Mesh) -> Self {
        let (t, a) = (tilt_deg.to_radians(), azimuth_deg.to_radians());
        let rotation = Rotation3::new(Vector3::new(t * a.cos(), t * a.sin(), 0.0))
            * Rotation3::from_axis_angle(&Vector3::z_axis(), roll_deg.to_radians());
        Self {
            rotation,
            range,
            offset: Vector2::new(0.013, -0.008),
            mesh,
            twine: 0.002,
            contrast: [70.0; 2],
            noise: 10.0,
            seed: 7,
        }
    }

    fn draw(&self) -> Vec<u8> {
        let camera = camera();
        let (n, x, y) = (self.rotation * Vector3::z(), self.rotation * Vector3::x(), self.rotation * Vector3::y());
        let at_axis = Vector3::new(0.0, 0.0, self.range);
        let (a1, a2) = (self.mesh.a1(), self.mesh.a2());
        let det = a1.perp(&a2);
        let mut noise = Stream(self.seed);
        let mut out = vec![0; WIDTH * HEIGHT];
        const SUB: usize = 4;
        for v in 0..HEIGHT {
            for u in 0..WIDTH {
                let mut twine = 0.0;
                for k in 0..SUB * SUB {
                    let p = Vector2::new(
                        u as f64 + ((k % SUB) as f64 + 0.5) / SUB as f64 - 0.5,
                        v as f64 + ((k / SUB) as f64 + 0.5) / SUB as f64 - 0.5,
                    );
                    let ray = camera.ray_from_pixel(p).expect("a pinhole has all rays");
                    let nd = n.dot(&ray);
                    if nd < 0.05 {
                        continue;
                    }
                    let point = ray * (n.dot(&at_axis) / nd) - at_axis;
                    let q = Vector2::new(x.dot(&point), y.dot(&point)) + self.offset;
                    let (s1, s2) = (q.perp(&a2) / det, a1.perp(&q) / det);
                    // Distance from a line of constant s is |fraction| times the spacing.
                    let d1 = (s1 - s1.round()).abs() * det / a2.norm();
                    let d2 = (s2 - s2.round()).abs() * det / a1.norm();
                    let [first, second] = self.contrast;
                    twine += match [d1, d2].map(|d| d < 0.5 * self.twine) {
                        [true, true] => 0.5 * (first + second),
                        [true, false] => first,
                        [false, true] => second,
                        [false, false] => 0.0,
                    };
                }
                let bright = 100.0 + twine / (SUB * SUB) as f64 + self.noise * noise.gauss();
                out[v * WIDTH + u] = bright.round().clamp(0.0, 255.0) as u8;
            }
        }
        out
    }

    fn estimate(&self) -> Option<LatticeEstimate> {
        let picture = self.draw();
        let view = GrayView::packed(&picture, WIDTH, HEIGHT).expect("sized above");
        let mut estimator =
            LatticeEstimator::new(&camera(), &self.mesh, &Config::default()).expect("defaults are valid");
        estimator.estimate(view).expect("sizes agree")
    }

    /// Range error (relative), angle between normals (rad), X to the nearest mesh direction (rad), nearest node (m).
    fn errors(&self, e: &LatticeEstimate) -> [f64; 4] {
        let n = self.rotation * Vector3::z();
        let (a1, a2) = (self.mesh.a1(), self.mesh.a2());
        let x = e.pose.rotation * Vector3::x();
        let turn = [a1, a2, -a1, -a2]
            .map(|a| (self.rotation * Vector3::new(a.x, a.y, 0.0)).angle(&x))
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        let o = self.rotation.inverse() * (e.pose.translation - Vector3::new(0.0, 0.0, self.range));
        let q = Vector2::new(o.x, o.y) + self.offset;
        let det = a1.perp(&a2);
        let (s1, s2) = (q.perp(&a2) / det, a1.perp(&q) / det);
        let near = a1 * (s1 - s1.round()) + a2 * (s2 - s2.round());
        [e.range / self.range - 1.0, n.angle(&e.pose.normal()), turn, near.norm()]
    }
}

fn expect_right(scene: &Scene) -> LatticeEstimate {
    let e = scene.estimate().expect("a clear net");
    let [range, normal, turn, node] = scene.errors(&e);
    assert!(e.probability > 0.9, "probability {}", e.probability);
    // Ten to twenty times the bound for this picture (contrast over noise 7, a quarter of the pixels of the usual frame): what a wrong
    // period, a wrong sign of tilt or half a cell would never meet.
    assert!(range.abs() < 2e-3, "range off by {range}");
    assert!(normal < 0.4f64.to_radians(), "normal off by {} degrees", normal.to_degrees());
    assert!(turn < 0.3f64.to_radians(), "turn off by {} degrees", turn.to_degrees());
    assert!(node < 0.02 * scene.mesh.side1(), "node off by {node} m");
    e
}

fn square() -> Mesh {
    Mesh::square(0.05).expect("fixed and sound")
}

#[test]
fn every_stage_is_better_than_the_one_before() {
    let camera = camera();
    let mesh = Mesh::square(0.05).expect("a mesh");
    let scene = Scene::flat(25.0, 40.0, 12.0, 0.9, mesh);
    let picture = scene.draw();
    let view = GrayView::packed(&picture, WIDTH, HEIGHT).expect("sized above");
    let mut estimator = LatticeEstimator::new(&camera, &mesh, &Config::default()).expect("defaults are valid");
    assert!(estimator.stages().is_none(), "nothing was looked at");
    let answer = estimator.estimate(view).expect("sizes agree").expect("a net in plain view");
    let stages = *estimator.stages().expect("a cold start");
    let normal = scene.rotation * Vector3::z();
    let of = |pose: &net_geometry::Pose| {
        let range = pose.plane().range().expect("in front");
        [(range / scene.range - 1.0).abs(), pose.normal().angle(&normal)]
    };
    let (waves, lock, last) = (of(&stages.wave_vectors), of(&stages.lock_in), of(&answer.pose));
    for k in 0..2 {
        // Spectra resolve a hundredth of a cycle per tile, phases a hundred times that; noise may favour the lock-in by a little over the drawing.
        assert!(lock[k] < waves[k] && last[k] < 1.5 * lock[k].max(2e-5), "{waves:?} {lock:?} {last:?}");
    }
    // A followed picture has no search.
    estimator.update(view, &answer.pose).expect("sizes agree");
    assert!(estimator.stages().is_none());
}

#[test]
fn near_and_far_tilted_and_turned() {
    for (tilt, azimuth, roll, range) in [(3.0, 0.0, 0.0, 0.5), (25.0, 130.0, 20.0, 0.9), (40.0, 250.0, -35.0, 1.4)] {
        let e = expect_right(&Scene::flat(tilt, azimuth, roll, range, square()));
        assert_eq!(e.polarity, [Polarity::Bright; 2]);
    }
}

#[test]
fn dark_twine_is_told_from_bright() {
    let mut scene = Scene::flat(20.0, 300.0, 10.0, 0.8, square());
    scene.contrast = [-60.0; 2];
    assert_eq!(expect_right(&scene).polarity, [Polarity::Dark; 2]);
}

#[test]
fn a_bright_family_and_a_dark_one_are_both_where_they_are() {
    for contrast in [[70.0, -60.0], [-60.0, 70.0]] {
        let mut scene = Scene::flat(35.0, 20.0, 5.0, 0.7, square());
        scene.contrast = contrast;
        let expected = contrast.map(|c| if c > 0.0 { Polarity::Bright } else { Polarity::Dark });
        assert_eq!(expect_right(&scene).polarity, expected);
    }
}

#[test]
fn rectangles_and_rhombs() {
    expect_right(&Scene::flat(20.0, 40.0, 5.0, 0.9, Mesh::rectangular(0.06, 0.04).expect("sound")));
    let rhomb = Mesh::oblique(0.05, 0.05, 75f64.to_radians()).expect("sound");
    let scene = Scene::flat(15.0, 80.0, 10.0, 0.9, rhomb);
    expect_right(&scene);
    // The user knows the sides, not the angle.
    let picture = scene.draw();
    let view = GrayView::packed(&picture, WIDTH, HEIGHT).expect("sized above");
    let mut estimator = LatticeEstimator::new(&camera(), &square(), &Config::default()).expect("defaults are valid");
    let e = estimator.estimate(view).expect("sizes agree").expect("a clear net");
    let angle = e.crossing_angle.to_degrees();
    assert!((angle - 75.0).abs().min((angle - 105.0).abs()) < 0.5, "crossing angle {angle}");
    let [range, normal, ..] = scene.errors(&e);
    assert!(range.abs() < 5e-3 && normal < 1f64.to_radians(), "{range} {normal}");
}

#[test]
fn pixels_and_nodes_go_back_and_forth() {
    let e = expect_right(&Scene::flat(25.0, 130.0, 20.0, 0.9, square()));
    for i in -3..=3 {
        for j in -2..=2 {
            let ij = Vector2::new(f64::from(i), f64::from(j));
            let Some((pixel, depth)) = e.pixel_from_lattice(&camera(), ij) else { continue };
            let back = e.lattice_from_pixel(&camera(), pixel).expect("it was seen there");
            // Newton stops at 1e-9 cells; the pixel's own rounding is far below
            assert!((back - ij).norm() < 1e-6 && depth > 0.0, "{ij} {back}");
        }
    }
    let axis = e.lattice_from_pixel(&camera(), Vector2::new(211.5, 159.5)).expect("the axis meets the net");
    // The origin is the node nearest to the axis.
    assert!(axis.norm() < 0.75, "{axis}");
}

#[test]
fn nothing_is_not_a_net() {
    let mut estimator = LatticeEstimator::new(&camera(), &square(), &Config::default()).expect("defaults are valid");
    let mut stream = Stream(3);
    let flat = vec![90u8; WIDTH * HEIGHT];
    let noise: Vec<u8> = (0..WIDTH * HEIGHT).map(|_| (120.0 + 20.0 * stream.gauss()).clamp(0.0, 255.0) as u8).collect();
    let stripes: Vec<u8> = (0..WIDTH * HEIGHT).map(|k| if k % WIDTH % 20 < 3 { 180 } else { 90 }).collect();
    for picture in [flat, noise, stripes] {
        let view = GrayView::packed(&picture, WIDTH, HEIGHT).expect("sized above");
        let found = estimator.estimate(view).expect("sizes agree");
        assert!(found.is_none_or(|e| e.probability < 0.5));
    }
}

#[test]
fn bad_sizes_are_errors_and_tiny_ones_are_no_net() {
    let mut estimator = LatticeEstimator::new(&camera(), &square(), &Config::default()).expect("defaults are valid");
    let one = [9u8];
    assert!(estimator.estimate(GrayView::packed(&one, 1, 1).expect("one pixel")).is_err());
    let tiny = Camera::new(1.0, 1.0, 0.0, 0.0, 1, 1, Lens::None).expect("sound");
    let mut estimator = LatticeEstimator::new(&tiny, &square(), &Config::default()).expect("defaults are valid");
    assert!(estimator.estimate(GrayView::packed(&one, 1, 1).expect("one pixel")).expect("sizes agree").is_none());
    let config = Config { height_sigma_m: -1.0, ..Config::default() };
    assert!(LatticeEstimator::new(&tiny, &square(), &config).is_err());
}

#[test]
fn following_counts_cells() {
    let mut scene = Scene::flat(20.0, 130.0, 10.0, 0.9, square());
    let mut estimator = LatticeEstimator::new(&camera(), &scene.mesh, &Config::default()).expect("defaults are valid");
    let truth = |scene: &Scene| {
        let origin = scene.rotation * Vector3::new(scene.offset.x, scene.offset.y, 0.0);
        Vector3::new(0.0, 0.0, scene.range) - origin
    };
    let mut poses = Vec::new();
    let mut first = None;
    for frame in 0..7 {
        let picture = scene.draw();
        let view = GrayView::packed(&picture, WIDTH, HEIGHT).expect("sized above");
        let e = match poses.len() {
            0 => estimator.estimate(view),
            // The first step is known to half of it, the others are predicted by constant velocity.
            n => {
                let mut predicted: net_geometry::Pose = poses[n - 1];
                let step = if n > 1 {
                    poses[n - 1].translation - poses[n - 2].translation
                } else {
                    0.5 * (truth(&scene)
                        - truth(&Scene {
                            offset: Vector2::new(0.013, -0.008),
                            ..Scene::flat(20.0, 130.0, 10.0, 0.9, square())
                        }))
                };
                predicted.translation += step;
                estimator.update(view, &predicted)
            }
        };
        let e = e.expect("sizes agree").expect("a clear net");
        let [range, normal, ..] = scene.errors(&e);
        assert!(
            e.probability > 0.9 && range.abs() < 2e-3 && normal < 0.4f64.to_radians(),
            "frame {frame}: {range} {normal}"
        );
        // The origin is the same knot in every frame: a slip would show as 50 mm. In the net plane noise is below a millimetre.
        let offset = scene.rotation.inverse() * (e.pose.translation - truth(&scene));
        let start = *first.get_or_insert(offset);
        assert!((offset - start).norm() < 2e-3, "frame {frame}: {offset} from {start}");
        poses.push(e.pose);
        scene.offset.x += 0.4 * 0.05;
        scene.offset.y -= 0.1 * 0.05;
        scene.seed += 1;
    }
    estimator.reset();
    let picture = scene.draw();
    let view = GrayView::packed(&picture, WIDTH, HEIGHT).expect("sized above");
    assert!(estimator.update(view, &poses[0]).expect("sizes agree").is_none());
}
