//! From the covariance of the sheet's parameters to that of the pose.

use net_geometry::nalgebra::{Matrix6, SMatrix, UnitQuaternion, Vector3};

use crate::estimate::Labels;
use crate::fit::{Fitter, Observation, Robust};
use crate::surface::{PARAMETERS, Params, Surface};

/// What is known of the errors of an estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Errors {
    /// Rotation (rad) then translation (m), perturbations in the camera frame.
    pub pose: Matrix6<f64>,
    pub range: f64,
    pub tilt: f64,
    pub xy: f64,
    pub angle: f64,
}

/// Covariance of the first `count` parameters: the formal one times the squared residual scale (a sheet that does not fit knows less), plus
/// what residuals that are alike over `reach` px do ([`Fitter::scores`]: a sheet that bends otherwise than the model), plus what sides that
/// differ by `side_ratio` would do (considered, not estimated: it cannot be told from tilt and bend reliably).
pub(crate) fn parameters(
    fitter: &Fitter,
    surface: &Surface,
    observations: &[Observation],
    robust: Robust,
    formal: &[[f64; PARAMETERS]; PARAMETERS],
    count: usize,
    scale: f64,
    side_ratio: f64,
    reach: f64,
    scratch: &mut Vec<(usize, Params)>,
) -> [[f64; PARAMETERS]; PARAMETERS] {
    // One family longer by the ratio, the other shorter: coordinates change in proportion to their distance from the axis.
    let stretch = |o: &Observation| {
        let chart = surface.chart();
        chart
            .at(o.site.ray[0], o.site.ray[1])
            .map_or([0.0; 2], |p| [p.s[0] - surface.offset[0], surface.offset[1] - p.s[1]])
    };
    let pull = fitter.pull(count, observations, robust, stretch);
    let mut consider = [0.0; PARAMETERS];
    for a in 0..count {
        consider[a] = side_ratio * (0..count).map(|b| formal[a][b] * pull[b]).sum::<f64>();
    }
    let s2 = scale.max(0.3).powi(2);
    let alike = sandwich(formal, &fitter.scores(count, observations, robust, reach, scratch), count);
    let mut c = *formal;
    for a in 0..count {
        for b in 0..count {
            c[a][b] = s2 * formal[a][b] + alike[a][b] + consider[a] * consider[b];
        }
    }
    c
}

/// `a m a` over the first `count` rows and columns.
fn sandwich(
    a: &[[f64; PARAMETERS]; PARAMETERS],
    m: &[[f64; PARAMETERS]; PARAMETERS],
    count: usize,
) -> [[f64; PARAMETERS]; PARAMETERS] {
    let times = |x: &[[f64; PARAMETERS]; PARAMETERS], y: &[[f64; PARAMETERS]; PARAMETERS]| {
        let mut z = [[0.0; PARAMETERS]; PARAMETERS];
        for i in 0..count {
            for k in 0..count {
                for j in 0..count {
                    z[i][j] += x[i][k] * y[k][j];
                }
            }
        }
        z
    };
    times(&times(a, m), a)
}

/// Carries it over to the pose in the net frame, by differences.
pub(crate) fn pose(
    surface: &Surface,
    labels: &Labels,
    covariance: &[[f64; PARAMETERS]; PARAMETERS],
    count: usize,
) -> Errors {
    let base = labels.pose(surface);
    let mut j = SMatrix::<f64, 6, PARAMETERS>::zeros();
    for k in 0..count.min(7) {
        let step = 1e-6;
        let mut d = [0.0; PARAMETERS];
        d[k] = step;
        let moved = labels.pose(&surface.stepped(&d));
        let turn = UnitQuaternion::from_rotation_matrix(&(moved.rotation * base.rotation.inverse())).scaled_axis();
        let shift = moved.translation - base.translation;
        for i in 0..3 {
            j[(i, k)] = turn[i] / step;
            j[(i + 3, k)] = shift[i] / step;
        }
    }
    let c =
        SMatrix::<f64, PARAMETERS, PARAMETERS>::from_fn(
            |a, b| if a < count && b < count { covariance[a][b] } else { 0.0 },
        );
    let mut pose: Matrix6<f64> = j * c * j.transpose();
    pose = 0.5 * (pose + pose.transpose());
    let normal: Vector3<f64> = surface.normal();
    let turn = pose.fixed_view::<3, 3>(0, 0).into_owned();
    let tilt = (0.5 * (turn.trace() - normal.dot(&(turn * normal)))).max(0.0).sqrt();
    let shift = pose.fixed_view::<3, 3>(3, 3).into_owned();
    let xy = (0.5 * (shift.trace() - normal.dot(&(shift * normal)))).max(0.0).sqrt();
    Errors {
        pose,
        range: surface.depth * covariance[3][3].max(0.0).sqrt(),
        tilt,
        xy,
        angle: if count > 6 { covariance[6][6].max(0.0).sqrt() } else { 0.0 },
    }
}
