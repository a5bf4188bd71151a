//! Wave vectors all over the picture, from a plane and the lattice on it.

use net_geometry::Mesh;
use net_geometry::nalgebra::{Matrix3, Rotation3, Vector2, Vector3};

/// A lattice on a plane, seen by a pinhole of focal length 1: phase `φ_i(d) = (G_i · d) / (n · d)` cycles along the ray `d = (x, y, 1)`, up to a constant.
///
/// `G_i` is the distance of the plane times the i-th dual lattice vector (which is perpendicular to the other family's twines, one over their spacing long). How far the
/// plane is can only be said once the mesh is known: [`LatticeField::distance`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatticeField {
    /// Unit normal of the plane, away from the camera.
    pub normal: Vector3<f64>,
    /// `G_1`, `G_2`: in the plane, cycles.
    pub duals: [Vector3<f64>; 2],
    /// How the net bends off the plane, which is then its tangent where the optical axis meets it: `b` in the height `½ (b_0 x² + 2 b_1 x y + b_2 y²)` away from the camera, all in units of the plane's distance.
    /// x runs along the image's u axis laid into the plane, y completes the right-handed frame. Zero of a flat net.
    pub bend: [f64; 3],
}

/// The height of a bent net counts no farther than this part of its distance: beyond, a parabola is no net.
const HIGHEST: f64 = 0.3;

impl LatticeField {
    /// The one field with the wave vectors `ideal` (cycles per unit of x and y) along `ray` on a plane of the given normal.
    pub fn through(ideal: [Vector2<f64>; 2], ray: Vector3<f64>, normal: Vector3<f64>) -> Self {
        // ∇φ = G / (n·d) - n (G·d) / (n·d)² is perpendicular to d, with the given x and y; G is what of it lies in the plane.
        let along = normal.dot(&ray);
        let duals = ideal.map(|q| {
            let gradient = Vector3::new(q.x, q.y, -q.dot(&ray.xy()));
            (gradient - normal * normal.dot(&gradient)) * along
        });
        Self { normal, duals, bend: [0.0; 3] }
    }

    /// The field of `mesh` at `distance` m with the given net axes.
    pub fn of_mesh(mesh: &Mesh, camera_from_net: &Rotation3<f64>, distance: f64) -> Self {
        let (a1, a2) = (mesh.a1(), mesh.a2());
        let per_area = distance / a1.perp(&a2);
        let in_camera = |x: f64, y: f64| camera_from_net * (Vector3::new(x, y, 0.0) * per_area);
        let duals = [in_camera(a2.y, -a2.x), in_camera(-a1.y, a1.x)];
        Self { normal: camera_from_net * Vector3::z(), duals, bend: [0.0; 3] }
    }

    /// The same with all wave vectors times `factor`: of a net of the same mesh that many times as far.
    pub fn scaled(&self, factor: f64) -> Self {
        Self { duals: self.duals.map(|dual| dual * factor), ..*self }
    }

    /// Both wave vectors along `ray`, cycles per unit of x and y. `None` where the ray does not meet the plane, or grazes it.
    #[inline]
    pub fn waves(&self, ray: Vector3<f64>) -> Option<[Vector2<f64>; 2]> {
        let along = self.normal.dot(&ray);
        // Past 87 degrees there is nothing to see, and the field explodes.
        if along < 0.05 * ray.norm() {
            return None;
        }
        let scale = 1.0 / (along * along);
        let gradient = |v: &Vector3<f64>| (v.xy() * along - self.normal.xy() * v.dot(&ray)) * scale;
        let waves = self.duals.map(|dual| gradient(&dual));
        if self.bend == [0.0; 3] {
            return Some(waves);
        }
        // Of φ (1 + η): the height η, in distances, moves the point along the ray.
        let (axes, [x, y], height) = self.height(ray);
        let [b0, b1, b2] = self.bend;
        let slope = if height.abs() < HIGHEST {
            gradient(&axes[0]) * (b0 * x + b1 * y) + gradient(&axes[1]) * (b1 * x + b2 * y)
        } else {
            Vector2::zeros()
        };
        let phases = self.duals.map(|dual| dual.dot(&ray) / along);
        Some([waves[0] * (1.0 + height) + slope * phases[0], waves[1] * (1.0 + height) + slope * phases[1]])
    }

