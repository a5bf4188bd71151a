//! From peak values to one cell's pose (thesis 4.3.4 and 4.3.5).

use net_geometry::nalgebra::{Vector2, Vector3};
use net_geometry::{Basis, Camera, Mesh, PlanarPose, WaveVector, planar_pnp};

use crate::score::Candidate;

/// Two wave vectors chosen among the candidates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// The chosen candidates, by index, best first.
    pub chosen: [usize; 2],
    /// The rival of each: the best that was not chosen (for the second: among those that pass the angle check).
    pub rivals: [Option<usize>; 2],
    /// Value over the rival's value; infinite without one. Not a probability: it hardly tells right from wrong.
    pub confidence: [f64; 2],
}

/// The strongest candidate, and the strongest that crosses it at no less than `min_angle`, rad (the angle between lines, in cycles per
/// pixel). `None` without such a pair. `wave` maps a candidate's bin to cycles per pixel.
pub fn choose_pair(
    candidates: &[Candidate],
    min_angle: f64,
    wave: impl Fn(Vector2<f64>) -> WaveVector,
) -> Option<Choice> {
    let first = candidates.first()?;
    let along = wave(first.bin);
    let crosses = |c: &Candidate| {
        let k = wave(c.bin);
        k.perp(&along).abs().atan2(k.dot(&along).abs()) >= min_angle
    };
    let second = (1..candidates.len()).find(|&k| crosses(&candidates[k]))?;
    let rest = |k: &usize| *k != second;
    let rivals =
        [(1..candidates.len()).find(rest), (1..candidates.len()).filter(rest).find(|&k| crosses(&candidates[k]))];
    let confidence = [(0, rivals[0]), (second, rivals[1])].map(|(k, rival)| {
        rival.map_or(f64::INFINITY, |r| candidates[k].value() / candidates[r].value().max(f64::MIN_POSITIVE))
    });
    Some(Choice { chosen: [0, second], rivals, confidence })
}

/// Lattice vectors in the picture in the contract's order: the first is nearer to the u axis and points along it, the turn to the
/// second is the one from u to v (eq. 4.14 mended). `None` for parallel wave vectors.
pub fn ordered_basis(k1: WaveVector, k2: WaveVector) -> Option<Basis> {
    let Basis { mut b1, mut b2 } = Basis::from_wave_vectors(k1, k2).ok()?;
    if b1.x.abs() * b2.norm() < b2.x.abs() * b1.norm() {
        std::mem::swap(&mut b1, &mut b2);
    }
    if b1.x < 0.0 {
        b1 = -b1;
    }
    if b1.perp(&b2) < 0.0 {
        b2 = -b2;
    }
    Some(Basis { b1, b2 })
}

/// Both poses (the sign of a tilt cannot be told from one spectrum) of the cell of `mesh` that lies at `centre`, px, with lattice
/// vectors `basis`, px: its four corners, then IPPE (eq. 4.15 to 4.22). Better reprojection first. The pose's origin is the cell's centre.
/// `None` where a corner has no ray.
pub fn cell_poses(camera: &Camera, mesh: &Mesh, centre: Vector2<f64>, basis: &Basis) -> Option<[PlanarPose; 2]> {
    const CORNERS: [(f64, f64); 4] = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)];
    let mut points = [Vector2::zeros(); 4];
    let mut rays = [Vector3::zeros(); 4];
    for (k, (i, j)) in CORNERS.into_iter().enumerate() {
        points[k] = mesh.node(i, j);
        rays[k] = camera.ray_from_pixel(centre + basis.b1 * i + basis.b2 * j)?;
    }
    planar_pnp(&points, &rays).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use net_geometry::nalgebra::Rotation3;
    use net_geometry::{Lens, Pose};

    fn candidate(x: f64, y: f64, value: f64) -> Candidate {
        Candidate {
            peak_index: 0,
            bin: Vector2::new(x, y),
            peak: value,
            beam: 0.0,
            pattern: 0.0,
            absent: 0.0,
            multiples: 0,
        }
    }

    #[test]
    fn the_second_vector_crosses_the_first_and_rivals_are_named() {
        let list = [
            candidate(10.0, 0.0, 90.0),
            candidate(20.0, 1.0, 80.0),
            candidate(0.0, 11.0, 60.0),
            candidate(1.0, 22.0, 40.0),
        ];
        let choice = choose_pair(&list, 55_f64.to_radians(), |bin| bin / 100.0).unwrap();
        assert_eq!(choice.chosen, [0, 2]);
        assert_eq!(choice.rivals, [Some(1), Some(3)]);
        assert!((choice.confidence[0] - 90.0 / 80.0).abs() < 1e-12);
        assert!((choice.confidence[1] - 60.0 / 40.0).abs() < 1e-12);
        assert!(choose_pair(&list[..2], 55_f64.to_radians(), |bin| bin / 100.0).is_none());
        assert!(choose_pair(&[], 1.0, |bin| bin).is_none());
    }

    #[test]
    fn one_of_the_two_poses_of_a_far_cell_is_its_own() {
        let camera = Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None).unwrap();
        let mesh = Mesh::rectangular(0.05, 0.04).unwrap();
        let rotation = Rotation3::from_euler_angles(0.3, -0.4, 0.2);
        let pose = Pose { rotation, translation: Vector3::new(0.1, -0.05, 1.4) };
        let pixel = |i: f64, j: f64| camera.pixel_from_point(pose.transform(mesh.node(i, j).push(0.0))).unwrap();
        let basis = Basis { b1: pixel(0.5, 0.0) - pixel(-0.5, 0.0), b2: pixel(0.0, 0.5) - pixel(0.0, -0.5) };
        let (k1, k2) = basis.wave_vectors().unwrap();
        let found = ordered_basis(k2, -k1).unwrap();
        assert!((found.b1 - basis.b1).norm() < 1e-9 && (found.b2 - basis.b2).norm() < 1e-9);
        let poses = cell_poses(&camera, &mesh, pixel(0.0, 0.0), &found).unwrap();
        let miss = poses.map(|p| p.pose.normal().dot(&pose.normal()).clamp(-1.0, 1.0).acos().to_degrees());
        // Over one cell of 20 px perspective is taken for affine: a degree is what that costs at this tilt.
        assert!(miss[0].min(miss[1]) < 1.5, "{miss:?} degrees");
        let depth = poses.map(|p| (p.pose.translation.z / 1.4 - 1.0).abs());
        assert!(depth[0].min(depth[1]) < 0.005, "{depth:?}");
    }
}
