//! The mesh of a net: two lattice vectors in its plane.

use nalgebra::Vector2;

use crate::error::{Error, Result, positive};

/// Two sides and the angle between them. A side is knot to knot, not the stretched mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mesh {
    side1: f64,
    side2: f64,
    angle: f64,
}

impl Mesh {
    /// Square mesh of side `cell`, m.
    ///
    /// # Errors
    /// [`Error::Value`] if the side is not finite and above zero.
    pub fn square(cell: f64) -> Result<Self> {
        Self::rectangular(cell, cell)
    }

    /// Rectangular mesh of sides `a` and `b`, m.
    ///
    /// # Errors
    /// [`Error::Value`] if a side is not finite and above zero.
    pub fn rectangular(a: f64, b: f64) -> Result<Self> {
        Self::oblique(a, b, std::f64::consts::FRAC_PI_2)
    }

    /// Oblique (diamond) mesh of sides `a` and `b`, m, crossing at `angle`, rad, in (0, pi).
    ///
    /// # Errors
    /// [`Error::Value`] names the side or angle that is out of range.
    pub fn oblique(a: f64, b: f64, angle: f64) -> Result<Self> {
        let side1 = positive("mesh side a", a)?;
        let side2 = positive("mesh side b", b)?;
        if !(angle.is_finite() && angle > 0.0 && angle < std::f64::consts::PI) {
            return Err(Error::Value { field: "mesh angle", value: angle, expected: "radians between 0 and pi" });
        }
        Ok(Self { side1, side2, angle })
    }

    /// Length of the first lattice vector, m.
    pub fn side1(&self) -> f64 {
        self.side1
    }
    /// Length of the second lattice vector, m.
    pub fn side2(&self) -> f64 {
        self.side2
    }
    /// Angle from the first to the second lattice vector, rad.
    pub fn angle(&self) -> f64 {
        self.angle
    }
    /// Area of one cell, m².
    pub fn cell_area(&self) -> f64 {
        self.side1 * self.side2 * self.angle.sin()
    }

    /// First lattice vector in the net plane, m: along X.
    pub fn a1(&self) -> Vector2<f64> {
        Vector2::new(self.side1, 0.0)
    }
    /// Second lattice vector in the net plane, m.
    pub fn a2(&self) -> Vector2<f64> {
        // Exactly (0, side) for a right angle: cos(pi/2) is not zero in floating point.
        if self.is_right_angled() {
            return Vector2::new(0.0, self.side2);
        }
        Vector2::new(self.side2 * self.angle.cos(), self.side2 * self.angle.sin())
    }

    /// Whether the sides cross at 90 degrees.
    pub fn is_right_angled(&self) -> bool {
        (self.angle - std::f64::consts::FRAC_PI_2).abs() < 1e-12
    }

    /// Lattice node `(i, j)` in the net plane, m.
    pub fn node(&self, i: f64, j: f64) -> Vector2<f64> {
        self.a1() * i + self.a2() * j
    }
}

/// `50mm`, `5cm`, `0.05m`, `0.05` (metres), `50x40mm`, `50x50mm@60deg`.
impl std::str::FromStr for Mesh {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let expected =
            "give 50mm, 5cm, 0.05m or 0.05 (metres), 50x40mm for a rectangle, 50x50mm@60deg for an oblique mesh";
        let wrong = || Error::MeshText { text: text.to_owned(), expected };
        let number = |s: &str| s.trim().parse::<f64>().map_err(|_| wrong());
        let (sizes, angle) = match text.trim().split_once('@') {
            Some((sizes, angle)) => (sizes, number(angle.trim().strip_suffix("deg").ok_or_else(wrong)?)?.to_radians()),
            None => (text.trim(), std::f64::consts::FRAC_PI_2),
        };
        let (digits, unit) = match sizes {
            s if s.ends_with("mm") => (&s[..s.len() - 2], 1e-3),
            s if s.ends_with("cm") => (&s[..s.len() - 2], 1e-2),
            s if s.ends_with('m') => (&s[..s.len() - 1], 1.0),
            s => (s, 1.0),
        };
        let (a, b) = match digits.split_once('x') {
            Some((a, b)) => (number(a)? * unit, number(b)? * unit),
            None => (number(digits)? * unit, number(digits)? * unit),
        };
        Self::oblique(a, b, angle)
    }
}
