//! The thesis's way (Strandenes 2023): spectra of sections give the plane, contours the junctions, block matching the motion.

use net_fft::{ThesisConfig, ThesisEstimate, ThesisEstimator};
use net_flow::{FlowTracker, Hints, Motion};
use net_geometry::nalgebra::Vector2;
use net_geometry::{Camera, Junction, Lattice, Mesh, Pose, PoseCovariance};
use net_image::GrayView;
use net_junction::{Expectation, ExpectedNet, JunctionDetector};

use crate::error::Result;
use crate::estimate::{Connection, NetPose};
use crate::method::{Found, Track};

/// Probability from which a pose is vouched for. On random scenes of the simulator (`net-fft`, `examples/spectrum_study.rs`) 0.7 refuses 3 right poses in 188 more than 0.5 would, and
/// lets none through that is not one of the nets in view.
pub(crate) const PROBABILITY_THRESHOLD: f64 = 0.7;
/// A followed junction is the nearest one within this part of a cell of where the motion puts it.
const SNAP_CELLS: f64 = 0.35;

/// Sections, plane, junctions; the count of cells follows one junction from frame to frame.
#[derive(Debug)]
pub(crate) struct ThesisMethod {
    camera: Camera,
    estimator: ThesisEstimator,
    detector: JunctionDetector,
    flow: FlowTracker,
    track: Track,
    connection: Connection,
    /// The junction that is followed, its index, and the pose, all of the last frame that had one.
    last: Option<(Vector2<f64>, (i32, i32), Pose)>,
}

impl ThesisMethod {
    pub fn new(camera: &Camera, mesh: &Mesh, config: &ThesisConfig) -> Result<Self> {
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        Ok(Self {
            camera: *camera,
            estimator: ThesisEstimator::new(camera, mesh, config)?,
            detector: JunctionDetector::new(width, height, &net_junction::Config::default())?,
            flow: FlowTracker::new(width, height, &net_flow::Config::default())?,
            track: Track::default(),
            connection: Connection::Followed,
            last: None,
        })
    }

    /// The next frame; `None` when no plane goes through the sections. Fills `junctions` when the pose can be vouched for.
    pub fn update(&mut self, image: GrayView<'_>, junctions: &mut Vec<Junction>) -> Result<Option<Found>> {
        let result = self.flow.update(image, &Hints::default())?;
        let motion = (result.step.status == net_flow::Status::Tracked).then_some(result.step.motion).flatten();
        let estimate = self.estimator.estimate(image)?;
        let Some(estimate) = estimate.filter(|e| e.probability >= PROBABILITY_THRESHOLD) else {
            self.last = None;
            return Ok(estimate.map(|e| self.found(&e, e.pose)));
        };
        let mut lattice = Lattice { pose: estimate.pose, mesh: estimate.mesh };
        if let Some((_, _, last)) = &self.last {
            lattice = lattice.following(last);
        }
        let Lattice { mut pose, mesh } = lattice;
        let expected = ExpectedNet { camera: self.camera, mesh, pose, anchored: false };
        junctions.extend_from_slice(self.detector.detect(image, Some(&Expectation::Net(expected)))?);
        let shift = self.count_on(motion, &estimate, junctions);
        for junction in junctions.iter_mut() {
            junction.index = junction.index.map(|(i, j)| (i + shift.0, j + shift.1));
        }
        if let Some((pixel, (i, j))) = followed(junctions, &self.camera) {
            if let Some(point) = self.camera.ray_from_pixel(pixel).and_then(|ray| estimate.plane.point_along(ray)) {
                let away = pose.rotation * mesh.node(f64::from(i), f64::from(j)).push(0.0);
                pose.translation = point - away;
            }
            self.last = Some((pixel, (i, j), pose));
        } else {
            self.last = None;
        }
        Ok(Some(self.found(&estimate, pose)))
    }

    /// What to add to this frame's indices so that the count of the last frame goes on; a new count where it cannot.
    fn count_on(&mut self, motion: Option<Motion>, estimate: &ThesisEstimate, junctions: &[Junction]) -> (i32, i32) {
        let reach = SNAP_CELLS * estimate.axis_cell_area.sqrt();
        let goes_on = self.last.zip(motion).and_then(|((pixel, index, _), motion)| {
            let expected = motion.apply(pixel);
            let away = |j: &Junction| (j.pixel - expected).norm();
            let named = junctions.iter().filter(|j| j.index.is_some());
            let nearest = named.min_by(|a, b| away(a).total_cmp(&away(b))).filter(|j| away(j) <= reach)?;
            nearest.index.map(|(i, j)| (index.0 - i, index.1 - j))
        });
        self.connection = Connection::Followed;
        goes_on.unwrap_or_else(|| {
            self.connection = self.track.start();
            (0, 0)
        })
    }

    fn found(&self, estimate: &ThesisEstimate, pose: Pose) -> Found {
        let moved = pose.translation - estimate.pose.translation;
        let covariance: PoseCovariance = estimate.covariance.with_origin_moved(moved);
        let range_m = estimate.pose.translation.z;
        let net = NetPose {
            pose,
            covariance: covariance.matrix,
            range_m,
            distance_m: estimate.plane.distance,
            normal: estimate.plane.normal,
            sigma_range_m: estimate.covariance.sigma_range(&estimate.pose),
            sigma_tilt: estimate.covariance.sigma_tilt(&estimate.pose),
            sigma_xy_m: estimate.covariance.sigma_xy(&estimate.pose),
            sheet: None,
        };
        Found {
            net,
            probability: estimate.probability,
            track: self.track.number(),
            connection: self.connection,
            corrected: (0, 0),
            in_doubt: 0,
            vote: None,
        }
    }
}

/// The named junction nearest to the optical axis.
fn followed(junctions: &[Junction], camera: &Camera) -> Option<(Vector2<f64>, (i32, i32))> {
    let axis = Vector2::new(camera.cx(), camera.cy());
    let away = |j: &Junction| (j.pixel - axis).norm();
    let named = junctions.iter().filter(|j| j.index.is_some());
    let nearest = named.min_by(|a, b| away(a).total_cmp(&away(b)))?;
    Some((nearest.pixel, nearest.index?))
}
