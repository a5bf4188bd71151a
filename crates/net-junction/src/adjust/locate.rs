//! Where each twine lies, bin by bin: matched filter, local polarity, local amplitude.

use crate::adjust::config::AdjustConfig;
use crate::adjust::graph::{Graph, median};
use crate::adjust::profile::{Profiles, STEP_PX};
use crate::adjust::solve::WEIGHT_MAX;
use crate::adjust::template::{Kernel, Kernels, Match};

/// Cells to each side over which polarity and amplitude are compared.
const POLARITY_RADIUS: i32 = 4;
const AMPLITUDE_RADIUS: i32 = 3;
/// Amplitudes outside these parts of the neighbours' are something else than twine.
const AMPLITUDE_PARTS: (f32, f32) = (0.35, 3.0);
/// Twine is looked for this far at least and at most, px.
const SEARCH_PX: (f64, f64) = (1.0, 9.0);

/// Measured offsets of all bins; keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct Locator {
    kernels: Kernels,
    kernel_of_edge: Vec<Kernel>,
    heights: Vec<f32>,
    /// How far each edge is looked for, px.
    reaches: Vec<f64>,
    matches: Vec<Match>,
    /// For each edge the amplitudes, averaged over its bins, at every offset; limited.
    lines: Vec<f32>,
    signs: Vec<f32>,
    picked: Vec<(usize, f32)>,
    amplitudes: Vec<f32>,
    typical: Vec<f32>,
    scratch: Vec<f32>,
    sum: Vec<f32>,
    /// Offsets from the chord, px, for each edge and bin.
    pub offsets: Vec<f32>,
    /// Their weights, 0 to [`WEIGHT_MAX`].
    pub weights: Vec<f32>,
}

impl Locator {
    /// Window of the matched filter on each side of its middle, steps: wide enough for twine and its blur, not for its neighbours.
    fn kernels_for(&mut self, graph: &Graph, twine: f64, config: &AdjustConfig) {
        self.kernels.clear();
        self.kernel_of_edge.clear();
        let sigma = config.point_spread_px;
        for edge in &graph.edges {
            let [a, b] = edge.nodes.map(|n| &graph.nodes[n as usize]);
            let width = (0.5 * twine * (a.scale + b.scale)).max(0.15);
            let cell = a.spacing[edge.family].min(b.spacing[edge.family]);
            let half = (0.3 * cell).max(2.0).min(0.8 * width + 3.0 * sigma + 1.5);
            self.kernel_of_edge.push(self.kernels.get(width, sigma, (half / STEP_PX).round() as usize));
        }
    }

    fn widest(&self) -> usize {
        self.kernel_of_edge.iter().map(Kernel::half).max().unwrap_or(0)
    }

    fn median_height(&mut self, graph: &Graph) -> f64 {
        self.heights.clear();
        self.heights.extend(graph.nodes.iter().map(|n| n.height as f32));
        f64::from(median(&mut self.heights).unwrap_or(0.0))
    }

    /// The diameter, m, of those tried that explains most of the profiles' variance, on some hundreds of twines.
    pub fn fit_twine(&mut self, graph: &Graph, profiles: &mut Profiles, config: &AdjustConfig) -> f64 {
        let half = (0.35 * self.median_height(graph)).clamp(2.0, 9.0) / STEP_PX;
        let half = half.round() as usize;
        let stride = (graph.edges.len() / 600).max(1);
        profiles.sample(graph, half, false, stride);
        let mut best = (f32::MIN, config.twines_m[0]);
        for &twine in &config.twines_m {
            self.kernels.clear();
            self.scratch.clear();
            for e in (0..graph.edges.len()).step_by(stride) {
                let [a, b] = graph.edges[e].nodes.map(|n| &graph.nodes[n as usize]);
                let width = (0.5 * twine * (a.scale + b.scale)).max(0.15);
                let kernel = self.kernels.get(width, config.point_spread_px, half);
                self.sum.clear();
                self.sum.resize(profiles.width(), 0.0);
                for bin in 0..profiles.bins {
                    self.sum.iter_mut().zip(profiles.row(e, bin)).for_each(|(s, p)| *s += p);
                }
                let found = self.kernels.match_at(&kernel, &self.sum, half);
                self.scratch.push(found.gain / found.rest.max(1e-9));
            }
            let explained = median(&mut self.scratch).unwrap_or(0.0);
            if explained > best.0 {
                best = (explained, twine);
            }
        }
        best.1
    }

