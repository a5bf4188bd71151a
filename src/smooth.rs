//! Poses smoothed over time, as frames come in or a run at once: [`net_track`] fed with estimates.
//!
//! ```no_run
//! use netpose::smooth::{Answer, Config, FixedLag};
//! # fn frames() -> Vec<(i64, Vec<u8>)> { Vec::new() }
//! # let camera = netpose::Camera::new(600.0, 600.0, 423.5, 239.5, 848, 480, netpose::Lens::None)?;
//!
//! let mesh = netpose::Mesh::square(0.05)?;
//! let mut tracker = netpose::Tracker::new(camera, mesh, &netpose::Config::default())?;
//! let mut smoother = FixedLag::new(&Config::default())?;
//! for (timestamp_ns, pixels) in frames() {
//!     let view = netpose::GrayView::new(&pixels, 848, 480, 848)?;
//!     let sample = tracker.update(view, timestamp_ns)?.sample(timestamp_ns, &mesh);
//!     // Ten frames late. Nobody can look at the pictures again: a slip that the motion suggests parts the run.
//!     for (frame, pose) in smoother.push(&sample, |_| Answer::UNKNOWN)?.poses {
//!         println!("{frame}: {:?} m/s", pose.map(|p| p.velocity));
//!     }
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use net_geometry::Mesh;
use net_geometry::nalgebra::Vector2;
pub use net_track::*;

use crate::estimate::{Connection, Estimate};

impl Estimate<'_> {
    /// This frame for a smoother: its pose, unless it has none or its count is in doubt, and its time, ns.
    pub fn sample(&self, timestamp_ns: i64, mesh: &Mesh) -> Sample {
        let net = self.net.filter(|_| self.connection != Connection::Doubted);
        let measurement = net.map(|net| {
            let (sin, cos) = net.sheet.map_or(mesh.angle(), |sheet| sheet.crossing_angle).sin_cos();
            Measurement {
                pose: net.pose,
                covariance: net.covariance,
                probability: self.probability,
                lattice: [Vector2::new(mesh.side1(), 0.0), Vector2::new(cos, sin) * mesh.side2()],
                track: self.track,
            }
        });
        Sample { timestamp_ns, measurement, increment: None }
    }
}
