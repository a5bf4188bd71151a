//! Grey values across twines: what lies at each distance from the line that a twine is believed to follow.

use crate::adjust::graph::{Edge, Graph, median};
use crate::adjust::lanes::LANES;
use crate::adjust::source::{END, Source};

/// Distance between neighbouring values across the twine, px: to find it, in small cells, and to measure it.
pub(crate) const COARSE_PX: f64 = 1.0;
pub(crate) const FINE_PX: f64 = 0.5;
/// Cells from this size on, px, are looked for in steps of twice as much, and so on: in pictures of half the size.
const HALVED_CELL_PX: f64 = 18.0;
/// Longest steps, px.
const COARSEST_PX: f64 = 4.0;
/// Length of a bin along the twine, px, to find it and to measure it.
const BIN_PX: (f32, f32) = (5.0, 3.0);
/// Least and most bins of a twine that is measured.
const BINS: (f32, f32) = (5.0, 12.0);

/// Distance between values across the twine to find it in cells of this size, px.
pub(crate) fn coarse_px(cell: f64) -> f64 {
    if cell >= 2.0 * HALVED_CELL_PX {
        COARSEST_PX
    } else if cell >= HALVED_CELL_PX {
        2.0 * COARSE_PX
    } else {
        COARSE_PX
    }
}

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

    /// What is kept from a value of one bin's profile on: at least a whole vector beyond its end.
    #[inline(always)]
    pub fn from(&self, edge: usize, bin: usize, value: usize) -> &[f32] {
        &self.values[(edge * self.bins + bin) * self.width() + value..]
    }

    /// Samples `half` steps of `step_px` to each side of every twine, bent as it is believed to be. With `aside` the lines half a cell beside
    /// the twines, through the middles of the meshes: what profiles look like where there is no twine.
    ///
    /// Only every `stride`th twine is sampled; the others' profiles mean nothing. `bins` overrides the number of bins.
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
        let (bin_px, fewest) = if step_px < COARSE_PX { (BIN_PX.1, BINS.0) } else { (BIN_PX.0 * step_px as f32, 1.0) };
        self.bins = bins.unwrap_or((median / bin_px).clamp(fewest, BINS.1) as usize);
        self.along.clear();
        let share = (1.0 - 2.0 * END) / self.bins as f32;
        self.along.extend((0..self.bins).map(|b| END + share * (b as f32 + 0.5)));
        let width = self.width();
        // What is not sampled is not read.
        self.values.resize(graph.edges.len() * self.bins * width + LANES, 0.0);
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
        let values = &mut self.values[e * self.bins * width..][..self.bins * width + LANES];
        source.profiles([a, b], edge.bow, self.step_px, inside, values);
    }
}

/// Length of a twine's chord, px.
fn length(graph: &Graph, edge: &Edge) -> f64 {
    let [a, b] = edge.nodes.map(|n| graph.nodes[n as usize].pixel());
    (b - a).norm()
}
