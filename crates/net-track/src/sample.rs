//! What goes in: times, measured poses, and how the picture moved in between.

use net_geometry::Pose;
use net_geometry::nalgebra::{Matrix2, Matrix6, Vector2};

use crate::error::{Error, Result};

/// Largest coordinate, m, of a camera in the net frame: a measurement farther off is a mistake.
const FARTHEST_M: f64 = 1e5;

/// One frame. Without a measurement it is a time at which the pose is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Time of exposure, ns.
    pub timestamp_ns: i64,
    /// The lattice's pose, of frames whose pose can be vouched for.
    pub measurement: Option<Measurement>,
    /// How the camera moved along the net since the sample before, from a source that does not count cells (flow, an inertial or Doppler log).
    pub increment: Option<Increment>,
}

/// A measured pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Net to camera.
    pub pose: Pose,
    /// Of its errors: rotation (rad), then translation (m), perturbation in the camera frame ([`Pose::perturbed`]).
    pub covariance: Matrix6<f64>,
    /// In [0, 1]: that the pose is right but for whole cells.
    pub probability: f64,
    /// Lattice vectors in the net's plane, m: what one slipped cell moves the camera by.
    pub lattice: [Vector2<f64>; 2],
    /// Number of the count of cells: positions of different counts cannot be compared.
    pub track: u32,
}

/// A displacement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Increment {
    /// Of the camera's centre along the net's X and Y, m.
    pub shift: Vector2<f64>,
    /// Of its errors, m².
    pub covariance: Matrix2<f64>,
}

/// Refuses what makes no sense.
pub(crate) fn check(index: usize, sample: &Sample, previous_ns: Option<i64>) -> Result<()> {
    let timestamp_ns = sample.timestamp_ns;
    if let Some(previous_ns) = previous_ns.filter(|&p| p >= timestamp_ns) {
        return Err(Error::TimeOrder { index, timestamp_ns, previous_ns });
    }
    let wrong = |field, value, expected| Err(Error::Sample { index, field, value, expected });
    if let Some(m) = &sample.measurement {
        let numbers = m.pose.rotation.matrix().iter().chain(m.pose.translation.iter());
        if let Some(&value) = numbers.clone().find(|x| x.is_nan() || x.abs() > FARTHEST_M) {
            return wrong("pose", value, "finite, within 100 km");
        }
        let r = m.pose.rotation.matrix();
        let off = (r * r.transpose() - net_geometry::nalgebra::Matrix3::identity()).amax();
        if off > 1e-6 {
            return wrong("pose", off, "a rotation's columns are of unit length and at right angles, to a millionth");
        }
        if !(0.0..=1.0).contains(&m.probability) {
            return wrong("probability", m.probability, "0 to 1");
        }
        let c = &m.covariance;
        if let Some(&value) = c.iter().find(|x| !x.is_finite()) {
            return wrong("covariance", value, "finite numbers");
        }
        let asymmetry = (c - c.transpose()).amax();
        if asymmetry > 1e-6 * c.amax() {
            return wrong("covariance", asymmetry, "symmetric, to a millionth of its largest entry");
        }
        if c.cholesky().is_none() {
            let least = c.symmetric_eigen().eigenvalues.min();
            return wrong("covariance", least, "positive definite: its least eigenvalue is above zero");
        }
        let area = m.lattice[0].perp(&m.lattice[1]);
        if !(area.abs() > 1e-12 && area.abs() < FARTHEST_M) {
            return wrong("lattice", area, "two lattice vectors with a cell between them, m²");
        }
    }
    if let Some(f) = &sample.increment {
        if let Some(&value) = f.shift.iter().find(|x| x.is_nan() || x.abs() > FARTHEST_M) {
            return wrong("increment", value, "finite, within 100 km");
        }
        if f.covariance.cholesky().is_none() || !f.covariance.iter().all(|x| x.is_finite()) {
            return wrong("increment covariance", f.covariance.determinant(), "positive definite");
        }
    }
    Ok(())
}
