use net_geometry::{Camera, Junction, Mesh};
use net_image::GrayView;

use crate::config::Config;
use crate::error::{Error, Result};
use crate::estimate::{Estimate, Status};

/// Follows one net through the frames of one camera. Owns all buffers: after the first frames an update allocates nothing.
#[derive(Debug)]
pub struct Tracker {
    camera: Camera,
    previous_ns: Option<i64>,
    junctions: Vec<Junction>,
}

impl Tracker {
    /// A tracker for pictures of `camera` that show a net of `mesh`.
    ///
    /// # Errors
    /// [`Error::Config`] for a parameter out of range.
    pub fn new(camera: Camera, _mesh: Mesh, config: &Config) -> Result<Self> {
        config.validate()?;
        Ok(Self { camera, previous_ns: None, junctions: Vec::new() })
    }

    /// The next frame, taken at `timestamp_ns` (ns since the Unix epoch).
    ///
    /// # Errors
    /// [`Error::Geometry`] for an image of another size than the camera's, [`Error::TimeOrder`] for a time that does not come
    /// after the frame before. The tracker is then as it was.
    pub fn update(&mut self, image: GrayView<'_>, timestamp_ns: i64) -> Result<Estimate<'_>> {
        self.camera.check_image_size(image.width() as u32, image.height() as u32)?;
        if let Some(previous_ns) = self.previous_ns.filter(|&p| timestamp_ns <= p) {
            return Err(Error::TimeOrder { timestamp_ns, previous_ns });
        }
        self.previous_ns = Some(timestamp_ns);
        Ok(Estimate { status: Status::NoNet, probability: 0.0, net: None, junctions: &self.junctions })
    }
}
