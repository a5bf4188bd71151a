//! The mesh of a net: two lattice vectors in its plane.

use nalgebra::Vector2;

use crate::error::{Error, Result};

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
    /// [`Error::Value`] for a side out of 1 mm to 2 m: `50` is meant as millimetres, not as a net of 50 m meshes.
    pub fn square(cell: f64) -> Result<Self> {
        Self::rectangular(cell, cell)
    }

    /// Rectangular mesh of sides `a` and `b`, m.
    ///
    /// # Errors
    /// [`Error::Value`] for a side out of 1 mm to 2 m.
    pub fn rectangular(a: f64, b: f64) -> Result<Self> {
        Self::oblique(a, b, std::f64::consts::FRAC_PI_2)
    }

    /// Oblique (diamond) mesh of sides `a` and `b`, m, crossing at `angle`, rad, in (0, pi).
    ///
    /// # Errors
    /// [`Error::Value`] names the side (1 mm to 2 m) or angle that is out of range.
    pub fn oblique(a: f64, b: f64, angle: f64) -> Result<Self> {
        let side1 = side("mesh side a", a)?;
        let side2 = side("mesh side b", b)?;
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

    /// Lattice coordinates of a point of the net plane, m: whole numbers at the nodes.
    #[inline]
    pub fn coordinates(&self, point: Vector2<f64>) -> Vector2<f64> {
        let a2 = self.a2();
        let j = point.y / a2.y;
        Vector2::new((point.x - j * a2.x) / self.side1, j)
    }

    /// Indices of the node nearest to a point of the net plane, m: also for oblique meshes, where rounding the
    /// coordinates need not give it. `None` for a point that is not finite, or more than 2^30 cells away.
    pub fn nearest_node(&self, point: Vector2<f64>) -> Option<(i32, i32)> {
        // In a basis of shortest vectors (Lagrange) the nearest node is a corner of the point's cell. Each with its own
        // indices.
        let mut short = (self.a1(), Vector2::new(1.0, 0.0));
        let mut long = (self.a2(), Vector2::new(0.0, 1.0));
        loop {
            if short.0.norm_squared() > long.0.norm_squared() {
                std::mem::swap(&mut short, &mut long);
            }
            let overlap = short.0.dot(&long.0) / short.0.norm_squared();
            // A little more than a half, or at exactly 60 degrees it would go to and fro. Each round shortens the
            // longer vector, so this ends; meshes that are not slivers need one round at most.
            if !(overlap.abs() > 0.5 + 1e-9 && overlap.is_finite()) {
                break;
            }
            long = (long.0 - short.0 * overlap.round(), long.1 - short.1 * overlap.round());
        }
        let area = short.0.perp(&long.0);
        let corner = Vector2::new(point.perp(&long.0) / area, short.0.perp(&point) / area).map(f64::floor);
        let mut nearest = (f64::INFINITY, Vector2::repeat(f64::NAN));
        for step in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let at = corner + Vector2::new(step.0, step.1);
            let distance = (short.0 * at.x + long.0 * at.y - point).norm_squared();
            if distance < nearest.0 {
                nearest = (distance, short.1 * at.x + long.1 * at.y);
            }
        }
        let far = f64::from(1 << 30);
        (nearest.1.amax() < far).then_some((nearest.1.x as i32, nearest.1.y as i32))
    }

    /// The same lattice with its second vector for the first, and the opposite of its first for the second.
    pub fn turned(&self) -> Self {
        Self { side1: self.side2, side2: self.side1, angle: std::f64::consts::PI - self.angle }
    }
}

/// What a mesh may be written as.
const MESH_TEXT: &str = "give 50mm, 5cm, 0.05m or 0.05 (metres), 50x40mm for a rectangle, \
     50x50mm@60deg for an oblique mesh (sides from 1 mm to 2 m, angle between 0 and 180 degrees)";

/// Sides that a net's mesh may have, m.
const SIDES: std::ops::RangeInclusive<f64> = 0.001..=2.0;

fn side(field: &'static str, value: f64) -> Result<f64> {
    let expected = "metres from 0.001 to 2 (0.05 for a mesh of 50 mm)";
    if SIDES.contains(&value) { Ok(value) } else { Err(Error::Value { field, value, expected }) }
}

/// `50mm`, `5cm`, `0.05m`, `0.05` (metres), `50x40mm`, `50x50mm@60deg`.
impl std::str::FromStr for Mesh {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        parse(text.trim()).ok_or_else(|| Error::MeshText { text: text.to_owned(), expected: MESH_TEXT })
    }
}

fn parse(text: &str) -> Option<Mesh> {
    let (sizes, angle) = match text.split_once('@') {
        Some((sizes, angle)) => (sizes, number(angle.strip_suffix("deg")?)?.to_radians()),
        None => (text, std::f64::consts::FRAC_PI_2),
    };
    // "mm" before "m". Divided, not multiplied: 50 / 1000 is the number nearest to 0.05, 50 * 0.001 is not.
    let units = [("mm", 1000.0), ("cm", 100.0), ("m", 1.0), ("", 1.0)];
    let (digits, per_metre) =
        units.into_iter().find_map(|(unit, n)| Some((sizes.trim_end().strip_suffix(unit)?, n)))?;
    let (a, b) = digits.split_once('x').unwrap_or((digits, digits));
    let side = |digits| number(digits).map(|x| x / per_metre);
    Mesh::oblique(side(a)?, side(b)?, angle).ok()
}

/// A plain decimal number: Rust's parser would take `inf` and `nan` too.
fn number(text: &str) -> Option<f64> {
    let text = text.trim();
    text.bytes().all(|c| c.is_ascii_digit() || matches!(c, b'.' | b'e' | b'-')).then(|| text.parse().ok())?
}

/// The form that [`Mesh::from_str`](std::str::FromStr) reads, in millimetres.
impl std::fmt::Display for Mesh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // To a nanometre and a millionth of a degree: 0.0275 m is 27.5mm, not 27.500000000000004mm.
        let rounded = |x: f64, unit: f64| (x * unit * 1e6).round() / 1e6;
        let (a, b) = (rounded(self.side1, 1e3), rounded(self.side2, 1e3));
        if a == b && self.is_right_angled() {
            return write!(f, "{a}mm");
        }
        write!(f, "{a}x{b}mm")?;
        if self.is_right_angled() { Ok(()) } else { write!(f, "@{}deg", rounded(self.angle.to_degrees(), 1.0)) }
    }
}
