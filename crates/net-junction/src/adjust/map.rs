//! Where the lattice's nodes are predicted in the picture.

use net_geometry::nalgebra::Vector2;

use crate::contour::ExpectedNet;

/// A prediction of every lattice point's place in the picture: planar, bent or sheared nets alike.
pub trait LatticeMap {
    /// Pixel of the lattice point `(i, j)`, fractions included; `None` where it cannot be seen.
    fn pixel(&self, i: f64, j: f64) -> Option<Vector2<f64>>;

    /// Pixels per metre across the line of sight at `(i, j)`: focal length over depth. It gives twine its width.
    fn pixels_per_metre(&self, i: f64, j: f64) -> Option<f64>;

    /// Both at once, for maps to which that comes cheaper.
    fn place(&self, i: f64, j: f64) -> Option<(Vector2<f64>, f64)> {
        Some((self.pixel(i, j)?, self.pixels_per_metre(i, j)?))
    }

    /// A node that lies in the picture if any does, best in its middle.
    fn seed(&self) -> Option<(i32, i32)>;
}

impl LatticeMap for ExpectedNet {
    fn pixel(&self, i: f64, j: f64) -> Option<Vector2<f64>> {
        self.pixel_at(Vector2::new(i, j))
    }

    fn pixels_per_metre(&self, i: f64, j: f64) -> Option<f64> {
        let depth = self.pose.transform(self.mesh.node(i, j).push(0.0)).z;
        (depth > 0.0).then(|| 0.5 * (self.camera.fx() + self.camera.fy()) / depth)
    }

    fn seed(&self) -> Option<(i32, i32)> {
        let middle = Vector2::new(f64::from(self.camera.width()), f64::from(self.camera.height())) * 0.5;
        let at = self.lattice_at(middle).filter(|at| at.amax() < 1e6)?;
        Some((at.x.round() as i32, at.y.round() as i32))
    }
}