    /// Measures where twine lies within `search_cells` of where it is believed, into `offsets` and `weights`.
    pub fn locate(
        &mut self,
        graph: &mut Graph,
        profiles: &mut Profiles,
        twine: f64,
        search_cells: f64,
        config: &AdjustConfig,
    ) {
        self.kernels_for(graph, twine, config);
        self.reaches.clear();
        self.reaches.extend(graph.edges.iter().map(|e| {
            let [a, b] = e.nodes.map(|n| graph.nodes[n as usize].spacing[e.family]);
            (search_cells * a.min(b)).clamp(SEARCH_PX.0, SEARCH_PX.1)
        }));
        let farthest = self.reaches.iter().fold(SEARCH_PX.0, |a, &b| a.max(b));
        let steps = (farthest / STEP_PX).ceil() as usize;
        profiles.sample(graph, steps + self.widest(), false, 1);
        self.match_all(graph, profiles, steps);
        self.settle_signs(graph, steps);
        self.pick(graph, profiles, steps);
        self.weigh(graph, profiles);
    }

    fn match_all(&mut self, graph: &Graph, profiles: &Profiles, steps: usize) {
        let places = 2 * steps + 1;
        self.matches.clear();
        for (e, kernel) in self.kernel_of_edge.iter().enumerate() {
            for bin in 0..profiles.bins {
                let profile = profiles.row(e, bin);
                let first = profiles.half - steps;
                self.matches.extend((0..places).map(|k| self.kernels.match_at(kernel, profile, first + k)));
            }
        }
        debug_assert_eq!(self.matches.len(), graph.edges.len() * profiles.bins * places);
        let bins = profiles.bins;
        self.lines.clear();
        for edge in self.matches.chunks_exact(bins * places) {
            for k in 0..places {
                let sum: f32 = edge.iter().skip(k).step_by(places).map(|m| m.amplitude).sum();
                self.lines.push(sum / bins as f32);
            }
        }
        // One rope or fish must not outvote eighty twines.
        self.scratch.clear();
        let strongest = |line: &[f32]| line.iter().fold(0.0_f32, |most, a| most.max(a.abs()));
        self.scratch.extend(self.lines.chunks_exact(places).map(strongest));
        let limit = 1.5 * median(&mut self.scratch).unwrap_or(0.0) + 1e-6;
        self.lines.iter_mut().for_each(|a| *a = a.clamp(-limit, limit));
    }

    /// Whether twine is light or dark, by the strongest line in reach in the neighbourhood. Weights fall slowly: beside a twine the filter
    /// answers with the other sign, a third as strong, and a twine that is farther off than predicted must still outdo that.
    fn settle_signs(&mut self, graph: &Graph, steps: usize) {
        let places = 2 * steps + 1;
        self.signs.clear();
        for e in 0..graph.edges.len() {
            let near = |k: usize| {
                let q = (k as f64 - steps as f64) * STEP_PX;
                if q.abs() > self.reaches[e] {
                    0.0
                } else {
                    (-0.5 * (q / (self.reaches[e] + 0.5)).powi(2)).exp() as f32
                }
            };
            self.sum.clear();
            self.sum.resize(places, 0.0);
            graph.for_neighbours(e, POLARITY_RADIUS, |n| {
                let line = &self.lines[n * places..][..places];
                self.sum.iter_mut().zip(line).for_each(|(s, a)| *s += a);
            });
            let strongest = (0..places)
                .map(|k| self.sum[k] * near(k))
                .fold(0.0_f32, |best, s| if s.abs() > best.abs() { s } else { best });
            self.signs.push(if strongest < 0.0 { -1.0 } else { 1.0 });
        }
    }

