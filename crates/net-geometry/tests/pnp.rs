//! Planar PnP and homographies against poses that are known.

#![allow(clippy::unwrap_used)]

use net_geometry::nalgebra::{Matrix3, Rotation3, Vector2, Vector3};
use net_geometry::{Camera, Homography, Lens, Pose, ZyxAngles, planar_pnp};
use proptest::prelude::*;

/// Rounding of a chain of some hundred operations on numbers near one.
const ROUNDING: f64 = 1e-9;
/// The tilt is a square root of what is computed, so near zero tilt its rounding is the root of rounding.
const ROUNDING_OF_TILT: f64 = 1e-6;

fn camera() -> Camera {
    Camera::new(700.0, 710.0, 424.0, 240.0, 848, 480, Lens::None).unwrap()
}

/// A net turned by `turn` in its plane, tilted by `tilt` about the axis at `azimuth` in the image, `range` m away.
fn pose(tilt: f64, azimuth: f64, turn: f64, range: f64, x: f64, y: f64) -> Pose {
    let axis = net_geometry::nalgebra::Unit::new_normalize(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0));
    let rotation = Rotation3::from_axis_angle(&axis, tilt) * Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
    Pose { rotation, translation: Vector3::new(x * range, y * range, range) }
}

fn rays(pose: &Pose, points: &[Vector2<f64>]) -> Vec<Vector3<f64>> {
    points.iter().map(|p| pose.transform(p.push(0.0))).map(|x| x / x.z).collect()
}

fn rectangle(a: f64, b: f64, shift: Vector2<f64>) -> Vec<Vector2<f64>> {
    [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)]
        .map(|(x, y)| Vector2::new(x * a / 2.0, y * b / 2.0) + shift)
        .to_vec()
}

/// Angle between two rotations, rad, without the arc cosine that is blind near zero.
fn angle(a: &Rotation3<f64>, b: &Rotation3<f64>) -> f64 {
    2.0 * ((a.matrix() - b.matrix()).norm() / 8f64.sqrt()).min(1.0).asin()
}

