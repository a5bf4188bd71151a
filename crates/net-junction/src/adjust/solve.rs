//! Sparse least squares on node displacements and twine bows.
//!
//! A twine's bins see only the displacement of its ends across it, `n·x_a` and `n·x_b`, and its two bends. Bends are eliminated twine by
//! twine; what remains couples neighbouring nodes and is solved by conjugate gradients with 2 x 2 diagonal blocks, each round from
//! the last one's solution.

use net_geometry::nalgebra::{Matrix2, Vector2};
use net_image::widely;

use crate::adjust::config::AdjustConfig;
use crate::adjust::graph::{Graph, bend, median};

type V2 = Vector2<f32>;
type M2 = Matrix2<f32>;

/// Most weight of a bin; amplitudes five times their noise and more count alike.
pub(crate) const WEIGHT_MAX: f32 = 25.0;
/// Weight below which a bin says nothing of the scale of residuals: twine no stronger than noise.
const WEIGHT_MIN: f32 = 1.0;
/// Scale of residuals below which they are not believed, px.
const RESIDUAL_MIN_PX: f32 = 0.05;
/// Scale of residuals before the first round, px.
const RESIDUAL_START_PX: f32 = 0.15;
/// Constant part of the standard deviation of neighbours' different displacements, px.
const JITTER_MIN_PX: f64 = 0.1;
/// Constant part of the standard deviation of bows, px.
const BOW_MIN_PX: f32 = 0.05;
/// Standard deviation of a node's displacement in this pass, cells.
const SHIFT_CELLS: f64 = 0.25;
/// Conjugate-gradient steps of a round, at most, before the last one and in it, and the part of the right side at which they end. Each round goes
/// on from the last one's solution, and weights need not be known better than that.
const STEPS_MAX: [usize; 2] = [8, 24];
const STEPS_END: f32 = 2e-3;
/// Residuals of which the scale is the median.
const SCALE_SAMPLE: usize = 2000;

/// Products of a bin's coefficients that the normal equations are sums of.
const MOMENTS: usize = 16;

/// Normal equations of one twine, bends eliminated: for the displacements of its ends along `normal`.
#[derive(Debug, Clone, Copy, Default)]
struct Twine {
    /// How the displacement of one end pulls at the other: the block of the normal matrix.
    across: M2,
    /// Bends are `bend_right - bend_by_end * (s_a, s_b)`.
    bend_right: V2,
    bend_by_end: M2,
}

/// What does not change from round to round.
#[derive(Debug, Clone, Copy, Default)]
struct Frame {
    normal: V2,
    coherence: f32,
    /// Inverse variance of the bow.
    bow: f32,
    /// Difference of the ends' displacements so far.
    different: V2,
}

/// Buffers of this stage.
#[derive(Debug, Default)]
pub(crate) struct Solver {
    twines: Vec<Twine>,
    frames: Vec<Frame>,
    /// By bin: products of coefficients.
    moments: Vec<[f32; MOMENTS]>,
    /// By bin: coefficients of both ends and both bends.
    coefficients: Vec<[f32; 4]>,
    weights: Vec<f32>,
    magnitudes: Vec<f32>,
    /// Inverse variance of nodes' displacements.
    prior: Vec<f32>,
    /// Displacements since the last [`Solver::commit`].
    step: Vec<V2>,
    right: Vec<V2>,
    /// By node: its block of the normal matrix, and that inverted.
    own: Vec<M2>,
    inverse: Vec<M2>,
    residual: Vec<V2>,
    scaled: Vec<V2>,
    direction: Vec<V2>,
    product: Vec<V2>,
    /// Information on each node from its twines' bins alone, px⁻².
    pub information: Vec<M2>,
    /// Scale of the residuals, px.
    scale: f32,
}

widely! {
    /// Solves and reweighs.
    fn run<'a>(
        solver: &'a mut Solver,
        graph: &'a Graph,
        measured: (&'a [f32], &'a [f32]),
        rounds: usize,
    ) -> () {
        let (offsets, weights) = measured;
        for round in 0..rounds {
            solver.assemble(graph, offsets);
            let last = round + 1 == rounds;
            solver.conjugate_gradients(graph, STEPS_MAX[usize::from(last)]);
            if !last {
                solver.reweigh(graph, offsets, weights);
            }
        }
    }
}

