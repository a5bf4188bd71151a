//! The rational model, as in OpenCV:
//!
//! `x_d = x g + 2 p1 x y + p2 (r² + 2 x²)`, `y_d = y g + p1 (r² + 2 y²) + 2 p2 x y`,
//! `g = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)`.
//!
//! With `p = (p2, p1)` the tangential part is `x_d = 2 (p·x) x + r² p`, its Jacobian `2 (p·x + p xᵀ + x pᵀ)`. All of
//! the Jacobian is symmetric; where it is positive definite over a disc the map is one-to-one on it.

use nalgebra::{Matrix2, Vector2};

use super::{ARRIVED, MAX_STEPS, QUICK_STEPS, solve_increasing};

/// `g` and `dg / d(r²)`.
#[inline]
fn radial(k: &[f64; 8], square: f64) -> (f64, f64) {
    let [k1, k2, _, _, k3, k4, k5, k6] = *k;
    let above = 1.0 + square * (k1 + square * (k2 + square * k3));
    let below = 1.0 + square * (k4 + square * (k5 + square * k6));
    let d_above = k1 + square * (2.0 * k2 + square * 3.0 * k3);
    let d_below = k4 + square * (2.0 * k5 + square * 3.0 * k6);
    // Past a pole of the quotient nothing is of use.
    let g = if below > 0.0 { above / below } else { f64::NAN };
    (g, (d_above - g * d_below) / below)
}

/// Lower bound of the Jacobian's eigenvalues at radius `r`: `g` across, `g + 2 r² g'` along the radius, less what the
/// tangential part can take away, `6 |p| r`.
pub(super) fn stretch(k: &[f64; 8], r: f64) -> f64 {
    let (g, slope) = radial(k, r * r);
    if g.is_nan() {
        return f64::NAN;
    }
    g.min(g + 2.0 * r * r * slope) - 6.0 * k[2].hypot(k[3]) * r
}

/// Distorted point and Jacobian.
#[inline]
pub(super) fn distort(k: &[f64; 8], point: Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
    let square = point.norm_squared();
    let (g, slope) = radial(k, square);
    let p = Vector2::new(k[3], k[2]);
    let along = 2.0 * p.dot(&point);
    let distorted = point * (g + along) + p * square;
    let diagonal = g + along;
    let outer = (slope * point + p) * point.transpose() + point * (slope * point + p).transpose();
    (distorted, Matrix2::identity() * diagonal + outer + point * p.transpose() + p * point.transpose())
}

/// The point that goes to `distorted`.
pub(super) fn undistort(k: &[f64; 8], distorted: Vector2<f64>, valid_radius: f64) -> Option<Vector2<f64>> {
    // Lenses are nearly the identity, so Newton's method mostly arrives from there.
    let (g, _) = radial(k, distorted.norm_squared());
    if let Some(point) = newton(k, distorted, distorted / g.max(0.5), valid_radius, QUICK_STEPS) {
        return Some(point);
    }
    // If not, without the tangential part, which is small, it is a matter of the radius alone, and safely solved.
    let length = distorted.norm();
    let radius = |r: f64| {
        let (g, slope) = radial(k, r * r);
        (r * g, g + 2.0 * r * r * slope)
    };
    let start = solve_increasing(length.min(radius(valid_radius).0), valid_radius, radius)?;
    newton(k, distorted, distorted * (start / length), valid_radius, MAX_STEPS)
}

/// Newton's method from `point`. Where it arrives within the valid radius is the one point that goes to `distorted`,
/// wherever it started.
#[inline]
fn newton(
    k: &[f64; 8],
    distorted: Vector2<f64>,
    mut point: Vector2<f64>,
    valid_radius: f64,
    max_steps: usize,
) -> Option<Vector2<f64>> {
    for _ in 0..max_steps {
        let (image, jacobian) = distort(k, point);
        let error = distorted - image;
        let (a, b, d) = (jacobian[(0, 0)], jacobian[(0, 1)], jacobian[(1, 1)]);
        let step = Vector2::new(d * error.x - b * error.y, a * error.y - b * error.x) / (a * d - b * b);
        point += step;
        // NaN never arrives.
        if step.norm_squared() <= ARRIVED * ARRIVED * (1.0 + point.norm_squared()) {
            return (point.norm_squared() <= valid_radius * valid_radius).then_some(point);
        }
    }
    None
}
