//! A picture with its truth, and predictions of its lattice.

use std::collections::BTreeSet;

use net_geometry::nalgebra::{DMatrix, Vector2, Vector3};
use net_geometry::{Camera, Mesh};
use net_junction::LatticeMap;
use net_lattice::LatticeEstimate;
use net_sim::{Image, Scenario, Simulator, Visibility};

use crate::Result;

pub type Index = (i32, i32);
/// Node at the first end, and direction.
pub type Edge = (Index, usize);

/// A true knot.
#[derive(Debug, Clone, Copy)]
pub struct Knot {
    pub index: Index,
    pub pixel: Vector2<f64>,
    /// In the camera frame, m.
    pub point: Vector3<f64>,
    pub visible: bool,
    /// Covered by growth, fish or another net: what is between it and its neighbours is not known.
    pub covered: bool,
}

pub struct Sample {
    pub name: String,
    pub image: Image<u8>,
    pub camera: Camera,
    pub mesh: Mesh,
    /// In the picture.
    pub knots: Vec<Knot>,
    pub missing: BTreeSet<Edge>,
    pub bent: bool,
}

impl Sample {
    pub fn simulated(kind: &str, k: u64, scenario: &Scenario) -> Result<Self> {
        let frame = scenario.frame(0)?;
        let camera = scenario.camera()?;
        let mut image = Image::default();
        let mut simulator = Simulator::new(camera);
        let truth = simulator.render(&frame.scene, frame.seed, &mut image)?;
        let layer = truth.layers.first().ok_or("a scene without a net")?;
        let knots = layer.nodes.iter().map(|n| Knot {
            index: n.index,
            pixel: n.pixel,
            point: n.point,
            visible: n.visibility == Visibility::Visible,
            covered: !matches!(n.visibility, Visibility::Visible | Visibility::Missing),
        });
        let edge = |[a, b]: [Index; 2]| (a.min(b), usize::from(a.0 == b.0));
        let net = &frame.scene.layers[0].net;
        Ok(Self {
            name: format!("{kind} {k}"),
            camera,
            mesh: net.mesh()?,
            knots: knots.collect(),
            missing: layer.missing_edges.iter().map(|e| edge(e.nodes)).collect(),
            bent: net.surface != net_sim::Surface::default(),
            image,
        })
    }

    /// The true lattice without its jitter.
    pub fn true_map(&self) -> Option<TrueMap<'_>> {
        let degree = if self.bent { 4 } else { 1 };
        let middle = Vector2::new(f64::from(self.camera.width()), f64::from(self.camera.height())) * 0.5;
        let away = |k: &&Knot| (k.pixel - middle).norm();
        let seed = self.knots.iter().min_by(|a, b| away(a).total_cmp(&away(b)))?.index;
        let reach = self.knots.iter().map(|k| (k.index.0 - seed.0).abs().max((k.index.1 - seed.1).abs())).max()?;
        let mut map =
            TrueMap { camera: &self.camera, seed, reach: f64::from(reach.max(1)), degree, terms: DMatrix::zeros(0, 3) };
        let count = map.basis(0.0, 0.0).len();
        if self.knots.len() < 2 * count {
            return None;
        }
        let rows = self.knots.iter().map(|k| map.basis(f64::from(k.index.0), f64::from(k.index.1)));
        let rows: Vec<f64> = rows.flatten().collect();
        let left = DMatrix::from_row_slice(self.knots.len(), count, &rows);
        // Far knots are the less certain: errors in pixels count.
        let weights: Vec<f64> = self.knots.iter().map(|k| 1.0 / k.point.z).collect();
        let right = DMatrix::from_fn(self.knots.len(), 3, |r, c| self.knots[r].point[c] * weights[r]);
        let left = DMatrix::from_fn(left.nrows(), count, |r, c| left[(r, c)] * weights[r]);
        map.terms = left.svd(true, true).solve(&right, 1e-12).ok()?;
        Some(map)
    }
}

/// A polynomial through the true knots.
pub struct TrueMap<'a> {
    camera: &'a Camera,
    seed: Index,
    reach: f64,
    degree: i32,
    terms: DMatrix<f64>,
}

impl TrueMap<'_> {
    fn basis(&self, i: f64, j: f64) -> Vec<f64> {
        let (x, y) = ((i - f64::from(self.seed.0)) / self.reach, (j - f64::from(self.seed.1)) / self.reach);
        let powers = (0..=self.degree).flat_map(|n| (0..=n).map(move |k| (n - k, k)));
        powers.map(|(a, b)| x.powi(a) * y.powi(b)).collect()
    }

    fn point(&self, i: f64, j: f64) -> Vector3<f64> {
        let basis = self.basis(i, j);
        Vector3::from_fn(|c, _| basis.iter().enumerate().map(|(r, b)| b * self.terms[(r, c)]).sum())
    }
}

impl LatticeMap for TrueMap<'_> {
    fn pixel(&self, i: f64, j: f64) -> Option<Vector2<f64>> {
        self.place(i, j).map(|(pixel, _)| pixel)
    }
    fn pixels_per_metre(&self, i: f64, j: f64) -> Option<f64> {
        self.place(i, j).map(|(_, scale)| scale)
    }
    fn place(&self, i: f64, j: f64) -> Option<(Vector2<f64>, f64)> {
        // A polynomial means nothing far from what it was fitted to.
        let away = (i - f64::from(self.seed.0)).abs().max((j - f64::from(self.seed.1)).abs());
        let point = (away < self.reach + 3.0).then(|| self.point(i, j))?;
        let scale = (point.z > 0.0).then(|| 0.5 * (self.camera.fx() + self.camera.fy()) / point.z)?;
        Some((self.camera.pixel_from_point(point)?, scale))
    }
    fn seed(&self) -> Option<Index> {
        Some(self.seed)
    }
}

/// What the lattice estimator makes of the picture.
pub struct EstimatedMap<'a> {
    pub estimate: &'a LatticeEstimate,
    pub camera: &'a Camera,
}

impl LatticeMap for EstimatedMap<'_> {
    fn pixel(&self, i: f64, j: f64) -> Option<Vector2<f64>> {
        self.place(i, j).map(|(pixel, _)| pixel)
    }
    fn pixels_per_metre(&self, i: f64, j: f64) -> Option<f64> {
        self.place(i, j).map(|(_, scale)| scale)
    }
    fn place(&self, i: f64, j: f64) -> Option<(Vector2<f64>, f64)> {
        let (pixel, depth) = self.estimate.pixel_from_lattice(self.camera, Vector2::new(i, j))?;
        Some((pixel, 0.5 * (self.camera.fx() + self.camera.fy()) / depth))
    }
    fn seed(&self) -> Option<Index> {
        let axis = Vector2::new(self.camera.cx(), self.camera.cy());
        let at = self.estimate.lattice_from_pixel(self.camera, axis).filter(|at| at.amax() < 1e6)?;
        Some((at.x.round() as i32, at.y.round() as i32))
    }
}
