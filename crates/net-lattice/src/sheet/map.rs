//! Lattice coordinates over the whole picture: exact on a grid, interpolated in between.

use crate::picture::view::Level;
use crate::sheet::chart::Chart;
use crate::sheet::surface::Surface;

/// Lattice coordinates at the corners of a level's blocks.
#[derive(Debug, Default)]
pub(crate) struct PhaseMap {
    /// Both coordinates, cells; NaN where the sheet cannot be seen.
    pub s: Vec<[f32; 2]>,
    pub nodes_x: usize,
    /// A row of exact nodes.
    coarse: Vec<[f64; 2]>,
    /// Rows of exact nodes, interpolated along them.
    rows: Vec<[f64; 2]>,
}

/// Coordinates within one block, linear: value at its middle and change per level pixel.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Plane {
    pub s: f32,
    pub du: f32,
    pub dv: f32,
}

/// Blocks side by side.
pub(crate) const LANES: usize = 8;
/// A number for each of them.
pub(crate) type Lanes = [f32; LANES];

/// Lattice coordinates over blocks side by side, of both families: in the middle of each, and their change per px.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Strip {
    pub s: [Lanes; 2],
    pub du: [Lanes; 2],
    pub dv: [Lanes; 2],
    /// 1 where the sheet is seen, else 0.
    pub seen: Lanes,
}

/// Blocks between exact values when the sheet is bent; a cubic fills the rest.
const STRIDE: usize = 4;

impl PhaseMap {
    /// Fills the map for one level.
    pub(crate) fn fill(&mut self, surface: &Surface, level: &Level) {
        let chart = surface.chart();
        self.nodes_x = level.nodes_x;
        self.s.clear();
        if surface.is_flat() || level.nodes_x <= 3 * STRIDE || level.nodes_y <= 3 * STRIDE {
            self.s.extend(level.rays.iter().map(|r| exact(&chart, r).map(|s| s as f32)));
            return;
        }
        self.fill_bent(&chart, level);
    }

    /// Exact on every fourth node, cubic between: 16 times fewer Newton solves, error far below a thousandth of a cell.
    fn fill_bent(&mut self, chart: &Chart, level: &Level) {
        let (nx, ny) = (level.nodes_x, level.nodes_y);
        // Gaps between exact nodes; a last one that is narrower is none.
        let (gaps_x, gaps_y) = ((nx - 1) / STRIDE, (ny - 1) / STRIDE);
        // The first of the four exact nodes about a node, or nearest to it, and their weights.
        let about = |x: usize, gaps: usize| {
            let first = (x / STRIDE).saturating_sub(1).min(gaps - 3);
            (first, weights(x - first * STRIDE))
        };
        self.rows.clear();
        for y in 0..=gaps_y {
            self.coarse.clear();
            self.coarse.extend(level.rays[y * STRIDE * nx..][..nx].iter().step_by(STRIDE).map(|ray| exact(chart, ray)));
            self.rows.extend((0..=gaps_x * STRIDE).map(|x| {
                let (first, weights) = about(x, gaps_x);
                cubic(&weights, |i| self.coarse[first + i])
            }));
        }
        self.s.clear();
        self.s.resize(nx * ny, [f32::NAN; 2]);
        let wide = gaps_x * STRIDE + 1;
        for (y, out) in self.s.chunks_exact_mut(nx).enumerate().take(gaps_y * STRIDE + 1) {
            let (first, weights) = about(y, gaps_y);
            let rows = &self.rows[first * wide..][..4 * wide];
            for (x, out) in out[..wide].iter_mut().enumerate() {
                *out = cubic(&weights, |j| rows[j * wide + x]).map(|s| s as f32);
            }
        }
        // In that last gap, and where a neighbour is invisible: exact.
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

    /// The same over [`LANES`] blocks from `(x, y)` on.
    #[inline(always)]
    pub(crate) fn strip(&self, x: usize, y: usize) -> Strip {
        let i = y * self.nodes_x + x;
        let (top, bottom) = (&self.s[i..][..LANES + 1], &self.s[i + self.nodes_x..][..LANES + 1]);
        let mut strip = Strip::default();
        for l in 0..LANES {
            let plane = |f: usize| {
                let (a, b, c, d) = (top[l][f], top[l + 1][f], bottom[l][f], bottom[l + 1][f]);
                Plane { s: 0.25 * (a + b + c + d), du: 0.125 * (b - a + d - c), dv: 0.125 * (c - a + d - b) }
            };
            let [p, q] = [plane(0), plane(1)];
            // Both coordinates of a corner are there, or none.
            let seen = !p.s.is_nan();
            strip.seen[l] = if seen { 1.0 } else { 0.0 };
            for (f, plane) in [p, q].into_iter().enumerate() {
                strip.s[f][l] = if seen { plane.s } else { 0.0 };
                strip.du[f][l] = if seen { plane.du } else { 0.0 };
                strip.dv[f][l] = if seen { plane.dv } else { 0.0 };
            }
        }
        strip
    }
}

fn exact(chart: &Chart, ray: &[f64; 2]) -> [f64; 2] {
    if ray[0].is_nan() {
        return [f64::NAN; 2];
    }
    chart.at(ray[0], ray[1]).map_or([f64::NAN; 2], |p| p.s)
}

/// Weights of four exact nodes in Lagrange's cubic through them, `t` blocks after the first.
#[inline]
fn weights(t: usize) -> [f64; 4] {
    let t = t as f64 / STRIDE as f64;
    let (a, b, c, d) = (t, t - 1.0, t - 2.0, t - 3.0);
    [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0]
}

/// Weighted sum of four nodes.
#[inline]
fn cubic(weights: &[f64; 4], node: impl Fn(usize) -> [f64; 2]) -> [f64; 2] {
    let mut sum = [0.0; 2];
    for (i, w) in weights.iter().enumerate() {
        let n = node(i);
        sum[0] += w * n[0];
        sum[1] += w * n[1];
    }
    sum
}
