//! The door: scene in, picture and truth out.

use nalgebra::{Rotation3, Vector2, Vector3};
use net_geometry::{Camera, Pose};
use net_image::Image;

use crate::error::Result;
use crate::net::fabric::Fabric;
use crate::net::lattice::Lattice;
use crate::net::region::Region;
use crate::render::blur::Blur;
use crate::render::jpeg::Jpeg;
use crate::render::layer::{LayerPainter, Subject};
use crate::render::object::ObjectPainter;
use crate::render::water::{Medium, Veil};
use crate::render::{backdrop, sensor, snow};
use crate::scene::{Layer, Object, Scene};
use crate::survey::layer_truth;
use crate::truth::{LayerTruth, Truth, Visibility};

/// Nets are drawn out to eight times their range, but no farther than this unless that is less than four times it, m: beyond,
/// meshes are fractions of a pixel.
const FAR_M: f64 = 12.0;
/// Motion blur is the mean of pictures at most this far apart, px.
const EXPOSURE_STEP_PX: f64 = 0.7;
/// And of at most so many (an odd number: the middle one is the truth's).
const MOST_EXPOSURES: usize = 41;

/// Draws scenes through one camera. Keeps its large buffers (light, coverage, knots) and the shape of bent nets from frame to frame.
#[derive(Debug)]
pub struct Simulator {
    camera: Camera,
    veil: Veil,
    region: Region,
    nets: Vec<HungNet>,
    nets_painter: LayerPainter,
    objects_painter: ObjectPainter,
    blur: Blur,
    jpeg: Jpeg,
    /// The picture while light adds up, grey levels.
    picture: Vec<f32>,
    /// Sum of the pictures of one exposure.
    exposure: Vec<f32>,
    truth: Truth,
}

/// What is known of one net of the scene.
#[derive(Debug)]
struct HungNet {
    fabric: Fabric,
    lattice: Lattice,
}

