//! The precise way: one lattice on one sheet over the whole picture, followed from frame to frame.

use net_flow::{FlowTracker, Hints, Mode, Motion as FlowMotion, Status};
use net_geometry::nalgebra::Vector2;
use net_geometry::{Camera, Junction, Mesh, Pose};
use net_image::GrayView;
use net_junction::{AdjustConfig, LatticeMap, NetAdjuster, Twine};
use net_lattice::{LatticeEstimate, LatticeEstimator};

use crate::error::Result;
use crate::estimate::{Connection, Layer, NetPose, Sheet};
use crate::knots::Knots;
use crate::method::Found;
use crate::method::count::{CellCount, Counted, Naming};
use crate::motion::Motion;
use crate::prior::MotionPrior;

/// Follows the lattice; starts anew when it is lost.
#[derive(Debug)]
pub(crate) struct LatticeMethod {
    estimator: LatticeEstimator,
    threshold: f64,
    motion: Motion,
    count: CellCount,
    flow: FlowTracker,
    /// The last answer whose lattice was known, and when. Its cells are counted even where its normal is too doubtful to vouch for a pose.
    last: Option<(i64, LatticeEstimate)>,
    /// Frames since.
    frames_since: u32,
    /// When the frame was taken that the flow starts from, if its lattice was known.
    flow_from: Option<i64>,
    /// What became of the count in frames without a pose, to be said with the next pose.
    unsaid: Option<Connection>,
    /// Whether the velocity spans a count begun anew that nothing has proved since.
    velocity_in_doubt: bool,
    adjuster: NetAdjuster,
    /// Twines of the last answer, and where its lattice is by the knots that were measured.
    twines: Vec<Twine>,
    knots: Knots,
}

/// Distance, cells, between predicted and found lattice above which a count is not carried over a gap.
const COUNTED_ON_CELLS: f64 = 0.3;

/// Farthest, cells, that a followed lattice may lie from where it was predicted.
const FOLLOWED_CELLS: f64 = 0.2;
/// Farthest, as cosine, that its normal may have turned from the predicted one: 2 degrees.
const FOLLOWED_COSINE: f64 = 0.99939;

/// Longest time over which names are carried on without a velocity.
const LONGEST_GAP_NS: i64 = 1_000_000_000;
/// Most frames without a pose after which the net may be guessed where it was: at a cell a frame the fourth after it is still within the vote's reach. Where the
/// right shift is out of reach the vote may be sure of a wrong one.
const LONGEST_GAP_FRAMES: u32 = 3;

/// Twines that there is room for from the start.
const TWINES: usize = 16384;

/// Largest standard deviation of a prior, cells, that names nodes by itself: three of them are half a cell.
const SURE_PRIOR_CELLS: f64 = 1.0 / 6.0;

/// Where the net may be, by witness, with how sure its names are.
#[derive(Debug, Clone, Copy)]
struct Expected {
    /// Whether the caller gave a prior.
    by_prior: bool,
    /// By a sure prior, else at constant velocity, else by a vague prior.
    first: Option<(Pose, Naming)>,
    /// At constant velocity.
    steady: Option<(Pose, Naming)>,
    /// As the picture flowed, and whether no other cell was as likely by that.
    flowed: Option<(Pose, bool)>,
    /// As if nothing had moved.
    rest: Option<Pose>,
}

impl Expected {
    /// With a prior: whether another witness that is sure of itself gives other names.
    fn contradicts(&self, named: &LatticeEstimate) -> bool {
        let other = |pose: &Pose| named.counted_on(pose).is_some_and(|(other, _)| !same_names(&other, named));
        let steady = self.steady.filter(|(_, naming)| *naming == Naming::Sure).map(|(pose, _)| pose);
        let flowed = self.flowed.filter(|(_, alone)| *alone).map(|(pose, _)| pose);
        self.by_prior && (steady.as_ref().is_some_and(other) || flowed.as_ref().is_some_and(other))
    }
}

