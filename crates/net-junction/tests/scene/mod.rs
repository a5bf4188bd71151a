//! Nets drawn by their definition: each pixel's share of twine from its distance to the nearest lattice lines. Shared by the tests.
#![allow(dead_code)] // each test uses its own part

use net_geometry::nalgebra::{Rotation3, Vector2, Vector3};
use net_geometry::{Camera, Junction, Lens, Mesh, Pose};
use net_image::{GrayView, View};
use net_junction::ExpectedNet;

pub const WIDTH: usize = 848;
pub const HEIGHT: usize = 480;

/// A net in front of the camera, and how it looks.
#[derive(Clone)]
pub struct Scene {
    pub net: ExpectedNet,
    /// Twine diameter, m.
    pub twine: f64,
    pub background: f64,
    pub contrast: f64,
    /// Standard deviation of the noise, grey levels.
    pub noise: f64,
    /// Brightness gained from left to right, grey levels.
    pub gradient: f64,
    /// First and last node along both directions; everything outside is water.
    pub extent: [(i32, i32); 2],
}

/// A square net of 50 mm with 2.5 mm twine, tilted about x and y and rolled, degrees, its origin near the optical axis at `range`, m.
pub fn scene(range: f64, tilt_x: f64, tilt_y: f64, roll: f64) -> Scene {
    let rotation = Rotation3::from_axis_angle(&Vector3::x_axis(), tilt_x.to_radians())
        * Rotation3::from_axis_angle(&Vector3::y_axis(), tilt_y.to_radians())
        * Rotation3::from_axis_angle(&Vector3::z_axis(), roll.to_radians());
    Scene {
        net: ExpectedNet {
            camera: Camera::new(600.0, 600.0, 424.0, 240.0, WIDTH as u32, HEIGHT as u32, Lens::None).unwrap(),
            mesh: Mesh::square(0.05).unwrap(),
            pose: Pose { rotation, translation: Vector3::new(0.007, -0.011, range) },
            anchored: true,
        },
        twine: 0.0025,
        background: 80.0,
        contrast: 90.0,
        noise: 3.0,
        gradient: 30.0,
        extent: [(-1000, 1000); 2],
    }
}

impl Scene {
    pub fn draw(&self) -> Vec<u8> {
        let mut random = Random(7);
        let mut picture = Vec::with_capacity(WIDTH * HEIGHT);
        for v in 0..HEIGHT {
            for u in 0..WIDTH {
                let p = Vector2::new(u as f64, v as f64);
                let light = self.background + self.gradient * (p.x / WIDTH as f64 - 0.5);
                let value = light + self.contrast * self.twine_at(p) + self.noise * random.normal();
                picture.push(value.round().clamp(0.0, 255.0) as u8);
            }
        }
        picture
    }

    /// Share of a pixel that twine covers.
    fn twine_at(&self, p: Vector2<f64>) -> f64 {
        let at = |d: Vector2<f64>| self.net.lattice_at(p + d);
        let (Some(here), Some(u), Some(v)) =
            (at(Vector2::zeros()), at(Vector2::new(0.5, 0.0)), at(Vector2::new(0.0, 0.5)))
        else {
            return 0.0;
        };
        let mut clear = 1.0;
        let sides = [self.net.mesh.side2(), self.net.mesh.side1()];
        let sine = self.net.mesh.angle().sin();
        for axis in 0..2 {
            let line = here[axis].round();
            let outside =
                |axis: usize, x: f64| x < f64::from(self.extent[axis].0) || x > f64::from(self.extent[axis].1);
            if outside(axis, line) || outside(1 - axis, here[1 - axis]) {
                continue;
            }
            let slope = Vector2::new(u[axis] - here[axis], v[axis] - here[axis]).norm() * 2.0;
            let distance = (here[axis] - line).abs() / slope;
            // Lines of constant i are a side of the other direction's height apart.
            let width = self.twine / (sides[1 - axis] * sine) / slope;
            // Twine seen through a point spread of 0.6 px: the integral of the Gaussian across it.
            let edge = |x: f64| 1.0 / (1.0 + (-1.702 * x / 0.6).exp());
            let cover = edge(distance + 0.5 * width) - edge(distance - 0.5 * width);
            clear *= 1.0 - cover;
        }
        1.0 - clear
    }

