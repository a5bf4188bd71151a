//! The surface a net hangs on: height, slope and bend over the nominal plane.

use nalgebra::{Matrix2, Vector2, Vector3};

use crate::scene::Surface;

/// A [`Surface`] ready to be evaluated.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sheet {
    surface: Surface,
    flat: bool,
}

impl Sheet {
    pub(crate) fn new(surface: &Surface) -> Self {
        Self { surface: surface.clone(), flat: surface.is_level() }
    }

    /// Height over the plane, m, and its slope.
    pub(crate) fn height(&self, p: Vector2<f64>) -> (f64, Vector2<f64>) {
        if self.flat {
            return (0.0, Vector2::zeros());
        }
        let s = &self.surface;
        // The polynomial levels off beyond its reach.
        let reach2 = s.reach_m * s.reach_m;
        let q = 1.0 + p.norm_squared() / reach2;
        let root = q.sqrt();
        let (x, y) = (p.x / root, p.y / root);
        let [xx, xy, yy] = s.curvature_per_m;
        let [c3, c4, c5, c6] = s.cubic_per_m2;
        let [c7, c8, c9, c10, c11] = s.quartic_per_m3;
        let (x2, y2) = (x * x, y * y);
        let mut h = 0.5 * xx * x2 + xy * x * y + 0.5 * yy * y2;
        h += x2 * x * c3 + x2 * y * c4 + x * y2 * c5 + y2 * y * c6;
        h += x2 * x2 * c7 + x2 * x * y * c8 + x2 * y2 * c9 + x * y2 * y * c10 + y2 * y2 * c11;
        let mut slope = Vector2::new(
            xx * x
                + xy * y
                + 3.0 * x2 * c3
                + 2.0 * x * y * c4
                + y2 * c5
                + (4.0 * x2 * x * c7 + 3.0 * x2 * y * c8 + 2.0 * x * y2 * c9 + y2 * y * c10),
            xy * x
                + yy * y
                + x2 * c4
                + 2.0 * x * y * c5
                + 3.0 * y2 * c6
                + (x2 * x * c8 + 2.0 * x2 * y * c9 + 3.0 * x * y2 * c10 + 4.0 * y2 * y * c11),
        );
        // Chain rule through the levelling: d(p / root)/dp = (1 - p p^T / (reach² q)) / root.
        slope = (slope - p * (p.dot(&slope) / (reach2 * q))) / root;
        for wave in &s.waves {
            let (sin, cos) = wave.direction_deg.to_radians().sin_cos();
            let direction = Vector2::new(cos, sin);
            let number = std::f64::consts::TAU / wave.length_m;
            let phase = wave.phase_deg.to_radians();
            let at = number * direction.dot(&p) + phase;
            h += wave.amplitude_m * (at.sin() - phase.sin());
            slope += direction * (wave.amplitude_m * number * at.cos());
        }
        (h, slope)
    }

    /// Point of the surface over `p`, in the net frame.
    pub(crate) fn point(&self, p: Vector2<f64>) -> Vector3<f64> {
        Vector3::new(p.x, p.y, self.height(p).0)
    }

    /// Principal curvatures over `p`, 1/m, the larger magnitude first; positive bends away from the camera at the sides.
    pub(crate) fn curvatures(&self, p: Vector2<f64>) -> [f64; 2] {
        if self.flat {
            return [0.0; 2];
        }
        // Central differences of the analytic slope; its third derivatives are bounded, so 0.1 mm leaves 1e-8.
        let step = 1e-4;
        let column = |d: Vector2<f64>| (self.height(p + d).1 - self.height(p - d).1) / (2.0 * step);
        let (a, b) = (column(Vector2::x() * step), column(Vector2::y() * step));
        let (slope, hessian) = (self.height(p).1, Matrix2::from_columns(&[a, b]));
        let first = Matrix2::identity() + slope * slope.transpose();
        let second = hessian / (1.0 + slope.norm_squared()).sqrt();
        let shape = first.try_inverse().unwrap_or_else(Matrix2::identity) * second;
        let (half_trace, det) = (0.5 * shape.trace(), shape.determinant());
        let root = (half_trace * half_trace - det).max(0.0).sqrt();
        let (upper, lower) = (half_trace + root, half_trace - root);
        if upper.abs() >= lower.abs() { [upper, lower] } else { [lower, upper] }
    }
}
