//! Grey values across twines: what lies at each distance from the line that a twine is believed to follow.

use net_geometry::nalgebra::Vector2;
use net_image::{GrayView, Image};

use crate::adjust::graph::{Edge, Graph, bend, median};

/// Distance between neighbouring values across the twine, px: to find it, and to measure it.
pub(crate) const COARSE_PX: f64 = 1.0;
pub(crate) const FINE_PX: f64 = 0.5;
/// Part of a twine at each end that is left to the knots.
const END: f32 = 0.03;
/// Length of a bin along the twine, px, to find it and to measure it.
const BIN_PX: (f32, f32) = (5.0, 3.0);
/// Least and most bins of a twine that is measured.
const BINS: (f32, f32) = (5.0, 12.0);
/// Most distance between samples along the twine, px: bilinear samples then touch nearly every pixel.
const ALONG_PX: f32 = 1.75;
/// A picture coordinate's unit, 1/65536 px, and a fraction's, 1/256 px.
const ONE: f32 = 65536.0;
/// Most samples of a bin.
const SAMPLES_MAX: f32 = 16.0;

/// Profiles of all twines: for each edge `bins` rows of `width()` values. Distances go from `-half` to `half` steps across the
/// twine, positive to the left of the way from the first to the second node as the picture is seen (from u to v).
#[derive(Debug, Default)]
pub(crate) struct Profiles {
    pub values: Vec<f32>,
    /// Whether the bin lies inside the picture, for each edge and bin.
    pub inside: Vec<bool>,
    pub bins: usize,
    /// Values on each side of the line.
    pub half: usize,
    /// Distance between them, px.
    pub step_px: f64,
    /// Median length of the twines, px.
    pub length_px: f32,
    /// Middle of each bin, 0 to 1 along the twine.
    pub along: Vec<f32>,
    lengths: Vec<f32>,
    sums: Vec<i32>,
}

/// A picture without gaps between its rows.
#[derive(Debug, Default)]
pub(crate) struct Source(Image<u8>);

impl Source {
    /// Takes the picture in.
    pub fn load(&mut self, image: GrayView) {
        self.0.resize(image.width(), image.height());
        for (v, row) in image.rows().enumerate() {
            self.0.row_mut(v).copy_from_slice(row);
        }
    }
}

impl Source {
    /// Puts into each of `inside.len()` bins of `width` values, `step_px` apart, the mean picture across the line between two pixels, and says
    /// which bins lie inside the picture.
    pub fn profiles(
        &self,
        [a, b]: [Vector2<f64>; 2],
        bow: [f32; 2],
        step_px: f64,
        inside: &mut [bool],
        sums: &mut Vec<i32>,
        values: &mut [f32],
    ) {
        let width = values.len() / inside.len().max(1);
        let (a, chord) = (a.cast::<f32>(), (b - a).cast::<f32>());
        let length = chord.norm();
        let normal = Vector2::new(-chord.y, chord.x) / length;
        let share = (1.0 - 2.0 * END) / inside.len() as f32;
        let samples = (length * share / ALONG_PX).ceil().clamp(1.0, SAMPLES_MAX) as usize;
        let step = normal * step_px as f32;
        let back = step * (width / 2) as f32;
        let weight = 1.0 / samples as f32;
        for (bin, (profile, inside)) in values.chunks_exact_mut(width).zip(inside).enumerate() {
            sums.clear();
            sums.resize(width, 0);
            for s in 0..samples {
                let along = END + share * (bin as f32 + (s as f32 + 0.5) * weight);
                let [hump, s_bend] = bend(along);
                let middle = a + chord * along + normal * (hump * bow[0] + s_bend * bow[1]);
                *inside &= is_inside(&self.0, middle);
                add_line(&self.0, middle - back, step, sums);
            }
            let unit = weight / ONE;
            profile.iter_mut().zip(sums.iter()).for_each(|(p, &s)| *p = unit * s as f32);
        }
    }
}

impl Profiles {
    /// Values of a profile.
    pub fn width(&self) -> usize {
        2 * self.half + 1
    }

    /// The profile of one bin.
    pub fn row(&self, edge: usize, bin: usize) -> &[f32] {
        &self.values[(edge * self.bins + bin) * self.width()..][..self.width()]
    }

    /// Samples `half` steps of `step_px` to each side of every twine, bent as it is believed to be. With `aside` the lines half a cell beside
    /// the twines, through the middles of the meshes: what profiles look like where there is no twine.
    ///
    /// Only every `stride`th twine is sampled; the others' profiles are zero. `bins` overrides the number of bins.
    pub fn sample(
        &mut self,
        source: &Source,
        graph: &Graph,
        (half, step_px): (usize, f64),
        aside: bool,
        stride: usize,
        bins: Option<usize>,
    ) {
        (self.half, self.step_px) = (half, step_px);
        self.lengths.clear();
        self.lengths.extend(graph.edges.iter().step_by(stride).map(|e| length(graph, e) as f32));
        let median = median(&mut self.lengths).unwrap_or(1.0);
        self.length_px = median;
        let (bin_px, fewest) = if step_px < COARSE_PX { (BIN_PX.1, BINS.0) } else { (BIN_PX.0, 1.0) };
        self.bins = bins.unwrap_or((median / bin_px).clamp(fewest, BINS.1) as usize);
        self.along.clear();
        let share = (1.0 - 2.0 * END) / self.bins as f32;
        self.along.extend((0..self.bins).map(|b| END + share * (b as f32 + 0.5)));
        let width = self.width();
        self.values.clear();
        self.values.resize(graph.edges.len() * self.bins * width, 0.0);
        self.inside.clear();
        self.inside.resize(graph.edges.len() * self.bins, true);
        for (e, edge) in graph.edges.iter().enumerate().step_by(stride) {
            self.sample_one(source, graph, e, edge, aside);
        }
    }

