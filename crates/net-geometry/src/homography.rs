//! Homographies: how one picture of a plane maps to another.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::pose::Pose;

/// Projective map between two planes, `w (x', y', 1) = H (x, y, 1)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Homography {
    /// `H`, of any scale but zero.
    matrix: Matrix3<f64>,
}

/// Ratio of eigenvalues (squared lengths) below which normalised points count as lying on a line. Rounding leaves about
/// 1e-16, a sliver of 1 : 1000 has 1e-6.
const DEGENERATE: f64 = 1e-12;

fn degenerate(why: &'static str) -> Error {
    Error::Degenerate { what: "homography", why }
}

impl Homography {
    /// Takes a 3 x 3 matrix.
    ///
    /// # Errors
    /// [`Error::Degenerate`] if it is singular or not finite.
    pub fn from_matrix(matrix: Matrix3<f64>) -> Result<Self> {
        let scale = matrix.norm();
        let det = (matrix / scale).determinant();
        if !(scale.is_finite() && det.is_finite() && det != 0.0) {
            return Err(degenerate("the matrix is singular or not finite"));
        }
        Ok(Self { matrix })
    }

    /// The homography that takes `from[i]` to `to[i]`; see [`Homography::from_pairs`].
    ///
    /// # Errors
    /// [`Error::Degenerate`] for unequal lengths, and as [`Homography::from_pairs`].
    pub fn from_points(from: &[Vector2<f64>], to: &[Vector2<f64>]) -> Result<Self> {
        if from.len() != to.len() {
            return Err(degenerate("there are not as many images as points"));
        }
        Self::from_pairs(from.iter().copied().zip(to.iter().copied()))
    }

    /// The homography that takes the first of each pair to the second, by the direct linear transform on normalised
    /// coordinates (Hartley 1997), in the reduced form of Harker and O'Leary 2005: exact for four points, algebraic
    /// least squares for more. Reads the pairs several times and allocates nothing.
    ///
    /// # Errors
    /// [`Error::Degenerate`] for fewer than four pairs, points that are not finite, or that lie (but for one) on a
    /// line.
    pub fn from_pairs(pairs: impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> + Clone) -> Result<Self> {
        let source = Normalisation::of(pairs.clone().map(|p| p.0))?;
        let target = Normalisation::of(pairs.clone().map(|p| p.1))?;
        let n = pairs.clone().count() as f64;
        let pairs = || pairs.clone().map(|(p, q)| (source.apply(p), target.apply(q)));

        // Rows of h: (a, b, c), (d, e, f), g. With centred points c and f follow from g and the means; a, b, d, e
        // follow from g by least squares on the points. What is left is a 2n x 3 system for g, always well scaled.
        let mut spread = Matrix2::zeros();
        let (mut mean_u, mut mean_v) = (Vector2::zeros(), Vector2::zeros());
        for (x, y) in pairs() {
            spread += x * x.transpose();
            mean_u += x * (y.x / n);
            mean_v += x * (y.y / n);
        }
        if spread.determinant() <= DEGENERATE * n * n {
            return Err(degenerate("the points lie on a line"));
        }
        let inverse_spread = spread.try_inverse().ok_or(degenerate("the points lie on a line"))?;
        let row_u = |x: Vector2<f64>, y: Vector2<f64>| (x * y.x - mean_u).push(y.x);
        let row_v = |x: Vector2<f64>, y: Vector2<f64>| (x * y.y - mean_v).push(y.y);
        let (mut fit_u, mut fit_v) = (Matrix2x3::zeros(), Matrix2x3::zeros());
        for (x, y) in pairs() {
            fit_u += x * row_u(x, y).transpose();
            fit_v += x * row_v(x, y).transpose();
        }
        (fit_u, fit_v) = (inverse_spread * fit_u, inverse_spread * fit_v);
        let mut system = Matrix3::zeros();
        for (x, y) in pairs() {
            let du = row_u(x, y) - fit_u.transpose() * x;
            let dv = row_v(x, y) - fit_v.transpose() * x;
            system += du * du.transpose() + dv * dv.transpose();
        }
        let eigen = system.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let [_, middle, largest] = order.map(|k| eigen.eigenvalues[k]);
        if !(largest.is_finite() && middle > DEGENERATE * largest) {
            return Err(degenerate("all points but one lie on a line"));
        }

        let g: Vector3<f64> = eigen.eigenvectors.column(order[0]).into_owned();
        let (ab, de) = (fit_u * g, fit_v * g);
        let (c, f) = (mean_u.dot(&g.xy()), mean_v.dot(&g.xy()));
        let h = Matrix3::new(ab.x, ab.y, c, de.x, de.y, f, g.x, g.y, g.z).normalize();
        if h.determinant().abs() <= DEGENERATE {
            return Err(degenerate("the images of the points lie on a line"));
        }
        Self::from_matrix(target.inverse_matrix() * h * source.matrix())
    }

