//! Junctions (knots) of a fish net in a picture, to a fraction of a pixel and with their lattice indices.
//!
//! # The contour method
//! Twine parts the picture into openings, one to each mesh; an opening's four corners lie beside four junctions (Strandenes 2023, 4.4).
//! [`JunctionDetector::detect`] takes these steps, each in its own file:
//!
//! 1. blur and adaptive threshold, light and dark twine, block size and offset following the net ([`Config`]);
//! 2. outlines of the openings, where the grey values cross the threshold between two pixels;
//! 3. area and shape against the cell that is expected there: accepted, or rejected with the reason ([`CellBox`], [`Verdict`]);
//! 4. four straight sides fitted to each opening, or the rectangle of least area ([`Shape`]);
//! 5. corners of neighbours grouped by DBSCAN, at most one of each opening, and averaged;
//! 6. lattice indices, by walking from mesh to mesh.
//!
//! What is expected may be a predicted pose and mesh ([`ExpectedNet`], the most useful), the cells' area alone ([`CellArea`], the thesis's
//! Algorithm 5), or nothing. Camera, pixel and net frame are those of [`net_geometry`].
//!
//! ```
//! use net_geometry::nalgebra::{Rotation3, Vector3};
//! use net_geometry::{Camera, Lens, Mesh, Pose};
//! use net_image::View;
//! use net_junction::{Config, Expectation, ExpectedNet, JunctionDetector};
//!
//! let picture = vec![0_u8; 848 * 480]; // from the camera
//! let camera = Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None)?;
//! let pose = Pose { rotation: Rotation3::identity(), translation: Vector3::new(0.0, 0.0, 1.5) };
//! let expectation = Expectation::Net(ExpectedNet { camera, mesh: Mesh::square(0.05)?, pose, anchored: false });
//!
//! let mut detector = JunctionDetector::new(848, 480, &Config::default())?;
//! let junctions = detector.detect(View::packed(&picture, 848, 480)?, Some(&expectation))?;
//! assert!(junctions.is_empty()); // no net in a black picture
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Net adjustment
//! With a pose good to a third of a cell, [`NetAdjuster::adjust`] does what outlines cannot: it predicts every node in view, measures across each
//! predicted twine where it really lies, and solves for all nodes and the twines' bows at once. Meshes need not be closed; twine of
//! half a pixel in cells of 5 px is enough. Nodes are told apart into seen, hidden, overgrown and missing, twines likewise ([`Twine`]). Where
//! nothing stands out from lines half a cell aside, nothing is reported. Bent and sheared nets come in by their own [`LatticeMap`].

mod adjust;
mod contour;
mod error;

pub use adjust::{AdjustConfig, LatticeMap, NetAdjuster, Twine, TwineState};
pub use contour::*;
pub use error::{Error, Result};
