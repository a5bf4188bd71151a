//! Virtual nets with known pose: a scene goes in, its picture and the exact truth come out.
//!
//! Geometry is in `net_geometry`'s conventions; brightness is in grey levels, 0 black to 255 white.
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

mod error;
mod net;
mod random;
mod render;
mod scenario;
mod scene;
mod simulator;
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
pub use truth::{AxisTruth, LayerTruth, MissingEdge, NodeTruth, Truth, Visibility};
