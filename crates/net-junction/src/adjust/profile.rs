//! Grey values across twines: what lies at each distance from the line that a twine is believed to follow.

use net_geometry::nalgebra::Vector2;
use net_image::{GrayView, Image};

use crate::adjust::graph::{Graph, bend};

/// Distance between neighbouring values across the twine, px.
pub(crate) const STEP_PX: f64 = 0.5;
/// Part of a twine at each end that is left to the knots.
const END: f64 = 0.03;
/// Length of a bin along the twine, px, and the most bins of a twine.
const BIN_PX: f64 = 3.0;
const BINS_MAX: f64 = 12.0;
/// Distance between samples along the twine, px: the point spread has averaged over as much already.
const ALONG_PX: f64 = 1.25;

/// Profiles of all twines: for each edge `bins` rows of `width()` values. Distances go from `-half * STEP_PX` to `half * STEP_PX` across the
/// twine, positive to the left of the way from the first to the second node as the picture is seen (from u to v).
#[derive(Debug, Default)]
pub(crate) struct Profiles {
    pub values: Vec<f32>,
    /// Whether the bin lies inside the picture, for each edge and bin.
    pub inside: Vec<bool>,
    pub bins: usize,
    /// Values on each side of the line.
    pub half: usize,
    /// Middle of each bin, 0 to 1 along the twine.
    pub along: Vec<f64>,
    lengths: Vec<f32>,
    source: Image<f32>,
}

impl Profiles {
    /// Takes the picture in.
    pub fn load(&mut self, image: GrayView) {
        self.source.resize(image.width(), image.height());
        for (v, row) in image.rows().enumerate() {
            for (s, &p) in self.source.row_mut(v).iter_mut().zip(row) {
                *s = f32::from(p);
            }
        }
    }

    /// Values of a profile.
    pub fn width(&self) -> usize {
        2 * self.half + 1
    }

    /// The profile of one bin.
    pub fn row(&self, edge: usize, bin: usize) -> &[f32] {
        &self.values[(edge * self.bins + bin) * self.width()..][..self.width()]
    }

    /// Samples `half` steps to each side of every twine, bent as it is believed to be. With `aside` the lines half a cell beside
    /// the twines, through the middles of the meshes: what profiles look like where there is no twine.
    ///
    /// Only every `stride`th twine is sampled; the others' profiles are zero.
    pub fn sample(&mut self, graph: &Graph, half: usize, aside: bool, stride: usize) {
        self.half = half;
        self.lengths.clear();
        self.lengths.extend(graph.edges.iter().map(|e| {
            let [a, b] = e.nodes.map(|n| graph.nodes[n as usize].pixel());
            (b - a).norm() as f32
        }));
        let median = crate::adjust::graph::median(&mut self.lengths).unwrap_or(1.0);
        self.bins = (f64::from(median) / BIN_PX).clamp(1.0, BINS_MAX) as usize;
        self.along.clear();
        self.along.extend((0..self.bins).map(|b| END + (1.0 - 2.0 * END) * (b as f64 + 0.5) / self.bins as f64));
        let width = self.width();
        self.values.clear();
        self.values.resize(graph.edges.len() * self.bins * width, 0.0);
        self.inside.clear();
        self.inside.resize(graph.edges.len() * self.bins, true);
        for (e, edge) in graph.edges.iter().enumerate().step_by(stride) {
            let [first, second] = edge.nodes.map(|n| &graph.nodes[n as usize]);
            let (mut a, mut b) = (first.pixel(), second.pixel());
            if aside {
                a += first.half_steps[1 - edge.family];
                b += second.half_steps[1 - edge.family];
            }
            let chord = b - a;
            let length = chord.norm();
            let normal = Vector2::new(-chord.y, chord.x) / length;
            let samples = (length * (1.0 - 2.0 * END) / (self.bins as f64 * ALONG_PX)).ceil().clamp(1.0, 16.0) as usize;
            let share = 1.0 / samples as f32;
            for bin in 0..self.bins {
                let k = e * self.bins + bin;
                let profile = &mut self.values[k * width..][..width];
                for s in 0..samples {
                    let part = (bin as f64 + (s as f64 + 0.5) / samples as f64) / self.bins as f64;
                    let along = END + (1.0 - 2.0 * END) * part;
                    let [bow, s_bend] = bend(along);
                    let middle = a + chord * along + normal * (bow * edge.bow[0] + s_bend * edge.bow[1]);
                    if !inside(&self.source, middle) {
                        self.inside[k] = false;
                    }
                    let start = middle - normal * (STEP_PX * half as f64);
                    add_line(&self.source, start, normal * STEP_PX, share, profile);
                }
            }
        }
    }
}

