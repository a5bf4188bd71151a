//! The pose of one cell (thesis 4.3.5, mended).

use net_geometry::nalgebra::{Vector2, Vector3};
use net_geometry::{Basis, Mesh, PlanarPose, planar_pnp};

use crate::error::Result;

/// Both poses of a net of `mesh` whose lattice vectors are those of `ideal` (two wave vectors on the plane `z = 1`, cycles per unit) along `ray`; the origin is where the ray meets the net.
///
/// Four corners of a cell about the section's centre, from the basis that is the inverse transpose of the wave vectors (replaces eq. 4.14; 4.15 to 4.22 stand), and IPPE in place
/// of an iteration, which stays at zero tilt when it starts there. The two answers are mirror images of each other across the line of sight: a parallelogram cannot tell them apart, whatever their
/// errors say; other sections can. The first wave vector belongs to the mesh's first side; both have the turn from u to v between them.
///
/// # Errors
/// [`crate::Error::Geometry`] for parallel wave vectors, or corners that no pose puts in front of the camera.
pub fn cell_poses(ideal: [Vector2<f64>; 2], ray: Vector3<f64>, mesh: &Mesh) -> Result<[PlanarPose; 2]> {
    let basis = Basis::from_wave_vectors(ideal[0], ideal[1])?;
    let corners = [(-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0.5, -0.5)];
    let in_net = corners.map(|(i, j)| mesh.node(i, j));
    let rays = corners.map(|(i, j)| ray + (basis.b1 * i + basis.b2 * j).push(0.0));
    Ok(planar_pnp(&in_net, &rays)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::LatticeField;
    use net_geometry::nalgebra::Rotation3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn one_of_the_two_is_the_net(
            tilt in 0.05..1.0f64, azimuth in 0.0..6.2f64, roll in -0.7..0.7f64, distance in 0.4..5.0f64,
            a in 0.02..0.08f64, b in 0.02..0.08f64, angle in 1.0..2.1f64, x in -0.4..0.4f64, y in -0.3..0.3f64,
        ) {
            let mesh = Mesh::oblique(a, b, angle).unwrap();
            let turn = Rotation3::new(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt) * Rotation3::new(Vector3::z() * roll);
            let ray = Vector3::new(x, y, 1.0);
            prop_assume!((turn * Vector3::z()).dot(&ray) > 0.3);
            let field = LatticeField::of_mesh(&mesh, &turn, distance);
            let poses = cell_poses(field.waves(ray).unwrap(), ray, &mesh).unwrap();
            let truth = ray * (distance / field.normal.dot(&ray));
            // The corners of a parallelogram, not of the cell's true picture: the difference is of second order in the cell's size over the distance.
            let tolerance = 3.0 * ((a + b) / distance).powi(2) + 1e-6;
            let best = poses.iter().map(|p| (p.pose.normal() - field.normal).norm()).fold(f64::INFINITY, f64::min);
            prop_assert!(best < 40.0 * tolerance.max(1e-4), "normal off by {best}");
            let depth = poses.iter().map(|p| (p.pose.translation - truth).norm() / truth.norm()).fold(f64::INFINITY, f64::min);
            prop_assert!(depth < 4.0 * tolerance, "place off by {depth}");
        }
    }

    #[test]
    fn parallel_waves_are_an_error() {
        let mesh = Mesh::square(0.05).unwrap();
        assert!(cell_poses([Vector2::new(10.0, 0.0), Vector2::new(20.0, 0.0)], Vector3::z(), &mesh).is_err());
    }
}