    /// Phases of both families along `ray`, cycles, up to a constant.
    #[inline]
    pub fn phases(&self, ray: Vector3<f64>) -> [f64; 2] {
        let mut depth = 1.0 / self.normal.dot(&ray);
        if self.bend != [0.0; 3] {
            depth *= 1.0 + self.height(ray).2;
        }
        [self.duals[0].dot(&ray) * depth, self.duals[1].dot(&ray) * depth]
    }

    /// Axes of the bend, where along them the ray meets the plane (from where the optical axis does), and the height there; in distances.
    #[inline]
    fn height(&self, ray: Vector3<f64>) -> ([Vector3<f64>; 2], [f64; 2], f64) {
        let n = self.normal;
        let x_axis = (Vector3::x() - n * n.x).normalize();
        let y_axis = n.cross(&x_axis);
        let point = ray / n.dot(&ray) - Vector3::z() / n.z;
        let (x, y) = (x_axis.dot(&point), y_axis.dot(&point));
        let [b0, b1, b2] = self.bend;
        let height = 0.5 * (b0 * x * x + b2 * y * y) + b1 * x * y;
        ([x_axis, y_axis], [x, y], height.clamp(-HIGHEST, HIGHEST))
    }

    /// Curvatures, 1/m, along the two directions in which the net bends most and least (largest magnitude first), positive away from the camera.
    pub fn curvatures(&self, mesh: &Mesh) -> [f64; 2] {
        let [b0, b1, b2] = self.bend;
        let (mean, half) = (0.5 * (b0 + b2), (0.5 * (b0 - b2)).hypot(b1));
        let (a, b) = if mean < 0.0 { (mean - half, mean + half) } else { (mean + half, mean - half) };
        [a, b].map(|bend| bend / self.distance(mesh))
    }

    /// Ratio of the first lattice side to the second, and the angle between them, rad.
    pub fn shape(&self) -> (f64, f64) {
        let [g1, g2] = self.duals;
        // Of dual vectors: the sides have the inverse ratio, the angle is the supplement.
        (g2.norm() / g1.norm(), g1.cross(&g2).norm().atan2(-g1.dot(&g2)))
    }

    /// Perpendicular distance of the plane, m, from the mean (geometric) of the mesh's sides: they are what a net keeps when it hangs askew.
    pub fn distance(&self, mesh: &Mesh) -> f64 {
        let [g1, g2] = self.duals;
        // |a_1| = D |g_2| / |g_1 x g_2|, and the other way round.
        let unit_sides = (g1.norm() * g2.norm()).sqrt() / g1.cross(&g2).norm();
        (mesh.side1() * mesh.side2()).sqrt() / unit_sides
    }

    /// The lattice vectors in the camera frame for a plane at distance 1.
    pub fn unit_sides(&self) -> [Vector3<f64>; 2] {
        let [g1, g2] = self.duals;
        let per_volume = 1.0 / g1.cross(&g2).dot(&self.normal);
        [g2.cross(&self.normal) * per_volume, self.normal.cross(&g1) * per_volume]
    }

