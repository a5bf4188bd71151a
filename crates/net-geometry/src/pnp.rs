//! Pose of a plane from points on it (IPPE: Collins and Bartoli, "Infinitesimal plane-based pose estimation", IJCV
//! 2014).

use nalgebra::{Matrix2, Rotation3, Vector2, Vector3};

use crate::error::{Error, Result};
use crate::homography::Homography;
use crate::pose::Pose;

/// One of the two poses that a plane's picture allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarPose {
    /// Plane to camera.
    pub pose: Pose,
    /// Root mean square reprojection error on the plane `z = 1`; times the focal length it is pixels. Infinite for a
    /// pose that puts a point behind the camera.
    pub rms: f64,
}

/// Both poses of a plane from at least four of its points, better one first. Analytic, allocates nothing.
///
/// `points_in_plane`: coordinates in the plane, m; they need not be centred. `rays`: `(x, y, 1)` of the same points in
/// the camera frame (any positive z will do).
///
/// The homography's value and Jacobian at the points' centroid leave two poses, whose normals are mirror images of each
/// other in the line of sight to the centroid. In a small or distant patch they reproject alike: look at both errors
/// before believing the sign of the tilt. Facing the camera the two are one. Points given in mirrored order show the back
/// of the plane: the pose's normal then points at the camera (negative z).
///
/// # Errors
/// [`Error::Degenerate`] for fewer than four points, unequal lengths, numbers that are not finite, rays that do not
/// point forward, points on a line, or points that no pose puts in front of the camera.
pub fn planar_pnp(points_in_plane: &[Vector2<f64>], rays: &[Vector3<f64>]) -> Result<[PlanarPose; 2]> {
    let degenerate = |why| Error::Degenerate { what: "planar pose", why };
    if points_in_plane.len() < 4 || points_in_plane.len() != rays.len() {
        return Err(degenerate("it takes four points or more, and a ray for each"));
    }
    if !rays.iter().all(|ray| ray.z > 0.0) {
        return Err(degenerate("a ray does not point forward"));
    }
    let pairs = points_in_plane.iter().zip(rays).map(|(&point, ray)| (point, ray.xy() / ray.z));
    let image_from_plane = Homography::from_pairs(pairs.clone()).map_err(|error| match error {
        Error::Degenerate { why, .. } => degenerate(why),
        other => other,
    })?;
    let centroid = points_in_plane.iter().sum::<Vector2<f64>>() / points_in_plane.len() as f64;
    let (centre, jacobian) = image_from_plane
        .apply_with_jacobian(centroid)
        .ok_or_else(|| degenerate("the centre of the points goes to infinity"))?;

    let mut poses = rotations(centre, jacobian)
        .ok_or_else(|| degenerate("the plane is seen edge on"))?
        .map(|rotation| with_rotation(rotation, centroid, pairs.clone()));
    if poses[1].rms < poses[0].rms {
        poses.swap(0, 1);
    }
    if poses[0].rms.is_finite() { Ok(poses) } else { Err(degenerate("no pose puts all points in front of the camera")) }
}

/// The two rotations whose plane, at the point seen at `centre` (on `z = 1`), has the homography's `jacobian` there up
/// to scale.
fn rotations(centre: Vector2<f64>, jacobian: Matrix2<f64>) -> Option<[Rotation3<f64>; 2]> {
    // Turn the camera to look at the centre. The picture near it is then an orthographic one of the plane, scaled: the
    // jacobian is B A with A the upper left 2 x 2 of the wanted rotation over the distance.
    let camera_from_sight = Rotation3::rotation_between(&Vector3::z(), &centre.push(1.0))?;
    let sight = camera_from_sight.matrix();
    let b = sight.fixed_view::<2, 2>(0, 0) - centre * sight.fixed_view::<1, 2>(2, 0);
    let a = b.try_inverse()? * jacobian;
    // A = Rot(left) diag(large, small) Rot(right), small with a sign: small / large is the cosine of the tilt against
    // the line of sight.
    let (e, f) = ((a[(0, 0)] + a[(1, 1)]) / 2.0, (a[(0, 0)] - a[(1, 1)]) / 2.0);
    let (g, h) = ((a[(1, 0)] + a[(0, 1)]) / 2.0, (a[(1, 0)] - a[(0, 1)]) / 2.0);
    let (sum, difference) = (e.hypot(h), f.hypot(g));
    let (angle_difference, angle_sum) = (g.atan2(f), h.atan2(e));
    let (left, right) = ((angle_sum + angle_difference) / 2.0, (angle_sum - angle_difference) / 2.0);
    // Without the cancellation of 1 - cos²: sin² = 4 sum difference / large².
    let tilt = (2.0 * (sum * difference).sqrt()).atan2(sum - difference);
    let turn = |angle| Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
    tilt.is_finite().then(|| {
        [tilt, -tilt]
            .map(|t| camera_from_sight * turn(left) * Rotation3::from_axis_angle(&Vector3::x_axis(), t) * turn(right))
    })
}

/// The best translation for a rotation (linear least squares of errors times depth), and the reprojection error it
/// leaves.
fn with_rotation(
    rotation: Rotation3<f64>,
    centroid: Vector2<f64>,
    pairs: impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> + Clone,
) -> PlanarPose {
    // With X = R (p - centroid) and t the centroid's place, image * (X.z + t.z) = X.xy + t.xy. The mean over the points
    // gives t.xy from t.z, and what varies gives t.z.
    let points = || pairs.clone().map(|(p, image)| (rotation * (p - centroid).push(0.0), image));
    let excess = |x: Vector3<f64>, image: Vector2<f64>| image * x.z - x.xy();
    let n = points().count() as f64;
    let (mut mean_image, mut mean_excess) = (Vector2::zeros(), Vector2::zeros());
    for (x, image) in points() {
        mean_image += image / n;
        mean_excess += excess(x, image) / n;
    }
    let (mut product, mut square) = (0.0, 0.0);
    for (x, image) in points() {
        product += (image - mean_image).dot(&(excess(x, image) - mean_excess));
        square += (image - mean_image).norm_squared();
    }
    let depth = -product / square;
    let centre = (mean_excess + mean_image * depth).push(depth);

    let mut sum = 0.0;
    for (x, image) in points() {
        let x = x + centre;
        sum += if x.z > 0.0 { (x.xy() / x.z - image).norm_squared() } else { f64::INFINITY };
    }
    let rms = (sum / n).sqrt();
    let pose = Pose { rotation, translation: centre - rotation * centroid.push(0.0) };
    PlanarPose { pose, rms: if rms.is_finite() { rms } else { f64::INFINITY } }
}
