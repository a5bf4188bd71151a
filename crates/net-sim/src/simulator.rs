//! The door: scene in, picture and truth out.

use nalgebra::{Vector2, Vector3};
use net_geometry::Camera;
use net_image::Image;

use crate::error::Result;
use crate::net::lattice::Lattice;
use crate::net::region::Region;
use crate::render::layer::LayerPainter;
use crate::render::sensor;
use crate::scene::{Layer, Scene};
use crate::truth::{AxisTruth, LayerTruth, NodeTruth, Truth, Visibility};

/// Nets are drawn no deeper than this, m.
const MAX_DEPTH_M: f64 = 12.0;

/// Draws scenes through one camera. Keeps its buffers: pictures after the first of a kind allocate nothing.
#[derive(Debug)]
pub struct Simulator {
    camera: Camera,
    region: Region,
    lattice: Lattice,
    painter: LayerPainter,
    /// The picture while light adds up, grey levels.
    picture: Vec<f32>,
    truth: Truth,
}

impl Simulator {
    /// A simulator of this camera's pictures.
    pub fn new(camera: Camera) -> Self {
        Self {
            camera,
            region: Region::default(),
            lattice: Lattice::default(),
            painter: LayerPainter::new(),
            picture: Vec::new(),
            truth: Truth::default(),
        }
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Draws `scene` into `image`, which takes the camera's size, and returns what it shows. The same scene and seed give the
    /// same picture, to the byte.
    ///
    /// # Errors
    /// [`crate::Error::Value`] for a scene that [`Scene::validate`] refuses.
    pub fn render(&mut self, scene: &Scene, seed: u64, image: &mut Image<u8>) -> Result<&Truth> {
        scene.validate()?;
        let (width, height) = (self.camera.width() as usize, self.camera.height() as usize);
        self.picture.clear();
        self.picture.resize(width * height, scene.water.veil_grey as f32);
        self.truth.layers.clear();
        for layer in scene.layers.iter().rev() {
            let truth = self.layer(scene, layer)?;
            self.truth.layers.push(truth);
        }
        self.truth.layers.reverse();
        image.resize(width, height);
        sensor::expose(&self.picture, &scene.sensor, seed, image);
        Ok(&self.truth)
    }

    /// The light that the last picture was made of, before noise: grey levels, row by row.
    pub fn noiseless(&self) -> &[f32] {
        &self.picture
    }

    fn layer(&mut self, scene: &Scene, layer: &Layer) -> Result<LayerTruth> {
        let (mesh, pose) = (layer.net.mesh()?, layer.pose.pose());
        self.region.look(&self.camera, &pose, &mesh, MAX_DEPTH_M);
        self.lattice.lay_out(&layer.net, &mesh, &pose, &self.camera, &self.region);
        self.painter.paint(scene, &layer.net, &self.lattice, &self.camera, &mut self.picture);
        let (width, height) = (f64::from(self.camera.width()), f64::from(self.camera.height()));
        let inside = |p: Vector2<f64>| p.x >= -0.5 && p.y >= -0.5 && p.x < width - 0.5 && p.y < height - 0.5;
        let nodes = self.lattice.iter().filter(|(_, n)| inside(n.pixel)).map(|(index, n)| NodeTruth {
            index,
            pixel: n.pixel,
            depth_m: n.point.z,
            visibility: Visibility::Visible,
        });
        let plane = pose.plane();
        let axis = plane.range().and_then(|range_m| {
            let foot = pose.inverse_transform(Vector3::z() * range_m);
            let basis = nalgebra::Matrix2::from_columns(&[mesh.a1(), mesh.a2()]);
            let cells = basis.try_inverse()? * foot.xy();
            let crossing_angle = mesh.angle();
            Some(AxisTruth { range_m, distance_m: plane.distance, normal: plane.normal, cells, crossing_angle })
        });
        Ok(LayerTruth { pose, mesh, axis, nodes: nodes.collect() })
    }
}
