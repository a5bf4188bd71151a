//! Motion along a net over a whole run: poses smoothed by a convex program, slipped cells found, verified and repaired.
//!
//! A lattice says where the camera is to a millimetre, modulo one cell; which cell is a matter of counting. Errors are therefore of three kinds, and each has its own term:
//! small ones with a known covariance (least squares), wrong poses (Huber's loss), and a count that is wrong by whole cells *from some frame on* (an L1 price on its steps).
//! Motion joins the frames: speed and turning change by white accelerations, within bounds. All of it is one second-order-cone program (see `program.rs`), solved by
//! [clarabel](https://clarabel.org) on one thread: the same input gives the same output. Conventions are those of [`net_geometry`].
//!
//! # Steps
//! 1. [`Sample`]s are checked and parted where the count begins anew or too much time passes: [`Gap`].
//! 2. A program with free slips proposes steps by whole cells; each is rounded, and weighed by the likelihood it gains: [`Suspect`].
//! 3. The caller's verifier (the vote on the pictures, see `net_flow::vote`) answers. Confirmed slips are applied; at all others the run is parted. Both are a [`Repair`].
//! 4. Programs over overlapping windows give the poses, a block-tridiagonal inverse their covariances: [`Smoothed`].
//!
//! [`smooth`] does a whole run, [`FixedLag`] does the same as frames come in.
//!
//! ```
//! use net_geometry::nalgebra::{Matrix6, Rotation3, Vector2, Vector3};
//! use net_geometry::Pose;
//! use net_track::{Answer, Config, Measurement, Origin, Sample, smooth};
//!
//! // Half a second at 0.2 m/s along X, 1.5 m from the net; the fourth frame has no pose.
//! let samples: Vec<Sample> = (0..6)
//!     .map(|k| {
//!         let pose = Pose { rotation: Rotation3::identity(), translation: Vector3::new(-0.02 * f64::from(k), 0.0, 1.5) };
//!         let lattice = [Vector2::new(0.05, 0.0), Vector2::new(0.0, 0.05)];
//!         let measurement = Measurement { pose, covariance: Matrix6::identity() * 1e-6, probability: 0.99, lattice, track: 0 };
//!         Sample {
//!             timestamp_ns: 100_000_000 * i64::from(k),
//!             measurement: (k != 3).then_some(measurement),
//!             increment: None,
//!         }
//!     })
//!     .collect();
//! let run = smooth(&samples, &Config::default(), |_| Answer::UNKNOWN)?;
//! let fourth = run.poses[3].ok_or("between two measured frames")?;
//! assert_eq!(fourth.origin, Origin::Interpolated);
//! assert!((fourth.pose.camera_in_net().x - 0.06).abs() < 1e-4 && (fourth.velocity.x - 0.2).abs() < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What is not safe
//! - A count that is wrong by the *same* number of cells in every frame is a steady velocity, and motion cannot object. Only the vote, or an [`Increment`] from a source that does not count
//!   cells, tells.
//! - Covariances of smoothed poses take the frames' errors as independent. What errors share (calibration, shading, a mesh size that is wrong) does not average out.
//! - A slip in the last three frames of a stretch looks like an outlier.
//! - Slips are told from motion by the vehicle's restlessness ([`Config::acceleration_density`]): a vehicle that is pushed by a cell within a frame gives suspects, which the verifier must refute.

mod config;
mod error;
mod marginals;
mod online;
mod program;
mod result;
mod sample;
mod slips;
mod smoother;
mod state;

pub use config::Config;
pub use error::{Error, Result};
pub use online::{FixedLag, Ready};
pub use result::{Answer, Gap, GapReason, Origin, Repair, Smoothed, Suspect, Trajectory, Verdict};
pub use sample::{Increment, Measurement, Sample};
pub use smoother::smooth;
