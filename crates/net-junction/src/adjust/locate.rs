//! Where each twine lies, bin by bin: matched filter, local polarity, local amplitude.

use net_image::widely;
use wide::f32x8;

use crate::adjust::config::AdjustConfig;
use crate::adjust::graph::{Edge, Graph, bend, median, upper};
use crate::adjust::lanes::LANES;
use crate::adjust::profile::{COARSE_PX, Profiles};
use crate::adjust::solve::{Solver, WEIGHT_MAX};
use crate::adjust::source::Source;
use crate::adjust::template::{Kernel, Kernels, Look};

/// Amplitudes outside these parts of the neighbours' are something else than twine.
const AMPLITUDE_PARTS: (f32, f32) = (0.35, 3.0);
/// Least noise, in parts of strong twine's amplitude.
const LEAST_NOISE: f32 = 0.15;
/// Twine is looked for this far at least, px.
const SEARCH_MIN_PX: f64 = 1.0;
/// Length over which what the template leaves, as a sum of squares, is taken for noise, px: misfit counts as noise.
const REST_PX: f32 = 2.5;
/// Ways of the picture during the exposure that are tried, px; none longer than this part of a cell, where the first harmonic of the lattice has a
/// sixth left. Shorter ones than these leave twine where it is.
const BLURS_PX: [f64; 8] = [5.0, 5.75, 6.5, 7.25, 8.0, 10.0, 12.0, 16.0];
const BLUR_CELLS: f64 = 0.85;
/// Share of the variance that motion must explain on top, and the part of what still twine leaves that it may leave at the most: in small cells hardly
/// anything is left. Chosen on drawn nets, of which none that stood still was taken for moving.
const BLUR_GAIN: f32 = 0.05;
const BLUR_LEFT: f32 = 0.7;
/// Twines on which the diameter is tried.
const FIT_TWINES: usize = 150;

/// Places within a vector.
const EACH: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// Measured offsets of all bins; keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct Locator {
    pub profiles: Profiles,
    kernels: Kernels,
    kernel_of_edge: Vec<Kernel>,
    /// How far each edge is looked for, px.
    reaches: Vec<f32>,
    /// Offsets on each side at which `responses` are.
    steps: usize,
    /// For each edge and bin the amplitudes at every offset.
    responses: Vec<f32>,
    /// For each edge the amplitudes, averaged over its bins, at every offset; limited.
    lines: Vec<f32>,
    /// By block: their sums.
    block_lines: Vec<f32>,
    /// By block.
    signs: Vec<f32>,
    /// By edge and bin: amplitude where twine is picked; NaN where it is not.
    picked: Vec<f32>,
    /// By edge: twine's typical amplitude; by block: around it.
    amplitudes: Vec<f32>,
    typical: Vec<f32>,
    scratch: Vec<f32>,
    rests: Vec<f32>,
    sum: Vec<f32>,
    /// Offsets from the chord, px, for each edge and bin.
    pub offsets: Vec<f32>,
    /// Their weights, 0 to [`WEIGHT_MAX`].
    pub weights: Vec<f32>,
}

impl Locator {
    fn kernels_for(&mut self, graph: &Graph, look: &Look, step_px: f64) {
        self.kernels.start(step_px);
        self.kernel_of_edge.clear();
        for e in 0..graph.edges.len() {
            self.kernel_of_edge.push(kernel_for(&mut self.kernels, graph, e, look));
        }
    }

    fn widest(&self) -> usize {
        self.kernel_of_edge.iter().map(Kernel::half).max().unwrap_or(0)
    }

