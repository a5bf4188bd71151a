//! Sparse least squares on node displacements and twine bows.
//!
//! A twine's bins see only the displacement of its ends across it, `n·x_a` and `n·x_b`, and its two bends. Bends are eliminated twine by
//! twine; what remains couples neighbouring nodes and is solved by conjugate gradients with 2 x 2 diagonal blocks.

use net_geometry::nalgebra::{Matrix2, Vector2};

use crate::adjust::config::AdjustConfig;
use crate::adjust::graph::{Graph, bend, median};

/// Most weight of a bin; amplitudes five times their noise and more count alike.
pub(crate) const WEIGHT_MAX: f32 = 25.0;
/// Weight that the strongest answer in reach has where there is nothing but noise: three times the noise, squared.
const WEIGHT_OF_NOISE: f32 = 9.0;
/// Rounds of robust reweighting.
const ROUNDS: usize = 5;
/// Scale of residuals below which they are not believed, px.
const RESIDUAL_MIN_PX: f64 = 0.05;
/// Constant part of the standard deviation of neighbours' different displacements, px.
const JITTER_MIN_PX: f64 = 0.1;
/// Constant part of the standard deviation of bows, px.
const BOW_MIN_PX: f64 = 0.05;
/// Standard deviation of a node's displacement in this pass, cells.
const SHIFT_CELLS: f64 = 0.25;
/// Conjugate-gradient steps, at most, and the part of the residual at which they end.
const STEPS_MAX: usize = 60;
const STEPS_END: f64 = 1e-4;

/// Normal equations of one twine, bends eliminated: for the displacements of its ends along `normal`.
#[derive(Debug, Clone, Copy, Default)]
struct Twine {
    normal: Vector2<f64>,
    system: Matrix2<f64>,
    /// Weight of the difference between its ends' total displacements.
    coherence: f64,
    /// Bends are `bend_right - bend_by_end * (s_a, s_b)`.
    bend_right: Vector2<f64>,
    bend_by_end: Matrix2<f64>,
}

/// Buffers of this stage.
#[derive(Debug, Default)]
pub(crate) struct Solver {
    twines: Vec<Twine>,
    weights: Vec<f32>,
    residuals: Vec<f32>,
    magnitudes: Vec<f32>,
    step: Vec<Vector2<f64>>,
    right: Vec<Vector2<f64>>,
    inverse: Vec<Matrix2<f64>>,
    residual: Vec<Vector2<f64>>,
    scaled: Vec<Vector2<f64>>,
    direction: Vec<Vector2<f64>>,
    product: Vec<Vector2<f64>>,
    /// Information on each node from its twines' bins alone, px⁻².
    pub information: Vec<Matrix2<f64>>,
    /// Scale of the residuals, px.
    pub scale: f64,
}

impl Solver {
    /// Moves nodes and bends twines towards the measured `offsets` (px across the chord, for each edge and bin) of the given
    /// `weights` (0 to [`WEIGHT_MAX`]). `along` are the bins' places on the twine.
    pub fn solve(&mut self, graph: &mut Graph, along: &[f64], offsets: &[f32], weights: &[f32], config: &AdjustConfig) {
        self.weights.clear();
        self.weights.extend_from_slice(weights);
        self.scale = 0.15;
        for _ in 0..ROUNDS {
            self.assemble(graph, along, offsets, config);
            self.conjugate_gradients(graph);
            self.reweigh(graph, along, offsets, weights);
        }
        for (e, twine) in self.twines.iter().enumerate() {
            let bow = twine.bends(self.ends(graph, e));
            graph.edges[e].bow = [bow.x, bow.y];
        }
        for (node, step) in graph.nodes.iter_mut().zip(&self.step) {
            node.shift += step;
        }
    }

    /// Sum of the bins' weights after the last reweighting, as far as they exceed what noise reaches: how much twine fits.
    pub fn weight(&self) -> f32 {
        self.weights.iter().map(|w| (w - WEIGHT_OF_NOISE).max(0.0)).sum()
    }

    /// Displacement of a twine's ends across it.
    fn ends(&self, graph: &Graph, edge: usize) -> Vector2<f64> {
        let [a, b] = graph.edges[edge].nodes.map(|n| self.step[n as usize]);
        let normal = self.twines[edge].normal;
        Vector2::new(normal.dot(&a), normal.dot(&b))
    }

