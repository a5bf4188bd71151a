//! The unknowns of a frame, and what measurements and motion say of them: linear residuals.
//!
//! Unknowns of frame k, twelve numbers: `w` (rad), so that its rotation is `exp(w) R` about the linearisation `R`; `c` (m), so that the camera's centre in the net
//! frame is `C + c`; turning (rad/s, camera frame); velocity (m/s, net frame). In the centre a slip of whole cells is a plain sum, and a large distance from
//! the origin is no lever.

use net_geometry::Pose;
use net_geometry::nalgebra::{Matrix2, Matrix6, Rotation3, UnitQuaternion, Vector2, Vector3, Vector6};

use crate::config::Config;
use crate::sample::{Increment, Measurement};

/// Unknowns of a frame.
pub(crate) const STATE: usize = 12;
/// Where they begin: rotation, centre, turning, velocity.
pub(crate) const ROTATION: usize = 0;
pub(crate) const CENTRE: usize = 3;
pub(crate) const TURNING: usize = 6;
pub(crate) const VELOCITY: usize = 9;

/// A residual in deviations: sum of factor times unknown, less `rhs`.
#[derive(Debug, Clone, Default)]
pub(crate) struct Row {
    pub terms: Vec<(usize, f64)>,
    pub rhs: f64,
}

/// What a frame's unknowns are linearised about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Linear {
    pub rotation: Rotation3<f64>,
    /// Camera's centre in the net frame, m.
    pub centre: Vector3<f64>,
}

impl Linear {
    pub fn of(pose: &Pose) -> Self {
        Self { rotation: pose.rotation, centre: pose.camera_in_net() }
    }

    pub fn pose(&self) -> Pose {
        Pose { rotation: self.rotation, translation: -(self.rotation * self.centre) }
    }

    /// Between two, at `part` from 0 to 1.
    pub fn between(&self, other: &Self, part: f64) -> Self {
        let turn = rotation_vector(&(other.rotation * self.rotation.inverse()));
        Self {
            rotation: Rotation3::new(turn * part) * self.rotation,
            centre: self.centre + (other.centre - self.centre) * part,
        }
    }

    pub fn stepped(&self, w: Vector3<f64>, c: Vector3<f64>) -> Self {
        Self { rotation: Rotation3::new(w) * self.rotation, centre: self.centre + c }
    }
}

/// Rotation vector, rad, by way of the quaternion: the arc cosine of a trace is blind near zero.
pub(crate) fn rotation_vector(r: &Rotation3<f64>) -> Vector3<f64> {
    UnitQuaternion::from_rotation_matrix(r).scaled_axis()
}

/// From (turn, shift of the net's origin in the camera frame) to (w, c): `c = -R'(d + [t]x w)`.
fn centre_from_shift(pose: &Pose) -> Matrix6<f64> {
    let back = pose.rotation.matrix().transpose();
    let mut j = Matrix6::identity();
    j.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-back * pose.translation.cross_matrix()));
    j.fixed_view_mut::<3, 3>(3, 3).copy_from(&-back);
    j
}

/// The covariance of (w, c) as one of (turn, shift): the inverse of the above.
pub(crate) fn shift_covariance(pose: &Pose, of_centre: &Matrix6<f64>) -> Matrix6<f64> {
    let mut j = Matrix6::identity();
    j.fixed_view_mut::<3, 3>(3, 0).copy_from(&-pose.translation.cross_matrix());
    j.fixed_view_mut::<3, 3>(3, 3).copy_from(&-pose.rotation.matrix());
    let c = j * of_centre * j.transpose();
    0.5 * (c + c.transpose())
}

/// A measurement, whitened.
#[derive(Debug, Clone)]
pub(crate) struct Whitened {
    pub at: Linear,
    /// Inverse Cholesky factor of the covariance of (w, c).
    pub white: Matrix6<f64>,
    pub lattice: [Vector2<f64>; 2],
}

impl Whitened {
    /// With `correction` cells added. `None` for a covariance that is not positive definite after the change of variables.
    pub fn new(m: &Measurement, correction: (i32, i32)) -> Option<Self> {
        let j = centre_from_shift(&m.pose);
        let c = j * m.covariance * j.transpose();
        let white = (0.5 * (c + c.transpose())).cholesky()?.l().try_inverse()?;
        let mut at = Linear::of(&m.pose);
        let cells = m.lattice[0] * f64::from(correction.0) + m.lattice[1] * f64::from(correction.1);
        at.centre += cells.push(0.0);
        white.iter().all(|x| x.is_finite()).then_some(Self { at, white, lattice: m.lattice })
    }

