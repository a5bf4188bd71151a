//! What the caller knows of the camera's motion.

use net_geometry::Pose;
use net_geometry::nalgebra::{Matrix3, Matrix6, Rotation3, SMatrix, Vector2, Vector3};

use crate::error::{Error, Result};

/// The camera's motion since the frame before, from the vehicle's own odometry (DVL, IMU, thrusters). It says where to look for the net and which cell a step led to where the
/// picture does not tell; what the picture does tell has precedence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionPrior {
    /// From the camera frame of the frame before to that of this one: a resting point is at `X_now = R * X_before + t`. The frame before is that of the last update,
    /// whatever came of it.
    pub now_from_before: Pose,
    /// Covariance, rotation (rad) then translation (m), perturbation in the camera frame of now; as of every pose here. Honest figures matter: one standard deviation below a
    /// sixth of a cell at the net decides alone which cell it is, where the picture is silent.
    pub covariance: Matrix6<f64>,
}

/// Largest element that a rotation times its transpose may be off the identity.
const NOT_A_ROTATION: f64 = 1e-6;

/// Row and column of the first value that is not finite, from 0.
fn not_finite<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> Option<(usize, usize)> {
    (0..R).flat_map(|row| (0..C).map(move |column| (row, column))).find(|&at| !m[at].is_finite())
}

impl MotionPrior {
    /// Rest, for certain.
    pub(crate) fn rest() -> Self {
        let now_from_before = Pose { rotation: Rotation3::identity(), translation: Vector3::zeros() };
        Self { now_from_before, covariance: Matrix6::zeros() }
    }

    /// Refuses what is no motion, and names the value.
    pub(crate) fn validate(&self) -> Result<()> {
        let (r, t, c) = (self.now_from_before.rotation.matrix(), &self.now_from_before.translation, &self.covariance);
        let turned = (r * r.transpose() - Matrix3::identity()).amax();
        let [bad_turn, bad_shift, bad_variance] = [not_finite(r), not_finite(t), not_finite(c)];
        let negative = (0..6).find(|&k| c[(k, k)] < 0.0);
        let what = if let Some((row, column)) = bad_turn {
            format!("rotation, row {row}, column {column} is {}: expected a finite number", r[(row, column)])
        } else if let Some((row, _)) = bad_shift {
            format!("translation, {} is {}: expected a finite number of metres", ["x", "y", "z"][row], t[row])
        } else if turned > NOT_A_ROTATION || r.determinant() < 0.0 {
            "the rotation is none: its matrix times its transpose is not the identity, or it mirrors".to_owned()
        } else if let Some((row, column)) = bad_variance {
            format!("covariance, row {row}, column {column} is {}: expected a finite number", c[(row, column)])
        } else if let Some(k) = negative {
            format!("covariance, row {k}, column {k} is {}: expected a variance, 0 or more", c[(k, k)])
        } else if (c - c.transpose()).amax() > 1e-6 * c.amax() {
            "the covariance is not symmetric".to_owned()
        } else {
            return Ok(());
        };
        Err(Error::Prior { what })
    }

    /// Two motions, `earlier` first.
    pub(crate) fn after(&self, earlier: &Self) -> Self {
        let (last, first) = (self.now_from_before, earlier.now_from_before);
        let moved = last.rotation * first.translation;
        // R = R2 R1 and t = R2 t1 + t2, both perturbed.
        let mut carried = SMatrix::<f64, 6, 6>::zeros();
        carried.fixed_view_mut::<3, 3>(0, 0).copy_from(last.rotation.matrix());
        carried.fixed_view_mut::<3, 3>(3, 3).copy_from(last.rotation.matrix());
        let mut own = SMatrix::<f64, 6, 6>::identity();
        own.fixed_view_mut::<3, 3>(3, 0).copy_from(&-moved.cross_matrix());
        Self {
            now_from_before: Pose { rotation: last.rotation * first.rotation, translation: moved + last.translation },
            covariance: carried * earlier.covariance * carried.transpose() + own * self.covariance * own.transpose(),
        }
    }

