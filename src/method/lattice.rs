//! The precise way: one lattice on one sheet over the whole picture, followed from frame to frame.

use net_flow::vote::{CellVote, VoteConfig, VoteResult};
use net_flow::{FlowTracker, Hints, Motion as FlowMotion, Status};
use net_geometry::nalgebra::Vector2;
use net_geometry::{Camera, Junction, Mesh, Pose};
use net_image::GrayView;
use net_junction::{AdjustConfig, LatticeMap, NetAdjuster, Twine};
use net_lattice::{LatticeEstimate, LatticeEstimator};

use crate::error::Result;
use crate::estimate::{Layer, NetPose, Sheet};
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
    vote: CellVote,
    /// The last answer that was vouched for, and when.
    last: Option<(i64, LatticeEstimate)>,
    /// When the frame was taken that the flow starts from, if its answer was vouched for.
    flow_from: Option<i64>,
    adjuster: NetAdjuster,
}

/// Distance, cells, between predicted and found lattice above which a count is not carried over a gap.
const COUNTED_ON_CELLS: f64 = 0.3;

/// Farthest, cells, that a followed lattice may lie from where it was predicted.
const FOLLOWED_CELLS: f64 = 0.2;
/// Farthest, as cosine, that its normal may have turned from the predicted one: 2 degrees.
const FOLLOWED_COSINE: f64 = 0.99939;

/// Longest time over which names are carried on without a velocity.
const LONGEST_GAP_NS: i64 = 1_000_000_000;

/// How the nodes of a frame got their names.
#[derive(Debug, Clone, Copy)]
enum Naming {
    /// Where they were predicted, within a fraction of a cell.
    Sure,
    /// The likeliest; may be off by whole cells.
    Guess,
    /// Nothing to go by.
    New,
}

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
            vote: CellVote::new(&VoteConfig::default())?,
            last: None,
            flow_from: None,
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
        // A steady motion says where the lattice is to a fraction of a cell, which is what following takes.
        let predicted = self.motion.predict(timestamp_ns);
        let mut found = None;
        if let Some(pose) = &predicted {
            let followed = self.estimator.update(image, pose)?;
            let followed = followed.filter(|e| e.probability >= self.threshold && is_near(e, pose));
            found = followed.map(|estimate| (estimate, Naming::Sure));
        }
        if found.is_none() {
            found = self.estimator.estimate(image)?.map(|estimate| {
                let flow = step.motion.map(|motion| (motion, step.status == Status::Tracked));
                self.name(estimate, timestamp_ns, predicted.as_ref(), flow)
            });
        }
        let Some((mut estimate, naming)) = found else {
            self.flow_from = None;
            return Ok(None);
        };
        let vouched = estimate.probability >= self.threshold;
        if vouched {
            estimate = self.judge(image, estimate, naming);
            self.motion.observe(timestamp_ns, &estimate.pose);
            self.estimator.follow_on(&estimate);
            self.list_junctions(image, &estimate, junctions)?;
        }
        let answer = Found { net: net_pose(&estimate), probability: estimate.probability, track: self.track.number() };
        self.flow_from = vouched.then_some(timestamp_ns);
        if vouched {
            self.last = Some((timestamp_ns, estimate));
        }
        Ok(Some(answer))
    }

    /// Names for a sheet found anew: as predicted, else as the picture flowed, else as if nothing had moved.
    fn name(
        &self,
        estimate: LatticeEstimate,
        timestamp_ns: i64,
        predicted: Option<&Pose>,
        flow: Option<(FlowMotion, bool)>,
    ) -> (LatticeEstimate, Naming) {
        let named = |pose: &Pose, sure: bool| {
            let (named, off) = estimate.counted_on(pose)?;
            Some((named, if sure && off < COUNTED_ON_CELLS { Naming::Sure } else { Naming::Guess }))
        };
        let recent = self.last.as_ref().filter(|(then, _)| timestamp_ns.saturating_sub(*then) <= LONGEST_GAP_NS);
        let by_flow = || {
            let (then, last) = recent?;
            let (motion, tracked) = flow.filter(|_| self.flow_from == Some(*then))?;
            named(&self.pose_after(last, &motion)?, tracked)
        };
        let by_rest = || named(&recent?.1.pose, false);
        let found = predicted.and_then(|pose| named(pose, true)).or_else(by_flow).or_else(by_rest);
        found.unwrap_or((estimate, Naming::New))
    }

    /// What does not repeat has the last word on the count of cells; where it is silent, a guess is a new count.
    fn judge(&mut self, image: GrayView<'_>, estimate: LatticeEstimate, naming: Naming) -> LatticeEstimate {
        if matches!(naming, Naming::New) {
            self.vote.reset();
        }
        let camera = self.estimator.camera();
        let middle = SheetMap { estimate: &estimate, camera }.seed();
        let vote = middle.map(|middle| {
            self.vote.update(image, middle, |ij| estimate.pixel_from_lattice(camera, ij).map(|(pixel, _)| pixel))
        });
        let correction = vote.as_ref().and_then(VoteResult::correction);
        match (naming, vote, correction) {
            (Naming::New, ..) | (Naming::Guess, _, None) => self.restart(),
            // Sure enough without a vote.
            (Naming::Sure, _, None) => (),
            // The frames before this one were numbered right, or are not in doubt.
            (_, _, Some((0, 0))) => (),
            (Naming::Guess, Some(vote), Some(cells)) if vote.frames == 1 && vote.dropped == 0 => {
                return estimate.renumbered(cells);
            }
            // Numbers were given that now prove wrong by whole cells: those go under the old count, these under a new one.
            (_, _, Some(cells)) => {
                self.restart();
                return estimate.renumbered(cells);
            }
        }
        estimate
    }

    /// The net before or behind the one of the last frame that had a pose, in that frame's picture.
    pub fn another(&mut self, image: GrayView<'_>) -> Result<Option<Layer>> {
        let Some((_, first)) = &self.last else { return Ok(None) };
        let other = self.estimator.another(image, first)?;
        Ok(other.map(|e| Layer { net: net_pose(&e), probability: e.probability, followed: false }))
    }

    /// The twines of the last frame that had a pose.
    pub fn twines(&self) -> &[Twine] {
        self.adjuster.twines()
    }

    /// Pixel and depth, m, of a lattice point in the last frame that had a pose.
    pub fn pixel_from_lattice(&self, at: Vector2<f64>) -> Option<(Vector2<f64>, f64)> {
        self.last.as_ref()?.1.pixel_from_lattice(self.estimator.camera(), at)
    }

    /// Lattice coordinates at the optical axis in the last frame that had a pose.
    pub fn lattice_at_axis(&self) -> Option<Vector2<f64>> {
        let camera = self.estimator.camera();
        self.last.as_ref()?.1.lattice_from_pixel(camera, Vector2::new(camera.cx(), camera.cy()))
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