    /// Measured less linearised, (w, c).
    pub fn off(&self, linear: &Linear) -> Vector6<f64> {
        let w = rotation_vector(&(self.at.rotation * linear.rotation.inverse()));
        let c = self.at.centre - linear.centre;
        Vector6::new(w.x, w.y, w.z, c.x, c.y, c.z)
    }

    /// Residuals of frame `k`: unknown less measured.
    pub fn rows(&self, k: usize, linear: &Linear) -> [Row; 6] {
        let rhs = self.white * self.off(linear);
        std::array::from_fn(|r| Row {
            terms: (0..=r).map(|c| (STATE * k + c, self.white[(r, c)])).collect(),
            rhs: rhs[r],
        })
    }

    /// What a cell along both directions added to the measurement does to the residuals.
    pub fn cells(&self) -> [[f64; 2]; 6] {
        std::array::from_fn(|r| {
            self.lattice.map(|a| -(self.white[(r, CENTRE)] * a.x + self.white[(r, CENTRE + 1)] * a.y))
        })
    }
}

/// Residuals of the step from frame `k - 1` to `k`: speed and turning are walks whose steps are white accelerations.
pub(crate) fn motion_rows(k: usize, before: &Linear, here: &Linear, dt: f64, config: &Config) -> [Row; 12] {
    // Cholesky factor of [dt^3/3, dt^2/2; dt^2/2, dt], inverted.
    let (l11, l21, l22) = (dt.powf(1.5) / 3f64.sqrt(), 0.75f64.sqrt() * dt.sqrt(), 0.5 * dt.sqrt());
    let relative = here.rotation * before.rotation.inverse();
    let turned = rotation_vector(&relative);
    let moved = here.centre - before.centre;
    let (a, b) = (STATE * (k - 1), STATE * k);
    std::array::from_fn(|r| {
        let (axis, turning, second) = (r % 3, r < 6, r % 6 >= 3);
        let (density, place, rate) = if turning {
            (config.turning_density, ROTATION, TURNING)
        } else {
            (config.acceleration_density, CENTRE, VELOCITY)
        };
        // e1: place moved less rate times time; e2: change of rate.
        let mut e1 = Row { terms: vec![(b + place + axis, 1.0), (a + rate + axis, -dt)], rhs: 0.0 };
        if turning {
            e1.terms.extend((0..3).map(|c| (a + place + c, -relative.matrix()[(axis, c)])));
            e1.rhs = -turned[axis];
        } else {
            e1.terms.push((a + place + axis, -1.0));
            e1.rhs = -moved[axis];
        }
        let scale = |row: &mut Row, by: f64| {
            row.terms.iter_mut().for_each(|t| t.1 *= by);
            row.rhs *= by;
        };
        if !second {
            scale(&mut e1, 1.0 / (l11 * density));
            return e1;
        }
        scale(&mut e1, -l21 / l11);
        e1.terms.extend([(b + rate + axis, 1.0), (a + rate + axis, -1.0)]);
        scale(&mut e1, 1.0 / (l22 * density));
        e1
    })
}

/// Residuals of an increment from frame `k - 1` to `k`. `None` for a covariance that is not positive definite.
pub(crate) fn increment_rows(k: usize, before: &Linear, here: &Linear, step: &Increment) -> Option<[Row; 2]> {
    let white: Matrix2<f64> = step.covariance.cholesky()?.l().try_inverse()?;
    let rhs = white * (step.shift - (here.centre - before.centre).xy());
    let (a, b) = (STATE * (k - 1) + CENTRE, STATE * k + CENTRE);
    Some(std::array::from_fn(|r| Row {
        terms: (0..2).flat_map(|c| [(b + c, white[(r, c)]), (a + c, -white[(r, c)])]).collect(),
        rhs: rhs[r],
    }))
}

/// Weak knowledge of the first frame's rates, so that a single frame has an answer.
pub(crate) fn rate_rows(config: &Config) -> [Row; 6] {
    std::array::from_fn(|r| {
        let (at, sigma) = if r < 3 { (TURNING + r, 2.0) } else { (VELOCITY + r - 3, config.speed_max_m_s) };
        Row { terms: vec![(at, 1.0 / sigma)], rhs: 0.0 }
    })
}