impl Solver {
    /// Takes nodes and twines where they are now believed to be as the place from which displacements count.
    pub fn start(&mut self, graph: &Graph, along: &[f32], config: &AdjustConfig) {
        self.step.clear();
        self.step.resize(graph.nodes.len(), V2::zeros());
        self.prior.clear();
        self.prior.extend(graph.nodes.iter().map(|n| (SHIFT_CELLS * n.height).powi(-2) as f32));
        self.frames.clear();
        self.frames.extend(graph.edges.iter().map(|edge| {
            let [a, b] = edge.nodes.map(|n| &graph.nodes[n as usize]);
            let chord = (b.pixel() - a.pixel()).cast::<f32>();
            let length = chord.norm();
            let height = a.height.min(b.height);
            Frame {
                normal: V2::new(-chord.y, chord.x) / length,
                coherence: (config.jitter_cells * height + JITTER_MIN_PX).powi(-2) as f32,
                bow: (config.bow as f32 * length + BOW_MIN_PX).powi(-2),
                different: (b.shift - a.shift).cast(),
            }
        }));
        self.coefficients.clear();
        self.coefficients.extend(along.iter().map(|&at| {
            let [bow, s_bend] = bend(at);
            [1.0 - at, at, bow, s_bend]
        }));
        self.moments.clear();
        self.moments.extend(self.coefficients.iter().map(|c| {
            let mut products = [0.0; MOMENTS];
            let pairs = [(0, 0), (0, 1), (1, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];
            for (p, (a, b)) in products.iter_mut().zip(pairs) {
                *p = c[a] * c[b];
            }
            products
        }));
        self.scale = RESIDUAL_START_PX;
    }

    /// Fits displacements and bends to the measured `offsets` (px across the chord, for each edge and bin) of the given
    /// `weights` (0 to [`WEIGHT_MAX`]), reweighting them `rounds` times.
    pub fn solve(&mut self, graph: &Graph, offsets: &[f32], weights: &[f32], rounds: usize) {
        self.weights.clear();
        self.weights.extend_from_slice(weights);
        run(self, graph, (offsets, weights), rounds);
    }

    /// Moves nodes and bends twines as was found.
    pub fn commit(&mut self, graph: &mut Graph) {
        for e in 0..self.twines.len() {
            let bends = self.twines[e].bends(self.ends(graph, e));
            graph.edges[e].bow = [bends.x, bends.y];
        }
        for (node, step) in graph.nodes.iter_mut().zip(&self.step) {
            node.shift += step.cast::<f64>();
        }
    }

    /// How far, px, the twine's ends now lie off its chord as it was at the start, its bow and its S-bend.
    #[inline(always)]
    pub fn shape(&self, graph: &Graph, edge: usize) -> [f32; 4] {
        let ends = self.ends(graph, edge);
        let bends = self.twines[edge].bends(ends);
        [ends.x, ends.y, bends.x, bends.y]
    }

    /// Displacement of a twine's ends across it.
    #[inline(always)]
    fn ends(&self, graph: &Graph, edge: usize) -> V2 {
        let [a, b] = graph.edges[edge].nodes.map(|n| self.step[n as usize]);
        let normal = self.frames[edge].normal;
        V2::new(normal.dot(&a), normal.dot(&b))
    }

    #[inline(always)]
    fn assemble(&mut self, graph: &Graph, offsets: &[f32]) {
        let nodes = graph.nodes.len();
        self.twines.clear();
        self.right.clear();
        self.right.resize(nodes, V2::zeros());
        self.inverse.clear();
        self.inverse.extend(self.prior.iter().map(|&p| M2::identity() * p));
        self.information.clear();
        self.information.resize(nodes, M2::zeros());
        let floor = (1.5 * self.scale).max(RESIDUAL_MIN_PX);
        let unit = 1.0 / (WEIGHT_MAX * floor * floor);
        let bins = self.moments.len();
        let measured = self.weights.chunks_exact(bins).zip(offsets.chunks_exact(bins));
        for ((edge, frame), (weights, offsets)) in graph.edges.iter().zip(&self.frames).zip(measured) {
            let mut m = [0.0_f32; MOMENTS];
            let mut r = [0.0_f32; 4];
            let bins = self.moments.iter().zip(&self.coefficients).zip(weights.iter().zip(offsets));
            for ((moments, coefficients), (weight, offset)) in bins {
                let weight = weight * unit;
                let pull = weight * offset;
                m.iter_mut().zip(moments).for_each(|(m, p)| *m += weight * p);
                r.iter_mut().zip(coefficients).for_each(|(r, c)| *r += pull * c);
            }
            let ends = M2::new(m[0], m[1], m[1], m[2]);
            // Rows: bends; columns: ends.
            let cross = M2::new(m[3], m[5], m[4], m[6]);
            let (b00, b01, b11) = (m[7] + frame.bow, m[8], m[9] + 4.0 * frame.bow);
            // The prior makes it positive definite.
            let inverse = M2::new(b11, -b01, -b01, b00) / (b00 * b11 - b01 * b01);
            let bend_by_end = inverse * cross;
            let bend_right = inverse * V2::new(r[2], r[3]);
            let system = ends - cross.tr_mul(&bend_by_end);
            let right = V2::new(r[0], r[1]) - cross.tr_mul(&bend_right);
            let Frame { normal, coherence, different, .. } = *frame;
            let outer = normal * normal.transpose();
            let across = outer * system[(0, 1)] - M2::identity() * coherence;
            self.twines.push(Twine { across, bend_right, bend_by_end });
            for (k, node) in edge.nodes.into_iter().enumerate() {
                let (node, sign) = (node as usize, if k == 0 { 1.0 } else { -1.0 });
                self.right[node] += normal * right[k] + different * (sign * coherence);
                let known = outer * system[(k, k)];
                self.information[node] += known;
                self.inverse[node] += known + M2::identity() * coherence;
            }
        }
        self.own.clone_from(&self.inverse);
        for block in &mut self.inverse {
            *block = block.try_inverse().unwrap_or_else(M2::zeros);
        }
    }

    /// `product = A direction`.
    #[inline(always)]
    fn multiply(&mut self, graph: &Graph) {
        for ((p, d), own) in self.product.iter_mut().zip(&self.direction).zip(&self.own) {
            *p = own * d;
        }
        for (edge, twine) in graph.edges.iter().zip(&self.twines) {
            let [a, b] = edge.nodes.map(|n| n as usize);
            // Symmetric.
            let (to_a, to_b) = (twine.across * self.direction[b], twine.across * self.direction[a]);
            self.product[a] += to_a;
            self.product[b] += to_b;
        }
    }

    #[inline(always)]
    fn conjugate_gradients(&mut self, graph: &Graph, most: usize) {
        let nodes = graph.nodes.len();
        let precondition = |inverse: &[M2], from: &[V2], to: &mut Vec<V2>| {
            to.clear();
            to.extend(inverse.iter().zip(from).map(|(m, r)| m * r));
        };
        self.product.clear();
        self.product.resize(nodes, V2::zeros());
        precondition(&self.inverse, &self.right, &mut self.scaled);
        let end = dot(&self.right, &self.scaled) * STEPS_END * STEPS_END;
        // From where the last round ended.
        self.direction.clone_from(&self.step);
        self.multiply(graph);
        self.residual.clear();
        self.residual.extend(self.right.iter().zip(&self.product).map(|(r, p)| r - p));
        precondition(&self.inverse, &self.residual, &mut self.scaled);
        self.direction.clone_from(&self.scaled);
        let mut squared = dot(&self.residual, &self.scaled);
        for _ in 0..most {
            if squared <= end || squared.is_nan() {
                break;
            }
            self.multiply(graph);
            let rate = squared / dot(&self.direction, &self.product);
            for k in 0..nodes {
                self.step[k] += self.direction[k] * rate;
                self.residual[k] -= self.product[k] * rate;
            }
            precondition(&self.inverse, &self.residual, &mut self.scaled);
            let next = dot(&self.residual, &self.scaled);
            let keep = next / squared;
            for (d, s) in self.direction.iter_mut().zip(&self.scaled) {
                *d = s + *d * keep;
            }
            squared = next;
        }
    }

    #[inline(always)]
    fn reweigh(&mut self, graph: &Graph, offsets: &[f32], weights: &[f32]) {
        let bins = self.coefficients.len();
        // Weights hold the residuals for a moment.
        for e in 0..self.twines.len() {
            let [x, y, bow, s_bend] = self.shape(graph, e);
            let of_edge = e * bins..(e + 1) * bins;
            for ((w, o), c) in self.weights[of_edge.clone()].iter_mut().zip(&offsets[of_edge]).zip(&self.coefficients) {
                *w = o - (c[0] * x + c[1] * y + c[2] * bow + c[3] * s_bend);
            }
        }
        self.magnitudes.clear();
        let stride = (weights.len() / SCALE_SAMPLE).max(1);
        let known = self.weights.iter().zip(weights).step_by(stride).filter(|(_, w)| **w > WEIGHT_MIN);
        self.magnitudes.extend(known.map(|(r, _)| r.abs()));
        self.scale = (1.4826 * median(&mut self.magnitudes).unwrap_or(0.0)).max(0.06);
        let softness = 1.0 / (2.5 * self.scale);
        for (w, &w0) in self.weights.iter_mut().zip(weights) {
            *w = w0 / (1.0 + (*w * softness).powi(2)).powi(2);
        }
    }
}

/// Sum of products, in lanes.
#[inline(always)]
fn dot(a: &[V2], b: &[V2]) -> f32 {
    const NODES: usize = 8;
    let (a, b) = (a.as_chunks::<NODES>(), b.as_chunks::<NODES>());
    let mut sums = [V2::zeros(); NODES];
    for (a, b) in a.0.iter().zip(b.0) {
        for k in 0..NODES {
            sums[k] += a[k].component_mul(&b[k]);
        }
    }
    let rest = a.1.iter().zip(b.1).map(|(a, b)| a.component_mul(b));
    sums.into_iter().chain(rest).sum::<V2>().sum()
}

impl Twine {
    #[inline(always)]
    fn bends(&self, ends: V2) -> V2 {
        self.bend_right - self.bend_by_end * ends
    }
}