    /// Where a net is now that was at `before`, with the standard deviation along its X and Y, m, of the point that the optical axis meets; `None` if it meets none.
    pub(crate) fn carry(&self, before: &Pose) -> Option<(Pose, Vector2<f64>)> {
        let motion = self.now_from_before;
        let pose = Pose {
            rotation: motion.rotation * before.rotation,
            translation: motion.rotation * before.translation + motion.translation,
        };
        let plane = pose.plane();
        let range = plane.range().filter(|r| *r > 0.0)?;
        // A point X of the net is off by turn x (X - t) + shift. What of that lies along the optical axis does not move the point that the axis meets.
        let lever = Vector3::z() * range - motion.translation;
        let deviation = |along: Vector3<f64>| {
            let gradient = along - plane.normal * (along.z / plane.normal.z.max(0.1));
            let mut row = SMatrix::<f64, 1, 6>::zeros();
            row.fixed_view_mut::<1, 3>(0, 0).copy_from(&lever.cross(&gradient).transpose());
            row.fixed_view_mut::<1, 3>(0, 3).copy_from(&gradient.transpose());
            (row * self.covariance * row.transpose())[0].max(0.0).sqrt()
        };
        Some((pose, Vector2::new(deviation(pose.x_axis()), deviation(pose.y_axis()))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(turn: Vector3<f64>, shift: Vector3<f64>) -> Pose {
        Pose { rotation: Rotation3::new(turn), translation: shift }
    }

    /// What is left out are products of two perturbations of 1e-5.
    const SECOND_ORDER: f64 = 1e-9;

    /// Small perturbations of both motions go where the composed covariance says: J C J^T of one number each.
    #[test]
    fn motions_and_their_errors_compose() {
        let (first, last) = (
            motion(Vector3::new(0.1, -0.2, 0.3), Vector3::new(0.2, 0.1, -0.3)),
            motion(Vector3::new(-0.2, 0.1, 0.05), Vector3::new(-0.1, 0.3, 0.2)),
        );
        for (which, k) in (0..2).flat_map(|which| (0..6).map(move |k| (which, k))) {
            let mut covariance = Matrix6::zeros();
            covariance[(k, k)] = 1e-10;
            let prior = |pose, own: bool| MotionPrior {
                now_from_before: pose,
                covariance: if own { covariance } else { Matrix6::zeros() },
            };
            let both = prior(last, which == 1).after(&prior(first, which == 0));
            let mut step = [0.0; 6];
            step[k] = 1e-5;
            let (turn, shift) = (Vector3::from_row_slice(&step[..3]), Vector3::from_row_slice(&step[3..]));
            let moved = |pose: Pose, own: bool| if own { pose.perturbed(turn, shift) } else { pose };
            let composed = prior(moved(last, which == 1), false).after(&prior(moved(first, which == 0), false));
            let (turn, shift) = both.now_from_before.perturbation_to(&composed.now_from_before);
            for (n, x) in turn.iter().chain(shift.iter()).enumerate() {
                assert!((both.covariance[(n, n)].sqrt() - x.abs()).abs() < SECOND_ORDER, "{which} {k}: {n}");
            }
        }
    }

    #[test]
    fn a_net_is_carried_and_its_place_is_as_sure_as_the_motion() {
        let before =
            Pose { rotation: Rotation3::from_euler_angles(0.3, -0.4, 0.1), translation: Vector3::new(0.1, 0.0, 1.2) };
        let now_from_before = motion(Vector3::new(0.02, 0.03, -0.05), Vector3::new(0.04, -0.01, 0.02));
        let at_axis = |pose: &Pose| pose.inverse_transform(Vector3::z() * pose.plane().range().expect("in view")).xy();
        for k in 0..6 {
            let mut covariance = Matrix6::zeros();
            covariance[(k, k)] = 1e-10;
            let (pose, deviation) = MotionPrior { now_from_before, covariance }.carry(&before).expect("in view");
            let point = Vector3::new(0.3, 0.2, 0.0);
            let expected = now_from_before.transform(before.transform(point));
            assert!((pose.transform(point) - expected).norm() < 1e-12);
            let mut step = [0.0; 6];
            step[k] = 1e-5;
            let (turn, shift) = (Vector3::from_row_slice(&step[..3]), Vector3::from_row_slice(&step[3..]));
            let prior = MotionPrior { now_from_before: now_from_before.perturbed(turn, shift), covariance };
            let moved = at_axis(&prior.carry(&before).expect("in view").0) - at_axis(&pose);
            // Turning the plane moves the point too, by a second-order share: a tenth of the first at these angles.
            assert!((moved.abs() - deviation).amax() < 0.5e-5, "{k}: {moved} {deviation}");
        }
    }

    #[test]
    fn what_is_no_motion_is_refused() {
        let rest = MotionPrior::rest();
        assert!(rest.validate().is_ok());
        let matrix =
            |m: Matrix3<f64>| Pose { rotation: Rotation3::from_matrix_unchecked(m), translation: Vector3::zeros() };
        let mut torn = Matrix3::identity();
        torn[(1, 2)] = f64::NAN;
        let mut skew = Matrix6::identity();
        skew[(0, 4)] = 0.5;
        let mut endless = Matrix6::identity();
        endless[(2, 3)] = f64::INFINITY;
        let moved = motion(Vector3::zeros(), Vector3::new(0.0, f64::NAN, 0.0));
        for (prior, words) in [
            (MotionPrior { now_from_before: moved, ..rest }, "translation, y is NaN: expected a finite number"),
            (MotionPrior { now_from_before: matrix(torn), ..rest }, "rotation, row 1, column 2 is NaN"),
            (MotionPrior { now_from_before: matrix(Matrix3::identity() * 2.0), ..rest }, "the rotation is none"),
            (MotionPrior { covariance: Matrix6::identity() * -1.0, ..rest }, "covariance, row 0, column 0 is -1"),
            (MotionPrior { covariance: endless, ..rest }, "covariance, row 2, column 3 is inf"),
            (MotionPrior { covariance: skew, ..rest }, "the covariance is not symmetric"),
        ] {
            let refused = prior.validate().unwrap_err();
            assert!(matches!(refused, Error::Prior { .. }), "{prior:?}");
            assert!(refused.to_string().starts_with(&format!("prior: {words}")), "{refused}");
        }
    }
}
