//! Motion of the picture from one frame to another.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// Where the points of one frame lie in another: a homography from pixel to pixel. (A similarity or a shift is one, too.)
///
/// Named like poses: `next_from_prev.apply(pixel_in_prev)` is a pixel of the next frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Pixel to pixel, scaled so that the bottom right element is 1.
    matrix: Matrix3<f64>,
}

impl Default for Motion {
    fn default() -> Self {
        Self::identity()
    }
}

impl Motion {
    /// Nothing moves.
    pub fn identity() -> Self {
        Self { matrix: Matrix3::identity() }
    }

    /// Everything moves by `shift`, px.
    pub fn translation(shift: Vector2<f64>) -> Self {
        Self { matrix: Matrix3::new_translation(&shift) }
    }

    /// The similarity `(u, v) -> (a u - b v + tu, b u + a v + tv)`: scale `hypot(a, b)`, turn `atan2(b, a)` from u to v.
    pub fn similarity(a: f64, b: f64, shift: Vector2<f64>) -> Self {
        Self { matrix: Matrix3::new(a, -b, shift.x, b, a, shift.y, 0.0, 0.0, 1.0) }
    }

    /// From a homography; `None` if it is not finite, not invertible, or turns the picture over.
    pub fn from_matrix(matrix: Matrix3<f64>) -> Option<Self> {
        let scale = matrix[(2, 2)];
        let matrix = matrix / scale;
        (matrix.iter().all(|x| x.is_finite()) && matrix.determinant() > 1e-9).then_some(Self { matrix })
    }

    /// The homography, bottom right element 1.
    pub fn matrix(&self) -> &Matrix3<f64> {
        &self.matrix
    }

    /// Where `pixel` goes. NaN for points that go behind the horizon of the homography.
    #[inline]
    pub fn apply(&self, pixel: Vector2<f64>) -> Vector2<f64> {
        let m = &self.matrix;
        let w = m[(2, 0)] * pixel.x + m[(2, 1)] * pixel.y + m[(2, 2)];
        let u = m[(0, 0)] * pixel.x + m[(0, 1)] * pixel.y + m[(0, 2)];
        let v = m[(1, 0)] * pixel.x + m[(1, 1)] * pixel.y + m[(1, 2)];
        if w > 1e-9 { Vector2::new(u / w, v / w) } else { Vector2::new(f64::NAN, f64::NAN) }
    }

    /// How a small neighbourhood of `pixel` is stretched and turned: the Jacobian of [`Motion::apply`].
    #[inline]
    pub fn jacobian(&self, pixel: Vector2<f64>) -> Matrix2<f64> {
        let m = &self.matrix;
        let q = m * Vector3::new(pixel.x, pixel.y, 1.0);
        let (u, v) = (q.x / q.z, q.y / q.z);
        Matrix2::new(
            m[(0, 0)] - u * m[(2, 0)],
            m[(0, 1)] - u * m[(2, 1)],
            m[(1, 0)] - v * m[(2, 0)],
            m[(1, 1)] - v * m[(2, 1)],
        ) / q.z
    }

    /// The way back; `None` where numbers fail (never for a motion that [`Motion::from_matrix`] accepted and that is well scaled).
    pub fn inverse(&self) -> Option<Self> {
        Self::from_matrix(self.matrix.try_inverse()?)
    }

    /// `c_from_a = a_to_b.then(&b_to_c)`; `None` where the product is no longer a motion.
    pub fn then(&self, next: &Self) -> Option<Self> {
        Self::from_matrix(next.matrix * self.matrix)
    }

    /// This motion followed by a shift, px.
    pub fn shifted(&self, shift: Vector2<f64>) -> Self {
        // The last row of a shift is (0, 0, 1), so the bottom right element stays 1.
        Self { matrix: Matrix3::new_translation(&shift) * self.matrix }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Double rounding of a few operations on numbers of the size of a picture.
    const ROUNDING: f64 = 1e-9;

    fn tilted() -> Motion {
        Motion::from_matrix(Matrix3::new(1.02, -0.05, 7.0, 0.04, 0.97, -3.0, 1e-5, -2e-5, 1.0)).expect("a motion")
    }

    #[test]
    fn inverse_and_then_undo_each_other() {
        let motion = tilted();
        let both = motion.then(&motion.inverse().expect("invertible")).expect("a motion");
        let p = Vector2::new(812.0, 33.0);
        assert!((both.apply(p) - p).norm() < ROUNDING);
    }

    #[test]
    fn jacobian_is_the_derivative() {
        let (motion, p, h) = (tilted(), Vector2::new(411.0, 222.0), 1e-3);
        let du = (motion.apply(p + Vector2::new(h, 0.0)) - motion.apply(p - Vector2::new(h, 0.0))) / (2.0 * h);
        let dv = (motion.apply(p + Vector2::new(0.0, h)) - motion.apply(p - Vector2::new(0.0, h))) / (2.0 * h);
        // Central differences: the error is of second order in h, times the tiny perspective terms.
        assert!((motion.jacobian(p) - Matrix2::from_columns(&[du, dv])).norm() < 1e-8);
    }

    #[test]
    fn refuses_what_is_no_motion() {
        assert!(Motion::from_matrix(Matrix3::zeros()).is_none());
        assert!(Motion::from_matrix(Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0))).is_none());
        assert!(Motion::from_matrix(Matrix3::identity() * f64::NAN).is_none());
        let beyond =
            Motion::from_matrix(Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -0.01, 0.0, 1.0)).expect("a motion");
        assert!(beyond.apply(Vector2::new(200.0, 0.0)).x.is_nan());
    }
}