proptest! {
    #[test]
    fn finds_the_pose_and_its_mirror(
        tilt in 0.0..75f64.to_radians(), azimuth in -3.1..3.1, turn in -3.1..3.1, range in 0.3..8.0,
        x in -0.4..0.4, y in -0.3..0.3, a in 0.02..0.2, b in 0.02..0.2, off_x in -1.0..1.0, off_y in -1.0..1.0,
    ) {
        let points = rectangle(a, b, Vector2::new(off_x, off_y) * 0.1);
        let truth = pose(tilt, azimuth, turn, range, x, y);
        prop_assume!(points.iter().all(|p| truth.transform(p.push(0.0)).z > 0.1 * range));
        // Edge on to the line of sight there is nothing to see.
        let centre = truth.transform(Vector3::new(off_x * 0.1, off_y * 0.1, 0.0));
        let incidence = truth.normal().dot(&centre.normalize()).abs();
        prop_assume!(incidence > 0.1);
        let [first, second] = planar_pnp(&points, &rays(&truth, &points)).unwrap();

        prop_assert!(first.rms < ROUNDING, "rms {}", first.rms);
        prop_assert!(first.rms <= second.rms);
        // Whichever reprojects better, the truth is one of the two; where they differ it is the first.
        let error = angle(&first.pose.rotation, &truth.rotation);
        prop_assert!(error < ROUNDING_OF_TILT, "rotation off by {error}, second by {}", angle(&second.pose.rotation, &truth.rotation));
        prop_assert!((first.pose.translation - truth.translation).norm() < ROUNDING_OF_TILT * range);
        for p in [first, second] {
            let r = p.pose.rotation.matrix();
            prop_assert!((r.transpose() * r - Matrix3::identity()).norm() < ROUNDING);
            prop_assert!((r.determinant() - 1.0).abs() < ROUNDING);
            prop_assert!(points.iter().all(|q| p.rms.is_infinite() || p.pose.transform(q.push(0.0)).z > 0.0));
        }
        // The second normal is the mirror image of the first in the line of sight to the centroid.
        let sight = centre.normalize();
        let n = first.pose.normal();
        let mirrored = sight * (2.0 * sight.dot(&n)) - n;
        prop_assert!((second.pose.normal() - mirrored).norm() < 4.0 * ROUNDING_OF_TILT);
    }

    #[test]
    fn many_points_with_noise_stay_near(
        tilt in 0.1..1.2f64, azimuth in -3.1..3.1, turn in -0.7..0.7, seed in 0u64..1000,
    ) {
        let truth = pose(tilt, azimuth, turn, 1.0, 0.05, -0.02);
        let points: Vec<_> = (0..10).flat_map(|i| (0..10).map(move |j| Vector2::new(f64::from(i) - 4.5, f64::from(j) - 4.5) * 0.05)).collect();
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(1);
        let mut noise = || { state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407); (state >> 40) as f64 / 16_777_216.0 - 0.5 };
        let amplitude = 0.5 / 700.0;
        let rays: Vec<_> = rays(&truth, &points).into_iter().map(|r| r + Vector3::new(noise(), noise(), 0.0) * amplitude).collect();
        let [first, second] = planar_pnp(&points, &rays).unwrap();
        // Uniform noise in (-a/2, a/2) has a root mean square of a/sqrt(6) over both axes; IPPE is not the
        // least-squares optimum.
        prop_assert!(first.rms < 2.0 * amplitude / 6f64.sqrt(), "rms {} of {amplitude}", first.rms);
        prop_assert!(angle(&first.pose.rotation, &truth.rotation) < 0.03);
        prop_assert!(second.rms > first.rms);
    }

    #[test]
    fn homography_agrees_with_the_camera(
        tilt in 0.0..1.3f64, azimuth in -3.1..3.1, turn in -3.1..3.1, range in 0.3..8.0, px in -0.2..0.2, py in -0.2..0.2,
    ) {
        let (camera, pose) = (camera(), pose(tilt, azimuth, turn, range, 0.1, 0.05));
        let h = Homography::pixel_from_net(&camera, &pose).unwrap();
        let point = Vector2::new(px, py) * range;
        let Some(pixel) = camera.pixel_from_point(pose.transform(point.push(0.0))) else { return Ok(()) };
        prop_assert!((h.apply(point).unwrap() - pixel).norm() < ROUNDING * (1.0 + pixel.norm()));
        let back = h.inverse().unwrap().apply(pixel).unwrap();
        prop_assert!((back - point).norm() < 1e-7 * range, "{back} for {point}");

        // From points: four of them, and a grid.
        for n in [2, 6] {
            let grid: Vec<_> = (0..n * n).map(|k| Vector2::new(f64::from(k % n), f64::from(k / n)) * (0.1 * range / f64::from(n))).collect();
            let Some(pixels) = grid.iter().map(|p| camera.pixel_from_point(pose.transform(p.push(0.0)))).collect::<Option<Vec<_>>>() else { return Ok(()) };
            let fitted = Homography::from_points(&grid, &pixels).unwrap();
            for (p, q) in grid.iter().zip(&pixels) {
                prop_assert!((fitted.apply(*p).unwrap() - q).norm() < 1e-8 * (1.0 + q.norm()));
            }
        }

        // Jacobian against central differences.
        let (_, jacobian) = h.apply_with_jacobian(point).unwrap();
        let step = 1e-6 * range;
        for k in 0..2 {
            let mut d = Vector2::zeros();
            d[k] = step;
            let numeric = (h.apply(point + d).unwrap() - h.apply(point - d).unwrap()) / (2.0 * step);
            prop_assert!((numeric - jacobian.column(k)).norm() < 1e-4 * (1.0 + jacobian.norm()));
        }
    }

    #[test]
    fn zyx_angles_round_trip(yaw in -3.1..3.1, pitch in -1.57..1.57, roll in -3.1..3.1) {
        let angles = ZyxAngles { yaw, pitch, roll };
        let back = ZyxAngles::from_rotation(&angles.rotation());
        prop_assert!((back.yaw - yaw).abs() < 1e-9 && (back.pitch - pitch).abs() < 1e-9 && (back.roll - roll).abs() < 1e-9);
    }
}

#[test]
fn zero_tilt_on_the_axis_has_one_pose() {
    let truth = pose(0.0, 0.0, 0.3, 2.0, 0.0, 0.0);
    let points = rectangle(0.05, 0.05, Vector2::zeros());
    let [first, second] = planar_pnp(&points, &rays(&truth, &points)).unwrap();
    for found in [first, second] {
        assert!(found.pose.plane().tilt() < ROUNDING_OF_TILT);
        assert!((found.pose.translation - truth.translation).norm() < ROUNDING_OF_TILT);
        assert!(found.rms < ROUNDING);
    }
}

#[test]
fn a_centred_parallelogram_is_tilted_not_flat() {
    // The picture of a distant square tilted by 40 degrees is nearly a parallelogram: iterative solvers stay at zero
    // tilt.
    let truth = pose(40f64.to_radians(), 1.0, 0.2, 4.0, 0.0, 0.0);
    let points = rectangle(0.02, 0.02, Vector2::zeros());
    let found = planar_pnp(&points, &rays(&truth, &points)).unwrap();
    for p in found {
        assert!((p.pose.plane().tilt() - 40f64.to_radians()).abs() < 1e-2);
    }
    assert!(angle(&found[0].pose.rotation, &truth.rotation) < ROUNDING_OF_TILT);
}

