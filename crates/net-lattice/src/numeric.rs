//! Small numeric tools: quick sines and logarithms for pixel loops, the error function, quantiles, a symmetric solver.

/// `x` modulo 1 into [-0.5, 0.5], by adding and taking away 1.5 x 2^23 (rounds to nearest without a library call; |x| < 4 million).
#[inline(always)]
pub(crate) fn wrap(x: f32) -> f32 {
    const MAGIC: f32 = 12_582_912.0;
    x - ((x + MAGIC) - MAGIC)
}

/// `(sin, cos)` of `x` cycles to 4e-6: Taylor at half the angle, then the double-angle formulas.
#[inline(always)]
pub(crate) fn sin_cos_cycles(x: f32) -> (f32, f32) {
    let a = wrap(x) * std::f32::consts::PI;
    let q = a * a;
    let s = a * (1.0 + q * (-1.666_667e-1 + q * (8.333_333e-3 + q * (-1.984_127e-4 + q * 2.755_732e-6))));
    let c = 1.0 + q * (-0.5 + q * (4.166_667e-2 + q * (-1.388_889e-3 + q * (2.480_159e-5 - q * 2.755_732e-7))));
    (2.0 * s * c, 1.0 - 2.0 * s * s)
}

/// Base-2 logarithm of a positive number to 0.01.
#[inline(always)]
pub(crate) fn log2_rough(x: f32) -> f32 {
    let bits = x.to_bits();
    let exponent = (bits >> 23) as f32 - 127.0;
    let m = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000) - 1.0;
    exponent + m * (1.3465 - 0.3465 * m)
}

/// 2 to the power of `x` to 0.3 %, for x in -126..127.
#[inline(always)]
pub(crate) fn exp2_rough(x: f32) -> f32 {
    // Shifted above zero, where truncation is the floor and needs no library call.
    let x = x.clamp(-126.0, 126.0) + 127.0;
    let whole = x as i32;
    let f = x - whole as f32;
    f32::from_bits((whole as u32) << 23) * (1.0 + f * (0.6565 + 0.3435 * f))
}

/// Error function to 1.2e-7 (Numerical Recipes, erfcc).
pub(crate) fn erf(x: f64) -> f64 {
    let z = x.abs();
    let t = 1.0 / (1.0 + 0.5 * z);
    let poly = -z * z - 1.265_512_23
        + t * (1.000_023_68
            + t * (0.374_091_96
                + t * (0.096_784_18
                    + t * (-0.186_288_06
                        + t * (0.278_868_07
                            + t * (-1.135_203_98 + t * (1.488_515_87 + t * (-0.822_152_23 + t * 0.170_872_77))))))));
    let r = 1.0 - t * poly.exp();
    if x < 0.0 { -r } else { r }
}

/// Quantiles of the magnitudes of every fifth value, by a histogram over their range; `q` ascending.
pub(crate) fn magnitude_quantiles<const N: usize>(
    values: impl Iterator<Item = f32> + Clone,
    q: [f64; N],
    histogram: &mut Vec<u32>,
) -> [f32; N] {
    /// Of the hundreds of thousands of pixels of a picture so many are plenty.
    const SAMPLED: usize = 5;
    const BINS: usize = 4096;
    let values = values.step_by(SAMPLED);
    let (mut max, mut count) = (0.0f32, 0u64);
    for v in values.clone() {
        max = max.max(v.abs());
        count += 1;
    }
    if count == 0 || max <= 0.0 {
        return [0.0; N];
    }
    histogram.clear();
    histogram.resize(BINS, 0);
    let per = (BINS - 1) as f32 / max;
    for v in values {
        histogram[((v.abs() * per) as usize).min(BINS - 1)] += 1;
    }
    let mut out = [max; N];
    let (mut sum, mut next) = (0u64, 0);
    for (k, n) in histogram.iter().enumerate() {
        sum += u64::from(*n);
        while next < N && sum > (q[next] * count as f64) as u64 {
            out[next] = (k as f32 + 0.5) / per;
            next += 1;
        }
    }
    out
}

/// Magnitude at which a high-passed picture is clipped. Twine is a few standard deviations of what is around it; fish and tags are tens, and
/// would drown it in every sum. Without noise everything beside the twine is zero, so never less than a tenth of what stands out.
pub(crate) fn clip_level(values: impl Iterator<Item = f32> + Clone, histogram: &mut Vec<u32>) -> f32 {
    const SIGMAS: f32 = 4.0;
    let [middle, high] = magnitude_quantiles(values, [0.5, 0.97], histogram);
    (SIGMAS * 1.4826 * middle).clamp(0.1 * high, high)
}

