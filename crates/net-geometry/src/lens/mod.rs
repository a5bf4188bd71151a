//! How lenses bend the pinhole's rays. All models work on the plane `z = 1`: an undistorted point `(x, y)` goes to a
//! distorted one.

mod kannala_brandt;
mod plumb_bob;
mod rational;

use nalgebra::{Matrix2, Vector2};

use crate::error::{Error, Result, finite};

/// How the lens bends the pinhole's rays. Coefficients in OpenCV's order.
///
/// A model is used only as far out as it is one-to-one, and to 89.9 degrees off the axis at most: polynomials fitted to
/// calibration images turn back somewhere beyond the picture's corners, and there a pixel would belong to two rays.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Lens {
    /// Straight pinhole.
    #[default]
    None,
    /// `k1, k2, p1, p2, k3` (ROS `plumb_bob`, Brown 1966).
    PlumbBob([f64; 5]),
    /// `k1, k2, p1, p2, k3, k4, k5, k6` (ROS `rational_polynomial`, OpenCV `CALIB_RATIONAL_MODEL`).
    Rational([f64; 8]),
    /// `k1, k2, k3, k4` on the angle off the axis (ROS `equidistant`, OpenCV `fisheye`, Kannala and Brandt 2006).
    KannalaBrandt([f64; 4]),
}

/// Tangent of the largest angle off the axis, 89.9 degrees.
const MAX_RADIUS: f64 = 572.957;

/// Where a lens squeezes lengths to less than this, it is taken to turn back.
const MIN_STRETCH: f64 = 1e-3;

/// Newton steps before a point counts as having no inverse.
const MAX_STEPS: usize = 30;

/// Newton steps from a guess before a better start is looked for. Real lenses take three to five.
const QUICK_STEPS: usize = 8;

/// Distance, on the plane `z = 1`, at which Newton's method has arrived: a millionth of a millionth of a focal length.
const ARRIVED: f64 = 1e-12;

impl Lens {
    /// The lens of a ROS `camera_info`'s or a Kalibr camchain's distortion model and coefficients. Coefficients may be
    /// fewer, or more if those that the model has no room for are zero; all zero is no lens.
    ///
    /// # Errors
    /// [`Error::LensModel`] for a model not known or too many coefficients, [`Error::Value`] for one that is not
    /// finite.
    pub fn from_model(model: &str, coefficients: &[f64]) -> Result<Self> {
        let wrong = |expected| Error::LensModel { model: model.to_owned(), count: coefficients.len(), expected };
        for &k in coefficients {
            finite("distortion coefficient", k)?;
        }
        let used = coefficients.iter().rposition(|&k| k != 0.0).map_or(0, |last| last + 1);
        let take = |room: usize| {
            let enough = used <= room;
            enough.then_some(&coefficients[..used]).ok_or_else(|| wrong("more coefficients than the model has"))
        };
        let lens = match model.trim().to_ascii_lowercase().as_str() {
            "plumb_bob" | "radtan" | "brown_conrady" => Self::PlumbBob(filled(take(5)?)),
            "rational_polynomial" | "rational" => Self::Rational(filled(take(8)?)),
            "equidistant" | "equi" | "fisheye" | "kannala_brandt" | "kannala_brandt4" => {
                Self::KannalaBrandt(filled(take(4)?))
            }
            // The fisheye model bends rays even if all its coefficients are zero; these do not.
            "" | "none" | "pinhole" => {
                take(0)?;
                Self::None
            }
            _ => return Err(wrong("known are plumb_bob, rational_polynomial, equidistant and none")),
        };
        match lens {
            Self::PlumbBob(_) | Self::Rational(_) if used == 0 => Ok(Self::None),
            lens => Ok(lens),
        }
    }

