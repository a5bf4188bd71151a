//! The precise way: one lattice on one sheet over the whole picture, followed from frame to frame.

use net_geometry::nalgebra::Vector2;
use net_geometry::{Camera, Junction, Mesh};
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
    adjuster: NetAdjuster,
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
            adjuster: NetAdjuster::new(camera.width() as usize, camera.height() as usize, &AdjustConfig::default())?,
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
            self.list_junctions(image, &estimate, junctions)?;
        }
        Ok(Some(Found { net: net_pose(&estimate), probability: estimate.probability, track: self.track.number() }))
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
