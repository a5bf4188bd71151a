use net_geometry::{Camera, Mesh, Pose};
use net_image::GrayView;

use crate::answer::estimate::LatticeEstimate;
use crate::answer::stages::Stages;
use crate::config::Config;
use crate::error::Result;
use crate::picture::view::View;
use crate::workspace::Workspace;

/// Finds a net in single pictures, and follows it.
///
/// Owns every plan and buffer. One estimator per camera and mesh.
#[derive(Debug)]
pub struct LatticeEstimator {
    camera: Camera,
    mesh: Mesh,
    pub(crate) config: Config,
    /// `None` when the picture is too small for a lattice.
    pub(crate) work: Option<Workspace>,
}
impl LatticeEstimator {
    /// Plans for one camera and mesh.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] names what is wrong in the configuration.
    pub fn new(camera: &Camera, mesh: &Mesh, config: &Config) -> Result<Self> {
        config.validate()?;
        let work = View::new(camera, config.working_pixels).map(|view| Workspace::new(camera, mesh, config, view));
        Ok(Self { camera: *camera, mesh: *mesh, config: config.clone(), work })
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The mesh.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Cold start: the net in one picture. `None` when nothing periodic was found at all; otherwise act on it only from
    /// [`Config::probability_threshold`] on.
    ///
    /// # Errors
    /// [`crate::Error::Geometry`] when the picture's size is not the camera's.
    pub fn estimate(&mut self, image: GrayView<'_>) -> Result<Option<LatticeEstimate>> {
        self.camera.check_image_size(image.width() as u32, image.height() as u32)?;
        let Some(work) = &mut self.work else { return Ok(None) };
        work.load(image);
        let found = work.cold(&self.config);
        work.last = found.as_ref().map(LatticeEstimate::followed);
        Ok(found)
    }

    /// The net in the next picture of a sequence, from where it was in the last one and the pose that is `predicted` for this one (net to
    /// camera; a constant-velocity prediction or the vehicle's own motion). The lattice is followed: the origin stays the node it was, so
    /// long as the prediction is off by less than half a cell across the picture's middle. `None` without a last picture, or when the net
    /// left the view; a low probability says that it was lost. Then start anew with [`LatticeEstimator::estimate`].
    ///
    /// # Errors
    /// [`crate::Error::Geometry`] when the picture's size is not the camera's.
    pub fn update(&mut self, image: GrayView<'_>, predicted: &Pose) -> Result<Option<LatticeEstimate>> {
        self.camera.check_image_size(image.width() as u32, image.height() as u32)?;
        let Some(work) = &mut self.work else { return Ok(None) };
        work.load(image);
        let found = work.follow(&self.config, predicted);
        work.last = found.as_ref().map(LatticeEstimate::followed);
        Ok(found)
    }

    /// Follows `estimate` in the next [`Self::update`]: for a caller that changed its names, see [`LatticeEstimate::counted_on`].
    pub fn follow_on(&mut self, estimate: &LatticeEstimate) {
        if let Some(work) = &mut self.work {
            work.last = Some(estimate.followed());
        }
    }

    /// The stages of the last picture. `None` if it was not a cold start, or nothing periodic was found.
    pub fn stages(&self) -> Option<&Stages> {
        self.work.as_ref()?.stages.as_ref()
    }

    /// Forgets the last picture.
    pub fn reset(&mut self) {
        if let Some(work) = &mut self.work {
            work.last = None;
        }
    }
}
