//! From the covariance of the sheet's parameters to that of the pose.

use net_geometry::nalgebra::{Matrix3, Matrix6, SMatrix, UnitQuaternion, Vector3};

use crate::answer::estimate::Labels;
use crate::sheet::alike::Influence;
use crate::sheet::fit::{Fit, Fitter, Observation, Robust};
use crate::sheet::surface::{PARAMETERS, Params, QUADRATIC, SHAPE, Surface};

/// What is known of the errors of an estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Errors {
    /// Covariance: rotation (rad) then translation (m), perturbations in the camera frame.
    pub pose: Matrix6<f64>,
    /// Standard deviations: of the depth on the axis, m; the normal's direction, rad; the place in the net plane, m; the crossing angle, rad, unless it was held.
    pub range: f64,
    pub tilt: f64,
    pub xy: f64,
    pub angle: Option<f64>,
    /// Of the principal curvatures, 1/m, unless the sheet was held flat.
    pub curvatures: Option<[f64; 2]>,
}

/// What makes errors besides the observations' noise.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Doubt {
    /// Share of the formal covariance that is counted.
    pub formal: f64,
    /// Residual scale, in units of what the observations claim.
    pub scale: f64,
    /// Distance over which residuals may be alike, px.
    pub reach: f64,
    /// Standard deviation of the ratio of the sides.
    pub side_ratio: f64,
    /// Angle by which bumps too short for the sheet may turn the normal on the axis, rad.
    pub bumps: f64,
}

/// Share of the formal covariance that is counted in any case: what the residuals of a few tiles show may be next to nothing by chance. Simulated flat nets
/// have an error squared per degree of freedom of 1.0 to 1.2 without it, and of 0.4 with all of it, since it is in the residuals a second time.
pub(crate) const FORMAL: f64 = 0.15;

/// Errors of a fit of the first `count` parameters: what residuals that are alike do ([`Fitter::alike`]: a sheet that bends otherwise than the model, and noise), a
/// part of the formal covariance, and what sides of another ratio would do (considered, not estimated: it cannot be told from tilt and bend reliably).
pub(crate) fn errors(
    fitter: &Fitter,
    fit: &Fit,
    count: usize,
    observations: &[Observation],
    robust: Robust,
    labels: &Labels,
    doubt: &Doubt,
    scratch: &mut Vec<Influence>,
) -> Errors {
    let (surface, formal) = (&fit.surface, &fit.covariance);
    // One family longer by the ratio, the other shorter: coordinates change in proportion to their distance from the axis.
    let chart = surface.chart();
    let stretch = |o: &Observation| {
        chart
            .at(o.site.ray[0], o.site.ray[1])
            .map_or([0.0; 2], |p| [p.s[0] - surface.offset[0], surface.offset[1] - p.s[1]])
    };
    let pull = fitter.pull(count, observations, robust, stretch);
    let consider: Params = std::array::from_fn(|a| {
        doubt.side_ratio * formal[a].iter().zip(&pull).take(count).map(|(c, pull)| c * pull).sum::<f64>()
    });
    let noise = doubt.formal * doubt.scale.max(0.3).powi(2);
    let mut c = fitter.alike(count, observations, robust, formal, doubt.reach, scratch);
    for a in 0..count {
        for b in 0..count {
            c[a][b] += noise * formal[a][b] + consider[a] * consider[b];
        }
    }
    let curvatures = (count >= SHAPE + QUADRATIC).then(|| curvatures(fitter, surface, &c));
    Errors { curvatures, ..pose(surface, labels, &c, count, doubt.bumps) }
}

/// Standard deviations of the principal curvatures: a change of the second derivatives changes each by what it is along its own direction, to first order.
fn curvatures(fitter: &Fitter, surface: &Surface, covariance: &[[f64; PARAMETERS]; PARAMETERS]) -> [f64; 2] {
    surface.principal().map(|(_, [x, y])| {
        let along = [x * x, 2.0 * x * y, y * y];
        // Of the parameters, and of the coefficients of a relief, which follow them.
        let (mut own, mut open) = ([0.0; PARAMETERS], 0.0);
        own[SHAPE..SHAPE + QUADRATIC].copy_from_slice(&along);
        if let Some(relief) = &surface.relief {
            open = fitter.bumps.carry(&relief.curvature_row(along), &mut own);
        }
        let of = |row: &[f64; PARAMETERS]| row.iter().zip(&own).map(|(c, d)| c * d).sum::<f64>();
        let variance: f64 = covariance.iter().zip(&own).map(|(row, d)| d * of(row)).sum();
        (variance + open).max(0.0).sqrt()
    })
}

/// From the parameters to the pose in the net frame, by differences.
fn pose(
    surface: &Surface,
    labels: &Labels,
    covariance: &[[f64; PARAMETERS]; PARAMETERS],
    count: usize,
    bumps: f64,
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
    let tilted = bumps * bumps * (Matrix3::identity() - normal * normal.transpose());
    let mut turned = pose.fixed_view_mut::<3, 3>(0, 0);
    turned += tilted;
    let turn = pose.fixed_view::<3, 3>(0, 0).into_owned();
    let tilt = (0.5 * (turn.trace() - normal.dot(&(turn * normal)))).max(0.0).sqrt();
    let shift = pose.fixed_view::<3, 3>(3, 3).into_owned();
    let xy = (0.5 * (shift.trace() - normal.dot(&(shift * normal)))).max(0.0).sqrt();
    Errors {
        pose,
        range: surface.depth * covariance[3][3].max(0.0).sqrt(),
        tilt,
        xy,
        angle: (count > 6).then(|| covariance[6][6].max(0.0).sqrt()),
        curvatures: None,
    }
}
