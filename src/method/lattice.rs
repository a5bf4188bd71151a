//! The precise way: one lattice on one sheet over the whole picture, followed from frame to frame.

use net_geometry::{Camera, Junction, JunctionState, Mesh};
use net_image::GrayView;
use net_lattice::{LatticeEstimate, LatticeEstimator, Node};

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
    nodes: Vec<Node>,
}

/// Distance, cells, between predicted and found lattice above which a count is not carried over a gap.
const COUNTED_ON_CELLS: f64 = 0.3;

impl LatticeMethod {
    pub fn new(camera: &Camera, mesh: &Mesh, config: &net_lattice::Config) -> Result<Self> {
        Ok(Self {
            estimator: LatticeEstimator::new(camera, mesh, config)?,
            threshold: config.probability_threshold,
            motion: Motion::default(),
            track: Track::default(),
            nodes: Vec::new(),
        })
    }

    /// The next frame; `None` when there is nothing like a net. Fills `junctions` when the pose can be vouched for.
    pub fn update(
        &mut self,
        image: GrayView<'_>,
        timestamp_ns: i64,
        junctions: &mut Vec<Junction>,
    ) -> Result<Option<Found>> {
        let predicted = self.motion.predict(timestamp_ns);
        let mut found = match &predicted {
            Some(pose) => self.estimator.update(image, pose)?.filter(|e| e.probability >= self.threshold),
            None => None,
        };
        if found.is_none() {
            found = self.estimator.estimate(image)?;
            if let Some(estimate) = found.as_mut().filter(|e| e.probability >= self.threshold) {
                match predicted.and_then(|pose| estimate.counted_on(&pose)).filter(|(_, off)| *off < COUNTED_ON_CELLS) {
                    Some((counted, _)) => *estimate = counted,
                    None => self.track.start(),
                }
            }
        }
        let Some(estimate) = found else { return Ok(None) };
        if estimate.probability >= self.threshold {
            self.motion.observe(timestamp_ns, &estimate.pose);
            self.estimator.follow_on(&estimate);
            self.list_junctions(&estimate, junctions);
        }
        Ok(Some(Found { net: net_pose(&estimate), probability: estimate.probability, track: self.track.number() }))
    }

    /// The nodes in view, where the sheet says they are.
    fn list_junctions(&mut self, estimate: &LatticeEstimate, junctions: &mut Vec<Junction>) {
        estimate.nodes_in_view(self.estimator.camera(), &mut self.nodes);
        junctions.extend(self.nodes.iter().map(|node| Junction {
            pixel: node.pixel,
            index: Some(node.index),
            sigma_px: NODE_JITTER_CELLS.hypot(NODE_NOISE_PX / node.cell_px) * node.cell_px,
            state: JunctionState::Seen,
        }));
    }
}

/// How far knots of a made net lie from their lattice, cells: 1 to 2 % is what twine and knotting leave.
const NODE_JITTER_CELLS: f64 = 0.02;
/// What the lattice's own place in the picture leaves, px.
const NODE_NOISE_PX: f64 = 0.1;

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
