//! Geometry of looking at a net: camera, mesh, pose, plane, and what links them. Pure mathematics: no images, no files.
//!
//! # Conventions
//! Every crate, the command line, Python and the files agree on these.
//!
//! - **Camera frame**: x right, y down, z forward (OpenCV and ROS optical frame).
//! - **Pixels** `(u, v)`: u right, v down; the centre of the top-left pixel is `(0, 0)`, so the image reaches from -0.5
//!   to its width less 0.5. A pixel is one of the image as it was read, lens distortion included.
//! - **Rays** are `(x, y, 1)` in the camera frame: points of the plane `z = 1`.
//! - **Net frame**: the net is the plane `Z = 0` (of a bent net: its tangent plane at the optical axis). X runs along
//!   the first mesh direction, the one nearest to the image's u axis; Y completes the right-handed frame; Z points away
//!   from the camera.
//! - **Pose** is net to camera: `X_cam = R * X_net + t`. Lattice node `(i, j)` lies at `i a1 + j a2` in the net plane,
//!   `a1` along X.
//! - **Perturbations** and covariances of a pose are in the camera frame, rotation (rad) before translation (m):
//!   `exp(w) R`, `t + d`.
//! - **Units**: metres, radians, nanoseconds since the Unix epoch. Degrees only in files and on screen, and then the
//!   name says so.
//! - **Names**: `camera_from_net` maps net coordinates to camera coordinates, so that `a_from_c = a_from_b * b_from_c`.
//!
//! # From pixels to a net
//! 1. [`Camera`] with its [`Lens`] turns pixels into rays and points into pixels, with Jacobians. What a model cannot
//!    answer is `None`: a wrong ray is worse than none.
//! 2. [`Basis`] turns wave vectors of a spectrum into lattice vectors in the picture.
//! 3. [`planar_pnp`] finds both poses that the picture of a plane allows; [`Homography`] maps one picture of it to
//!    another.
//! 4. [`Plane`] goes through points of several such poses, and [`Pose::from_plane`] turns it with a direction into a
//!    pose.
//! 5. [`Lattice`], a [`Mesh`] in a pose, picks the origin and the axes of the net frame, lists the nodes in view and
//!    names junctions.
//! 6. [`PoseCovariance`] says how sure range, tilt and place are.
//!
//! Beside it: [`Dbscan`] and [`NearestPoints`] for points of the picture, [`ZyxAngles`] for people.
//!
//! ```
//! use net_geometry::nalgebra::{Vector2, Vector3};
//! use net_geometry::{Camera, Lattice, Lens, Mesh, ZyxAngles, Pose, planar_pnp};
//!
//! let lens = Lens::PlumbBob([-0.2, 0.05, 0.0, 0.0, 0.0]);
//! let camera = Camera::new(700.0, 700.0, 424.0, 240.0, 848, 480, lens)?;
//! let mesh: Mesh = "50mm".parse()?;
//!
//! // One cell of a net 1.2 m away, tilted by 20 degrees about the image's u axis, and its picture.
//! let rotation = ZyxAngles { roll: 20f64.to_radians(), ..Default::default() }.rotation();
//! let truth = Lattice { pose: Pose { rotation, translation: Vector3::new(0.01, 0.02, 1.2) }, mesh };
//! let corners = [(0, 0), (0, 1), (1, 1), (1, 0)];
//! let pixels: Vec<_> = corners.into_iter().filter_map(|index| truth.pixel_of_node(&camera, index)).collect();
//!
//! // Back from the picture.
//! let rays: Vec<_> = pixels.into_iter().filter_map(|pixel| camera.ray_from_pixel(pixel)).collect();
//! let points = corners.map(|(i, j)| mesh.node(i.into(), j.into()));
//! let [best, mirrored] = planar_pnp(&points, &rays)?;
//! assert!(best.rms < mirrored.rms);
//! assert!((best.pose.plane().tilt() - 20f64.to_radians()).abs() < 1e-6);
//!
//! // The origin is the node nearest to the optical axis; which nodes the camera sees.
//! let net = Lattice { pose: best.pose, mesh }.canonical()?;
//! let mut nodes = Vec::new();
//! net.nodes_in_view(&camera, 4.0, &mut nodes);
//! assert!(nodes.iter().any(|node| node.index == (0, 0)) && nodes.len() > 300);
//! # Ok::<(), net_geometry::Error>(())
//! ```

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
mod region;
mod twine;

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
pub use twine::{Twine, TwineState};

pub use nalgebra;