/// Names for a sheet found anew: as predicted, else as the picture flowed, else as if nothing had moved.
fn name(estimate: LatticeEstimate, expected: &Expected) -> (LatticeEstimate, Naming) {
    let named = |(pose, naming): (Pose, Naming)| {
        let (named, off) = estimate.counted_on(&pose)?;
        Some((named, if off < COUNTED_ON_CELLS { naming } else { Naming::Guess }))
    };
    // The flow is sure of itself too often where a net behind moves along.
    let guess = |pose: Option<Pose>| pose.and_then(|pose| named((pose, Naming::Guess)));
    let found = expected.first.and_then(named);
    let found = found.or_else(|| guess(expected.flowed.map(|(pose, _)| pose))).or_else(|| guess(expected.rest));
    found.unwrap_or((estimate, Naming::New))
}

fn same_names(a: &LatticeEstimate, b: &LatticeEstimate) -> bool {
    (a.pose.translation - b.pose.translation).norm() < 1e-9
}

/// Whether a followed answer is what was predicted, nearly. One that is not may have locked half a cell aside at the rim: look anew.
fn is_near(followed: &LatticeEstimate, predicted: &Pose) -> bool {
    followed.pose.normal().dot(&predicted.normal()) > FOLLOWED_COSINE
        && followed
            .counted_on(predicted)
            .is_some_and(|(named, off)| off < FOLLOWED_CELLS && same_names(&named, followed))
}

impl LatticeMethod {
    pub fn new(camera: &Camera, mesh: &Mesh, config: &net_lattice::Config) -> Result<Self> {
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        Ok(Self {
            estimator: LatticeEstimator::new(camera, mesh, config)?,
            threshold: config.probability_threshold,
            motion: Motion::default(),
            count: CellCount::new()?,
            flow: FlowTracker::new(width, height, &net_flow::Config { mode: Mode::Summed, ..Default::default() })?,
            last: None,
            frames_since: 0,
            flow_from: None,
            unsaid: None,
            velocity_in_doubt: false,
            adjuster: NetAdjuster::new(width, height, &AdjustConfig::default())?,
            twines: Vec::with_capacity(TWINES),
            knots: Knots::new(),
        })
    }

    /// The next frame; `None` when there is nothing like a net. Fills `junctions` when the pose can be vouched for.
    pub fn update(
        &mut self,
        image: GrayView<'_>,
        timestamp_ns: i64,
        prior: Option<&MotionPrior>,
        junctions: &mut Vec<Junction>,
    ) -> Result<Option<Found>> {
        self.motion.carry(prior);
        self.frames_since = self.frames_since.saturating_add(1);
        let mut expected = self.expect(timestamp_ns);
        // A prior, or a steady motion, says where the lattice is to a fraction of a cell, which is what following takes.
        let mut found = None;
        if let Some((pose, naming)) = &expected.first {
            let followed = self.estimator.update(image, pose)?;
            let followed = followed.filter(|e| e.probability >= self.threshold && is_near(e, pose));
            found = followed.map(|estimate| (estimate, *naming));
        }
        // How the picture flowed matters only where nothing surer tells, or against a prior that stands alone.
        let steady = expected.steady.is_some_and(|(_, naming)| naming == Naming::Sure);
        if found.is_none() || (expected.by_prior && !steady) {
            self.flow(image, &mut expected)?;
        } else {
            self.flow.pass(image)?;
        }
        if found.is_none() {
            found = self.estimator.estimate(image)?.map(|estimate| name(estimate, &expected));
        }
        // Who contradicts leaves a guess.
        if let Some((estimate, naming)) = &mut found
            && *naming == Naming::Sure
            && expected.first.is_some_and(|(_, naming)| naming == Naming::Sure)
            && expected.contradicts(estimate)
        {
            *naming = Naming::Guess;
        }
        let Some((mut estimate, naming)) = found else {
            self.flow_from = None;
            return Ok(None);
        };
        let vouched = estimate.probability >= self.threshold;
        let known = estimate.evidence.lattice_probability() >= self.threshold;
        let (mut connection, mut cells, mut in_doubt, mut vote) = (Connection::Followed, (0, 0), 0, None);
        if known {
            self.list_junctions(image, &estimate, junctions)?;
            let counted = self.count_cells(&estimate, naming, junctions);
            estimate = estimate.renumbered(counted.cells);
            (connection, cells, in_doubt) = (counted.connection, counted.cells, counted.in_doubt);
            vote = counted.vote;
            self.motion.observe(timestamp_ns, &estimate.pose);
            self.estimator.follow_on(&estimate);
        }
        let (net, probability, track) = (net_pose(&estimate), estimate.probability, self.count.track());
        self.flow_from = known.then_some(timestamp_ns);
        if known {
            self.last = Some((timestamp_ns, estimate));
            self.frames_since = 0;
        }
        if vouched {
            connection = self.say(connection);
        } else {
            junctions.clear();
            self.withhold(connection);
        }
        let carried_on = matches!(connection, Connection::Followed | Connection::Settled);
        let corrected = if carried_on { cells } else { (0, 0) };
        Ok(Some(Found { net, probability, track, connection, corrected, in_doubt, vote }))
    }