    /// The name of the model in a ROS `camera_info`; a pinhole is a `plumb_bob` of zeros there.
    pub fn model(&self) -> &'static str {
        match self {
            Self::None | Self::PlumbBob(_) => "plumb_bob",
            Self::Rational(_) => "rational_polynomial",
            Self::KannalaBrandt(_) => "equidistant",
        }
    }

    /// The coefficients in OpenCV's order; none for a pinhole.
    pub fn coefficients(&self) -> &[f64] {
        match self {
            Self::None => &[],
            Self::PlumbBob(k) => k,
            Self::Rational(k) => k,
            Self::KannalaBrandt(k) => k,
        }
    }

    /// Radius on the plane `z = 1` out to which the model is one-to-one; infinite for a pinhole.
    pub(crate) fn valid_radius(&self) -> f64 {
        match self {
            Self::None => f64::INFINITY,
            Self::PlumbBob(k) => first_failure(|r| rational::stretch(&plumb_bob::as_rational(k), r)),
            Self::Rational(k) => first_failure(|r| rational::stretch(k, r)),
            Self::KannalaBrandt(k) => first_failure(|r| kannala_brandt::stretch(k, r)),
        }
    }

    /// Distorts a point with its Jacobian, whether or not it lies within the valid radius.
    #[inline]
    pub(crate) fn distort(&self, point: Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        match self {
            Self::None => (point, Matrix2::identity()),
            Self::PlumbBob(k) => rational::distort(&plumb_bob::as_rational(k), point),
            Self::Rational(k) => rational::distort(k, point),
            Self::KannalaBrandt(k) => kannala_brandt::distort(k, point),
        }
    }

    /// The point within `valid_radius` that [`Lens::distort`] takes to `distorted`.
    #[inline]
    pub(crate) fn undistort(&self, distorted: Vector2<f64>, valid_radius: f64) -> Option<Vector2<f64>> {
        match self {
            Self::None => Some(distorted),
            Self::PlumbBob(k) => rational::undistort(&plumb_bob::as_rational(k), distorted, valid_radius),
            Self::Rational(k) => rational::undistort(k, distorted, valid_radius),
            Self::KannalaBrandt(k) => kannala_brandt::undistort(k, distorted, valid_radius),
        }
    }
}

fn filled<const N: usize>(given: &[f64]) -> [f64; N] {
    let mut all = [0.0; N];
    all.iter_mut().zip(given).for_each(|(a, g)| *a = *g);
    all
}

/// The first radius at which `stretch`, the least factor by which the lens stretches lengths there, is not above
/// [`MIN_STRETCH`].
fn first_failure(stretch: impl Fn(f64) -> f64) -> f64 {
    let fails = |r: f64| {
        let least = stretch(r);
        least.is_nan() || least <= MIN_STRETCH
    };
    // By angle, in steps of a hundredth of a degree: a fold that fits between two of them is none.
    let step = 0.01f64.to_radians();
    let radius = |k: usize| (k as f64 * step).tan().min(MAX_RADIUS);
    let Some(k) = (1..8990).find(|&k| fails(radius(k))) else { return MAX_RADIUS };
    let (mut good, mut bad) = (radius(k - 1), radius(k));
    for _ in 0..60 {
        let middle = 0.5 * (good + bad);
        if fails(middle) {
            bad = middle;
        } else {
            good = middle;
        }
    }
    good
}

/// The `x` in `[0, end]` where a function that increases there takes the value `target`: Newton's method inside a
/// shrinking bracket, which is halved whenever Newton's step is not at most half of the step before. `None` if the
/// function does not get that high. `value_and_slope` gives both at `x`.
fn solve_increasing(target: f64, end: f64, value_and_slope: impl Fn(f64) -> (f64, f64)) -> Option<f64> {
    if !(target >= 0.0 && target <= value_and_slope(end).0) {
        return None;
    }
    let (mut low, mut high) = (0.0, end);
    let (mut x, mut step) = (target.min(end), end);
    for _ in 0..200 {
        let (value, slope) = value_and_slope(x);
        // A short step does not mean that it has arrived: beside a pole all steps are short.
        if (value - target).abs() <= 8.0 * f64::EPSILON * target || high - low <= f64::EPSILON * high {
            break;
        }
        if value < target {
            low = x;
        } else {
            high = x;
        }
        let newton = (target - value) / slope;
        let good = newton.abs() <= 0.5 * step.abs() && x + newton >= low && x + newton <= high;
        step = if good { newton } else { 0.5 * (low + high) - x };
        x += step;
    }
    Some(x)
}