#[test]
fn a_perfect_parallelogram_has_two_tilts() {
    // The affine picture of a square: no perspective tells the sign of the tilt, so neither pose is better.
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)];
    let points = corners.map(|(x, y)| Vector2::new(x, y) * 0.025);
    let tilt = 40f64.to_radians();
    let rays = corners.map(|(x, y)| Vector3::new(0.02 * x, 0.02 * y * tilt.cos(), 1.0));
    let [first, second] = planar_pnp(&points, &rays).unwrap();
    for found in [first, second] {
        assert!((found.pose.plane().tilt() - tilt).abs() < ROUNDING, "{found:?}");
    }
    assert!((first.rms - second.rms).abs() < ROUNDING && first.rms > 1e-4);
    assert!((first.pose.normal().y + second.pose.normal().y).abs() < ROUNDING);
}

#[test]
fn points_in_mirrored_order_show_the_back() {
    let truth = pose(0.4, 1.0, 0.2, 1.0, 0.0, 0.0);
    let points = rectangle(0.1, 0.1, Vector2::zeros());
    let mirrored: Vec<_> = points.iter().map(|p| Vector2::new(p.y, p.x)).collect();
    let [first, _] = planar_pnp(&mirrored, &rays(&truth, &points)).unwrap();
    assert!(first.pose.normal().z < 0.0);
    assert!(first.rms < ROUNDING);
}

#[test]
fn zyx_is_yaw_after_pitch_after_roll() {
    // Eq. 4.2, multiplied out by hand for yaw = 90°, pitch = 0, roll = 90°.
    let half = std::f64::consts::FRAC_PI_2;
    let r = ZyxAngles { yaw: half, pitch: 0.0, roll: half }.rotation();
    let expected = Matrix3::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
    assert!((r.matrix() - expected).norm() < 1e-15);
    // Gimbal lock keeps the rotation.
    let locked = ZyxAngles { yaw: 0.3, pitch: half, roll: 0.8 }.rotation();
    let back = ZyxAngles::from_rotation(&locked);
    assert_eq!(back.roll, 0.0);
    assert!((back.rotation().matrix() - locked.matrix()).norm() < 1e-9);
}

#[test]
fn bad_points_are_errors() {
    let square = rectangle(0.1, 0.1, Vector2::zeros());
    let good = rays(&pose(0.3, 0.0, 0.0, 1.0, 0.0, 0.0), &square);
    let line: Vec<_> = (0..4).map(|k| Vector2::new(f64::from(k), 2.0 * f64::from(k))).collect();
    let three_on_a_line =
        vec![Vector2::new(0.0, 0.0), Vector2::new(1.0, 1.0), Vector2::new(2.0, 2.0), Vector2::new(0.0, 1.0)];
    let one = vec![Vector2::new(0.3, 0.1); 4];
    for points in [&line, &three_on_a_line, &one] {
        let pixels: Vec<_> = points.iter().map(|p| Vector3::new(p.x * 0.1, p.y * 0.1, 1.0)).collect();
        assert!(planar_pnp(points, &pixels).is_err(), "{points:?}");
        assert!(planar_pnp(points, &good).is_err(), "{points:?}");
        assert!(planar_pnp(&square, &pixels).is_err(), "{points:?}");
    }
    assert!(planar_pnp(&square[..3], &good[..3]).is_err());
    assert!(planar_pnp(&square, &good[..3]).is_err());
    assert!(planar_pnp(&[], &[]).is_err());
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        let mut points = square.clone();
        points[2].x = bad;
        assert!(planar_pnp(&points, &good).is_err(), "{bad}");
        let mut rays = good.clone();
        rays[1].y = bad;
        assert!(planar_pnp(&square, &rays).is_err(), "{bad}");
        rays = good.clone();
        rays[1].z = -bad;
        assert!(planar_pnp(&square, &rays).is_err(), "{bad}");
    }
    let through_camera = Pose { rotation: Rotation3::identity(), translation: Vector3::new(0.3, 0.1, 0.0) };
    assert!(Homography::pixel_from_net(&camera(), &through_camera).is_err());
    assert!(Homography::from_matrix(Matrix3::zeros()).is_err());
    assert!(Homography::from_matrix(Matrix3::from_element(f64::NAN)).is_err());
}
