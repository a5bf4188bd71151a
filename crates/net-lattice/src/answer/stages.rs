//! What the stages of a cold start gave one after the other, for those who want to know what each is good for.

use net_geometry::Pose;

use crate::answer::estimate::Labels;
use crate::sheet::surface::Surface;

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
    /// From what the search gave, and what that was locked to.
    pub(crate) fn new(hypothesis: &Surface, locked: &Surface) -> Self {
        let pose = |surface: &Surface| Labels::nearest(surface).pose(surface);
        Self { wave_vectors: pose(hypothesis), lock_in: pose(locked) }
    }
}
