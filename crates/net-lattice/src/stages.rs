//! What the stages of a cold start gave one after the other, for those who want to know what each is good for.

use net_geometry::Pose;

use crate::conclude::cold_labels;
use crate::estimator::LatticeEstimator;
use crate::surface::Surface;
use crate::workspace::Lock;

/// The poses that the likelihood's answer came from, in the conventions of [`LatticeEstimate::pose`](crate::LatticeEstimate::pose): at the
/// tangent plane on the optical axis. Origins are the nodes nearest to the axis, each stage's own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stages {
    /// Of the wave vectors of all tiles alone: the search's hypothesis, refined on the spectra, at the period that was chosen later. A
    /// spectrum's power knows no place along the net: the origin lies on the axis.
    pub wave_vectors: Pose,
    /// Of the phases of the fundamentals, before anything was drawn; light twine already told from dark, and the period chosen.
    pub lock_in: Pose,
}

impl Stages {
    pub(crate) fn new(lock: &Lock) -> Self {
        let pose = |surface: &Surface| cold_labels(surface).pose(surface);
        Self { wave_vectors: pose(&lock.start), lock_in: pose(&lock.surface) }
    }
}

impl LatticeEstimator {
    /// The stages of the last picture. `None` if it was not a cold start, or nothing periodic was found.
    pub fn stages(&self) -> Option<&Stages> {
        self.work.as_ref()?.stages.as_ref()
    }
}