fn inside(image: &Image<f32>, p: Vector2<f64>) -> bool {
    p.x > 1.0 && p.y > 1.0 && p.x < image.width() as f64 - 2.0 && p.y < image.height() as f64 - 2.0
}

/// Adds `share` of the picture's values at `start + k * step` to `out[k]`; beyond its end the picture goes on as its last pixel. Bilinear.
fn add_line(image: &Image<f32>, start: Vector2<f64>, step: Vector2<f64>, share: f32, out: &mut [f32]) {
    let end = start + step * out.len() as f64;
    let width = image.width();
    let (mut x, mut y) = (start.x as f32, start.y as f32);
    let (dx, dy) = (step.x as f32, step.y as f32);
    let data = image.data();
    if inside(image, start) && inside(image, end) {
        for value in out {
            // Inside: positive, and the next pixels are there.
            let (u0, v0) = (x as u32, y as u32);
            let (fu, fv) = (x - u0 as f32, y - v0 as f32);
            let at = v0 as usize * width + u0 as usize;
            let (top, low) = (&data[at..at + 2], &data[at + width..at + width + 2]);
            let (a, b) = (top[0] + fu * (top[1] - top[0]), low[0] + fu * (low[1] - low[0]));
            *value += share * (a + fv * (b - a));
            x += dx;
            y += dy;
        }
        return;
    }
    let (right, bottom) = ((width - 1) as f32, (image.height() - 1) as f32);
    for value in out {
        let (u, v) = (x.clamp(0.0, right), y.clamp(0.0, bottom));
        let (u0, v0) = (u as usize, v as usize);
        let (fu, fv) = (u - u0 as f32, v - v0 as f32);
        let at = v0 * width + u0;
        let (to_right, below) = (usize::from(u0 + 1 < width), if v0 + 1 < image.height() { width } else { 0 });
        let top = data[at] + fu * (data[at + to_right] - data[at]);
        let low = data[at + below] + fu * (data[at + below + to_right] - data[at + below]);
        *value += share * (top + fv * (low - top));
        x += dx;
        y += dy;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_is_sampled_exactly_and_goes_on_beyond_the_end() {
        let mut image = Image::new(20, 10);
        for v in 0..10 {
            for u in 0..20 {
                image.row_mut(v)[u] = 3.0 * u as f32 + 10.0 * v as f32;
            }
        }
        let at = |u: f64, v: f64| 3.0 * u.clamp(0.0, 19.0) + 10.0 * v.clamp(0.0, 9.0);
        for (start, step) in
            [((4.3, 2.2), (0.4, 0.3)), ((-2.0, 5.0), (0.5, 0.1)), ((17.0, 8.0), (0.3, 0.4)), ((1e9, -1e9), (0.5, 0.0))]
        {
            let mut out = [1.0_f32; 9];
            add_line(&image, Vector2::new(start.0, start.1), Vector2::new(step.0, step.1), 0.5, &mut out);
            for (k, value) in out.iter().enumerate() {
                let (u, v) = (start.0 + step.0 * k as f64, start.1 + step.1 * k as f64);
                // Single precision of coordinates.
                assert!((f64::from(*value) - 1.0 - 0.5 * at(u, v)).abs() < 1e-3, "at ({u}, {v})");
            }
        }
    }
}