    /// The diameter, m, of those tried that explains most of the profiles' variance, on some hundreds of twines.
    pub fn fit_twine(
        &mut self,
        source: &Source,
        graph: &Graph,
        scratch: &mut Profiles,
        height: f64,
        look: &Look,
        config: &AdjustConfig,
    ) -> f64 {
        let half = ((0.35 * height).clamp(2.0, 9.0) / COARSE_PX).round() as usize;
        // Odd: both families in turn.
        let stride = (graph.edges.len() / FIT_TWINES) | 1;
        scratch.sample(source, graph, (half, COARSE_PX), false, stride, Some(1));
        let mut best = (f32::MIN, config.twines_m[0]);
        for &twine in &config.twines_m {
            self.kernels.start(COARSE_PX);
            self.scratch.clear();
            for e in (0..graph.edges.len()).step_by(stride) {
                let Edge { nodes, family, .. } = graph.edges[e];
                let [a, b] = nodes.map(|n| &graph.nodes[n as usize]);
                let width = (0.5 * twine * (a.scale + b.scale)).max(0.15);
                let kernel =
                    self.kernels.get(width, look.spread_px, 0.5 * look.blur_m[family] * (a.scale + b.scale), half);
                let found = self.kernels.match_at(&kernel, scratch.from(e, 0, 0), half);
                self.scratch.push(found.gain / found.rest.max(1e-9));
            }
            let explained = upper(&mut self.scratch).unwrap_or(0.0);
            if explained > best.0 {
                best = (explained, twine);
            }
        }
        best.1
    }

    /// How far, m, the net moved across the twines of each family while the shutter was open: the way that explains most of the
    /// profiles' variance, wherever in reach twine then lies. Near twine moves farther in the picture than far.
    pub fn fit_blur(
        &mut self,
        source: &Source,
        graph: &Graph,
        scratch: &mut Profiles,
        height: f64,
        look: &Look,
        config: &AdjustConfig,
    ) -> [f64; 2] {
        let scale = graph.nodes.iter().map(|n| n.scale).sum::<f64>() / graph.nodes.len().max(1) as f64;
        if BLUR_CELLS * height < BLURS_PX[0] {
            return [0.0; 2];
        }
        let cell = height.min(3.0 * BLURS_PX[BLURS_PX.len() - 1]);
        let (half, shifts) = ((0.5 * cell).round().max(3.0) as usize, (0.3 * cell).ceil() as usize);
        let stride = (graph.edges.len() / FIT_TWINES) | 1;
        scratch.sample(source, graph, (half + shifts, COARSE_PX), false, stride, Some(1));
        let places = 2 * shifts + 1;
        let Self { kernels, scratch: explained, rests, sum: amplitudes, .. } = self;
        amplitudes.resize(places, 0.0);
        [0, 1].map(|family| {
            let twines = || (0..graph.edges.len()).step_by(stride).filter(|&e| graph.edges[e].family == family);
            rests.clear();
            let (mut still, mut best) = (f32::MIN, (f32::MIN, 0.0));
            let standing = config.twines_m.iter().map(|&twine| (twine, 0.0));
            let moving = BLURS_PX.into_iter().take_while(|b| *b <= BLUR_CELLS * cell).map(|b| (look.twine_m, b));
            for (twine, blur) in standing.chain(moving) {
                kernels.start(COARSE_PX);
                explained.clear();
                for (n, e) in twines().enumerate() {
                    let [a, b] = graph.edges[e].nodes.map(|n| &graph.nodes[n as usize]);
                    let width = (0.5 * twine * (a.scale + b.scale)).max(0.15);
                    let blur = blur / scale * 0.5 * (a.scale + b.scale);
                    let kernel = kernels.get(width, look.spread_px, blur, half);
                    let profile = scratch.from(e, 0, 0);
                    // The same for all kernels, which are of the same length.
                    if rests.len() == n * places {
                        rests.extend((0..places).map(|k| kernels.rest(&kernel, &profile[k..]).max(1e-9)));
                    }
                    kernels.amplitudes(&kernel, profile, half, amplitudes);
                    let shares = amplitudes.iter().zip(&rests[n * places..]).map(|(a, rest)| kernel.gain(*a) / rest);
                    explained.push(shares.fold(0.0, f32::max));
                }
                let explained = upper(explained).unwrap_or(0.0);
                if blur == 0.0 {
                    still = explained.max(still);
                } else if explained > best.0
                    && explained > still + BLUR_GAIN
                    && 1.0 - explained < BLUR_LEFT * (1.0 - still)
                {
                    best = (explained, blur / scale);
                }
            }
            best.1
        })
    }

