//! Wave vectors of a lattice in the picture, and the lattice vectors they belong to.

use nalgebra::{Matrix2, Vector2};

use crate::error::{Error, Result};

/// Spatial frequency of a periodic pattern, cycles per pixel along u and v.
pub type WaveVector = Vector2<f64>;

/// Two lattice vectors in the picture, px: neighbouring junctions are `b1` and `b2` apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Basis {
    /// First lattice vector, px.
    pub b1: Vector2<f64>,
    /// Second lattice vector, px.
    pub b2: Vector2<f64>,
}

impl Basis {
    /// Lattice vectors are the rows of the inverse transpose of the matrix whose rows are the wave vectors, so that
    /// `b_i · k_j = 1` for `i = j` and 0 otherwise. (Replaces the thesis's eq. 4.14, which swaps the sides of a
    /// foreshortened cell.)
    ///
    /// # Errors
    /// [`Error::Degenerate`] for parallel or zero wave vectors.
    pub fn from_wave_vectors(k1: WaveVector, k2: WaveVector) -> Result<Self> {
        let rows = Matrix2::new(k1.x, k1.y, k2.x, k2.y);
        let det = rows.determinant();
        let scale = k1.norm() * k2.norm();
        if !(det.is_finite() && det.abs() > 1e-9 * scale && scale > 0.0) {
            return Err(Error::Degenerate { what: "lattice basis", why: "the wave vectors are parallel or zero" });
        }
        Ok(Self { b1: Vector2::new(k2.y, -k2.x) / det, b2: Vector2::new(-k1.y, k1.x) / det })
    }

    /// The wave vectors of this basis, cycles per pixel.
    ///
    /// # Errors
    /// [`Error::Degenerate`] for parallel or zero lattice vectors.
    pub fn wave_vectors(&self) -> Result<(WaveVector, WaveVector)> {
        let dual = Self::from_wave_vectors(self.b1, self.b2)?;
        Ok((dual.b1, dual.b2))
    }

    /// Signed area of one cell, px²: positive when the turn from `b1` to `b2` is the one from u to v.
    pub fn cell_area(&self) -> f64 {
        self.b1.perp(&self.b2)
    }
}
