//! The fisheye model of Kannala and Brandt, as in OpenCV: the distance from the centre of the picture is a polynomial
//! in the angle off the axis, `θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)`, and `θ = atan r`.

use nalgebra::{Matrix2, Vector2};

use super::solve_increasing;

/// Below this radius the picture is the pinhole's to the last digit.
const CENTRE: f64 = 1e-9;

/// `θ_d` and `dθ_d / dθ`.
#[inline]
fn radial(k: &[f64; 4], angle: f64) -> (f64, f64) {
    let s = angle * angle;
    let value = angle * (1.0 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
    let slope = 1.0 + s * (3.0 * k[0] + s * (5.0 * k[1] + s * (7.0 * k[2] + s * 9.0 * k[3])));
    (value, slope)
}

/// How much the angle is stretched at radius `r` (the plane `z = 1` itself is squeezed towards 90 degrees by nature).
pub(super) fn stretch(k: &[f64; 4], r: f64) -> f64 {
    radial(k, r.atan()).1
}

/// Distorted point and Jacobian.
#[inline]
pub(super) fn distort(k: &[f64; 4], point: Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
    let r = point.norm();
    if r < CENTRE {
        return (point, Matrix2::identity());
    }
    let (angle_d, slope) = radial(k, r.atan());
    let (across, along) = (angle_d / r, slope / (1.0 + r * r));
    let direction = point / r;
    let outer = direction * direction.transpose();
    (point * across, (Matrix2::identity() - outer) * across + outer * along)
}

/// The point that goes to `distorted`.
pub(super) fn undistort(k: &[f64; 4], distorted: Vector2<f64>, valid_radius: f64) -> Option<Vector2<f64>> {
    let length = distorted.norm();
    if length < CENTRE {
        return Some(distorted);
    }
    let angle = solve_increasing(length, valid_radius.atan(), |angle| radial(k, angle))?;
    Some(distorted * (angle.tan() / length))
}
