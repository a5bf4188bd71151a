//! Virtual nets with known pose: a scene goes in, its picture and the exact truth come out.
//!
//! Geometry is in `net_geometry`'s conventions; brightness is in grey levels, 0 black to 255 white; noise too.
//!
//! ```
//! use net_geometry::{Camera, Lens, Mesh};
//! use net_sim::{Image, Layer, NetPose, Scene, Simulator};
//!
//! let camera = Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None)?;
//! let mesh = Mesh::square(0.05)?;
//! let pose = NetPose { range_m: 1.5, tilt_y_deg: 20.0, ..NetPose::default() };
//! let scene = Scene { layers: vec![Layer::planar(&mesh, pose)], ..Scene::default() };
//!
//! let mut simulator = Simulator::new(camera);
//! let mut image = Image::default();
//! let truth = simulator.render(&scene, 1, &mut image)?;
//! let axis = truth.layers[0].axis.expect("the net fills the view");
//! assert!((axis.range_m - 1.5).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What can be drawn
//! A [`Scene`] is plain data that reads from TOML or JSON: nets ([`Net`]: any mesh, sheared, bent, jittered, torn, overgrown; several one
//! behind the other), [`Water`], [`Light`], [`Snow`], [`Object`]s, a [`Backdrop`] that is no net, the [`Sensor`] and its [`Motion`]. A
//! [`Scenario`] adds a camera, a [`Path`] and a name: [`Scenario::all`] lists those that have one, the thesis's figures and tables first.
//! [`Study`] draws scenes at random, a seed a scene. [`thesis`] has the thesis's own drawing algorithm to the letter.
//!
//! # How it is drawn
//! 1. Knots: on a plane, or on a bent sheet laid so that every side keeps its length (a Chebyshev net); then jitter; then the camera,
//!    lens and all.
//! 2. Twine, knot to knot: a cylinder's outline in the picture, through a Gaussian point spread in closed form (two error functions
//!    across it). Nothing is rasterised or supersampled, so a twine's centre of brightness lies on its axis to 0.001 px however thin
//!    it is, and meshes of a few pixels do not alias. Twines of one direction add up; crossing ones cover each other.
//! 3. Knots, growth, fish and all else over that from back to front, seen through the water between.
//! 4. Defocus, motion (the mean of many pictures), vignette, exposure; then noise, eight bits, JPEG.
//!
//! # What truth means
//! [`Truth`] is computed from the scene, never measured on the picture. Range, normal, crossing angle and curvature are those of the
//! smooth net where the optical axis meets it ([`AxisTruth`]); a knot's pixel has its jitter in it. Whether a knot is visible is
//! geometry: what water, blur and noise take away is not counted.
//!
//! Approximations, all without a bias of position: where twines cross at another angle than 90 degrees in the picture, the overlap's
//! brightness; the outline's second order in diameter over distance (0.005 px for 2 mm at 0.3 m); scatter as one blur for all
//! depths. Nets end, fading, at eight times their range or 12 m (but not before four times their range).
//!
//! # Always the same
//! The same scene, seed and camera give the same picture to the byte. What belongs to a place in the net or the water comes from a
//! hash of that place, so it stays from frame to frame; the sensor's noise comes from ChaCha8.

mod error;
mod net;
mod random;
mod render;
mod scenario;
mod scene;
mod simulator;
mod study;
mod survey;
pub mod thesis;
mod truth;

pub use error::{Error, Result};
pub use net_image::Image;
pub use scenario::{CameraModel, Frame, Path, Scenario};
pub use scene::{
    Backdrop, Extent, Growth, Hole, Kind, Layer, Light, Motion, Net, NetPose, Object, Scene, Sensor, Snow, Surface,
    Texture, Twine, Water, Wave,
};
pub use simulator::Simulator;
pub use study::Study;
pub use truth::{AxisTruth, LayerTruth, MissingEdge, NodeTruth, Truth, Visibility};