    /// Plane to picture: pixel of the point `(X, Y)` m of the net's plane, for the pinhole of `camera`. The lens is not
    /// in it: no homography describes a lens.
    ///
    /// # Errors
    /// [`Error::Degenerate`] if the plane passes through the camera.
    pub fn pixel_from_net(camera: &Camera, pose: &Pose) -> Result<Self> {
        let edge_on = pose.plane().distance.abs() <= 1e-9 * pose.translation.norm();
        if edge_on {
            return Err(degenerate("the plane passes through the camera"));
        }
        let r = pose.rotation.matrix();
        let plane = Matrix3::from_columns(&[r.column(0).into(), r.column(1).into(), pose.translation]);
        let intrinsics = Matrix3::new(camera.fx(), 0.0, camera.cx(), 0.0, camera.fy(), camera.cy(), 0.0, 0.0, 1.0);
        Self::from_matrix(intrinsics * plane)
    }

    /// The 3 x 3 matrix. Its scale has no meaning.
    pub fn matrix(&self) -> &Matrix3<f64> {
        &self.matrix
    }

    /// Where `point` goes; `None` if to infinity.
    #[inline]
    pub fn apply(&self, point: Vector2<f64>) -> Option<Vector2<f64>> {
        let h = self.matrix * point.push(1.0);
        let image = h.xy() / h.z;
        (image.x.is_finite() && image.y.is_finite()).then_some(image)
    }

    /// Where `point` goes, and the 2 x 2 Jacobian there: its columns are the images of small steps along x and y.
    #[inline]
    pub fn apply_with_jacobian(&self, point: Vector2<f64>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let h = self.matrix * point.push(1.0);
        let image = h.xy() / h.z;
        let top = self.matrix.fixed_view::<2, 2>(0, 0);
        let jacobian = (top - image * self.matrix.fixed_view::<1, 2>(2, 0)) / h.z;
        (image.iter().chain(jacobian.iter()).all(|x| x.is_finite())).then_some((image, jacobian))
    }

    /// The way back.
    ///
    /// # Errors
    /// [`Error::Degenerate`] if rounding leaves none.
    pub fn inverse(&self) -> Result<Self> {
        // Of scale one, so that the determinant of a small or large matrix does not vanish or overflow.
        let inverse = (self.matrix / self.matrix.norm())
            .try_inverse()
            .ok_or(Error::Degenerate { what: "inverse of a homography", why: "the matrix is singular" })?;
        Self::from_matrix(inverse)
    }
}

/// `a_from_c = a_from_b * b_from_c`.
impl std::ops::Mul for Homography {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self { matrix: self.matrix * other.matrix }
    }
}

/// Shift and scale that bring points to mean zero and root mean square distance √2 (Hartley 1997).
#[derive(Debug, Clone, Copy)]
struct Normalisation {
    mean: Vector2<f64>,
    scale: f64,
}

impl Normalisation {
    fn of(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Result<Self> {
        let count = points.clone().count();
        if count < 4 {
            return Err(degenerate("it takes four points or more"));
        }
        let n = count as f64;
        let mean = points.clone().sum::<Vector2<f64>>() / n;
        let square = points.map(|p| (p - mean).norm_squared()).sum::<f64>() / n;
        let scale = (2.0 / square).sqrt();
        // Coordinates that differ by rounding alone are one point.
        if !(scale.is_finite() && scale > 0.0 && square.sqrt() > 4.0 * f64::EPSILON * mean.amax()) {
            return Err(degenerate("the points are one, or not finite"));
        }
        Ok(Self { mean, scale })
    }

    fn apply(&self, point: Vector2<f64>) -> Vector2<f64> {
        (point - self.mean) * self.scale
    }

    fn matrix(&self) -> Matrix3<f64> {
        let (s, m) = (self.scale, self.mean);
        Matrix3::new(s, 0.0, -s * m.x, 0.0, s, -s * m.y, 0.0, 0.0, 1.0)
    }

    fn inverse_matrix(&self) -> Matrix3<f64> {
        let (s, m) = (1.0 / self.scale, self.mean);
        Matrix3::new(s, 0.0, m.x, 0.0, s, m.y, 0.0, 0.0, 1.0)
    }
}