impl Simulator {
    /// A simulator of this camera's pictures.
    pub fn new(camera: Camera) -> Self {
        Self {
            camera,
            veil: Veil::default(),
            region: Region::default(),
            nets: Vec::new(),
            nets_painter: LayerPainter::new(),
            objects_painter: ObjectPainter::default(),
            blur: Blur::default(),
            jpeg: Jpeg::new(),
            picture: Vec::new(),
            exposure: Vec::new(),
            truth: Truth::default(),
        }
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Draws `scene` into `image`, which takes the camera's size, and returns what it shows. `seed` is that of the sensor's noise.
    /// The same scene and seed give the same picture, to the byte.
    ///
    /// # Errors
    /// [`crate::Error::Value`] or [`crate::Error::Geometry`] for a scene that [`Scene::validate`] refuses.
    pub fn render(&mut self, scene: &Scene, seed: u64, image: &mut Image<u8>) -> Result<&Truth> {
        scene.validate()?;
        let (width, height) = (self.camera.width() as usize, self.camera.height() as usize);
        self.veil.fill(scene, &self.camera);
        let count = self.exposures(scene);
        self.exposure.clear();
        for k in 0..count {
            let after_middle_s = ((k as f64 + 0.5) / count as f64 - 0.5) * scene.sensor.exposure_s;
            self.draw(scene, after_middle_s, k == count / 2)?;
            if count > 1 {
                self.exposure.resize(self.picture.len(), 0.0);
                self.exposure.iter_mut().zip(&self.picture).for_each(|(sum, p)| *sum += p / count as f32);
            }
        }
        if count > 1 {
            std::mem::swap(&mut self.exposure, &mut self.picture);
        }
        self.blur.apply(&mut self.picture, width, scene.sensor.defocus_px);
        sensor::expose(&mut self.picture, scene, width, height);
        self.truth.noise_grey = scene.sensor.noise_grey(scene.water.veil_grey * scene.sensor.gain);
        image.resize(width, height);
        sensor::read_out(&self.picture, &scene.sensor, seed, image);
        if let Some(quality) = scene.sensor.jpeg_quality {
            self.jpeg.apply(image, quality);
        }
        Ok(&self.truth)
    }

    /// The light that the last picture was made of, before noise: grey levels, row by row.
    pub fn noiseless(&self) -> &[f32] {
        &self.picture
    }

    /// How many pictures make one exposure.
    fn exposures(&self, scene: &Scene) -> usize {
        let linear = Vector3::from(scene.motion.linear_m_per_s).norm();
        let angular = Vector3::from(scene.motion.angular_deg_per_s).map(f64::to_radians).norm();
        let range = scene.layers.iter().map(|l| l.pose.range_m).fold(f64::INFINITY, f64::min);
        let way_px = self.camera.fx() * scene.sensor.exposure_s * (linear / range + angular);
        let count = (way_px / EXPOSURE_STEP_PX).ceil() as usize;
        (count | 1).min(MOST_EXPOSURES)
    }

    /// Draws the scene as it is `after_middle_s` from the middle of the exposure.
    fn draw(&mut self, scene: &Scene, after_middle_s: f64, keep_truth: bool) -> Result<()> {
        let Self { camera, veil, region, nets, nets_painter, objects_painter, picture, truth, .. } = self;
        let camera = &*camera;
        let medium = Medium::new(scene, camera, veil);
        picture.clear();
        picture.extend_from_slice(&veil.grey);
        if let Some(backdrop) = &scene.backdrop {
            backdrop::paint(backdrop, &medium, picture);
        }
        while nets.len() < scene.layers.len() {
            nets.push(HungNet { fabric: Fabric::new()?, lattice: Lattice::default() });
        }
        if keep_truth {
            truth.layers.clear();
            truth.outlines.clear();
        }
        let mut outlines = Vec::new();
        let mut objects: Vec<&Object> = scene.objects.iter().collect();
        // Deepest first; equally deep ones as they are listed.
        let depth = |o: &Object| o.range_m + o.velocity_m_per_s[2] * scene.time_s;
        objects.sort_by(|a, b| depth(b).total_cmp(&depth(a)));
        let mut objects = objects.into_iter().peekable();
        for (layer, hung) in scene.layers.iter().zip(nets).rev() {
            let pose = moved(&layer.pose.pose(), scene, after_middle_s);
            let behind = |o: &&Object| {
                let ray = Vector3::new(o.x_m, o.y_m, o.range_m) / o.range_m;
                depth(o) > pose.plane().depth_along(ray).unwrap_or(layer.pose.range_m)
            };
            while let Some(object) = objects.next_if(behind) {
                objects_painter.paint(object, &medium, nets_painter.edge(), picture, &mut outlines);
                if keep_truth {
                    hide(&mut truth.layers, Visibility::Occluded, |p| objects_painter.cover(p));
                }
            }
            hung.fabric.take(&layer.net)?;
            let range_m = layer.pose.range_m;
            let far_m = (8.0 * range_m).min(FAR_M).max(4.0 * range_m);
            hung.lattice.lay_out(&layer.net, &mut hung.fabric, &pose, camera, region, far_m);
            let subject = Subject {
                net: &layer.net,
                fabric: &hung.fabric,
                lattice: &hung.lattice,
                pose: &pose,
                medium: &medium,
                far_m,
            };
            let behind_grey = middle(picture, camera);
            nets_painter.paint(&subject, picture);
            if keep_truth {
                hide(&mut truth.layers, Visibility::BehindNet, |p| nets_painter.cover(p));
                let mut layer_truth = layer_truth(layer, &subject, nets_painter)?;
                layer_truth.contrast_grey = seen_in_the_middle(&layer_truth, layer, &medium) - behind_grey;
                truth.layers.push(layer_truth);
            }
        }
        for object in objects {
            objects_painter.paint(object, &medium, nets_painter.edge(), picture, &mut outlines);
            if keep_truth {
                hide(&mut truth.layers, Visibility::Occluded, |p| objects_painter.cover(p));
            }
        }
        if scene.snow.density_per_m3 > 0.0 {
            snow::paint(&medium, nets_painter.disc(), nets_painter.edge(), picture);
        }
        if keep_truth {
            truth.layers.reverse();
            truth.outlines = outlines;
        }
        Ok(())
    }
}

/// The pose some time after the middle of the exposure, the camera moving as the scene says.
fn moved(pose: &Pose, scene: &Scene, after_middle_s: f64) -> Pose {
    if after_middle_s == 0.0 {
        return *pose;
    }
    let way = Vector3::from(scene.motion.linear_m_per_s) * after_middle_s;
    let turn = Vector3::from(scene.motion.angular_deg_per_s).map(f64::to_radians) * after_middle_s;
    let back = Rotation3::new(turn).inverse();
    Pose { rotation: back * pose.rotation, translation: back * (pose.translation - way) }
}

/// Marks visible knots of these nets that something covers.
fn hide(layers: &mut [LayerTruth], by: Visibility, cover: impl Fn(Vector2<f64>) -> f32) {
    for node in layers.iter_mut().flat_map(|l| &mut l.nodes) {
        if node.visibility == Visibility::Visible && cover(node.pixel) > 0.5 {
            node.visibility = by;
        }
    }
}

/// Brightness in the middle of the picture, over a few pixels.
fn middle(picture: &[f32], camera: &Camera) -> f64 {
    let (width, height) = (camera.width() as usize, camera.height() as usize);
    let (u, v) = (width / 2, height / 2);
    let rows = v.saturating_sub(2)..(v + 3).min(height);
    let columns = u.saturating_sub(2)..(u + 3).min(width);
    let values = rows.flat_map(|v| picture[v * width..][columns.clone()].iter());
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), &p| (s + f64::from(p), n + 1.0));
    sum / count
}

/// Brightness of wide twine where the optical axis meets the net, or would.
fn seen_in_the_middle(truth: &LayerTruth, layer: &Layer, medium: &Medium) -> f64 {
    let range_m = truth.axis.map_or(layer.pose.range_m, |a| a.range_m);
    let point = Vector3::z() * range_m;
    let camera = medium.camera();
    let place = truth.pose.inverse_transform(point).xy();
    medium.seen(layer.net.twine.grey, point, Vector2::new(camera.cx(), camera.cy()), place)
}
