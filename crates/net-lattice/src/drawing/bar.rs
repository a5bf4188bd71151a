//! How a twine looks across itself, as in `template`, but in closed form: plain arithmetic works on many pixels at once, a table on one. For pictures that are
//! followed; what a first picture is found by was set with the table.

/// A bar of given width and blur, prepared for many places.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bar {
    /// Half its width, cells.
    half: f32,
    /// One over the blur times the root of 2, per cell.
    per: f32,
    /// Whether the next twine is near enough to be seen between the two.
    crowded: bool,
}

/// Least and largest blur, cells, one standard deviation: sharper than any pixel, and so wide that no twine is left.
const SHARP: f32 = 1e-3;
const GONE: f32 = 0.5;
/// Standard deviations of blur beyond which nothing of a bar is left.
const REACH: f32 = 3.5;

impl Bar {
    /// Twine of `width` cells, blurred with a standard deviation of `blur` cells.
    #[inline(always)]
    pub(crate) fn new(width: f32, blur: f32) -> Self {
        let (half, blur) = (0.5 * width.clamp(0.002, 0.9), blur.clamp(SHARP, GONE));
        Self { half, per: std::f32::consts::FRAC_1_SQRT_2 / blur, crowded: half + REACH * blur > 0.5 }
    }

    /// Coverage and its derivative per cell at `q` cells from a twine, |q| <= 1/2.
    #[inline(always)]
    pub(crate) fn cover<const N: usize>(&self, q: &[f32; N]) -> ([f32; N], [f32; N]) {
        let (mut value, mut slope) = ([0.0; N], [0.0; N]);
        for k in 0..N {
            (value[k], slope[k]) = self.one(q[k]);
        }
        if self.crowded {
            for k in 0..N {
                let (p, d) = self.one(q[k] - 1f32.copysign(q[k]));
                value[k] += p;
                slope[k] += d;
            }
        }
        (value, slope)
    }

    /// The same of one twine alone.
    #[inline(always)]
    fn one(&self, q: f32) -> (f32, f32) {
        let (above, below) = (edge((q + self.half) * self.per), edge((q - self.half) * self.per));
        (0.5 * (above.0 - below.0), (above.1 - below.1) * self.per * (0.5 * std::f32::consts::FRAC_2_SQRT_PI))
    }
}

/// `(erf(x), exp(-x²))`, to 3e-6 (Abramowitz and Stegun 7.1.26).
#[inline(always)]
fn edge(x: f32) -> (f32, f32) {
    let z = x.abs();
    let t = 1.0 / (1.0 + 0.327_591_1 * z);
    let series = t * (0.254_829_6 + t * (-0.284_496_74 + t * (1.421_413_7 + t * (-1.453_152 + t * 1.061_405_4))));
    let bell = exp2(-std::f32::consts::LOG2_E * z * z);
    ((1.0 - series * bell).copysign(x), bell)
}

/// 2 to the power of a number that is not above zero, to 3e-6.
#[inline(always)]
fn exp2(x: f32) -> f32 {
    // Added, this rounds to a whole number, which is then in the lowest bits.
    const MAGIC: f32 = 12_582_912.0;
    const LEAST: f32 = -120.0;
    let x = if x > LEAST { x } else { LEAST };
    let whole = x + MAGIC;
    let f = x - (whole - MAGIC);
    let part = 1.0
        + f * (std::f32::consts::LN_2 + f * (0.240_226_5 + f * (0.055_504_11 + f * (0.009_618_13 + f * 0.001_333_36))));
    f32::from_bits(whole.to_bits().wrapping_add(127) << 23) * part
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::erf;

    #[test]
    fn coverage_is_that_of_a_blurred_bar_and_its_derivative_fits() {
        for (width, blur) in [(0.04f32, 0.006f32), (0.06, 0.03), (0.04, 0.12), (0.2, 0.25), (0.13, 0.02)] {
            let bar = Bar::new(width, blur);
            let n = 2000;
            let mut mean = 0.0;
            for k in 0..n {
                let q = (k as f32 + 0.5) / n as f32 - 0.5;
                let (p, d) = bar.cover(&[q]);
                mean += f64::from(p[0]) / f64::from(n);
                let exact = |q: f64| -> f64 {
                    let edge = |x: f64| erf(x / (f64::from(blur) * std::f64::consts::SQRT_2));
                    let one = |q: f64| 0.5 * (edge(q + 0.5 * f64::from(width)) - edge(q - 0.5 * f64::from(width)));
                    (-3..=3).map(|m| one(q + f64::from(m))).sum()
                };
                let (q, h) = (f64::from(q), 1e-3 * f64::from(blur));
                // A bar and the next one, of which 5e-4 of either is left where a third begins to count.
                assert!((f64::from(p[0]) - exact(q)).abs() < 3e-4, "{width} {blur} {q}");
                let slope = (exact(q + h) - exact(q - h)) / (2.0 * h);
                assert!((f64::from(d[0]) - slope).abs() < 5e-3 * f64::from(0.1 / blur).max(1.0), "{width} {blur} {q}");
            }
            assert!((mean - f64::from(width)).abs() < 3e-4, "{width} {blur}: {mean}");
        }
    }

    #[test]
    fn quick_functions_hold_their_errors() {
        for k in -4000..4000 {
            let x = k as f32 * 0.002_3;
            let (e, bell) = edge(x);
            assert!((f64::from(e) - erf(f64::from(x))).abs() < 3e-6, "{x}");
            assert!((f64::from(bell) - (-f64::from(x).powi(2)).exp()).abs() < 3e-6, "{x}");
        }
        assert_eq!(edge(f32::MAX).0, 1.0);
    }
}
