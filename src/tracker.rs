use net_geometry::nalgebra::Vector2;
use net_geometry::{Camera, Junction, Mesh};
use net_image::GrayView;

use crate::config::{Config, Method};
use crate::error::{Error, Result};
use crate::estimate::{Connection, Estimate, Layer, Status};
use crate::method::lattice::LatticeMethod;
use crate::method::thesis::{PROBABILITY_THRESHOLD, ThesisMethod};
use crate::prior::MotionPrior;

/// Follows one net through the frames of one camera. Owns all buffers: after the first frames an update allocates nothing.
#[derive(Debug)]
pub struct Tracker {
    camera: Camera,
    method: Engine,
    threshold: f64,
    previous_ns: Option<i64>,
    /// Whether the last frame had a pose.
    posed: bool,
    junctions: Vec<Junction>,
    /// Whether to look for more than one net, and what was found.
    several: bool,
    layers: Vec<Layer>,
}

#[derive(Debug)]
enum Engine {
    Lattice(Box<LatticeMethod>),
    Thesis(Box<ThesisMethod>),
}

impl Tracker {
    /// A tracker for pictures of `camera` that show a net of `mesh`.
    ///
    /// # Errors
    /// [`Error::Lattice`] or [`Error::Thesis`] for a parameter out of range.
    pub fn new(camera: Camera, mesh: Mesh, config: &Config) -> Result<Self> {
        config.validate()?;
        let (method, threshold) = match config.method {
            Method::Lattice => {
                let method = LatticeMethod::new(&camera, &mesh, &config.lattice)?;
                (Engine::Lattice(Box::new(method)), config.lattice.probability_threshold)
            }
            Method::Thesis => {
                let method = ThesisMethod::new(&camera, &mesh, &config.thesis)?;
                (Engine::Thesis(Box::new(method)), PROBABILITY_THRESHOLD)
            }
        };
        Ok(Self {
            camera,
            method,
            threshold,
            previous_ns: None,
            posed: false,
            junctions: Vec::new(),
            several: config.layers,
            layers: Vec::new(),
        })
    }

    /// The next frame, taken at `timestamp_ns` (ns since the Unix epoch).
    ///
    /// # Errors
    /// [`Error::Geometry`] for an image of another size than the camera's, [`Error::TimeOrder`] for a time that does not come
    /// after the frame before. The tracker is then as it was.
    pub fn update(&mut self, image: GrayView<'_>, timestamp_ns: i64) -> Result<Estimate<'_>> {
        self.next(image, timestamp_ns, None)
    }

    /// The same with the caller's prediction of the camera's motion since the last update. Steps of most of a cell between frames are then no riddle, and the net may be out of view for a
    /// while: what priors say of the frames in between adds up. A prior that the picture contradicts decides nothing: the picture's own count is taken, or a new one begins.
    /// [`crate::Method::Thesis`] takes no notice of it.
    ///
    /// # Errors
    /// As [`Tracker::update`]; [`Error::Prior`] for what is no motion.
    pub fn update_with_prior(
        &mut self,
        image: GrayView<'_>,
        timestamp_ns: i64,
        prior: &MotionPrior,
    ) -> Result<Estimate<'_>> {
        prior.validate()?;
        self.next(image, timestamp_ns, Some(prior))
    }

    fn next(&mut self, image: GrayView<'_>, timestamp_ns: i64, prior: Option<&MotionPrior>) -> Result<Estimate<'_>> {
        // A side past u32 cannot be a calibrated camera's either.
        let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        self.camera.check_image_size(side(image.width()), side(image.height()))?;
        if let Some(previous_ns) = self.previous_ns.filter(|&p| timestamp_ns <= p) {
            return Err(Error::TimeOrder { timestamp_ns, previous_ns });
        }
        self.previous_ns = Some(timestamp_ns);
        self.junctions.clear();
        let found = match &mut self.method {
            Engine::Lattice(method) => method.update(image, timestamp_ns, prior, &mut self.junctions)?,
            Engine::Thesis(method) => method.update(image, &mut self.junctions)?,
        };
        let (probability, track) = found.map_or((0.0, 0), |f| (f.probability, f.track));
        let connection = found.map_or(Connection::Followed, |f| f.connection);
        let (corrected, in_doubt) = found.map_or(((0, 0), 0), |f| (f.corrected, f.in_doubt));
        let vote = found.and_then(|f| f.vote);
        let net = found.filter(|f| f.probability >= self.threshold).map(|f| f.net);
        self.posed = net.is_some();
        let status = if self.posed { Status::Ok } else { Status::NoNet };
        self.layers.clear();
        if let (Some(net), true) = (net, self.several) {
            self.layers.push(Layer { net, probability, followed: true });
            let other = match &mut self.method {
                Engine::Lattice(method) => method.another(image)?.filter(|layer| layer.probability >= self.threshold),
                Engine::Thesis(_) => None,
            };
            self.layers.extend(other);
            self.layers.sort_by(|a, b| a.net.range_m.total_cmp(&b.net.range_m));
        }
        let twines = match &self.method {
            Engine::Lattice(method) if self.posed => method.twines(),
            _ => &[],
        };
        let (junctions, layers) = (&self.junctions, &self.layers);
        Ok(Estimate {
            status,
            probability,
            net,
            track,
            connection,
            corrected,
            in_doubt,
            vote,
            junctions,
            twines,
            layers,
        })
    }

    /// Where a point of the lattice (fractions included) is in the last frame: its pixel, lens distortion included, and its depth along the optical axis, m. On the sheet as
    /// it hangs, bent or sheared. `None` for what is not in front of the camera, if that frame had no pose, and for methods without a sheet.
    pub fn pixel_from_lattice(&self, at: Vector2<f64>) -> Option<(Vector2<f64>, f64)> {
        match &self.method {
            Engine::Lattice(method) if self.posed => method.pixel_from_lattice(at),
            _ => None,
        }
    }

    /// The same pixel by the knots that were measured, bilinear between them, and a little beyond. Where the sheet misfits, this is where the net is. `None` where no knot is near.
    pub fn pixel_by_knots(&self, at: Vector2<f64>) -> Option<Vector2<f64>> {
        match &self.method {
            Engine::Lattice(method) if self.posed => method.pixel_by_knots(at),
            _ => None,
        }
    }

    /// Lattice coordinates of what the optical axis meets in the last frame; `None` as above.
    pub fn lattice_at_axis(&self) -> Option<Vector2<f64>> {
        match &self.method {
            Engine::Lattice(method) if self.posed => method.lattice_at_axis(),
            _ => None,
        }
    }
}