    /// Samples the picture across every twine, as far as it is looked for, and filters what is there. Offsets are from where nodes are
    /// believed to be now.
    pub fn look(&mut self, source: &Source, graph: &Graph, look: &Look, search_cells: f64, step_px: f64) {
        self.kernels_for(graph, look, step_px);
        self.reach(graph, search_cells);
        let farthest = self.reaches.iter().fold(0.0_f32, |a, &b| a.max(b));
        self.steps = (f64::from(farthest) / step_px).ceil() as usize + 1;
        self.profiles.sample(source, graph, (self.steps + self.widest(), step_px), false, 1, None);
        let places = 2 * self.steps + 1;
        let first = self.profiles.half - self.steps;
        self.responses.resize(graph.edges.len() * self.profiles.bins * places + LANES, 0.0);
        self.lines.clear();
        self.lines.resize(graph.edges.len() * places, 0.0);
        filter_all(self, first, places);
        self.settle_signs(graph);
    }

    /// How far twine is looked for from now on, cells; no farther than it was sampled.
    pub fn reach(&mut self, graph: &Graph, search_cells: f64) {
        self.reaches.clear();
        self.reaches.extend((0..graph.edges.len()).map(|e| reach_px(graph, e, search_cells)));
    }

    /// Whether twine is light or dark, by the strongest line in reach in the neighbourhood.
    fn settle_signs(&mut self, graph: &Graph) {
        let places = 2 * self.steps + 1;
        // One rope or fish must not outvote eighty twines.
        self.scratch.clear();
        let strongest = |line: &[f32]| line.iter().fold(0.0_f32, |most, a| most.max(a.abs()));
        self.scratch.extend(self.lines.chunks_exact(places).map(strongest));
        let limit = 1.5 * median(&mut self.scratch).unwrap_or(0.0) + 1e-6;
        self.lines.iter_mut().for_each(|a| *a = a.clamp(-limit, limit));
        let line = |e: usize| Some(&self.lines[e * places..][..places]);
        graph.blocks.sum_members(places, line, &mut self.block_lines);
        graph.blocks.sum_neighbours(places, &mut self.block_lines, &mut self.sum);
        self.signs.clear();
        for block in 0..graph.blocks.count() {
            let Some(&first) = graph.blocks.members(block).first() else {
                self.signs.push(1.0);
                continue;
            };
            let reach = self.reaches[first as usize];
            let around = &self.block_lines[block * places..][..places];
            self.signs.push(sign(around, reach / self.profiles.step_px as f32));
        }
    }

    /// Measures where twine lies within reach of where `solver` has it, into `offsets` and `weights`.
    pub fn pick(&mut self, graph: &mut Graph, solver: Option<&Solver>) {
        let bins = graph.edges.len() * self.profiles.bins;
        self.picked.clear();
        self.picked.reserve(bins);
        self.offsets.clear();
        self.offsets.reserve(bins);
        self.weights.clear();
        self.weights.reserve(bins);
        pick_all(self, graph, solver);
        self.weigh(graph);
    }