    /// The best place of each bin, to a fraction of a step.
    fn pick(&mut self, graph: &Graph, profiles: &Profiles, steps: usize) {
        let places = 2 * steps + 1;
        self.picked.clear();
        self.offsets.clear();
        for e in 0..graph.edges.len() {
            let (sign, reach) = (self.signs[e], self.reaches[e]);
            let prior = |k: usize| {
                let q = (k as f64 - steps as f64) * STEP_PX;
                if q.abs() > reach { 0.0 } else { (-0.5 * (q / (0.6 * reach + 0.3)).powi(2)).exp() as f32 }
            };
            for bin in 0..profiles.bins {
                let matches = &self.matches[(e * profiles.bins + bin) * places..][..places];
                let mut best = (0, 0.0_f32);
                for (k, m) in matches.iter().enumerate() {
                    let gain = if m.amplitude * sign > 0.0 { m.gain * prior(k) } else { 0.0 };
                    if gain > best.1 {
                        best = (k, gain);
                    }
                }
                self.picked.push(best);
                let k = best.0.clamp(1, places - 2);
                let [l, c, r] = [k - 1, k, k + 1].map(|k| matches[k].amplitude.abs());
                let curvature = l - 2.0 * c + r;
                let part = if curvature < -1e-9 { (0.5 * (l - r) / curvature).clamp(-0.6, 0.6) } else { 0.0 };
                let q = (k as f32 - steps as f32 + part) * STEP_PX as f32;
                let [bow, s_bend] = crate::adjust::graph::bend(profiles.along[bin]);
                let bent = bow * graph.edges[e].bow[0] + s_bend * graph.edges[e].bow[1];
                self.offsets.push(q + bent as f32);
            }
        }
    }

    /// How much each bin is believed: amplitude over what the template leaves, nothing where the amplitude is not the neighbours'.
    fn weigh(&mut self, graph: &mut Graph, profiles: &Profiles) {
        let bins = profiles.bins;
        let places = self.matches.len() / (graph.edges.len() * bins).max(1);
        let found = |k: usize| self.matches[k * places + self.picked[k].0];
        self.scratch.clear();
        self.scratch.extend((0..self.picked.len()).map(|k| found(k).amplitude.abs()));
        let overall = median(&mut self.scratch).unwrap_or(0.0);
        self.weights.clear();
        for k in 0..self.picked.len() {
            let m = found(k);
            let steps = (places - 1) / 2;
            let q = (self.picked[k].0 as f64 - steps as f64) * STEP_PX;
            let good = profiles.inside[k] && self.picked[k].1 > 0.0 && q.abs() < 0.98 * self.reaches[k / bins];
            let noise = ((m.rest - m.gain).max(1e-6) / 5.0).sqrt().max(0.15 * overall + 1e-6);
            self.weights.push(if good { (m.amplitude / noise).powi(2).min(WEIGHT_MAX) } else { 0.0 });
        }
        self.amplitudes.clear();
        for e in 0..graph.edges.len() {
            self.scratch.clear();
            let of_edge = e * bins..(e + 1) * bins;
            self.scratch.extend(of_edge.filter(|&k| self.weights[k] > 0.0).map(|k| found(k).amplitude.abs()));
            self.amplitudes.push(median(&mut self.scratch).unwrap_or(f32::NAN));
        }
        graph.local_median(&self.amplitudes, AMPLITUDE_RADIUS, &mut self.typical);
        for k in 0..self.weights.len() {
            let part = self.matches[k * places + self.picked[k].0].amplitude.abs() / self.typical[k / bins];
            if !(part > AMPLITUDE_PARTS.0 && part < AMPLITUDE_PARTS.1) {
                self.weights[k] = 0.0;
            }
        }
    }
}
