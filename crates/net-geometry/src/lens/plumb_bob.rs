//! Brown's model: a polynomial in the squared radius, and two tangential terms. The rational model with a denominator
//! of one.

/// The same lens as coefficients of the rational model.
#[inline]
pub(super) fn as_rational(k: &[f64; 5]) -> [f64; 8] {
    let [k1, k2, p1, p2, k3] = *k;
    [k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]
}
