//! How far poses are from the truth.

use net_geometry::nalgebra::{Rotation3, Vector2, Vector3};
use netpose::{Mesh, Pose};

/// A claim further off than this is wrong: the probability's definition of "right".
pub const RIGHT_RANGE_PERCENT: f64 = 5.0;
/// The same for the normal and the rotation in the net's plane, degrees.
pub const RIGHT_ANGLE_DEG: f64 = 5.0;

/// Errors of one pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseError {
    /// Estimated less true range along the optical axis, m.
    pub range_m: f64,
    /// The same in percent of the true range.
    pub range_percent: f64,
    /// Angle between the normals, degrees.
    pub normal_deg: f64,
    /// Angle between the estimated X axis and the nearest mesh direction of the truth, degrees.
    pub inplane_deg: f64,
}

impl PoseError {
    /// Compares ranges as given (they may come from a fit to a bent net) and the rotations of two poses.
    pub fn new(estimate: &Pose, range: f64, truth: &Pose, true_range: f64, mesh: &Mesh) -> Self {
        let range_m = range - true_range;
        Self {
            range_m,
            range_percent: 100.0 * range_m / true_range,
            normal_deg: estimate.normal().angle(&truth.normal()).to_degrees(),
            inplane_deg: inplane_error(estimate, truth, mesh).to_degrees(),
        }
    }

    /// Whether a claim with these errors is one that should not have been made.
    pub fn is_wrong(&self) -> bool {
        // Written so that NaN is wrong.
        !(self.range_percent.abs() <= RIGHT_RANGE_PERCENT
            && self.normal_deg <= RIGHT_ANGLE_DEG
            && self.inplane_deg <= RIGHT_ANGLE_DEG)
    }
}

/// Angle between the estimated X axis and the nearest mesh direction of the truth, rad: which direction is called the first is
/// a matter of naming.
fn inplane_error(estimate: &Pose, truth: &Pose, mesh: &Mesh) -> f64 {
    let x = estimate.rotation * Vector3::x();
    [mesh.a1(), mesh.a2()]
        .into_iter()
        .map(|a| {
            let angle = (truth.rotation * Vector3::new(a.x, a.y, 0.0)).angle(&x);
            angle.min(std::f64::consts::PI - angle)
        })
        .fold(f64::INFINITY, f64::min)
}

/// The net looks the same after a turn and a shift by whole cells: the frame of the run is laid onto the truth's once, on the
/// first pose of a count, and must then stay.
#[derive(Debug, Clone, Copy)]
struct Alignment {
    /// Rotation from the run's net frame to the truth's.
    true_from_run: Rotation3<f64>,
    /// The run's origin in the truth's net frame, m.
    shift: Vector3<f64>,
}

impl Alignment {
    /// From the first frame that has both poses.
    pub fn new(estimate: &Pose, truth: &Pose, mesh: &Mesh) -> Self {
        let turn = |k: usize| Rotation3::from_axis_angle(&Vector3::z_axis(), k as f64 * std::f64::consts::FRAC_PI_2);
        // True rotation = estimated rotation * run_from_true.
        // By the distance of the matrices: the angle between equal rotations is not always a number.
        let misfit = |run_from_true: &Rotation3<f64>| {
            ((estimate.rotation * run_from_true).matrix() - truth.rotation.matrix()).norm()
        };
        let best = (0..4).map(turn).min_by(|a, b| misfit(a).total_cmp(&misfit(b))).unwrap_or_default();
        let true_from_run = best.inverse();
        let gap = truth.camera_in_net() - true_from_run * estimate.camera_in_net();
        let cells = net_geometry::nalgebra::Matrix2::from_columns(&[mesh.a1(), mesh.a2()])
            .lu()
            .solve(&gap.xy())
            .unwrap_or_else(Vector2::zeros);
        let node = mesh.node(cells.x.round(), cells.y.round());
        Self { true_from_run, shift: Vector3::new(node.x, node.y, 0.0) }
    }

    /// Estimated less true position of the camera in the truth's net frame, m.
    pub fn position_error(&self, estimate: &Pose, truth: &Pose) -> Vector3<f64> {
        self.true_from_run * estimate.camera_in_net() + self.shift - truth.camera_in_net()
    }
}

/// Follows the error of the camera's place along the net through a run, count of cells by count of cells.
#[derive(Debug)]
pub struct Odometry {
    mesh: Mesh,
    /// Number of the count and how it lies on the truth.
    aligned: Option<(u32, Alignment)>,
    /// Error of the frame before, in the same count; `None` after a gap.
    before: Option<Vector3<f64>>,
    /// The place jumped by more than half a cell against the truth, and the run did not say so.
    pub slips: usize,
    /// The run said that it had lost the count and started another, with an origin of its own.
    pub restarts: usize,
}

impl Odometry {
    /// For a run on a net of this mesh.
    pub fn new(mesh: Mesh) -> Self {
        Self { mesh, aligned: None, before: None, slips: 0, restarts: 0 }
    }

