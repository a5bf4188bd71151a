//! What one frame brings.

use net_geometry::nalgebra::Vector2;
use net_image::GrayView;

/// Where the lattice is in the picture.
pub trait NetView {
    /// Pixel of the lattice point `(i, j)`, fractions included, and its depth along the optical axis, m; `None` where it cannot be seen.
    fn pixel(&self, at: Vector2<f64>) -> Option<(Vector2<f64>, f64)>;
}

impl<F: Fn(Vector2<f64>) -> Option<(Vector2<f64>, f64)>> NetView for F {
    fn pixel(&self, at: Vector2<f64>) -> Option<(Vector2<f64>, f64)> {
        self(at)
    }
}

/// What a frame says of a twine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Seen {
    /// The picture does not tell, or not enough.
    Unknown,
    /// There.
    Present,
    /// It looks gone, or broken, whether or not this frame alone could say so for certain.
    Missing,
    /// Behind a fish or another object.
    Hidden,
    /// Overgrown.
    Fouled,
}

/// One look at a twine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwineLook {
    /// Node at its first end.
    pub index: (i32, i32),
    /// 0: to node `(i + 1, j)`, 1: to `(i, j + 1)`.
    pub direction: usize,
    /// What the frame says.
    pub seen: Seen,
    /// Log likelihood ratio, present to missing.
    pub llr: f32,
    /// How many deviations the neighbourhood's twines stand out from where there are none.
    pub contrast: f32,
}

/// One frame whose pose can be vouched for.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a, V> {
    /// Its number; growing.
    pub number: u32,
    /// Number of the count of cells: another number, another map.
    pub track: u32,
    /// The picture.
    pub image: GrayView<'a>,
    /// Where the lattice is in it.
    pub view: &'a V,
    /// Lattice coordinates where the optical axis meets the net.
    pub axis: Vector2<f64>,
    /// The twines in view.
    pub twines: &'a [TwineLook],
}

/// Indices whose neighbours are numbers too.
pub(crate) fn in_reach(index: (i32, i32)) -> bool {
    index.0.unsigned_abs() < 1 << 29 && index.1.unsigned_abs() < 1 << 29
}
