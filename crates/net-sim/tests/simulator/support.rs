//! What several tests need.

use nalgebra::Vector2;
use net_geometry::{Camera, Lens, Mesh};
use net_sim::{Layer, NetPose, NodeTruth, Scene, Sensor, Truth};

pub type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

/// The thesis's camera (eq. 4.3).
pub fn camera() -> Camera {
    Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None).unwrap()
}

/// A camera of a quarter of its picture.
pub fn small_camera() -> Camera {
    Camera::new(300.0, 300.0, 211.5, 119.5, 424, 240, Lens::None).unwrap()
}

/// A flat net without noise.
pub fn quiet(mesh: &str, pose: NetPose) -> Scene {
    let mesh: Mesh = mesh.parse().unwrap();
    let sensor = Sensor { read_noise_grey: 0.0, ..Sensor::default() };
    Scene { layers: vec![Layer::planar(&mesh, pose)], sensor, ..Scene::default() }
}

pub fn pose(range_m: f64, tilt_x_deg: f64, tilt_y_deg: f64, roll_deg: f64) -> NetPose {
    NetPose { range_m, tilt_x_deg, tilt_y_deg, roll_deg, x_m: 0.013, y_m: -0.007 }
}

/// Neighbouring knots of the first net that are both in the picture: the first, the second, and the mesh direction (0 or 1).
pub fn edges(truth: &Truth) -> Vec<(NodeTruth, NodeTruth, usize)> {
    let nodes: std::collections::BTreeMap<_, _> = truth.layers[0].nodes.iter().map(|n| (n.index, *n)).collect();
    let mut edges = Vec::new();
    for (&(i, j), &a) in &nodes {
        for (family, next) in [(i + 1, j), (i, j + 1)].iter().enumerate() {
            edges.extend(nodes.get(next).map(|&b| (a, b, family)));
        }
    }
    edges
}

/// Centre of brightness along the row or column (`down`) through `p`, of what stands out from `background` within `half` px.
pub fn centre(picture: &[f32], width: usize, p: Vector2<f64>, half: usize, down: bool, background: f64) -> Option<f64> {
    let height = picture.len() / width;
    let (u, v) = (p.x.round() as usize, p.y.round() as usize);
    let (middle, last) = if down { (v, height) } else { (u, width) };
    let first = middle.checked_sub(half)?;
    if middle + half >= last {
        return None;
    }
    let at = |k: usize| f64::from(if down { picture[k * width + u] } else { picture[v * width + k] }) - background;
    let (sum, moment) = (first..=middle + half).fold((0.0, 0.0), |(s, m), k| (s + at(k), m + at(k) * k as f64));
    (sum.abs() > 1.0).then_some(moment / sum)
}

/// A hash of a picture (FNV-1a).
pub fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xCBF2_9CE4_8422_2325, |h, &b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01B3))
}