    /// The next frame with both poses: the error in the truth's net frame, m, and whether a cell was slipped to it.
    pub fn update(&mut self, track: u32, estimate: &Pose, truth: &Pose) -> (Vector3<f64>, bool) {
        let align = match self.aligned {
            Some((count, align)) if count == track => align,
            earlier => {
                self.restarts += usize::from(earlier.is_some());
                self.before = None;
                Alignment::new(estimate, truth, &self.mesh)
            }
        };
        self.aligned = Some((track, align));
        let error = align.position_error(estimate, truth);
        let half_cell = 0.5 * self.mesh.side1().min(self.mesh.side2());
        let slipped = self.before.is_some_and(|before| (error - before).xy().norm() > half_cell);
        self.slips += usize::from(slipped);
        self.before = Some(error);
        (error, slipped)
    }

    /// A frame without a pose: a jump across it may be motion that nobody saw.
    pub fn gap(&mut self) {
        self.before = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(roll: f64, tilt: f64, translation: [f64; 3]) -> Pose {
        let rotation =
            Rotation3::from_axis_angle(&Vector3::x_axis(), tilt) * Rotation3::from_axis_angle(&Vector3::z_axis(), roll);
        Pose { rotation, translation: Vector3::from(translation) }
    }

    #[test]
    fn a_net_named_otherwise_has_no_error() {
        let mesh = Mesh::square(0.05).unwrap();
        let truth = pose(0.1, 0.3, [0.01, -0.02, 1.5]);
        // The same net, its frame turned by a quarter and moved by 3 and -2 cells.
        let quarter = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        let named_otherwise = |p: &Pose| Pose {
            rotation: p.rotation * quarter,
            translation: p.transform(Vector3::new(0.15, -0.10, 0.0)),
        };
        let estimate = named_otherwise(&truth);
        let error = PoseError::new(&estimate, 1.6, &truth, 1.6, &mesh);
        assert!(!error.is_wrong() && error.normal_deg < 1e-6 && error.inplane_deg < 1e-5, "{error:?}");
        let align = Alignment::new(&estimate, &truth, &mesh);
        let later = pose(0.12, 0.25, [0.4, 0.1, 1.4]);
        assert!(align.position_error(&named_otherwise(&later), &later).norm() < 1e-12);
        // A slip by one cell stays visible.
        let mut slipped = named_otherwise(&later);
        slipped.translation = slipped.transform(Vector3::new(0.05, 0.0, 0.0));
        assert!((align.position_error(&slipped, &later).norm() - 0.05).abs() < 1e-12);
    }

    /// Rotations that are equal to the last digit, in any attitude.
    #[test]
    fn a_run_against_itself_has_no_error() {
        let mesh = Mesh::square(0.05).unwrap();
        for k in 0..500 {
            let turn = 0.003 * f64::from(k);
            let same = pose(0.1 + turn, 0.2 - turn, [0.01 * turn, 0.02, 1.2]);
            let mut odometry = Odometry::new(mesh);
            assert!(odometry.update(0, &same, &same).0.norm() < 1e-12, "turn {turn}");
        }
    }

    #[test]
    fn a_slip_in_silence_is_told_from_a_count_started_anew() {
        let mesh = Mesh::square(0.05).unwrap();
        let truth = pose(0.1, 0.2, [0.0, 0.0, 1.2]);
        let moved = |cells: f64| Pose { translation: truth.transform(Vector3::new(0.05 * cells, 0.0, 0.0)), ..truth };
        let mut odometry = Odometry::new(mesh);
        assert!(!odometry.update(0, &truth, &truth).1);
        assert!(odometry.update(0, &moved(1.0), &truth).1);
        // It stays a cell off: one slip, not one a frame.
        assert!(!odometry.update(0, &moved(1.0), &truth).1);
        assert!(!odometry.update(1, &moved(7.0), &truth).1);
        assert!(odometry.update(1, &moved(7.0), &truth).0.norm() < 1e-12);
        assert_eq!((odometry.slips, odometry.restarts), (1, 1));
    }

    #[test]
    fn wrong_is_wrong_by_range_by_tilt_and_by_not_being_a_number() {
        let mesh = Mesh::square(0.05).unwrap();
        let truth = pose(0.0, 0.3, [0.0, 0.0, 2.0]);
        assert!(PoseError::new(&truth, 2.11, &truth, 2.0, &mesh).is_wrong());
        assert!(PoseError::new(&pose(0.0, -0.3, [0.0, 0.0, 2.0]), 2.0, &truth, 2.0, &mesh).is_wrong());
        assert!(PoseError::new(&truth, f64::NAN, &truth, 2.0, &mesh).is_wrong());
        assert!(!PoseError::new(&truth, 1.91, &truth, 2.0, &mesh).is_wrong());
    }
}
