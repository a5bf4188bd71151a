//! Growth outward from where the prediction is right: measures some hundreds of twines, ring by ring, and bends the prediction to them.

use net_geometry::nalgebra::Vector2;

use crate::adjust::config::AdjustConfig;
use crate::adjust::graph::{Graph, median, upper};
use crate::adjust::lanes::LANES;
use crate::adjust::locate::{kernel_for, reach_px, sign, vertex};
use crate::adjust::map::LatticeMap;
use crate::adjust::source::Source;
use crate::adjust::template::{Kernels, Look};
use crate::adjust::warp::{FIRST_RADIUS, Measured, Warp, radii};

/// Most twines that are measured.
const TWINES: usize = 1500;
/// Amplitudes outside these parts of the typical one are something else than twine.
const AMPLITUDE_PARTS: (f32, f32) = (0.35, 3.0);
/// A twine this near to where it was predicted, cells, speaks for the prediction.
const NEAR_CELLS: f64 = 0.12;
/// By how much more twines must speak for a warp than for none: one that leads astray finds twine, too, if a neighbouring one.
const BETTER: f64 = 1.15;
/// Part of the twines that do not speak for the prediction which may not speak for a right warp either.
const LEFT: f64 = 0.5;
/// Where no twine would move farther than this, cells, there is nothing to compare.
const SMALL_CELLS: f64 = 0.1;

/// Growth begins where every third twine of the list shows half of what is seen where the net is.
const ORIGIN_STRIDE: usize = 3;
const ORIGIN_PART: f32 = 0.5;
/// Where growth begins the prediction is right to this, cells: a warp that moves it farther there has taken the gaps for blurred twine.
const ORIGIN_CELLS: f64 = 0.25;
/// Fewer twines than that have too much in common by chance.
const ORIGIN_FEWEST: f32 = 6.0;

/// A twine on the list, and how it was sampled.
#[derive(Debug, Clone, Copy)]
struct Twine {
    edge: u32,
    /// Its middle as predicted without a warp, and the distance from the seed, px.
    from: Vector2<f64>,
    radius: f64,
    /// Warp under which it was sampled, px across it, and the normal then; NaN until then.
    warped: f64,
    normal: Vector2<f64>,
    reach: f32,
}

/// Buffers of this stage.
#[derive(Debug, Default)]
pub(crate) struct Grower {
    kernels: Kernels,
    twines: Vec<Twine>,
    /// By twine: amplitudes at every offset.
    responses: Vec<f32>,
    /// Places of `responses`, for edges that are on the list.
    row_of_edge: Vec<u32>,
    profile: Vec<f32>,
    /// Rows of twines that are summed up, and their sums by block.
    limited: Vec<f32>,
    block_sums: Vec<f32>,
    sum: Vec<f32>,
    strongest: Vec<f32>,
    signs: Vec<f32>,
    /// By block: amplitude of what all twines around have in common.
    strengths: Vec<f32>,
    /// Offset, px, and amplitude of each sampled twine.
    picked: Vec<(f64, f32)>,
    measured: Vec<Measured>,
}

impl Grower {
    /// The warp that takes the prediction to the net, or none where that fits no better.
    pub fn grow(
        &mut self,
        source: &Source,
        graph: &Graph,
        seed: Vector2<f64>,
        diagonal: f64,
        look: &Look,
        config: &AdjustConfig,
    ) -> Warp {
        let mut warp = Warp::none(seed);
        let Some(cell) = graph.nodes.first().map(|n| n.height) else { return warp };
        self.list(graph, look, config);
        let steps = self.steps(look);
        let seed = self.origin(source, graph, seed, steps, look);
        warp = Warp::none(seed);
        self.twines.iter_mut().for_each(|t| t.radius = (t.from - seed).norm());
        for (round, radius) in radii(cell, diagonal).enumerate() {
            for k in 0..self.twines.len() {
                if self.twines[k].radius <= radius && self.twines[k].warped.is_nan() {
                    self.sample(source, graph, k, steps, &warp, look);
                }
            }
            self.pick(graph, steps, look);
            warp.fit(&self.measured, 1 + round.div_ceil(2));
        }
        let moves = |t: &Twine| t.normal.dot(&warp.at(t.from)).abs() / cell_of(graph, t);
        let at_origin = |t: &&Twine| t.radius < FIRST_RADIUS.1 * cell && !t.warped.is_nan();
        if self
            .twines
            .iter()
            .filter(at_origin)
            .any(|t| t.normal.dot(&warp.at(seed)).abs() > ORIGIN_CELLS * cell_of(graph, t))
        {
            return Warp::none(seed);
        }
        if self.twines.iter().filter(|t| !t.warped.is_nan()).any(|t| moves(t) > SMALL_CELLS) {
            let none = Warp::none(seed);
            let [without, with] = [&none, &warp].map(|w| {
                for k in 0..self.twines.len() {
                    self.sample(source, graph, k, steps, w, look);
                }
                self.pick(graph, steps, look);
                let near = |m: &&Measured| (m.across - m.normal.dot(&w.at(m.from))).abs() < NEAR_CELLS * m.cell;
                let near = self.measured.iter().filter(near).count();
                (near as f64, (self.measured.len() - near) as f64)
            });
            if with.0 < BETTER * without.0 || with.1 > LEFT * without.1 {
                return none;
            }
        }
        warp
    }

