//! Gauss-Newton on the field of a lattice: six numbers, whatever was measured.

use net_geometry::Mesh;
use net_geometry::nalgebra::{Rotation3, SMatrix, SVector, Vector3};

use crate::error::{Error, Result};
use crate::field::LatticeField;

/// How well the shape of a mesh is known when it hangs in the water.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ShapeConfig {
    /// One standard deviation of the crossing angle about the mesh's, degrees. Default 10: nets hang askew, twine turns in its knots. Smaller: surer tilts of a
    /// net that is known to be in shape, wrong ones of a net that is not.
    pub sigma_angle_deg: f64,
    /// One standard deviation of the ratio of the sides about the mesh's, relative. Default 0.01: twine hardly stretches, bars differ a little.
    pub sigma_ratio: f64,
    /// One standard deviation of a net's curvatures, 1/m. Default 0.3: what nets in pens show. 0 holds the net flat.
    pub sigma_curvature_per_m: f64,
}

impl Default for ShapeConfig {
    fn default() -> Self {
        Self { sigma_angle_deg: 10.0, sigma_ratio: 0.01, sigma_curvature_per_m: 0.3 }
    }
}

impl ShapeConfig {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Parameter`] names the field.
    pub fn validate(&self) -> Result<()> {
        for (field, value) in [("sigma_angle_deg", self.sigma_angle_deg), ("sigma_ratio", self.sigma_ratio)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::Parameter { field, value, expected: "a finite number above 0" });
            }
        }
        let value = self.sigma_curvature_per_m;
        if !(value >= 0.0 && value.is_finite()) {
            return Err(Error::Parameter {
                field: "sigma_curvature_per_m",
                value,
                expected: "a finite number, 0 or more",
            });
        }
        Ok(())
    }
}

/// The step of the numerical derivatives, rad or relative: fields are smooth over 1e-2, doubles carry 1e-16.
const STEP: f64 = 1e-5;

/// Number of parameters of a flat net: rotation about the camera (3), logarithms of scale and of the ratio of sides, crossing angle.
pub(crate) const FLAT: usize = 6;
/// And of a bent one: its three bends.
pub(crate) const BENT: usize = 9;
/// Numbers for all parameters, or by twos.
pub(crate) type Parameters = SVector<f64, BENT>;
pub(crate) type ParametersSquared = SMatrix<f64, BENT, BENT>;

/// `field` moved by the parameters `step`.
pub(crate) fn moved(field: &LatticeField, step: &Parameters) -> LatticeField {
    let turn = Rotation3::new(Vector3::new(step[0], step[1], step[2]));
    let normal = (turn * field.normal).normalize();
    let (open, close) = (Rotation3::new(normal * (0.5 * step[5])), Rotation3::new(normal * (-0.5 * step[5])));
    let [g1, g2] = field.duals;
    let (scale1, scale2) = ((step[3] + step[4]).exp(), (step[3] - step[4]).exp());
    let [b0, b1, b2] = field.bend;
    LatticeField {
        normal,
        duals: [open * (turn * g1) * scale1, close * (turn * g2) * scale2],
        bend: [b0 + step[6], b1 + step[7], b2 + step[8]],
    }
}

/// Normal equations about a field, and the fields next to it for derivatives.
#[derive(Debug, Clone)]
pub(crate) struct NormalEquations {
    pub(crate) field: LatticeField,
    neighbours: [LatticeField; BENT],
    /// How many of the parameters are fitted: [`FLAT`] or [`BENT`].
    fitted: usize,
    pub(crate) matrix: ParametersSquared,
    pub(crate) gradient: Parameters,
}

impl NormalEquations {
    pub(crate) fn about(field: &LatticeField, fitted: usize) -> Self {
        let neighbours = std::array::from_fn(|k| {
            let mut step = Parameters::zeros();
            step[k] = STEP;
            moved(field, &step)
        });
        let mut matrix = ParametersSquared::zeros();
        for k in fitted..BENT {
            matrix[(k, k)] = 1.0;
        }
        Self { field: *field, neighbours, fitted, matrix, gradient: Parameters::zeros() }
    }

    /// Value of `of` at the field and its derivatives there. `None` if it has none at one of them.
    #[inline]
    pub(crate) fn derive(&self, of: impl Fn(&LatticeField) -> Option<f64>) -> Option<(f64, Parameters)> {
        let value = of(&self.field)?;
        let mut derivatives = Parameters::zeros();
        for (derivative, neighbour) in derivatives.iter_mut().zip(&self.neighbours[..self.fitted]) {
            *derivative = (of(neighbour)? - value) / STEP;
        }
        Some((value, derivatives))
    }

    /// A measurement that exceeds its prediction by `residual`, of which `derivatives` are the prediction's, with the given weight (1 / variance).
    #[inline]
    pub(crate) fn add(&mut self, residual: f64, derivatives: &Parameters, weight: f64) {
        self.gradient.axpy(weight * residual, derivatives, 1.0);
        self.matrix.ger(weight, derivatives, derivatives, 1.0);
    }

    /// What is known of the mesh.
    pub(crate) fn add_shape(&mut self, mesh: &Mesh, shape: &ShapeConfig) {
        let ratio = |field: &LatticeField| Some(field.shape().0.ln());
        let angle = |field: &LatticeField| Some(field.shape().1);
        let expected_ratio = (mesh.side1() / mesh.side2()).ln();
        if let Some((value, derivatives)) = self.derive(ratio) {
            self.add(expected_ratio - value, &derivatives, shape.sigma_ratio.powi(-2));
        }
        if let Some((value, derivatives)) = self.derive(angle) {
            self.add(mesh.angle() - value, &derivatives, shape.sigma_angle_deg.to_radians().powi(-2));
        }
    }

    /// How much nets bend.
    pub(crate) fn add_bend(&mut self, mesh: &Mesh, shape: &ShapeConfig) {
        let sigma = shape.sigma_curvature_per_m * self.field.distance(mesh);
        for (k, bend) in self.field.bend.into_iter().enumerate() {
            self.matrix[(FLAT + k, FLAT + k)] += sigma.powi(-2);
            self.gradient[FLAT + k] -= bend * sigma.powi(-2);
        }
    }

    /// The field after one step, at most `longest` long (rad, relative). `None` if the measurements do not determine it, or the plane turns its edge.
    pub(crate) fn solve(&self, longest: f64) -> Option<LatticeField> {
        let mut step = self.matrix.cholesky()?.solve(&self.gradient);
        let length = step.norm();
        if !length.is_finite() {
            return None;
        }
        if length > longest {
            step *= longest / length;
        }
        let field = moved(&self.field, &step);
        (field.normal.z > 0.1).then_some(field)
    }
}

/// Squared and summed distance of the lattice's shape from the mesh's, in standard deviations.
pub(crate) fn shape_misfit(field: &LatticeField, mesh: &Mesh, sigma_ratio: f64, sigma_angle: f64) -> f64 {
    let (ratio, angle) = field.shape();
    let off_ratio = (ratio * mesh.side2() / mesh.side1()).ln() / sigma_ratio;
    let off_angle = (angle - mesh.angle()) / sigma_angle;
    off_ratio * off_ratio + off_angle * off_angle
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recovers_a_field_from_its_wave_vectors() {
        let mesh = Mesh::rectangular(0.06, 0.04).unwrap();
        let turn = Rotation3::new(Vector3::new(0.4, -0.3, 0.2));
        let truth = LatticeField::of_mesh(&mesh, &turn, 1.3);
        let rays = [(-0.4, -0.2), (0.4, -0.2), (-0.4, 0.2), (0.4, 0.2)].map(|(x, y)| Vector3::new(x, y, 1.0));
        let mut field =
            moved(&truth, &Parameters::from_row_slice(&[0.05, 0.04, -0.05, 0.06, 0.02, 0.05, 0.0, 0.0, 0.0]));
        for _ in 0..8 {
            let mut equations = NormalEquations::about(&field, FLAT);
            for ray in rays {
                for family in 0..2 {
                    for axis in 0..2 {
                        let of = |field: &LatticeField| Some(field.waves(ray)?[family][axis]);
                        let (value, derivatives) = equations.derive(of).unwrap();
                        equations.add(of(&truth).unwrap() - value, &derivatives, 1e6);
                    }
                }
            }
            equations.add_shape(&mesh, &ShapeConfig::default());
            field = equations.solve(0.3).unwrap();
        }
        assert!((field.normal - truth.normal).norm() < 1e-9);
        assert!((field.distance(&mesh) / 1.3 - 1.0).abs() < 1e-9);
        assert!(shape_misfit(&field, &mesh, 1e-3, 1e-3) < 1e-9);
    }

    #[test]
    fn too_few_measurements_determine_nothing() {
        let field = LatticeField::of_mesh(&Mesh::square(0.05).unwrap(), &Rotation3::identity(), 1.0);
        assert!(NormalEquations::about(&field, FLAT).solve(0.3).is_none());
    }
}