    fn sample_one(&mut self, source: &Source, graph: &Graph, e: usize, edge: &Edge, aside: bool) {
        let width = self.width();
        let [first, second] = edge.nodes.map(|n| &graph.nodes[n as usize]);
        let (mut a, mut b) = (first.pixel(), second.pixel());
        if aside {
            a += first.half_steps[1 - edge.family];
            b += second.half_steps[1 - edge.family];
        }
        let inside = &mut self.inside[e * self.bins..][..self.bins];
        let values = &mut self.values[e * self.bins * width..][..self.bins * width];
        source.profiles([a, b], edge.bow, self.step_px, inside, &mut self.sums, values);
    }
}

/// Length of a twine's chord, px.
fn length(graph: &Graph, edge: &Edge) -> f64 {
    let [a, b] = edge.nodes.map(|n| graph.nodes[n as usize].pixel());
    (b - a).norm()
}

fn is_inside(image: &Image<u8>, p: Vector2<f32>) -> bool {
    p.x > 1.0 && p.y > 1.0 && p.x < image.width() as f32 - 2.0 && p.y < image.height() as f32 - 2.0
}

/// Adds the picture's values at `start + k * step` to `out[k]`, in 65536ths of a grey level; beyond its end the picture goes on as its last
/// pixel. Bilinear, in whole numbers.
fn add_line(image: &Image<u8>, start: Vector2<f32>, step: Vector2<f32>, out: &mut [i32]) {
    let end = start + step * out.len() as f32;
    let width = image.width();
    let data = image.data();
    let between = |a: i32, b: i32, part: i32| (a << 8) + part * (b - a);
    if is_inside(image, start) && is_inside(image, end) {
        let (mut x, mut y) = ((start.x * ONE) as i32, (start.y * ONE) as i32);
        let (dx, dy) = ((step.x * ONE) as i32, (step.y * ONE) as i32);
        for value in out {
            let (fu, fv) = ((x >> 8) & 0xff, (y >> 8) & 0xff);
            let at = (y >> 16) as usize * width + (x >> 16) as usize;
            let square = &data[at..at + width + 2];
            let at = |k: usize| i32::from(square[k]);
            let (top, low) = (between(at(0), at(1), fu), between(at(width), at(width + 1), fu));
            *value += between(top, low, fv);
            x += dx;
            y += dy;
        }
        return;
    }
    let (mut x, mut y) = (start.x, start.y);
    let (right, bottom) = ((width - 1) as f32, (image.height() - 1) as f32);
    for value in out {
        let (u, v) = (x.clamp(0.0, right), y.clamp(0.0, bottom));
        let (u0, v0) = (u as usize, v as usize);
        let (fu, fv) = (((u - u0 as f32) * 256.0) as i32, ((v - v0 as f32) * 256.0) as i32);
        let at = v0 * width + u0;
        let (to_right, below) = (usize::from(u0 + 1 < width), if v0 + 1 < image.height() { width } else { 0 });
        let at = |k: usize| i32::from(data[at + k]);
        let (top, low) = (between(at(0), at(to_right), fu), between(at(below), at(below + to_right), fu));
        *value += between(top, low, fv);
        x += step.x;
        y += step.y;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_is_sampled_exactly_and_goes_on_beyond_the_end() {
        let mut image = Image::new(20, 10);
        for v in 0..10_u8 {
            for u in 0..20_u8 {
                image.row_mut(usize::from(v))[usize::from(u)] = 3 * u + 10 * v;
            }
        }
        let at = |u: f32, v: f32| 3.0 * u.clamp(0.0, 19.0) + 10.0 * v.clamp(0.0, 9.0);
        for (start, step) in
            [((4.3, 2.2), (0.4, 0.3)), ((-2.0, 5.0), (0.5, 0.1)), ((17.0, 8.0), (0.3, 0.4)), ((1e9, -1e9), (0.5, 0.0))]
        {
            let mut out = [65536_i32; 9];
            add_line(&image, Vector2::new(start.0, start.1), Vector2::new(step.0, step.1), &mut out);
            for (k, value) in out.iter().enumerate() {
                let (u, v) = (start.0 + step.0 * k as f32, start.1 + step.1 * k as f32);
                // Fractions are cut to 1/256 px, of 3 grey levels along u and 10 along v.
                assert!((*value as f32 / ONE - 1.0 - at(u, v)).abs() < 13.5 / 256.0, "at ({u}, {v})");
            }
        }
    }
}
