//! Where the net should be in the next frame: by the caller's word, or at constant velocity.

use net_geometry::Pose;
use net_geometry::nalgebra::{Rotation3, UnitQuaternion, Vector2, Vector3};

use crate::prior::MotionPrior;

/// Longest gap between frames, s, over which a velocity is carried on.
const LONGEST_GAP_S: f64 = 1.0;

/// Camera motion in the net frame, from the last two poses.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Motion {
    last: Option<(i64, Pose)>,
    /// Turn of the net as the camera sees it, rad/s, and velocity of the camera in the net frame, m/s.
    velocity: Option<(Vector3<f64>, Vector3<f64>)>,
    /// What the caller said of the motion since the last pose; `None` if it said nothing of some frame.
    since: Option<MotionPrior>,
}

impl Motion {
    /// Another frame, and what the caller knows of the motion to it. Before anything is predicted.
    pub fn carry(&mut self, prior: Option<&MotionPrior>) {
        self.since = self.since.zip(prior).map(|(since, prior)| prior.after(&since));
    }

    /// The pose expected by the caller's word, and its standard deviation along the net's X and Y, m, at the optical axis.
    pub fn by_prior(&self) -> Option<(Pose, Vector2<f64>)> {
        self.since?.carry(&self.last?.1)
    }

    /// The pose expected at `timestamp_ns`; `None` without a velocity from two recent poses.
    pub fn predict(&self, timestamp_ns: i64) -> Option<Pose> {
        let (then, pose) = self.last?;
        let dt = seconds(then, timestamp_ns);
        if dt > LONGEST_GAP_S {
            return None;
        }
        let (turn, speed) = self.velocity?;
        let rotation = Rotation3::new(turn * dt) * pose.rotation;
        let centre = pose.camera_in_net() + speed * dt;
        Some(Pose { rotation, translation: -(rotation * centre) })
    }

    /// The camera was elsewhere in the net when the last pose was seen: by whole cells, `net_shift`, m.
    pub fn renumber(&mut self, net_shift: Vector3<f64>) {
        if let Some((_, pose)) = &mut self.last {
            pose.translation -= pose.rotation * net_shift;
        }
    }

    /// A pose that is believed.
    pub fn observe(&mut self, timestamp_ns: i64, pose: &Pose) {
        self.velocity = self.last.and_then(|(then, last)| {
            let dt = seconds(then, timestamp_ns);
            (dt > 0.0 && dt <= LONGEST_GAP_S).then(|| {
                // By quaternion: the angle from a matrix's trace is not a number for the smallest turns.
                let turn = UnitQuaternion::from_rotation_matrix(&(pose.rotation * last.rotation.inverse()));
                let turn = turn.scaled_axis() / dt;
                (turn, (pose.camera_in_net() - last.camera_in_net()) / dt)
            })
        });
        self.last = Some((timestamp_ns, *pose));
        self.since = Some(MotionPrior::rest());
    }
}

fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of a few dozen double operations.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn a_steady_motion_is_predicted_exactly() {
        let pose = |t: f64| {
            let rotation =
                Rotation3::new(Vector3::new(0.1, -0.2, 0.05) * t) * Rotation3::from_euler_angles(0.1, 0.2, 0.3);
            let centre = Vector3::new(0.3 * t, -0.1 * t, -1.0 + 0.2 * t);
            Pose { rotation, translation: -(rotation * centre) }
        };
        let mut motion = Motion::default();
        assert!(motion.predict(0).is_none());
        motion.observe(0, &pose(0.0));
        assert!(motion.predict(100_000_000).is_none(), "one pose has no velocity");
        motion.observe(100_000_000, &pose(0.1));
        let predicted = motion.predict(300_000_000).expect("two poses were seen");
        assert!((predicted.matrix() - pose(0.3).matrix()).amax() < ROUNDING);
        assert!(motion.predict(2_000_000_000).is_none(), "too long ago");
    }

    #[test]
    fn the_smallest_turns_are_numbers() {
        for k in 0..2000 {
            let rotation = Rotation3::from_euler_angles(0.1, 0.2, 0.3);
            let turned = Rotation3::new(Vector3::new(1.0, -2.0, 0.5) * 1e-9 * f64::from(k)) * rotation;
            let mut motion = Motion::default();
            motion.observe(0, &Pose { rotation, translation: Vector3::z() });
            motion.observe(1_000_000, &Pose { rotation: turned, translation: Vector3::z() });
            let predicted = motion.predict(2_000_000).expect("two poses were seen");
            assert!(predicted.matrix().iter().all(|x| x.is_finite()), "turn {k}e-9");
        }
    }
}