    /// Net to camera: X along the first lattice vector. Right-handed only if the field is ([`Self::is_right_handed`]).
    pub fn rotation(&self) -> Rotation3<f64> {
        let x = self.unit_sides()[0].normalize();
        let y = self.normal.cross(&x);
        Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, self.normal]))
    }

    /// Whether the turn from the first to the second lattice vector is the one from X to Y.
    pub fn is_right_handed(&self) -> bool {
        self.duals[0].cross(&self.duals[1]).dot(&self.normal) > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_bent_net_has_the_gradient_of_its_phases_and_the_radius_of_its_sphere() {
        let mesh = Mesh::square(0.05).unwrap();
        let mut field = LatticeField::of_mesh(&mesh, &rotation(0.5, 1.0, 0.2), 2.0);
        field.bend = [0.3, -0.2, 0.4];
        for (x, y) in [(0.1, 0.2), (-0.3, 0.1), (0.4, -0.2)] {
            let phase = |x: f64, y: f64| field.phases(Vector3::new(x, y, 1.0));
            let waves = field.waves(Vector3::new(x, y, 1.0)).unwrap();
            let h = 1e-6;
            for (family, wave) in waves.iter().enumerate() {
                let du = (phase(x + h, y)[family] - phase(x - h, y)[family]) / (2.0 * h);
                let dv = (phase(x, y + h)[family] - phase(x, y - h)[family]) / (2.0 * h);
                assert!((wave - Vector2::new(du, dv)).norm() < 1e-5 * wave.norm());
            }
        }
        // A sphere of radius 5 m seen from 2 m: depths of 2 m and its sag of x² / 10 m.
        field = LatticeField::of_mesh(&mesh, &Rotation3::identity(), 2.0);
        field.bend = [0.4, 0.0, 0.4];
        assert!(field.curvatures(&mesh).iter().all(|curvature| (curvature - 0.2).abs() < 1e-12));
        let cells = field.phases(Vector3::new(0.25, 0.0, 1.0))[0] * 0.05;
        let sag = 0.5_f64.powi(2) / 10.0;
        assert!((cells - 0.25 * (2.0 + sag)).abs() < 1e-9, "{cells}");
    }

    fn rotation(tilt: f64, azimuth: f64, roll: f64) -> Rotation3<f64> {
        Rotation3::new(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt) * Rotation3::new(Vector3::z() * roll)
    }

    proptest! {
        #[test]
        fn a_net_is_told_from_its_wave_vectors_at_one_ray(
            tilt in 0.0..1.1f64, azimuth in 0.0..6.2f64, roll in -3.1..3.1f64, distance in 0.3..6.0f64,
            a in 0.01..0.1f64, b in 0.01..0.1f64, angle in 0.8..2.3f64, x in -0.4..0.4f64, y in -0.3..0.3f64,
        ) {
            let mesh = Mesh::oblique(a, b, angle).unwrap();
            let net = rotation(tilt, azimuth, roll);
            let field = LatticeField::of_mesh(&mesh, &net, distance);
            let ray = Vector3::new(x, y, 1.0);
            prop_assume!(field.normal.dot(&ray) > 0.1);
            let waves = field.waves(ray).unwrap();

            // The gradient of the phase of the point that the ray meets, by differences.
            let phase = |x: f64, y: f64| {
                let ray = Vector3::new(x, y, 1.0);
                let point = net.inverse() * (ray * (distance / field.normal.dot(&ray)));
                let second = point.y / mesh.a2().y;
                ((point.x - second * mesh.a2().x) / mesh.side1(), second)
            };
            let h = 1e-6;
            let (right, left, down, up) = (phase(x + h, y), phase(x - h, y), phase(x, y + h), phase(x, y - h));
            let expected = [
                Vector2::new(right.0 - left.0, down.0 - up.0) / (2.0 * h),
                Vector2::new(right.1 - left.1, down.1 - up.1) / (2.0 * h),
            ];
            for (got, expected) in waves.iter().zip(expected) {
                prop_assert!((got - expected).norm() < 1e-5 * (1.0 + expected.norm()), "{got} for {expected}");
            }

            let again = LatticeField::through(waves, ray, field.normal);
            prop_assert!((again.duals[0] - field.duals[0]).norm() < 1e-9 * field.duals[0].norm());
            prop_assert!((again.duals[1] - field.duals[1]).norm() < 1e-9 * field.duals[1].norm());
            let (ratio, crossing) = again.shape();
            prop_assert!((ratio - a / b).abs() < 1e-9 * ratio && (crossing - angle).abs() < 1e-9);
            prop_assert!((again.distance(&mesh) / distance - 1.0).abs() < 1e-9);
            prop_assert!(again.is_right_handed());
            prop_assert!((again.rotation().matrix() - net.matrix()).norm() < 1e-9);
        }
    }
}
