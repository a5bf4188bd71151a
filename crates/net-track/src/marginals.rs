//! How sure the smoothed poses are: blocks on the diagonal of the inverse of the normal matrix, which is block tridiagonal.

use net_geometry::nalgebra::{Matrix6, SMatrix};

use crate::config::Config;
use crate::program::{Solution, Window};
use crate::state::{Row, STATE, increment_rows, motion_rows, rate_rows};

type Block = SMatrix<f64, STATE, STATE>;

/// Covariances of (w, c) of every frame, outliers weighted down as Huber does. The bounds on speed and acceleration are left out: they could only make it surer.
/// `None` where the matrix is not positive definite to working precision.
pub(crate) fn covariances(window: &Window, solution: &Solution, config: &Config) -> Option<Vec<Matrix6<f64>>> {
    let n = window.dt.len();
    let mut diagonal = vec![Block::zeros(); n];
    let mut below = vec![Block::zeros(); n];
    let mut add = |row: &Row, weight: f64| {
        for &(i, x) in &row.terms {
            for &(j, y) in &row.terms {
                let (block, entry) = ((i / STATE, j / STATE), (i % STATE, j % STATE));
                if block.0 == block.1 {
                    diagonal[block.0][entry] += weight * x * y;
                } else if block.0 > block.1 {
                    below[block.0][entry] += weight * x * y;
                }
            }
        }
    };
    rate_rows(config).iter().for_each(|row| add(row, 1.0));
    for k in 0..n {
        let at = &solution.at[k];
        if k > 0 {
            let before = &solution.at[k - 1];
            motion_rows(k, before, at, window.dt[k], config).iter().for_each(|row| add(row, 1.0));
            if let Some(rows) = window.increments[k].as_ref().and_then(|step| increment_rows(k, before, at, step)) {
                let length = rows.iter().map(|r| r.rhs * r.rhs).sum::<f64>().sqrt();
                rows.iter().for_each(|row| add(row, weight(length, config)));
            }
        }
        if let Some(m) = window.measured[k].as_ref().filter(|_| !window.rejected[k]) {
            let weight = weight(window.residual(k, at), config);
            m.rows(k, at).iter().for_each(|row| add(row, weight));
        }
    }
    // What the frames before say of a frame, and what those behind say.
    let mut forward = diagonal.clone();
    for k in 1..n {
        let past = below[k] * forward[k - 1].cholesky()?.solve(&below[k].transpose());
        forward[k] -= past;
    }
    let mut backward = diagonal.clone();
    for k in (1..n).rev() {
        let future = below[k].transpose() * backward[k].cholesky()?.solve(&below[k]);
        backward[k - 1] -= future;
    }
    (0..n)
        .map(|k| {
            let inverse = (forward[k] + backward[k] - diagonal[k]).cholesky()?.inverse();
            Some(inverse.fixed_view::<6, 6>(0, 0).into_owned())
        })
        .collect()
}

/// Huber's weight of a residual of this length.
fn weight(length: f64, config: &Config) -> f64 {
    if length > config.huber_deviations { config.huber_deviations / length } else { 1.0 }
}
