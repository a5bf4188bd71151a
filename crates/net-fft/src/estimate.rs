//! What comes out.

use net_geometry::nalgebra::{Vector2, Vector3};
use net_geometry::{Basis, Mesh, PlanarPose, Plane, Pose, PoseCovariance};

use crate::choose::Confidence;
use crate::evidence::Evidence;
use crate::field::LatticeField;

/// Which side of the mesh as it was given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The first one.
    First,
    /// The second one.
    Second,
}

/// The net as one section sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionPose {
    /// Index of the section.
    pub section: usize,
    /// Its two wave vectors, bins: along the net frame's X side first; signs and labels are the same in all sections.
    pub bins: [Vector2<f64>; 2],
    /// Its two lattice vectors, px of the whole picture, X side first.
    pub basis: Basis,
    /// Both poses of one cell; the net's origin is where the section's central ray meets it.
    pub poses: [PlanarPose; 2],
    /// Index of the one whose tilt has the sign that all sections agree on.
    pub chosen: usize,
    /// How sure each of the two vectors is.
    pub confidence: [Confidence; 2],
}

impl SectionPose {
    /// Where the section's central ray meets the net, m in the camera frame.
    pub fn place(&self) -> Vector3<f64> {
        self.poses[self.chosen].pose.translation
    }

    /// Chooses of the two poses the one whose normal lies nearer.
    pub(crate) fn choose_nearest_to(&mut self, normal: Vector3<f64>) {
        let off = self.poses.map(|p| (p.pose.normal() - normal).norm());
        self.chosen = usize::from(off[1] < off[0]);
    }

    /// Mean of both vectors' confidences, by which the thesis picks three sections.
    pub fn mean_confidence(&self) -> f64 {
        0.5 * (self.confidence[0].ratio + self.confidence[1].ratio)
    }
}

/// What speaks for an estimate. See [`crate::ThesisEstimator`] for how the probability follows from it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Support {
    /// Evidence of the flattened spectra, per family of twines.
    pub evidence: Evidence,
    /// Share of the sections, of those that could see both families, that do.
    pub sections_seeing: f64,
    /// By how much the sections prefer the period to its strongest rival, nats.
    pub period_margin_nats: f64,
    /// How the second harmonic keeps step with the first, per family: about standard normal without a net; far above 0 for light twine, far below for dark.
    pub second_harmonic: [f64; 2],
    /// Root mean square of what the fit leaves of the wave vectors, bins.
    pub residual_bins: f64,
    /// How much more there is at sums and differences of the wave vectors than at themselves, or twice what there is at half of these, nats: well below 0 of a net.
    pub mixed_orders_nats: f64,
    /// How far the crossing angle is from the mesh's, standard deviations of [`crate::ShapeConfig`].
    pub angle_sigmas: f64,
    /// How far the ratio of the sides is from the mesh's, relative.
    pub ratio_off: f64,
    /// Mean of `ln(1 + (r / σ)²)` over the residuals r of the fit: 0.4 of noise alone; far above, the lattice is not what the waves show.
    pub misfit: f64,
    /// Numbers that the fit compared.
    pub measurements: u32,
}

/// Where the net is, from its spectrum. The place along the net is open: the origin lies on the optical axis, not on a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThesisEstimate {
    /// Net to camera.
    pub pose: Pose,
    /// The net's plane.
    pub plane: Plane,
    /// The mesh with its first side along the net frame's X, and the crossing angle as it hangs.
    pub mesh: Mesh,
    /// Which side of the given mesh lies along X.
    pub x_side: Side,
    /// The lattice that the pose was read from, X side first.
    pub field: LatticeField,
    /// In [0, 1]: that there is a net and that the pose is right (within some 5 % and 5 degrees).
    pub probability: f64,
    /// How sure the pose is, if it is right; the place along the net is anywhere in a cell.
    pub covariance: PoseCovariance,
    /// What the probability was made of.
    pub support: Support,
    /// Area of a cell where the optical axis meets the net, px² (where Algorithm 5 starts from).
    pub axis_cell_area: f64,
    /// The plane through the places of the three most confident sections (eq. 4.24), if there are three not on a line.
    pub plane_of_three: Option<Plane>,
    /// The plane through the places of all sections (eq. 4.30 to 4.35).
    pub plane_of_all: Option<Plane>,
    /// The plane in closed form from all sections' wave vectors ([`crate::plane_from_waves`]).
    pub plane_of_waves: Option<Plane>,
}

impl ThesisEstimate {
    /// From the camera to the net along the optical axis, m.
    pub fn range(&self) -> f64 {
        self.pose.translation.z
    }
}
