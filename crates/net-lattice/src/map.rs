//! Lattice coordinates over the whole picture: exact on a grid, interpolated in between.

use crate::surface::{Chart, Surface};
use crate::view::Level;

/// Lattice coordinates at the corners of a level's blocks.
#[derive(Debug, Default)]
pub(crate) struct PhaseMap {
    /// Both coordinates, cells; NaN where the sheet cannot be seen.
    pub s: Vec<[f32; 2]>,
    pub nodes_x: usize,
    coarse: Vec<[f64; 2]>,
    /// A row of all nodes interpolated from a row of exact ones, for four rows in turn.
    rows: [Vec<[f64; 2]>; STRIDE],
}

/// Coordinates within one block, linear: value at its middle and change per level pixel.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Plane {
    pub s: f32,
    pub du: f32,
    pub dv: f32,
}

/// Blocks between exact values when the sheet is bent; a cubic fills the rest.
const STRIDE: usize = 4;

impl PhaseMap {
    /// Fills the map for one level.
    pub(crate) fn fill(&mut self, surface: &Surface, level: &Level) {
        let chart = surface.chart();
        self.nodes_x = level.nodes_x;
        self.s.clear();
        if surface.height.iter().all(|c| *c == 0.0) || level.nodes_x < 3 * STRIDE || level.nodes_y < 3 * STRIDE {
            self.s.extend(level.rays.iter().map(|r| exact(&chart, r).map(|s| s as f32)));
            return;
        }
        self.fill_bent(&chart, level);
    }

    /// Exact on every fourth node, Catmull-Rom between: 16 times fewer Newton solves, error far below a thousandth of a cell.
    fn fill_bent(&mut self, chart: &Chart, level: &Level) {
        let (nx, ny) = (level.nodes_x, level.nodes_y);
        let position = |g: usize, n: usize| (g * STRIDE).min(n - 1);
        let (cx, cy) = ((nx - 1).div_ceil(STRIDE) + 1, (ny - 1).div_ceil(STRIDE) + 1);
        self.coarse.clear();
        for gy in 0..cy {
            let row = &level.rays[position(gy, ny) * nx..][..nx];
            self.coarse.extend((0..cx).map(|gx| exact(chart, &row[position(gx, nx)])));
        }
        self.s.clear();
        self.s.resize(nx * ny, [f32::NAN; 2]);
        // The last column and row of exact nodes may be nearer than the others: cubics only run inside the even part.
        let even = |n: usize| (n - 1) / STRIDE;
        let inside = |g: usize, n: usize| g >= 1 && g + 2 <= even(n);
        for gy in 0..cy {
            // Row `gy` of exact nodes, cubic along it.
            let row = &self.coarse[gy * cx..][..cx];
            let out = &mut self.rows[gy % STRIDE];
            out.clear();
            out.resize(nx, [f64::NAN; 2]);
            for gx in (0..cx).filter(|g| inside(*g, nx)) {
                for (t, o) in out[gx * STRIDE..][..STRIDE].iter_mut().enumerate() {
                    *o = cubic(t, |i| row[gx + i - 1]);
                }
            }
            // With it the four rows about the gap above the last are there.
            let Some(gap) = gy.checked_sub(2).filter(|gap| inside(*gap, ny)) else { continue };
            for t in 0..STRIDE {
                let out = &mut self.s[(gap * STRIDE + t) * nx..][..nx];
                for (x, o) in out.iter_mut().enumerate() {
                    *o = cubic(t, |j| self.rows[(gap + j - 1) % STRIDE][x]).map(|s| s as f32);
                }
            }
        }
        // Where the cubic has no neighbours (the rim) or a neighbour is invisible: exact.
        for (s, ray) in self.s.iter_mut().zip(&level.rays).filter(|(s, _)| s[0].is_nan()) {
            *s = exact(chart, ray).map(|s| s as f32);
        }
    }

    /// The plane of each family over the block whose upper left corner is node `(x, y)`. `None` where a corner cannot be seen.
    #[inline]
    pub(crate) fn block(&self, x: usize, y: usize) -> Option<[Plane; 2]> {
        let i = y * self.nodes_x + x;
        let top = &self.s[i..i + 2];
        let bottom = &self.s[i + self.nodes_x..i + self.nodes_x + 2];
        let total = top[0][0] + top[1][0] + bottom[0][0] + bottom[1][0];
        if total.is_nan() {
            return None;
        }
        let plane = |f: usize| {
            let (a, b, c, d) = (top[0][f], top[1][f], bottom[0][f], bottom[1][f]);
            Plane { s: 0.25 * (a + b + c + d), du: 0.125 * (b - a + d - c), dv: 0.125 * (c - a + d - b) }
        };
        Some([plane(0), plane(1)])
    }
}

fn exact(chart: &Chart, ray: &[f64; 2]) -> [f64; 2] {
    if ray[0].is_nan() {
        return [f64::NAN; 2];
    }
    chart.at(ray[0], ray[1]).map_or([f64::NAN; 2], |p| p.s)
}

/// Catmull-Rom's cubic through four exact nodes, `t` steps after the second.
#[inline]
fn cubic(t: usize, node: impl Fn(usize) -> [f64; 2]) -> [f64; 2] {
    let t = t as f64 / STRIDE as f64;
    let (t2, t3) = (t * t, t * t * t);
    let weights = [
        0.5 * (-t + 2.0 * t2 - t3),
        0.5 * (2.0 - 5.0 * t2 + 3.0 * t3),
        0.5 * (t + 4.0 * t2 - 3.0 * t3),
        0.5 * (t3 - t2),
    ];
    let mut sum = [0.0; 2];
    for (i, w) in weights.into_iter().enumerate() {
        let n = node(i);
        sum[0] += w * n[0];
        sum[1] += w * n[1];
    }
    sum
}
