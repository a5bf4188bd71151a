//! How sure a pose is.

use nalgebra::{Matrix2x6, Matrix6, SMatrix, Vector3};

use crate::pose::Pose;

/// Covariance of a pose: of the rotation vector, rad, then the shift, m, of [`Pose::perturbed`] (both in the camera
/// frame) that leads from the estimate to the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseCovariance {
    /// The 6 x 6 matrix, rad², rad m, m².
    pub matrix: Matrix6<f64>,
}

type Row = SMatrix<f64, 1, 6>;

fn row(turn: Vector3<f64>, shift: Vector3<f64>) -> Row {
    Row::from_row_slice(&[turn.x, turn.y, turn.z, shift.x, shift.y, shift.z])
}

impl PoseCovariance {
    /// The covariance after the net's origin has moved by `step`, m, in the camera frame (from one node to another):
    /// what turns about the old origin shifts the new one, `shift' = shift + turn x step`.
    pub fn with_origin_moved(&self, step: Vector3<f64>) -> Self {
        let mut transport = Matrix6::identity();
        transport.fixed_view_mut::<3, 3>(3, 0).copy_from(&-step.cross_matrix());
        Self { matrix: transport * self.matrix * transport.transpose() }
    }

    /// One standard deviation of the range on the optical axis, m; infinite for a plane that the axis does not meet.
    pub fn sigma_range(&self, pose: &Pose) -> f64 {
        let plane = pose.plane();
        let Some(range) = plane.range() else { return f64::INFINITY };
        // Of n·t / n_z, with n turned by w x n.
        let from_axis = pose.translation - Vector3::z() * range;
        let gradient = row(plane.normal.cross(&from_axis), plane.normal) / plane.normal.z;
        (gradient * self.matrix * gradient.transpose())[0].max(0.0).sqrt()
    }

    /// One standard deviation of the perpendicular distance, m.
    pub fn sigma_distance(&self, pose: &Pose) -> f64 {
        let normal = pose.normal();
        let gradient = row(normal.cross(&pose.translation), normal);
        (gradient * self.matrix * gradient.transpose())[0].max(0.0).sqrt()
    }

    /// One standard deviation of the normal's direction, rad, in the direction in which it is least sure.
    pub fn sigma_tilt(&self, pose: &Pose) -> f64 {
        // Turning about X moves the normal along -Y, turning about Y along X.
        self.largest_sigma(row(pose.x_axis(), Vector3::zeros()), row(pose.y_axis(), Vector3::zeros()))
    }

    /// One standard deviation of the origin's place in the net's plane, m, in the direction in which it is least sure.
    pub fn sigma_xy(&self, pose: &Pose) -> f64 {
        self.largest_sigma(row(Vector3::zeros(), pose.x_axis()), row(Vector3::zeros(), pose.y_axis()))
    }

    fn largest_sigma(&self, a: Row, b: Row) -> f64 {
        let gradient = Matrix2x6::from_rows(&[a, b]);
        let covariance = gradient * self.matrix * gradient.transpose();
        // Largest eigenvalue of a symmetric 2 x 2 matrix.
        let (mean, half) = (covariance.trace() / 2.0, (covariance[(0, 0)] - covariance[(1, 1)]) / 2.0);
        (mean + half.hypot(covariance[(0, 1)])).max(0.0).sqrt()
    }
}
