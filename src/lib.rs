//! Where is the net? From one underwater camera: pose, junctions and motion of a fish net.
//!
//! This is the crate that a vehicle stack embeds: [`Camera`], [`Mesh`], [`Tracker`], [`Estimate`], [`Config`], [`Error`].
//! Frames, units and signs are those of [`net_geometry`].

mod config;
mod error;
mod estimate;
mod knots;
mod method;
mod motion;
mod prior;
#[cfg(feature = "smooth")]
pub mod smooth;
mod tracker;

pub use config::{Config, Method};
pub use error::{Error, Result};
pub use estimate::{Connection, Estimate, Layer, NetPose, Sheet, Status};
pub use net_flow::vote::{ShiftScore, Verdict, VoteResult};
pub use net_geometry::{Camera, Junction, JunctionState, Lens, Mesh, Plane, Pose};
pub use net_image::GrayView;
pub use net_junction::{Twine, TwineState};
pub use prior::MotionPrior;
pub use tracker::Tracker;