    #[inline(always)]
    fn pick_twine(&mut self, graph: &Graph, e: usize, shape: Option<[f32; 4]>) {
        let (bins, places) = (self.profiles.bins, 2 * self.steps + 1);
        let (edge, step, kernel) = (&graph.edges[e], self.profiles.step_px as f32, &self.kernel_of_edge[e]);
        let (sign, reach) = (self.signs[graph.blocks.of_edge(e)], self.reaches[e]);
        let inverse = 1.0 / (0.6 * reach + 0.3).powi(2);
        for bin in 0..bins {
            let along = self.profiles.along[bin];
            let [bow, s_bend] = bend(along);
            // The profile's middle lies on the line as it was when it was sampled.
            let bent = bow * edge.bow[0] + s_bend * edge.bow[1];
            let believed =
                shape.map_or(0.0, |s| s[0] * (1.0 - along) + s[1] * along + s[2] * bow + s[3] * s_bend - bent);
            let row = &self.responses[(e * bins + bin) * places..][..places];
            let middle = believed / step + self.steps as f32;
            let (low, high) = (middle - reach / step, (middle + reach / step).min((places - 1) as f32));
            // Whole vectors: beyond the row's end is another one's beginning.
            let padded = &self.responses[(e * bins + bin) * places..][..places.next_multiple_of(LANES)];
            let (mut best, mut best_at) = (f32x8::ZERO, f32x8::ZERO);
            for (amplitudes, first) in padded.as_chunks::<LANES>().0.iter().zip((0u8..).step_by(LANES)) {
                let at = f32x8::from(EACH) + f32x8::splat(f32::from(first));
                let q = (at - f32x8::splat(middle)) * f32x8::splat(step);
                // A bell without an exponential.
                let bell = f32x8::ONE / (f32x8::ONE + q * q * f32x8::splat(0.25 * inverse));
                let near = f32x8::from(*amplitudes) * f32x8::splat(sign) * bell * bell;
                let better = at.simd_ge(f32x8::splat(low)) & at.simd_le(f32x8::splat(high)) & near.simd_gt(best);
                (best, best_at) = (better.select(near, best), better.select(at, best_at));
            }
            let most = best.to_array().into_iter().fold(0.0, |a, b| if b > a { b } else { a });
            let of_most = best.simd_ge(f32x8::splat(most)).select(best_at, f32x8::splat(f32::MAX));
            let first = of_most.to_array().into_iter().fold(f32::MAX, |a, b| if b < a { b } else { a });
            let at = if most > 0.0 { first as usize } else { 0 };
            let k = at.clamp(1, places - 2);
            let part = vertex([k - 1, k, k + 1].map(|k| row[k] * sign));
            let q = (k as f32 - self.steps as f32 + part) * step;
            self.offsets.push(q + bent);
            let good = most > 0.0 && self.profiles.inside[e * bins + bin] && (q - believed).abs() < 0.98 * reach;
            let amplitude = row[at].abs();
            self.picked.push(if good { amplitude } else { f32::NAN });
            // The squared sum that the template leaves, for now.
            let rest = if good {
                let first = at + self.profiles.half - self.steps - kernel.half();
                let rest = self.kernels.rest(kernel, self.profiles.from(e, bin, first)) - kernel.gain(amplitude);
                (rest.max(1e-6) * step / REST_PX).sqrt()
            } else {
                f32::NAN
            };
            self.weights.push(rest);
        }
    }

    /// How much each bin is believed: amplitude over what the template leaves, nothing where the amplitude is not the neighbours'.
    fn weigh(&mut self, graph: &mut Graph) {
        let bins = self.profiles.bins;
        self.amplitudes.clear();
        for e in 0..graph.edges.len() {
            self.scratch.clear();
            self.scratch.extend(self.picked[e * bins..(e + 1) * bins].iter().filter(|a| !a.is_nan()));
            self.amplitudes.push(median(&mut self.scratch).unwrap_or(f32::NAN));
        }
        graph.blocks.local_median(&self.amplitudes, &mut self.typical);
        self.scratch.clear();
        self.scratch.extend(self.amplitudes.iter().filter(|a| !a.is_nan()));
        let least = LEAST_NOISE * upper(&mut self.scratch).unwrap_or(0.0) + 1e-6;
        for (k, weight) in self.weights.iter_mut().enumerate() {
            let amplitude = self.picked[k];
            let part = amplitude / self.typical[graph.blocks.of_edge(k / bins)];
            // False for NaN.
            let alike = part > AMPLITUDE_PARTS.0 && part < AMPLITUDE_PARTS.1;
            *weight = if alike { (amplitude / weight.max(least)).powi(2).min(WEIGHT_MAX) } else { 0.0 };
        }
    }
}