    fn assemble(&mut self, graph: &Graph, along: &[f64], offsets: &[f32], config: &AdjustConfig) {
        let nodes = graph.nodes.len();
        self.twines.clear();
        self.step.clear();
        self.step.resize(nodes, Vector2::zeros());
        self.right.clear();
        self.right.resize(nodes, Vector2::zeros());
        self.inverse.clear();
        self.inverse.extend(graph.nodes.iter().map(|n| Matrix2::identity() / (SHIFT_CELLS * n.height).powi(2)));
        self.information.clear();
        self.information.resize(nodes, Matrix2::zeros());
        let floor = (1.5 * self.scale).max(RESIDUAL_MIN_PX);
        let unit = 1.0 / (f64::from(WEIGHT_MAX) * floor * floor);
        for (e, edge) in graph.edges.iter().enumerate() {
            let [a, b] = edge.nodes.map(|n| &graph.nodes[n as usize]);
            let chord = b.pixel() - a.pixel();
            let length = chord.norm();
            let normal = Vector2::new(-chord.y, chord.x) / length;
            let bow_sigma = config.bow * length + BOW_MIN_PX;
            let mut bends = Matrix2::new(bow_sigma.powi(-2), 0.0, 0.0, (0.5 * bow_sigma).powi(-2));
            let (mut ends, mut cross) = (Matrix2::zeros(), Matrix2::zeros());
            let (mut right_ends, mut right_bends) = (Vector2::zeros(), Vector2::zeros());
            for (bin, &at) in along.iter().enumerate() {
                let weight = f64::from(self.weights[e * along.len() + bin]) * unit;
                if weight > 0.0 {
                    let (end, bow) = (Vector2::new(1.0 - at, at), Vector2::from(bend(at)));
                    let offset = f64::from(offsets[e * along.len() + bin]);
                    ends += end * end.transpose() * weight;
                    cross += bow * end.transpose() * weight;
                    bends += bow * bow.transpose() * weight;
                    right_ends += end * (weight * offset);
                    right_bends += bow * (weight * offset);
                }
            }
            // The prior makes it positive definite.
            let inverse = bends.try_inverse().unwrap_or_else(Matrix2::zeros);
            let system = ends - cross.transpose() * inverse * cross;
            let right = right_ends - cross.transpose() * inverse * right_bends;
            let height = a.height.min(b.height);
            let coherence = (config.jitter_cells * height + JITTER_MIN_PX).powi(-2);
            self.twines.push(Twine {
                normal,
                system,
                coherence,
                bend_right: inverse * right_bends,
                bend_by_end: inverse * cross,
            });
            let different = b.shift - a.shift;
            let outer = normal * normal.transpose();
            for (k, node) in edge.nodes.into_iter().enumerate() {
                let (node, sign) = (node as usize, if k == 0 { 1.0 } else { -1.0 });
                self.right[node] += normal * right[k] + different * (sign * coherence);
                self.information[node] += outer * system[(k, k)];
                self.inverse[node] += outer * system[(k, k)] + Matrix2::identity() * coherence;
            }
        }
        for block in &mut self.inverse {
            *block = block.try_inverse().unwrap_or_else(Matrix2::zeros);
        }
    }

    /// `product = A direction`.
    fn multiply(&mut self, graph: &Graph) {
        for ((p, d), node) in self.product.iter_mut().zip(&self.direction).zip(&graph.nodes) {
            *p = d / (SHIFT_CELLS * node.height).powi(2);
        }
        for (edge, twine) in graph.edges.iter().zip(&self.twines) {
            let [a, b] = edge.nodes.map(|n| n as usize);
            let (da, db) = (self.direction[a], self.direction[b]);
            let pull = twine.system * Vector2::new(twine.normal.dot(&da), twine.normal.dot(&db));
            let apart = (da - db) * twine.coherence;
            self.product[a] += twine.normal * pull.x + apart;
            self.product[b] += twine.normal * pull.y - apart;
        }
    }

    fn conjugate_gradients(&mut self, graph: &Graph) {
        let nodes = graph.nodes.len();
        let precondition = |inverse: &[Matrix2<f64>], from: &[Vector2<f64>], to: &mut Vec<Vector2<f64>>| {
            to.clear();
            to.extend(inverse.iter().zip(from).map(|(m, r)| m * r));
        };
        let dot = |a: &[Vector2<f64>], b: &[Vector2<f64>]| a.iter().zip(b).map(|(x, y)| x.dot(y)).sum::<f64>();
        self.residual.clone_from(&self.right);
        precondition(&self.inverse, &self.residual, &mut self.scaled);
        self.direction.clone_from(&self.scaled);
        self.product.clear();
        self.product.resize(nodes, Vector2::zeros());
        let mut squared = dot(&self.residual, &self.scaled);
        let end = squared * STEPS_END * STEPS_END;
        for _ in 0..STEPS_MAX {
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

    fn reweigh(&mut self, graph: &Graph, along: &[f64], offsets: &[f32], weights: &[f32]) {
        self.residuals.clear();
        for (e, twine) in self.twines.iter().enumerate() {
            let ends = self.ends(graph, e);
            let bends = twine.bends(ends);
            for (bin, &at) in along.iter().enumerate() {
                let [bow, s_bend] = bend(at);
                let predicted = ends.x * (1.0 - at) + ends.y * at + bow * bends.x + s_bend * bends.y;
                self.residuals.push(offsets[e * along.len() + bin] - predicted as f32);
            }
        }
        self.magnitudes.clear();
        self.magnitudes.extend(self.residuals.iter().zip(weights).filter(|(_, w)| **w > 0.0).map(|(r, _)| r.abs()));
        self.scale = f64::from(1.4826 * median(&mut self.magnitudes).unwrap_or(0.0)).max(0.06);
        let softness = (2.5 * self.scale) as f32;
        for ((w, &w0), &r) in self.weights.iter_mut().zip(weights).zip(&self.residuals) {
            *w = w0 / (1.0 + (r / softness).powi(2)).powi(2);
        }
    }
}

impl Twine {
    fn bends(&self, ends: Vector2<f64>) -> Vector2<f64> {
        self.bend_right - self.bend_by_end * ends
    }
}
