//! From the poses of sections to the plane of the net and its rotation (thesis 4.3.6, mended).

use net_geometry::nalgebra::{Matrix3, Vector2, Vector3};
use net_geometry::{Mesh, Plane, Pose};

use crate::error::Result;

/// Places of the three largest `confidences`; earlier ones first among equals. `None` for fewer than three that are not NaN.
pub fn most_confident_three(confidences: impl Iterator<Item = f64>) -> Option<[usize; 3]> {
    let mut best: [Option<(usize, f64)>; 3] = [None; 3];
    for (index, confidence) in confidences.enumerate().filter(|(_, confidence)| !confidence.is_nan()) {
        let place = best.iter().position(|other| other.is_none_or(|(_, value)| confidence > value));
        if let Some(place) = place {
            best[place..].rotate_right(1);
            best[place] = Some((index, confidence));
        }
    }
    let [Some((a, _)), Some((b, _)), Some((c, _))] = best else { return None };
    Some([a, b, c])
}

/// The plane in closed form, without any pose: from both wave vectors (cycles per unit on the plane `z = 1`) along each of several rays, each with a weight.
///
/// For any two wave vectors of a lattice on a plane `|k1 x k2| = λ³ / (D A)`, with the depth `λ = D / (n·d)`, the distance `D` and the area `A` of the mesh's cell. So
/// `(A |k1 x k2|)^(-1/3) = (n·d) D^(-2/3)` is linear in the ray: least squares gives `m = n D^(-2/3)`, that is distance and both tilts with their sign. Any other basis of the lattice gives the same.
/// What it takes for granted is the cell's area, which shear changes.
///
/// # Errors
/// [`crate::Error::Geometry`] if the rays lie in a plane, or the wave vectors are parallel.
pub fn plane_from_waves(
    waves: impl Iterator<Item = ([Vector2<f64>; 2], Vector3<f64>, f64)>,
    mesh: &Mesh,
) -> Result<Plane> {
    let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for ([k1, k2], ray, weight) in waves {
        let value = (mesh.cell_area() * k1.perp(&k2).abs()).powf(-1.0 / 3.0);
        // Errors are relative: a value twice as large is twice as unsure.
        let weight = weight / (value * value);
        matrix.ger(weight, &ray, &ray, 1.0);
        right.axpy(weight * value, &ray, 1.0);
    }
    let degenerate = |why| net_geometry::Error::Degenerate { what: "plane from wave vectors", why };
    let smallest = matrix.symmetric_eigenvalues().min();
    // Rays of a section's width apart have 1e-3 of the largest; rounding leaves 1e-16.
    if smallest.is_nan() || smallest <= 1e-9 * matrix.trace() {
        return Err(degenerate("the rays lie in a plane").into());
    }
    let solution = matrix.cholesky().ok_or(degenerate("the rays lie in a plane"))?.solve(&right);
    Ok(Plane::new(solution, solution.norm().powf(-0.5))?)
}

/// One side of the cell as a section sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SideInSection {
    /// Ray through the section's centre.
    pub ray: Vector3<f64>,
    /// The lattice vector on the plane `z = 1`.
    pub step: Vector2<f64>,
    /// Its weight: the confidence (eq. 4.26).
    pub weight: f64,
}

/// The pose of the net in `plane` from one side of the cell in several sections, with its origin on the optical axis (eq. 4.26 to 4.29, mended). `angle` is the side's angle from the X axis, rad: 0 for the
/// first side, the mesh's for the second.
///
/// Every section's vector is lifted to the plane *there* before the mean (the picture's direction of a line changes over a tilted net), with its sign and label already made the others'.
///
/// # Errors
/// [`crate::Error::Geometry`] if no section sees the plane, or the axis does not meet it.
pub fn pose_in_plane(plane: &Plane, sides: impl Iterator<Item = SideInSection>, angle: f64) -> Result<Pose> {
    let mut sum = Vector3::zeros();
    for side in sides {
        let Some(lifted) = plane.lift(side.ray, side.step.push(0.0)) else { continue };
        let Some(unit) = lifted.try_normalize(0.0) else { continue };
        // Sections align before: this only keeps a stray sign from cancelling the rest.
        sum += unit * side.weight * if unit.dot(&sum) < 0.0 { -1.0 } else { 1.0 };
    }
    // Seen at the principal point, where the pose is made, a step in the plane goes where its x and y go.
    Ok(Pose::from_plane(plane, sum.xy(), angle)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::LatticeField;
    use net_geometry::nalgebra::Rotation3;
    use proptest::prelude::*;

    const RAYS: [(f64, f64); 4] = [(-0.35, -0.2), (0.35, -0.2), (-0.35, 0.2), (0.35, 0.2)];

    fn turned(tilt: f64, azimuth: f64, roll: f64) -> Rotation3<f64> {
        Rotation3::new(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt) * Rotation3::new(Vector3::z() * roll)
    }

    proptest! {
        #[test]
        fn plane_and_rotation_are_exact_for_exact_waves(
            tilt in 0.0..1.0f64, azimuth in 0.0..6.2f64, roll in -0.7..0.7f64, distance in 0.3..6.0f64, angle in 1.0..2.1f64,
        ) {
            let mesh = Mesh::oblique(0.05, 0.04, angle).unwrap();
            let turn = turned(tilt, azimuth, roll);
            let field = LatticeField::of_mesh(&mesh, &turn, distance);
            let rays = RAYS.map(|(x, y)| Vector3::new(x, y, 1.0));
            prop_assume!(rays.iter().all(|ray| field.normal.dot(ray) > 0.1));
            let waves = rays.map(|ray| (field.waves(ray).unwrap(), ray, 1.0));
            let plane = plane_from_waves(waves.into_iter(), &mesh).unwrap();
            prop_assert!((plane.normal - field.normal).norm() < 1e-9);
            prop_assert!((plane.distance / distance - 1.0).abs() < 1e-9);
            for (side, from_x) in [(0, 0.0), (1, angle)] {
                let sides = waves.iter().map(|&([k1, k2], ray, weight)| {
                    let basis = net_geometry::Basis::from_wave_vectors(k1, k2).unwrap();
                    SideInSection { ray, step: if side == 0 { basis.b1 } else { basis.b2 }, weight }
                });
                let pose = pose_in_plane(&plane, sides, from_x).unwrap();
                prop_assert!((pose.rotation.matrix() - turn.matrix()).norm() < 1e-8, "{} for {}", pose.rotation, turn);
            }
        }
    }

    #[test]
    fn three_are_picked_in_order() {
        assert_eq!(most_confident_three([1.0, 3.0, f64::NAN, 2.0, 3.0].into_iter()), Some([1, 4, 3]));
        assert_eq!(most_confident_three([f64::INFINITY, 1.0, 1.0, 1.0].into_iter()), Some([0, 1, 2]));
        assert_eq!(most_confident_three([1.0, 2.0].into_iter()), None);
    }

    #[test]
    fn rays_in_a_line_are_an_error() {
        let mesh = Mesh::square(0.05).unwrap();
        let field = LatticeField::of_mesh(&mesh, &Rotation3::identity(), 1.0);
        let waves =
            [-0.3, 0.0, 0.3].map(|x| Vector3::new(x, 0.0, 1.0)).map(|ray| (field.waves(ray).unwrap(), ray, 1.0));
        assert!(plane_from_waves(waves.into_iter(), &mesh).is_err());
        assert!(plane_from_waves(std::iter::empty(), &mesh).is_err());
    }
}