    /// How the count goes on to this pose from the one before, whatever happened in between.
    fn say(&mut self, connection: Connection) -> Connection {
        let unsaid = self.unsaid.take();
        if connection == Connection::Followed { unsaid.unwrap_or(connection) } else { connection }
    }

    /// Keeps what a frame without a pose says of the count. A doubt, and how it is settled, is said of every frame.
    fn withhold(&mut self, connection: Connection) {
        if matches!(connection, Connection::Started | Connection::Recognised | Connection::Restarted) {
            self.unsaid = Some(connection);
        }
    }

    /// Where the net may be, from the surest witness to the least; the flow, which takes its time, is not asked yet.
    fn expect(&self, timestamp_ns: i64) -> Expected {
        let naming = |sure: bool| if sure { Naming::Sure } else { Naming::Guess };
        let sides = [self.estimator.mesh().side1(), self.estimator.mesh().side2()];
        let prior = self.motion.by_prior().map(|(pose, sigma)| {
            let cells = (sigma.x / sides[0]).max(sigma.y / sides[1]);
            (pose, naming(cells < SURE_PRIOR_CELLS))
        });
        // Over frames without a pose a velocity is a guess.
        let by_velocity = match (self.gapless(), self.velocity_in_doubt) {
            (false, _) => Naming::Guess,
            (true, true) => Naming::Carried,
            (true, false) => Naming::Sure,
        };
        let steady = self.motion.predict(timestamp_ns).map(|pose| (pose, by_velocity));
        let recent = self.last.as_ref().filter(|(then, _)| {
            timestamp_ns.saturating_sub(*then) <= LONGEST_GAP_NS && self.frames_since <= LONGEST_GAP_FRAMES + 1
        });
        let rest = recent.map(|(_, last)| last.pose);
        // A vague prior is worth less than a velocity.
        let vague = prior.filter(|(_, naming)| *naming == Naming::Guess);
        let first = prior.filter(|(_, naming)| *naming == Naming::Sure).or(steady).or(vague);
        Expected { by_prior: prior.is_some(), first, steady, flowed: None, rest }
    }

    /// Whether the lattice was known in the frame before.
    fn gapless(&self) -> bool {
        self.last.as_ref().is_some_and(|(then, _)| self.flow_from == Some(*then))
    }

    /// Where the net may be as the picture flowed.
    fn flow(&mut self, image: GrayView<'_>, expected: &mut Expected) -> Result<()> {
        let step = self.flow.update(image, &Hints::default())?.step;
        let alone = step.status == Status::Tracked;
        if let (Some(motion), Some((_, last)), true) =
            (step.motion, &self.last, expected.rest.is_some() && self.gapless())
        {
            expected.flowed = self.pose_after(last, &motion).map(|pose| (pose, alone));
        }
        Ok(())
    }

