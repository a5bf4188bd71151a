//! Geometry of looking at a net: camera, mesh, pose, plane, and what links them.
//!
//! # Conventions
//! Every crate, the command line, Python and the files agree on these.
//!
//! - **Camera frame**: x right, y down, z forward (OpenCV and ROS optical frame).
//! - **Pixels** `(u, v)`: u right, v down; the centre of the top-left pixel is `(0, 0)`.
//! - **Net frame**: the net is the plane `Z = 0` (of a bent net: its tangent plane at the optical axis). X runs along the first
//!   mesh direction, the one nearest to the image's u axis; Y completes the right-handed frame; Z points away from the camera.
//! - **Pose** is net to camera: `X_cam = R * X_net + t`. Lattice node `(i, j)` lies at `i a1 + j a2` in the net plane.
//! - **Units**: metres, radians, nanoseconds since the Unix epoch. Degrees only in files and on screen, and then the name says so.
//! - **Names**: `camera_from_net` maps net coordinates to camera coordinates, so that `a_from_c = a_from_b * b_from_c`.

mod angles;
mod basis;
mod camera;
mod covariance;
mod dbscan;
mod error;
mod homography;
mod junction;
mod lattice;
mod lens;
mod mesh;
mod nearest;
mod plane;
mod pnp;
mod pose;

pub use angles::ZyxAngles;
pub use basis::{Basis, WaveVector};
pub use camera::Camera;
pub use covariance::PoseCovariance;
pub use dbscan::Dbscan;
pub use error::{Error, Result};
pub use homography::Homography;
pub use junction::{Junction, JunctionState};
pub use lattice::{Lattice, VisibleNode};
pub use lens::Lens;
pub use mesh::Mesh;
pub use nearest::NearestPoints;
pub use plane::Plane;
pub use pnp::{PlanarPose, planar_pnp};
pub use pose::Pose;

pub use nalgebra;
