//! The prior of the relief's coefficients: a smooth random field, and threads that stray.

use net_geometry::nalgebra::SMatrix;

use super::{GRID, Relief, Row, SIDE};

/// Standard deviation of how far threads stray, m: bumps of the default height, seen from tangent planes turned by the default slope.
const STRAY: f64 = 0.003;

impl Relief {
    /// Adds the inverse covariance of the coefficients of fields with this deviation, m, and correlation length, m.
    pub(crate) fn add_precision(&self, deviation: f64, length: f64, a: &mut [Row]) {
        let (grid, threads) = (precision(self.spacing, length), precision(self.along, length));
        let (of_grid, of_threads) = (deviation.powi(-2), STRAY.powi(-2));
        for (k, row) in a.iter_mut().enumerate() {
            if k < GRID {
                for (l, a) in row[..GRID].iter_mut().enumerate() {
                    *a += of_grid * grid[k / SIDE][l / SIDE] * grid[k % SIDE][l % SIDE];
                }
            } else {
                let first = GRID + (k - GRID) / SIDE * SIDE;
                for (a, p) in row[first..first + SIDE].iter_mut().zip(&threads[(k - GRID) % SIDE]) {
                    *a += of_threads * p;
                }
            }
        }
    }

    /// How unlikely the bumps, and what the threads stray, are under the prior: sums of squares of as many standard deviations as are seen, some tens of the grid and some of the threads.
    pub(crate) fn strain(&self, deviation: f64, length: f64) -> [f64; 2] {
        let (grid, threads) = (precision(self.spacing, length), precision(self.along, length));
        let bilinear = |p: &[[f64; SIDE]; SIDE], a: &[f64], b: &[f64]| -> f64 {
            (0..SIDE).map(|i| a[i] * (0..SIDE).map(|j| p[i][j] * b[j]).sum::<f64>()).sum()
        };
        let row = |j: usize| &self.coefficients[j * SIDE..][..SIDE];
        let rows = |j: usize| (0..SIDE).map(|k| grid[j][k] * bilinear(&grid, row(j), row(k))).sum::<f64>();
        let bumps = (0..SIDE).map(rows).sum::<f64>();
        let stray = [SIDE, SIDE + 1].map(|j| bilinear(&threads, row(j), row(j))).iter().sum::<f64>();
        [bumps / deviation.powi(2), stray / STRAY.powi(2)]
    }
}

/// Inverse covariance of coefficients so far apart, m, whose field has variance 1 and this correlation length, m.
fn precision(spacing: f64, length: f64) -> [[f64; SIDE]; SIDE] {
    /// A cubic B-spline's products with itself moved by so many gaps.
    const B: [f64; 4] = [151.0 / 315.0, 397.0 / 1680.0, 1.0 / 42.0, 1.0 / 5040.0];
    // A spline of correlated coefficients is correlated over both lengths; the spline's own is that of a Gaussian of variance 2/3.
    let own = length * length - 2.0 / 3.0 * spacing * spacing;
    let alike = |gaps: usize| match gaps {
        0 => 1.0,
        _ if own > 0.0 => (-0.5 * (gaps as f64 * spacing).powi(2) / own).exp(),
        _ => 0.0,
    };
    let variance = B[0] + 2.0 * (1..4).map(|n| B[n] * alike(n)).sum::<f64>();
    let covariance = SMatrix::<f64, SIDE, SIDE>::from_fn(|i, j| alike(i.abs_diff(j)) / variance);
    let inverse = covariance.try_inverse().unwrap_or_else(SMatrix::identity);
    std::array::from_fn(|i| std::array::from_fn(|j| inverse[(i, j)]))
}

#[cfg(test)]
mod tests {
    use super::super::COEFFICIENTS;
    use super::*;

    #[test]
    fn the_prior_is_a_field_of_its_deviation_and_length() {
        let (deviation, length) = (0.022, 0.36);
        let r = Relief::level([-1.0, -1.0], [1.0, 1.0], length);
        let mut a = vec![[0.0; COEFFICIENTS]; COEFFICIENTS];
        r.add_precision(deviation, length, &mut a);
        let precision = SMatrix::<f64, GRID, GRID>::from_fn(|i, j| a[i][j]);
        let covariance = Box::new(precision).try_inverse().expect("positive definite");
        let by = |x: f64, y: f64| {
            let (column, row) = (r.column(x), r.row(y));
            let mut w = [0.0; GRID];
            for j in 0..4 {
                (0..4).for_each(|i| w[(row.first + j) * SIDE + column.first + i] = column.value[i] * row.value[j]);
            }
            w
        };
        let between = |p: [f64; GRID], q: [f64; GRID]| {
            (0..GRID).map(|i| p[i] * (0..GRID).map(|j| covariance[(i, j)] * q[j]).sum::<f64>()).sum::<f64>()
        };
        for (x, y) in [(0.0, 0.0), (0.31, -0.17), (-0.5, 0.44)] {
            let here = by(x, y);
            let own = between(here, here) / deviation.powi(2);
            // A spline is not the same everywhere: a tenth of the variance between coefficients and on them.
            assert!((own - 1.0).abs() < 0.1, "variance {own}");
            for d in [0.5 * length, length, 1.5 * length] {
                let alike = between(here, by(x + d, y)) / deviation.powi(2);
                let gauss = (-0.5 * (d / length).powi(2)).exp();
                assert!((alike - gauss).abs() < 0.1, "{alike} over {d} m, {gauss}");
            }
        }
    }
}