/// Median of the values, which it reorders. Zero for none.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    quantile(values, 0.5)
}

/// The `q` quantile of `values`, which it reorders. Zero for none.
pub(crate) fn quantile(values: &mut [f64], q: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let k = ((values.len() as f64 * q) as usize).min(values.len() - 1);
    *values.select_nth_unstable_by(k, f64::total_cmp).1
}

/// Symmetric positive definite system of up to `N` unknowns, on the stack.
#[derive(Debug, Clone)]
pub(crate) struct Normal<const N: usize> {
    pub a: [[f64; N]; N],
    pub b: [f64; N],
}

impl<const N: usize> Normal<N> {
    pub(crate) fn new() -> Self {
        Self { a: [[0.0; N]; N], b: [0.0; N] }
    }

    /// Lower Cholesky factor of the leading `n` x `n` part. `None` if it is not positive definite.
    fn factor(&self, n: usize) -> Option<[[f64; N]; N]> {
        let mut l = [[0.0; N]; N];
        for i in 0..n {
            for j in 0..=i {
                let mut sum = self.a[i][j];
                for k in 0..j {
                    sum -= l[i][k] * l[j][k];
                }
                if i == j {
                    if !(sum > 0.0 && sum.is_finite()) {
                        return None;
                    }
                    l[i][i] = sum.sqrt();
                } else {
                    l[i][j] = sum / l[j][j];
                }
            }
        }
        Some(l)
    }

    /// The solution of the leading `n` equations, and the inverse of their matrix. Only the lower triangle of `a` is read.
    pub(crate) fn solve(&self, n: usize) -> Option<([f64; N], [[f64; N]; N])> {
        // Unit diagonal first: the unknowns have different units.
        let mut scaled = self.clone();
        let mut s = [0.0; N];
        for (i, s) in s.iter_mut().enumerate().take(n) {
            *s = 1.0 / (self.a[i][i] + 1e-9).sqrt();
        }
        for i in 0..n {
            for j in 0..=i {
                scaled.a[i][j] *= s[i] * s[j];
            }
            scaled.a[i][i] += 1e-9;
        }
        let l = scaled.factor(n)?;
        let mut inverse = [[0.0; N]; N];
        for column in 0..n {
            let mut y = [0.0; N];
            for i in column..n {
                let mut sum = f64::from(u8::from(i == column));
                for k in column..i {
                    sum -= l[i][k] * y[k];
                }
                y[i] = sum / l[i][i];
            }
            for i in (0..n).rev() {
                let mut sum = y[i];
                for k in i + 1..n {
                    sum -= l[k][i] * y[k];
                }
                y[i] = sum / l[i][i];
            }
            for i in 0..n {
                inverse[i][column] = s[i] * y[i] * s[column];
            }
        }
        let mut x = [0.0; N];
        for i in 0..n {
            x[i] = (0..n).map(|j| inverse[i][j] * self.b[j]).sum();
        }
        x.iter().all(|v| v.is_finite()).then_some((x, inverse))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quick_functions_hold_their_errors() {
        for k in -4000..4000 {
            let x = k as f32 * 0.003_1;
            let (s, c) = sin_cos_cycles(x);
            let (s0, c0) = (f64::from(x) * std::f64::consts::TAU).sin_cos();
            // f32 leaves 1e-6 of a cycle at 12 cycles
            assert!((f64::from(s) - s0).abs() < 2e-5 && (f64::from(c) - c0).abs() < 2e-5, "{x}");
        }
        for k in 1..2000 {
            let x = k as f32 * 0.37;
            assert!((log2_rough(x) - x.log2()).abs() < 0.012, "{x}");
            let y = x * 0.1 - 50.0;
            assert!((exp2_rough(y) / y.exp2() - 1.0).abs() < 0.004, "{y}");
        }
        assert!((erf(0.5) - 0.520_499_877_8).abs() < 2e-7 && (erf(-2.0) + 0.995_322_265).abs() < 2e-7);
    }

    #[test]
    fn solver_inverts() {
        let mut n = Normal::<4>::new();
        for i in 0..3 {
            for j in 0..=i {
                n.a[i][j] = if i == j { 4.0 + i as f64 } else { 1.0 };
            }
            n.b[i] = i as f64;
        }
        let (x, _) = n.solve(3).expect("positive definite");
        let row = |i: usize| (0..3).map(|j| n.a[i.max(j)][i.min(j)] * x[j]).sum::<f64>();
        for i in 0..3 {
            // the ridge of 1e-9 is all that is lost
            assert!((row(i) - i as f64).abs() < 1e-7);
        }
        assert_eq!(Normal::<3>::new().solve(0).map(|s| s.0), Some([0.0; 3]));
    }
}
