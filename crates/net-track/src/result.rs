//! What comes out.

use net_geometry::Pose;
use net_geometry::nalgebra::{Matrix6, Vector3};

/// Where a smoothed pose comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// The frame's measurement and its neighbours'.
    Smoothed,
    /// Its measurement lies so far off that it had little say.
    Outlier,
    /// The neighbours' alone: the frame has no measurement.
    Interpolated,
}

impl Origin {
    /// The word used in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Smoothed => "smoothed",
            Self::Outlier => "outlier",
            Self::Interpolated => "interpolated",
        }
    }
}

/// A smoothed pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Smoothed {
    /// Where it comes from.
    pub origin: Origin,
    /// Net to camera.
    pub pose: Pose,
    /// Rotation (rad), then translation (m), perturbation in the camera frame. As good as the measurements' covariances and as their independence.
    pub covariance: Matrix6<f64>,
    /// Velocity of the camera in the net frame, m/s.
    pub velocity: Vector3<f64>,
    /// Turning of the net as the camera sees it, rad/s, camera frame.
    pub turning: Vector3<f64>,
    /// Distance from the measurement, in its deviations, over all six numbers (six of them independent: 2.4 on average); zero without one.
    pub residual: f64,
    /// Cells that confirmed repairs added to this frame's lattice coordinates.
    pub correction: (i32, i32),
    /// Number of the stretch within which poses are connected: it grows with every new count of cells, every gap too long, and every suspected slip that nobody confirmed.
    pub segment: u32,
}

/// What the verifier says of a suspected slip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The cells slipped, by exactly so many.
    Confirmed,
    /// They did not: the camera jumped.
    Refuted,
    /// It cannot tell.
    Unknown,
}

impl Verdict {
    /// The word used in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Confirmed => "confirmed",
            Self::Refuted => "refuted",
            Self::Unknown => "unknown",
        }
    }
}

/// A step by whole cells that the motion does not explain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Suspect {
    /// First sample of the wrong count, from 0.
    pub sample: usize,
    /// The measured sample before it.
    pub before: usize,
    /// Cells to add to the lattice coordinates from here on.
    pub cells: (i32, i32),
    /// The same as the convex program has them, before rounding.
    pub estimate: [f64; 2],
    /// Log likelihood gained by it.
    pub gain: f64,
}

/// What the verifier answers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// Its judgement.
    pub verdict: Verdict,
    /// How sure it is, in deviations of its own; NaN without.
    pub z: f64,
}

impl Answer {
    /// Nobody looked.
    pub const UNKNOWN: Self = Self { verdict: Verdict::Unknown, z: f64::NAN };
}

/// A suspected slip with the evidence. It has been applied if, and only if, it was confirmed; otherwise the run is parted here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repair {
    /// What the motion says.
    pub suspect: Suspect,
    /// What the verifier says.
    pub answer: Answer,
}

/// A time without poses, or a place where the run is parted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gap {
    /// Last measured sample before it.
    pub before: usize,
    /// First measured sample after it.
    pub after: usize,
    /// Why.
    pub reason: GapReason,
}

/// Why a run is parted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GapReason {
    /// Too long without a measurement.
    Time,
    /// The count of cells began anew.
    Track,
    /// A suspected slip that nobody confirmed.
    Slip,
}

impl GapReason {
    /// The word used in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Track => "track",
            Self::Slip => "slip",
        }
    }
}

/// A whole run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trajectory {
    /// As many as samples; `None` where nothing is known.
    pub poses: Vec<Option<Smoothed>>,
    /// Suspected slips in order of time.
    pub repairs: Vec<Repair>,
    /// Where the run is parted, in order of time.
    pub gaps: Vec<Gap>,
}
