//! Scenes of the simulator, and estimates held against their truth.

#![allow(dead_code)] // every test takes what it needs

use net_fft::{ThesisConfig, ThesisEstimate, ThesisEstimator};
use net_geometry::nalgebra::Vector3;
use net_geometry::{Camera, Lens, Mesh};
use net_image::Image;
use net_sim::{AxisTruth, Layer, NetPose, Scene, Simulator};

pub fn camera() -> Camera {
    Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None).unwrap()
}

pub fn square() -> Mesh {
    Mesh::square(0.05).unwrap()
}

/// A net of this mesh at this pose, off any symmetry.
pub fn scene_of(mesh: &Mesh, range_m: f64, tilt_x_deg: f64, tilt_y_deg: f64, roll_deg: f64) -> Scene {
    let pose = NetPose { range_m, tilt_x_deg, tilt_y_deg, roll_deg, x_m: 0.013, y_m: -0.007 };
    Scene { layers: vec![Layer::planar(mesh, pose)], ..Scene::default() }
}

/// The picture, and the truth on the optical axis if a net is there.
pub fn draw(camera: &Camera, scene: &Scene, seed: u64) -> (Image<u8>, Option<AxisTruth>) {
    let (mut simulator, mut picture) = (Simulator::new(*camera), Image::default());
    let truth = simulator.render(scene, seed, &mut picture).unwrap();
    let axis = truth.layers.first().and_then(|layer| layer.axis);
    (picture, axis)
}

pub fn estimate(camera: &Camera, mesh: &Mesh, config: &ThesisConfig, picture: &Image<u8>) -> Option<ThesisEstimate> {
    let mut estimator = ThesisEstimator::new(camera, mesh, config).unwrap();
    estimator.estimate(picture.view().unwrap()).unwrap()
}

/// How far off an estimate is.
#[derive(Debug, Clone, Copy)]
pub struct Off {
    pub range_percent: f64,
    pub normal_deg: f64,
    /// Of the net frame's X axis from the nearest of the truth's mesh directions.
    pub in_plane_deg: f64,
    pub angle_deg: f64,
}

impl Off {
    pub fn of(found: &ThesisEstimate, truth: &AxisTruth) -> Self {
        let between = |a: &Vector3<f64>, b: &Vector3<f64>| a.cross(b).norm().atan2(a.dot(b)).to_degrees();
        let x = found.pose.x_axis();
        let [a1, a2] = truth.directions;
        let ways = [a1, -a1, a2, -a2].map(|direction| between(&x, &direction));
        let nearest = ways.iter().copied().fold(f64::INFINITY, f64::min);
        // The crossing angle belongs to the truth's sides: the supplement when X runs along the second one.
        let along_second = ways[2].min(ways[3]) < ways[0].min(ways[1]);
        let crossing = if along_second { std::f64::consts::PI - truth.crossing_angle } else { truth.crossing_angle };
        Self {
            range_percent: 100.0 * (found.range() / truth.range_m - 1.0).abs(),
            normal_deg: between(&found.plane.normal, &truth.normal),
            in_plane_deg: nearest,
            angle_deg: (found.mesh.angle() - crossing).to_degrees().abs(),
        }
    }

    pub fn is_right(&self) -> bool {
        self.range_percent < 5.0 && self.normal_deg < 5.0 && self.in_plane_deg < 5.0
    }
}