widely! {
    /// Amplitudes of all bins at all places, the first at this value of their profiles, and their means over the twine.
    fn filter_all<'a>(locator: &'a mut Locator, first: usize, places: usize) -> () {
        let Locator { profiles, kernels, kernel_of_edge, responses, lines, .. } = locator;
        let (bins, share) = (profiles.bins, 1.0 / profiles.bins as f32);
        let of_edges = responses.chunks_exact_mut(bins * places).zip(lines.chunks_exact_mut(places));
        for (e, (kernel, (responses, line))) in kernel_of_edge.iter().zip(of_edges).enumerate() {
            for (bin, row) in responses.chunks_exact_mut(places).enumerate() {
                kernels.amplitudes_inline(kernel, profiles.row(e, bin), first, row);
                line.iter_mut().zip(row).for_each(|(l, a)| *l += share * *a);
            }
        }
    }
}

widely! {
    /// Picks all twines.
    fn pick_all<'a>(locator: &'a mut Locator, graph: &'a Graph, solver: Option<&'a Solver>) -> () {
        for e in 0..graph.edges.len() {
            locator.pick_twine(graph, e, solver.map(|s| s.shape(graph, e)));
        }
    }
}

/// Matched filter for a twine.
pub(crate) fn kernel_for(kernels: &mut Kernels, graph: &Graph, edge: usize, look: &Look) -> Kernel {
    let Edge { nodes, family, .. } = graph.edges[edge];
    let [a, b] = nodes.map(|n| &graph.nodes[n as usize]);
    let width = (0.5 * look.twine_m * (a.scale + b.scale)).max(0.15);
    let blur = 0.5 * look.blur_m[family] * (a.scale + b.scale);
    let half = look.window_px(width, a.spacing[family].min(b.spacing[family]), blur);
    kernels.get(width, look.spread_px, blur, (half / kernels.step_px()).round() as usize)
}

/// How far a twine is looked for, px.
pub(crate) fn reach_px(graph: &Graph, edge: usize, search_cells: f64) -> f32 {
    let edge = &graph.edges[edge];
    let [a, b] = edge.nodes.map(|n| graph.nodes[n as usize].spacing[edge.family]);
    (search_cells * a.min(b)).max(SEARCH_MIN_PX) as f32
}

/// Sign of the strongest line in reach (in steps), of amplitudes at every offset. Weights fall slowly: beside a twine the filter answers
/// with the other sign, a third as strong, and a twine that is farther off than predicted must still outdo that.
pub(crate) fn sign(amplitudes: &[f32], reach: f32) -> f32 {
    let middle = (amplitudes.len() / 2) as f32;
    let weighted = amplitudes.iter().enumerate().map(|(k, a)| {
        let q = k as f32 - middle;
        if q.abs() > reach { 0.0 } else { a * (-0.5 * (q / (reach + 0.5)).powi(2)).exp() }
    });
    let strongest = weighted.fold(0.0_f32, |best, s| if s.abs() > best.abs() { s } else { best });
    if strongest < 0.0 { -1.0 } else { 1.0 }
}

/// Where three successive positive values have their maximum, in steps from the middle: that of a bell through them, or of a parabola.
pub(crate) fn vertex([l, c, r]: [f32; 3]) -> f32 {
    let least = 0.05 * c;
    let (across, curvature) =
        if l > least && r > least { ((l / r).ln(), (l * r / (c * c)).ln()) } else { (l - r, l - 2.0 * c + r) };
    if curvature < -1e-9 { (0.5 * across / curvature).clamp(-0.6, 0.6) } else { 0.0 }
}