    /// Nodes at least `margin` cells inside the picture and the net, where cells are at least `least_px` on their shorter side: index and pixel.
    pub fn inner_nodes(&self, margin: f64, least_px: f64) -> Vec<((i32, i32), Vector2<f64>)> {
        let mut nodes = self.nodes(0.0);
        nodes.retain(|((i, j), p)| {
            let at = Vector2::new(f64::from(*i), f64::from(*j));
            let steps = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)];
            let inside = steps.iter().all(|(x, y)| {
                let moved = at + Vector2::new(*x, *y) * margin;
                let here = |axis: usize| {
                    moved[axis] >= f64::from(self.extent[axis].0) && moved[axis] <= f64::from(self.extent[axis].1)
                };
                self.net.pixel_at(moved).is_some_and(|q| {
                    q.x >= 0.0 && q.y >= 0.0 && q.x <= (WIDTH - 1) as f64 && q.y <= (HEIGHT - 1) as f64
                }) && here(0)
                    && here(1)
            });
            inside
                && self.net.basis_at(*p).is_some_and(|b| {
                    // The shorter height: distance between parallel twines.
                    b.cell_area().abs() / b.b1.norm().max(b.b2.norm()) >= least_px
                })
        });
        nodes
    }

    /// Every node with a pixel at least `margin` px inside the picture: index and pixel.
    pub fn nodes(&self, margin: f64) -> Vec<((i32, i32), Vector2<f64>)> {
        let mut nodes = Vec::new();
        let range = |axis: usize| self.extent[axis].0.max(-300)..=self.extent[axis].1.min(300);
        for i in range(0) {
            for j in range(1) {
                let Some(p) = self.net.pixel_at(Vector2::new(f64::from(i), f64::from(j))) else { continue };
                let inside = |x: f64, size: usize| x >= margin && x <= (size - 1) as f64 - margin;
                if inside(p.x, WIDTH) && inside(p.y, HEIGHT) {
                    nodes.push(((i, j), p));
                }
            }
        }
        nodes
    }

    /// Length of the middle cell's shorter side, px.
    pub fn cell_px(&self) -> f64 {
        let basis = self.net.basis_at(Vector2::new(424.0, 240.0)).unwrap();
        basis.b1.norm().min(basis.b2.norm())
    }
}

pub fn view(picture: &[u8]) -> GrayView<'_> {
    View::packed(picture, WIDTH, HEIGHT).unwrap()
}

/// How junctions compare with the true nodes.
#[derive(Debug, Default)]
pub struct Score {
    pub found: usize,
    pub truth: usize,
    pub right: usize,
    /// Of the `truth` nodes.
    pub inner_found: usize,
    /// Right place and, among those, right name.
    pub named_right: usize,
    pub named_wrong: usize,
    pub rmse: f64,
    pub bias: Vector2<f64>,
    /// Root mean square of error over the sigma that was claimed; 1 is honest.
    pub error_over_sigma: f64,
}

impl Score {
    pub fn precision(&self) -> f64 {
        self.right as f64 / self.found.max(1) as f64
    }
    pub fn recall(&self) -> f64 {
        self.inner_found as f64 / self.truth.max(1) as f64
    }
}

/// One to one within `tolerance` px: `inner` counts for recall, any of `all` makes a junction right.
pub fn score(
    junctions: &[Junction],
    all: &[((i32, i32), Vector2<f64>)],
    inner: &[((i32, i32), Vector2<f64>)],
    tolerance: f64,
) -> Score {
    let mut taken = std::collections::BTreeSet::new();
    let mut score = Score { found: junctions.len(), truth: inner.len(), ..Score::default() };
    let (mut squares, mut normalised) = (0.0, 0.0);
    let mut matched = 0;
    for junction in junctions {
        let nearest =
            all.iter().map(|(name, p)| ((junction.pixel - p).norm(), name, p)).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((distance, name, p)) = nearest else { continue };
        if distance > tolerance || !taken.insert(*name) {
            if junction.index.is_some() {
                score.named_wrong += 1;
            }
            continue;
        }
        matched += 1;
        squares += distance * distance;
        normalised += distance * distance / (2.0 * junction.sigma_px.powi(2));
        score.bias += junction.pixel - p;
        match junction.index {
            Some(index) if index == *name => score.named_right += 1,
            Some(_) => score.named_wrong += 1,
            None => {}
        }
    }
    score.right = matched;
    let n = matched.max(1) as f64;
    score.rmse = (squares / n).sqrt();
    score.bias /= n;
    score.error_over_sigma = (normalised / n).sqrt();
    score.inner_found = inner.iter().filter(|(name, _)| taken.contains(name)).count();
    score
}

/// Numbers that look random and are the same everywhere.
pub struct Random(pub u64);

impl Random {
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
    /// Nearly normal: twelve uniforms.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}
