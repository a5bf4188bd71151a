//! Planes, the poses in them, and how sure they are.
#![allow(clippy::unwrap_used)]

use net_geometry::nalgebra::{Matrix6, Rotation3, Unit, Vector2, Vector3, Vector6};
use net_geometry::{Camera, Homography, Lens, Plane, Pose, PoseCovariance};
use proptest::prelude::*;

/// Rounding of a chain of some hundred operations on numbers near one.
const ROUNDING: f64 = 1e-9;

fn pose_of(tilt: f64, azimuth: f64, turn: f64, range: f64) -> Pose {
    let axis = Unit::new_normalize(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0));
    let rotation = Rotation3::from_axis_angle(&axis, tilt) * Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
    Pose { rotation, translation: Vector3::new(0.0, 0.0, range) }
}

/// Numbers that look random, the same each time, near normal: mean 0, variance 1.
fn normal(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

proptest! {
    #[test]
    fn points_of_a_plane_give_it_back(
        tilt in 0.0..1.4f64, azimuth in -3.1..3.1, range in 0.3..8.0,
        points in prop::collection::vec((-1.0..1.0, -1.0..1.0), 3..20),
    ) {
        let pose = pose_of(tilt, azimuth, 0.0, range);
        let truth = pose.plane();
        let points: Vec<_> = points.iter().map(|&(x, y)| pose.transform(Vector3::new(x, y, 0.0))).collect();
        let [a, b, c] = [points[0], points[1], points[2]];
        let area = (b - a).cross(&(c - a)).norm();
        prop_assume!(area > 0.01);
        let tolerance = ROUNDING / area.powi(2);
        for found in [Plane::through_points([a, b, c]).unwrap(), Plane::through_points([c, b, a]).unwrap(), Plane::fit(points.iter().copied()).unwrap()] {
            prop_assert!((found.normal - truth.normal).norm() < tolerance, "{found:?} for {truth:?}");
            prop_assert!((found.distance - truth.distance).abs() < tolerance);
            prop_assert!((found.range().unwrap() - range).abs() < 10.0 * tolerance / found.normal.z.powi(2));
        }
    }

    #[test]
    fn the_fit_is_the_best_near_it(seed: u64, tilt in 0.0..1.2f64, azimuth in -3.1..3.1) {
        // Total least squares: no plane nearby has a smaller sum of squares.
        let pose = pose_of(tilt, azimuth, 0.0, 2.0);
        let mut state = seed;
        let points: Vec<_> = (0..12).map(|_| pose.transform(Vector3::new(normal(&mut state), normal(&mut state), 0.05 * normal(&mut state)))).collect();
        let sum = |plane: &Plane| points.iter().map(|p| plane.distance_beyond(*p).powi(2)).sum::<f64>();
        let best = Plane::fit(points.iter().copied()).unwrap();
        for (k, step) in [(0, 1e-3), (0, -1e-3), (1, 1e-3), (1, -1e-3), (2, 1e-3), (2, -1e-3)] {
            let mut normal = best.normal;
            normal[k] += step;
            prop_assert!(sum(&Plane::new(normal, best.distance).unwrap()) >= sum(&best));
            let shifted = Plane { distance: best.distance + step, ..best };
            prop_assert!(sum(&shifted) >= sum(&best));
        }
        // A weight of zero takes a point out, a weight of two counts it twice.
        let weighted = |w: fn(usize) -> f64| Plane::fit_weighted(points.iter().enumerate().map(move |(k, &p)| (p, w(k)))).unwrap();
        let without = Plane::fit(points[1..].iter().copied()).unwrap();
        let left_out = weighted(|k| if k == 0 { 0.0 } else { 3.0 });
        prop_assert!((left_out.normal - without.normal).norm() < ROUNDING);
        let twice = Plane::fit(points.iter().chain(&points[..1]).copied()).unwrap();
        let doubled = weighted(|k| if k == 0 { 2.0 } else { 1.0 });
        prop_assert!((doubled.normal - twice.normal).norm() < ROUNDING);
    }

    #[test]
    fn plane_and_direction_give_the_pose_back(
        tilt in 0.0..1.3f64, azimuth in -3.1..3.1, turn in -3.1..3.1, range in 0.3..8.0, angle in 0.2..2.9,
    ) {
        let pose = pose_of(tilt, azimuth, turn, range);
        // The picture of a line of the net at `angle` from X, at the principal point, by the homography's Jacobian.
        let camera = Camera::new(1.0, 1.0, 0.0, 0.0, 1, 1, Lens::None).unwrap();
        let (_, jacobian) = Homography::pixel_from_net(&camera, &pose).unwrap().apply_with_jacobian(Vector2::zeros()).unwrap();
        for angle in [0.0f64, angle] {
            let direction: Vector2<f64> = jacobian * Vector2::new(angle.cos(), angle.sin());
            let found = Pose::from_plane(&pose.plane(), direction, angle).unwrap();
            prop_assert!((found.rotation.matrix() - pose.rotation.matrix()).norm() < 1e-7, "{found:?} for {pose:?}");
            prop_assert!((found.translation - pose.translation).norm() < 1e-7 * range);
        }
    }

    #[test]
    fn in_plane_rotation_is_measured_in_the_plane(tilt in 0.0..1.4f64, azimuth in -3.1..3.1, angle in -3.1..3.1) {
        // A pose whose X is u, lifted, and then turned by the angle about its own normal.
        let plane = pose_of(tilt, azimuth, 0.0, 1.0).plane();
        let straight = Pose::from_plane(&plane, Vector2::x(), 0.0).unwrap();
        prop_assert!(straight.in_plane_rotation().abs() < ROUNDING);
        let turned = Pose { rotation: straight.rotation * Rotation3::from_axis_angle(&Vector3::z_axis(), angle), ..straight };
        prop_assert!((turned.in_plane_rotation() - angle).abs() < ROUNDING);
    }

    #[test]
    fn perturbations_there_and_back(
        tilt in 0.0..1.4f64, azimuth in -3.1..3.1, w in prop::array::uniform3(-1.0..1.0f64), d in prop::array::uniform3(-1.0..1.0f64), scale in -9i32..0,
    ) {
        let pose = pose_of(tilt, azimuth, 0.3, 1.5);
        let (turn, shift) = (Vector3::from(w) * 10f64.powi(scale), Vector3::from(d));
        let moved = pose.perturbed(turn, shift);
        let (back_turn, back_shift) = pose.perturbation_to(&moved);
        prop_assert!((back_turn - turn).norm() < 1e-14 && (back_shift - shift).norm() < 1e-14);
        // The turn is about the net's origin, in the camera's axes.
        let point = Vector3::new(0.2, -0.1, 0.0);
        let expected = Rotation3::new(turn) * (pose.transform(point) - pose.translation) + pose.translation + shift;
        prop_assert!((moved.transform(point) - expected).norm() < ROUNDING);
    }

    #[test]
    fn sigmas_are_the_spread_of_what_they_name(tilt in 0.0..1.1f64, azimuth in -3.1..3.1, seed: u64) {
        let pose = pose_of(tilt, azimuth, 0.4, 1.2);
        let mut state = seed;
        // Some covariance, small enough for first order: of a square root with random entries.
        let root = Matrix6::from_fn(|_, _| 1e-4 * normal(&mut state));
        let covariance = PoseCovariance { matrix: root * root.transpose() };
        // Exactly, by the gradient in finite steps along the root's columns.
        let spread = |f: &dyn Fn(&Pose) -> f64| {
            (0..6).map(|k| {
                let x: Vector6<f64> = root.column(k).into_owned();
                let (w, d) = (x.fixed_rows::<3>(0).into_owned(), x.fixed_rows::<3>(3).into_owned());
                ((f(&pose.perturbed(w, d)) - f(&pose.perturbed(-w, -d))) / 2.0).powi(2)
            }).sum::<f64>().sqrt()
        };
        let close = |a: f64, b: f64| (a - b).abs() < 1e-4 * b.abs();
        let range = spread(&|p| p.plane().range().unwrap());
        prop_assert!(close(covariance.sigma_range(&pose), range), "{} {range}", covariance.sigma_range(&pose));
        let distance = spread(&|p| p.plane().distance);
        prop_assert!(close(covariance.sigma_distance(&pose), distance));
        // The least sure direction: no other has a larger spread, and one has this.
        let directions = || (0..180).map(|k| f64::from(k) * std::f64::consts::PI / 180.0);
        let in_plane = |a: f64| pose.x_axis() * a.cos() + pose.y_axis() * a.sin();
        let tilts = directions().map(|a| spread(&|p| p.normal().dot(&in_plane(a)))).fold(0.0, f64::max);
        // A degree beside the worst direction is 1.5e-4 below it.
        prop_assert!((covariance.sigma_tilt(&pose) / tilts - 1.0).abs() < 4e-4, "{} {tilts}", covariance.sigma_tilt(&pose));
        let places = directions().map(|a| spread(&|p| p.translation.dot(&in_plane(a)))).fold(0.0, f64::max);
        prop_assert!((covariance.sigma_xy(&pose) / places - 1.0).abs() < 4e-4);

        // Another origin: range, distance and tilt do not care, and going back undoes it.
        let step = pose.rotation * Vector3::new(0.15, -0.1, 0.0);
        let moved_pose = Pose { translation: pose.translation + step, ..pose };
        let moved = covariance.with_origin_moved(step);
        prop_assert!(close(moved.sigma_range(&moved_pose), range));
        prop_assert!(close(moved.sigma_distance(&moved_pose), distance));
        prop_assert!(close(moved.sigma_tilt(&moved_pose), covariance.sigma_tilt(&pose)));
        prop_assert!((moved.with_origin_moved(-step).matrix - covariance.matrix).norm() < 1e-12 * covariance.matrix.norm());
        let node = |p: &Pose| p.transform(Vector3::new(0.15, -0.1, 0.0)).dot(&in_plane(0.7));
        let at_node = spread(&|p| node(p));
        let x = in_plane(0.7);
        let matrix = moved.matrix.fixed_view::<3, 3>(3, 3).into_owned();
        prop_assert!(close((x.transpose() * matrix * x)[0].sqrt(), at_node));
    }
}

#[test]
fn the_lift_is_not_the_printed_one() {
    // Tilt 40 degrees, yaw 45: the printed eq. 4.27 (B = [b 0]) is off by 14.6 degrees.
    let about = |axis, degrees: f64| Rotation3::from_axis_angle(&axis, degrees.to_radians());
    let rotation = about(Vector3::y_axis(), 40.0) * about(Vector3::z_axis(), 45.0);
    let pose = Pose { rotation, translation: Vector3::new(0.0, 0.0, 1.0) };
    let direction = pose.x_axis().xy();
    let found = Pose::from_plane(&pose.plane(), direction, 0.0).unwrap();
    assert!((found.x_axis() - pose.x_axis()).norm() < ROUNDING);
    let y = pose.normal().cross(&direction.push(0.0)).normalize();
    let printed = y.cross(&pose.normal());
    assert!((printed.angle(&pose.x_axis()).to_degrees() - 14.6).abs() < 0.1, "{printed}");
}

#[test]
fn planes_face_the_camera() {
    for (normal, distance) in [((0.1, 0.2, 1.0), 2.0), ((-0.1, -0.2, -1.0), -2.0), ((0.3, 0.6, 3.0), 6.0)] {
        let plane = Plane::new(Vector3::new(normal.0, normal.1, normal.2), distance).unwrap();
        assert!((plane.range().unwrap() - 2.0).abs() < 1e-12);
        assert!(plane.normal.z > 0.0 && (plane.normal.norm() - 1.0).abs() < 1e-15);
    }
    let plane = Plane::new(Vector3::z(), 2.0).unwrap();
    assert_eq!(plane.distance_beyond(Vector3::new(5.0, 5.0, 1.5)), 0.5);
    assert_eq!(plane.point_along(Vector3::new(0.5, 0.0, 1.0)), Some(Vector3::new(1.0, 0.0, 2.0)));
    assert_eq!(plane.tilt(), 0.0);
    // Behind the camera nothing is seen.
    let behind = Plane::new(Vector3::z(), -2.0).unwrap();
    assert_eq!((behind.range(), behind.lift(Vector3::z(), Vector3::x())), (None, None));
    assert!(Pose::from_plane(&behind, Vector2::x(), 0.0).is_err());
}

#[test]
fn degenerate_points_are_errors() {
    let p = Vector3::new;
    let line = [p(0.0, 0.0, 1.0), p(1.0, 1.0, 2.0), p(2.0, 2.0, 3.0), p(3.0, 3.0, 4.0)];
    assert!(Plane::through_points([line[0], line[1], line[2]]).is_err());
    assert!(Plane::through_points([line[0], line[0], line[2]]).is_err());
    assert!(Plane::fit(line.into_iter()).is_err());
    assert!(Plane::fit([line[0]; 5].into_iter()).is_err());
    assert!(Plane::fit(line[..2].iter().copied()).is_err());
    assert!(Plane::fit(std::iter::empty()).is_err());
    // Parallel to the optical axis.
    assert!(Plane::through_points([p(1.0, 0.0, 1.0), p(1.0, 1.0, 1.0), p(1.0, 0.0, 2.0)]).is_err());
    // The corners of a cube have no plane.
    let cube = (0..8).map(|k| p(f64::from(k & 1), f64::from(k >> 1 & 1), 1.0 + f64::from(k >> 2)));
    assert!(Plane::fit(cube).is_err());
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        let points = [p(0.0, 0.0, 1.0), p(1.0, 0.0, 1.0), p(0.0, 1.0, 1.0), p(bad, 1.0, 1.0)];
        assert!(Plane::fit(points.into_iter()).is_err(), "{bad}");
        assert!(Plane::through_points([points[0], points[1], points[3]]).is_err() || bad == 1e300, "{bad}");
        assert!(Plane::new(p(0.0, bad, bad), 1.0).is_err() || bad == 1e300, "{bad}");
        assert!(Plane::fit_weighted(points.into_iter().map(|q| (q, -1.0))).is_err());
        assert!(Plane::fit_weighted(points[..3].iter().map(|&q| (q, bad))).is_err() || bad == 1e300, "{bad}");
    }
    assert!(Plane::new(Vector3::zeros(), 1.0).is_err());
    let plane = Plane::new(Vector3::z(), 1.0).unwrap();
    for direction in [Vector2::zeros(), Vector2::repeat(f64::NAN), Vector2::repeat(f64::INFINITY)] {
        assert!(Pose::from_plane(&plane, direction, 0.0).is_err(), "{direction}");
    }
    assert!(Pose::from_plane(&plane, Vector2::x(), f64::NAN).is_err());
}

#[test]
fn quaternion_and_matrix_say_the_same() {
    let pose = pose_of(1.0, 2.0, 3.0, 1.5);
    let q = pose.quaternion();
    assert!(q.w >= 0.0);
    assert!((q.to_rotation_matrix().matrix() - pose.rotation.matrix()).norm() < 1e-14);
    let point = Vector3::new(0.3, -0.2, 0.0);
    let by_matrix = (pose.matrix() * point.push(1.0)).xyz();
    assert!((by_matrix - pose.transform(point)).norm() < 1e-14);
    assert!((pose.inverse_transform(pose.transform(point)) - point).norm() < 1e-14);
    assert!((pose.transform(pose.camera_in_net())).norm() < 1e-14);
}