    fn list(&mut self, graph: &Graph, look: &Look, config: &AdjustConfig) {
        // Odd: both families in turn.
        let stride = graph.edges.len().div_ceil(TWINES) | 1;
        self.kernels.start(look.coarse_px);
        self.twines.clear();
        self.row_of_edge.clear();
        self.row_of_edge.resize(graph.edges.len(), u32::MAX);
        for e in (0..graph.edges.len()).step_by(stride) {
            let [a, b] = graph.edges[e].nodes.map(|n| &graph.nodes[n as usize]);
            if a.inside && b.inside {
                let from = (a.predicted + b.predicted) * 0.5;
                self.row_of_edge[e] = self.twines.len() as u32;
                self.twines.push(Twine {
                    edge: e as u32,
                    from,
                    radius: 0.0,
                    warped: f64::NAN,
                    normal: Vector2::zeros(),
                    reach: reach_px(graph, e, config.search_cells[0]),
                });
            }
        }
    }

    /// Where growth begins: the place nearest to the seed where twine stands out. The seed itself may lie beyond the net's end.
    fn origin(
        &mut self,
        source: &Source,
        graph: &Graph,
        seed: Vector2<f64>,
        steps: usize,
        look: &Look,
    ) -> Vector2<f64> {
        let none = Warp::none(seed);
        for k in (0..self.twines.len()).step_by(ORIGIN_STRIDE) {
            self.sample(source, graph, k, steps, &none, look);
        }
        self.settle_signs(graph, steps, look);
        let least = self.least_strength();
        let stands_out = |t: &&Twine| self.strengths[graph.blocks.of_edge(t.edge as usize)] >= least;
        let away = |t: &&Twine| (t.from - seed).norm_squared();
        let near = self.twines.iter().filter(stands_out).min_by(|a, b| away(a).total_cmp(&away(b)));
        let origin = near.map_or(seed, |t| t.from);
        self.twines.iter_mut().for_each(|t| t.warped = f64::NAN);
        self.responses.fill(0.0);
        origin
    }

    /// What blocks have in common where there is net, at least.
    fn least_strength(&mut self) -> f32 {
        self.strongest.clear();
        self.strongest.extend(self.strengths.iter().filter(|&&s| s > 0.0));
        ORIGIN_PART * upper(&mut self.strongest).unwrap_or(0.0)
    }

    /// Offsets on each side.
    fn steps(&mut self, look: &Look) -> usize {
        let farthest = self.twines.iter().fold(0.0_f32, |most, t| most.max(t.reach));
        let steps = (f64::from(farthest) / look.coarse_px).ceil() as usize + 1;
        self.responses.clear();
        self.responses.resize(self.twines.len() * (2 * steps + 1), 0.0);
        steps
    }

    fn sample(&mut self, source: &Source, graph: &Graph, k: usize, steps: usize, warp: &Warp, look: &Look) {
        let e = self.twines[k].edge as usize;
        let kernel = kernel_for(&mut self.kernels, graph, e, look);
        let ends = graph.edges[e].nodes.map(|n| graph.nodes[n as usize].predicted).map(|p| p + warp.at(p));
        let chord = ends[1] - ends[0];
        let normal = Vector2::new(-chord.y, chord.x) / chord.norm();
        let half = steps + kernel.half();
        self.profile.clear();
        self.profile.resize(2 * half + 1 + LANES, 0.0);
        let mut inside = [true];
        source.profiles(ends, [0.0; 2], look.coarse_px, &mut inside, &mut self.profile);
        let places = 2 * steps + 1;
        let out = &mut self.responses[k * places..][..places];
        self.kernels.amplitudes(&kernel, &self.profile, half - steps, out);
        if !inside[0] {
            out.fill(0.0);
        }
        let twine = &mut self.twines[k];
        (twine.normal, twine.warped) = (normal, normal.dot(&warp.at(twine.from)));
    }

