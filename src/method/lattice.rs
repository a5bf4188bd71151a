//! The precise way: one lattice on one sheet over the whole picture, followed from frame to frame.

use net_flow::{FlowTracker, Hints, Motion as FlowMotion, Status};
use net_geometry::nalgebra::Vector2;
use net_geometry::{Camera, Junction, Mesh, Pose};
use net_image::GrayView;
use net_junction::{AdjustConfig, LatticeMap, NetAdjuster};
use net_lattice::{LatticeEstimate, LatticeEstimator};

use crate::error::Result;
use crate::estimate::{NetPose, Sheet};
use crate::method::{Found, Track};
use crate::motion::Motion;

/// Follows the lattice; starts anew when it is lost.
#[derive(Debug)]
pub(crate) struct LatticeMethod {
    estimator: LatticeEstimator,
    threshold: f64,
    motion: Motion,
    track: Track,
    flow: FlowTracker,
    /// The last frame's answer, if it was vouched for.
    last: Option<LatticeEstimate>,
    adjuster: NetAdjuster,
}

/// Distance, cells, between predicted and found lattice above which a count is not carried over a gap.
const COUNTED_ON_CELLS: f64 = 0.3;

/// Farthest, cells, that a followed lattice may lie from where it was predicted.
const FOLLOWED_CELLS: f64 = 0.2;
/// Farthest, as cosine, that its normal may have turned from the predicted one: 2 degrees.
const FOLLOWED_COSINE: f64 = 0.99939;

/// Whether a followed answer is what was predicted, nearly. One that is not may have locked half a cell aside at the rim: look anew.
fn is_near(followed: &LatticeEstimate, predicted: &Pose) -> bool {
    let same_names = |named: &LatticeEstimate| (named.pose.translation - followed.pose.translation).norm() < 1e-9;
    followed.pose.normal().dot(&predicted.normal()) > FOLLOWED_COSINE
        && followed.counted_on(predicted).is_some_and(|(named, off)| off < FOLLOWED_CELLS && same_names(&named))
}

impl LatticeMethod {
    pub fn new(camera: &Camera, mesh: &Mesh, config: &net_lattice::Config) -> Result<Self> {
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        Ok(Self {
            estimator: LatticeEstimator::new(camera, mesh, config)?,
            threshold: config.probability_threshold,
            motion: Motion::default(),
            track: Track::default(),
            flow: FlowTracker::new(width, height, &net_flow::Config::default())?,
            last: None,
            adjuster: NetAdjuster::new(width, height, &AdjustConfig::default())?,
        })
    }

    /// The next frame; `None` when there is nothing like a net. Fills `junctions` when the pose can be vouched for.
    pub fn update(
        &mut self,
        image: GrayView<'_>,
        timestamp_ns: i64,
        junctions: &mut Vec<Junction>,
    ) -> Result<Option<Found>> {
        let step = self.flow.update(image, &Hints::default())?.step;
        let (flow_status, flow_motion) = (step.status, step.motion);
        // A steady motion says where the lattice is to a fraction of a cell, which is what following takes.
        let predicted = self.motion.predict(timestamp_ns);
        let mut found = None;
        if let Some(pose) = &predicted {
            let followed = self.estimator.update(image, pose)?;
            found = followed.filter(|e| e.probability >= self.threshold && is_near(e, pose));
        }
        if found.is_none() {
            found = self.estimator.estimate(image)?;
            if let Some(estimate) = found.as_mut().filter(|e| e.probability >= self.threshold) {
                let carried = match predicted {
                    Some(pose) => Some((pose, true)),
                    None => self.last.as_ref().zip(flow_motion).and_then(|(last, motion)| {
                        Some((self.pose_after(last, &motion)?, flow_status == Status::Tracked))
                    }),
                };
                let counted = carried.and_then(|(pose, sure)| {
                    let (named, off) = estimate.counted_on(&pose)?;
                    Some((named, sure && off < COUNTED_ON_CELLS))
                });
                match counted {
                    Some((named, sure)) => {
                        *estimate = named;
                        // The likeliest count goes on, under a new number: it may be off by whole cells.
                        if !sure {
                            self.restart();
                        }
                    }
                    None => self.restart(),
                }
            }
        }
        let Some(estimate) = found else {
            self.last = None;
            return Ok(None);
        };
        let answer = Found { net: net_pose(&estimate), probability: estimate.probability, track: self.track.number() };
        if estimate.probability >= self.threshold {
            self.motion.observe(timestamp_ns, &estimate.pose);
            self.estimator.follow_on(&estimate);
            self.list_junctions(image, &estimate, junctions)?;
            self.last = Some(estimate);
        } else {
            self.last = None;
        }
        Ok(Some(answer))
    }