    /// What does not repeat has the last word on the names of nodes; where it is silent, a guess is in doubt. Renames all but `estimate`.
    fn count_cells(&mut self, estimate: &LatticeEstimate, naming: Naming, junctions: &mut [Junction]) -> Counted {
        let camera = self.estimator.camera();
        self.knots.fill(junctions, |ij| estimate.pixel_from_lattice(camera, ij).map(|(pixel, _)| pixel));
        let middle = SheetMap { estimate, camera }.seed().unwrap_or_default();
        let (knots, gapless) = (&self.knots, self.gapless());
        let counted = self.count.update(self.flow.picture(), middle, naming, gapless, |ij| knots.pixel(ij));
        match counted.connection {
            Connection::Followed => {}
            // Names go on by the best guess. So does the velocity: it makes better guesses, but is none to rely on.
            Connection::Doubted => self.velocity_in_doubt = true,
            Connection::Restarted if naming != Naming::New && counted.cells == (0, 0) => self.velocity_in_doubt = true,
            // The vote tells the velocity as well.
            Connection::Settled | Connection::Restarted if counted.proven => {
                let net_shift =
                    estimate.renumbered(counted.cells_before).pose.camera_in_net() - estimate.pose.camera_in_net();
                self.motion.renumber(net_shift);
            }
            // What was renamed has no velocity: the change of names would look like one.
            _ => {
                self.motion = Motion::default();
                self.velocity_in_doubt = false;
            }
        }
        // A velocity that frames in doubt have told together is none to rely on before one look bears it out: they may have followed a net behind.
        let told_together = counted.connection == Connection::Settled && counted.cells != (0, 0);
        self.velocity_in_doubt = told_together || self.velocity_in_doubt && !counted.proven;
        if counted.cells != (0, 0) {
            let cells = counted.cells;
            let moved = |index: (i32, i32)| (index.0.saturating_add(cells.0), index.1.saturating_add(cells.1));
            junctions.iter_mut().for_each(|j| j.index = j.index.map(moved));
            self.twines.iter_mut().for_each(|t| t.index = moved(t.index));
            self.knots.renumber(cells);
        }
        counted
    }

    /// The net before or behind the one of the last frame whose lattice was known, in that frame's picture.
    pub fn another(&mut self, image: GrayView<'_>) -> Result<Option<Layer>> {
        let Some((_, first)) = &self.last else { return Ok(None) };
        let other = self.estimator.another(image, first)?;
        Ok(other.map(|e| Layer { net: net_pose(&e), probability: e.probability, followed: false }))
    }

    /// The twines of the last frame whose lattice was known.
    pub fn twines(&self) -> &[Twine] {
        &self.twines
    }

    /// Pixel of a lattice point by the measured knots of the last frame whose lattice was known.
    pub fn pixel_by_knots(&self, at: Vector2<f64>) -> Option<Vector2<f64>> {
        self.knots.pixel(at)
    }

    /// Pixel and depth, m, of a lattice point in the last frame whose lattice was known.
    pub fn pixel_from_lattice(&self, at: Vector2<f64>) -> Option<(Vector2<f64>, f64)> {
        self.last.as_ref()?.1.pixel_from_lattice(self.estimator.camera(), at)
    }

    /// Lattice coordinates at the optical axis in the last frame whose lattice was known.
    pub fn lattice_at_axis(&self) -> Option<Vector2<f64>> {
        let camera = self.estimator.camera();
        self.last.as_ref()?.1.lattice_from_pixel(camera, Vector2::new(camera.cx(), camera.cy()))
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
        self.twines.clear();
        self.twines.extend_from_slice(self.adjuster.twines());
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
        self.place(i, j).map(|(pixel, _)| pixel)
    }

    fn pixels_per_metre(&self, i: f64, j: f64) -> Option<f64> {
        self.place(i, j).map(|(_, scale)| scale)
    }

    fn place(&self, i: f64, j: f64) -> Option<(Vector2<f64>, f64)> {
        let (pixel, depth) = self.estimate.pixel_from_lattice(self.camera, Vector2::new(i, j))?;
        Some((pixel, 0.5 * (self.camera.fx() + self.camera.fy()) / depth))
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
            sigma_curvatures_per_m: e.curvature_sigmas,
            mean_plane: e.mean_plane,
            cell_margin: e.margin,
        }),
    }
}