    /// Whether twine is light or dark around each block, and how much of it there is.
    fn settle_signs(&mut self, graph: &Graph, steps: usize, look: &Look) {
        let places = 2 * steps + 1;
        let Self { twines, responses, row_of_edge, limited, block_sums, sum, strongest, signs, strengths, .. } = self;
        strongest.clear();
        let most = |row: &[f32]| row.iter().fold(0.0_f32, |most, a| most.max(a.abs()));
        let sampled = twines.iter().zip(responses.chunks_exact(places)).filter(|(t, _)| !t.warped.is_nan());
        strongest.extend(sampled.map(|(_, row)| most(row)).filter(|&a| a > 0.0));
        let limit = 1.5 * median(strongest).unwrap_or(0.0) + 1e-6;
        // Limited amplitudes, whether there are any, and how far they reach.
        let width = places + 2;
        limited.clear();
        for (t, row) in twines.iter().zip(responses.chunks_exact(places)) {
            let known = f32::from(!t.warped.is_nan());
            limited.extend(row.iter().map(|a| a.clamp(-limit, limit)));
            limited.extend([known, known * t.reach]);
        }
        let row = |e: usize| limited.get(row_of_edge[e] as usize * width..)?.get(..width);
        graph.blocks.sum_members(width, row, block_sums);
        graph.blocks.sum_neighbours(width, block_sums, sum);
        signs.clear();
        strengths.clear();
        for block in 0..graph.blocks.count() {
            let sum = &block_sums[block * width..][..width];
            let (amplitudes, count) = (&sum[..places], sum[places]);
            if count == 0.0 {
                // None was sampled there.
                signs.push(1.0);
                strengths.push(0.0);
                continue;
            }
            signs.push(sign(amplitudes, sum[places + 1] / (count.max(1.0) * look.coarse_px as f32)));
            strengths.push(most(amplitudes) / count.max(ORIGIN_FEWEST));
        }
    }

    /// Where the sampled twines lie.
    fn pick(&mut self, graph: &Graph, steps: usize, look: &Look) {
        self.settle_signs(graph, steps, look);
        let least = self.least_strength();
        let places = 2 * steps + 1;
        let Self { twines, responses, strongest, signs, strengths, picked, measured, .. } = self;
        picked.clear();
        strongest.clear();
        for (twine, row) in twines.iter().zip(responses.chunks_exact(places)) {
            let block = graph.blocks.of_edge(twine.edge as usize);
            let sign = signs[block];
            let mut best = (0, 0.0_f32);
            for (k, a) in row.iter().enumerate() {
                let q = (k as f32 - steps as f32) * look.coarse_px as f32;
                let near = if q.abs() > twine.reach { 0.0 } else { 1.0 / (1.0 + (0.5 * q / twine.reach).powi(2)) };
                if a * sign * near > best.1 {
                    best = (k, a * sign * near);
                }
            }
            let k = best.0.clamp(1, places - 2);
            let q =
                (k as f32 - steps as f32 + vertex([k - 1, k, k + 1].map(|k| row[k] * sign))) * look.coarse_px as f32;
            let good = !twine.warped.is_nan() && best.1 > 0.0 && q.abs() < 0.98 * twine.reach;
            picked.push((f64::from(q), if good { row[best.0].abs() } else { 0.0 }));
            // Water beyond the net's end must not say what is usual.
            if good && strengths[block] >= least {
                strongest.push(row[best.0].abs());
            }
        }
        let typical = median(strongest).unwrap_or(0.0);
        measured.clear();
        for (twine, &(q, amplitude)) in twines.iter().zip(picked.iter()) {
            if amplitude > AMPLITUDE_PARTS.0 * typical && amplitude < AMPLITUDE_PARTS.1 * typical {
                measured.push(Measured {
                    from: twine.from,
                    normal: twine.normal,
                    across: twine.warped + q,
                    cell: cell_of(graph, twine),
                });
            }
        }
    }
}

fn cell_of(graph: &Graph, twine: &Twine) -> f64 {
    let edge = &graph.edges[twine.edge as usize];
    let [a, b] = edge.nodes.map(|n| graph.nodes[n as usize].spacing[edge.family]);
    a.min(b)
}

/// A prediction with its correction.
pub(crate) struct Warped<'a, M> {
    pub map: &'a M,
    pub warp: &'a Warp,
}

impl<M: LatticeMap> LatticeMap for Warped<'_, M> {
    fn pixel(&self, i: f64, j: f64) -> Option<Vector2<f64>> {
        let p = self.map.pixel(i, j)?;
        Some(p + self.warp.at(p))
    }
    fn pixels_per_metre(&self, i: f64, j: f64) -> Option<f64> {
        self.map.pixels_per_metre(i, j)
    }
    fn place(&self, i: f64, j: f64) -> Option<(Vector2<f64>, f64)> {
        let (p, scale) = self.map.place(i, j)?;
        Some((p + self.warp.at(p), scale))
    }
    fn seed(&self) -> Option<(i32, i32)> {
        self.map.seed()
    }
}