    /// A new count. What was renamed has no velocity: the change of names would look like one.
    fn restart(&mut self) {
        self.track.start();
        self.motion = Motion::default();
    }

    /// The last pose, moved along the net as the picture moved about the optical axis.
    fn pose_after(&self, last: &LatticeEstimate, motion: &FlowMotion) -> Option<Pose> {
        let camera = self.estimator.camera();
        let axis = Vector2::new(camera.cx(), camera.cy());
        let before = last.lattice_from_pixel(camera, motion.inverse()?.apply(axis))?;
        let moved = before - last.lattice_from_pixel(camera, axis)?;
        let (sin, cos) = last.crossing_angle.sin_cos();
        let step = Vector2::new(moved.x * last.sides[0] + moved.y * last.sides[1] * cos, moved.y * last.sides[1] * sin);
        Some(Pose { translation: last.pose.translation - last.pose.rotation * step.push(0.0), ..last.pose })
    }

    /// The knots in view: predicted by the sheet, adjusted to the picture one by one.
    fn list_junctions(
        &mut self,
        image: GrayView<'_>,
        estimate: &LatticeEstimate,
        junctions: &mut Vec<Junction>,
    ) -> Result<()> {
        let map = SheetMap { estimate, camera: self.estimator.camera() };
        junctions.extend_from_slice(self.adjuster.adjust(image, &map)?);
        Ok(())
    }
}

/// The fitted sheet as a prediction of every node's pixel.
struct SheetMap<'a> {
    estimate: &'a LatticeEstimate,
    camera: &'a Camera,
}

impl LatticeMap for SheetMap<'_> {
    fn pixel(&self, i: f64, j: f64) -> Option<Vector2<f64>> {
        self.estimate.pixel_from_lattice(self.camera, Vector2::new(i, j)).map(|(pixel, _)| pixel)
    }

    fn pixels_per_metre(&self, i: f64, j: f64) -> Option<f64> {
        let (_, depth) = self.estimate.pixel_from_lattice(self.camera, Vector2::new(i, j))?;
        Some(0.5 * (self.camera.fx() + self.camera.fy()) / depth)
    }

    fn seed(&self) -> Option<(i32, i32)> {
        let axis = Vector2::new(self.camera.cx(), self.camera.cy());
        let at = self.estimate.lattice_from_pixel(self.camera, axis).filter(|at| at.amax() < 1e6)?;
        Some((at.x.round() as i32, at.y.round() as i32))
    }
}

fn net_pose(e: &LatticeEstimate) -> NetPose {
    let normal = e.pose.normal();
    NetPose {
        pose: e.pose,
        covariance: e.covariance,
        range_m: e.range,
        distance_m: e.range * normal.z,
        normal,
        sigma_range_m: e.range_sigma,
        sigma_tilt: e.tilt_sigma,
        sigma_xy_m: e.xy_sigma,
        sheet: Some(Sheet {
            crossing_angle: e.crossing_angle,
            sigma_crossing_angle: e.crossing_angle_sigma,
            curvatures_per_m: e.curvatures,
        }),
    }
}
