//! Which nodes belong to the same lattice as the seed: whole cells must not have been lost on the way.
//!
//! Where a prediction drifts off by more than half a cell, the neighbouring twine is found, looks as good, and is named wrongly. Between there and
//! where the prediction is right the displacements change by a whole cell over a few. So names are given as far as one can walk from
//! the seed over twines whose ends are displaced alike.

use std::collections::VecDeque;

use net_geometry::nalgebra::Vector2;

use crate::adjust::graph::Graph;
use crate::adjust::presence::{Twine, TwineState};
use crate::adjust::seen::Witnesses;

/// How much the displacements of a twine's ends may differ, cells: on twine that is seen, and across what is not.
const SEEN_CELLS: f64 = 0.25;
const UNSEEN_CELLS: f64 = 0.1;
/// Steps in a row that may lead across what is not seen: a prediction that drifts off is a cell off after more of them.
const UNSEEN_STEPS: u8 = 3;

/// Buffers of this stage.
#[derive(Debug, Default)]
pub(crate) struct Connector {
    reached: Vec<bool>,
    /// By node: steps since something was seen.
    blind: Vec<u8>,
    queue: VecDeque<u32>,
}

impl Connector {
    /// Whether a node is connected with the seed.
    pub fn reached(&self, node: usize) -> bool {
        self.reached[node]
    }

    /// Walks from the seen node that is nearest to the graph's first node, which is next to the seed.
    pub fn walk(&mut self, graph: &Graph, twines: &[Twine], witnesses: &Witnesses) {
        self.reached.clear();
        self.reached.resize(graph.nodes.len(), false);
        self.blind.clear();
        self.blind.resize(graph.nodes.len(), u8::MAX);
        self.queue.clear();
        let Some(seed) = graph.nodes.first().map(|n| n.predicted) else { return };
        let distance = |n: u32| (graph.nodes[n as usize].predicted - seed).norm_squared();
        let seen = (0..graph.nodes.len() as u32).filter(|&n| witnesses.saw(n as usize));
        let nearest = seen.min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        let Some(start) = nearest else { return };
        self.reached[start as usize] = true;
        self.blind[start as usize] = 0;
        self.queue.push_back(start);
        while let Some(node) = self.queue.pop_front() {
            let (i, j) = graph.nodes[node as usize].index;
            let around = [((i, j), 0), ((i, j), 1), ((i - 1, j), 0), ((i, j - 1), 1)];
            for (index, family) in around {
                let Some(edge) = graph.node_at(index).and_then(|n| graph.edge_from(n, family)) else { continue };
                let [a, b] = graph.edges[edge].nodes;
                let other = if a == node { b } else { a };
                let seen = twines[edge].state == TwineState::Present
                    || witnesses.saw(node as usize) && witnesses.saw(other as usize);
                let allowed = if seen { SEEN_CELLS } else { UNSEEN_CELLS };
                let blind = if seen { 0 } else { self.blind[node as usize] + 1 };
                if blind <= UNSEEN_STEPS && blind < self.blind[other as usize] && apart(graph, a, b) < allowed {
                    self.reached[other as usize] = true;
                    self.blind[other as usize] = blind;
                    self.queue.push_back(other);
                }
            }
        }
    }
}

/// Difference of two nodes' displacements, cells: the larger component along the two lattice directions.
fn apart(graph: &Graph, a: u32, b: u32) -> f64 {
    let [a, b] = [a, b].map(|n| &graph.nodes[n as usize]);
    let [s1, s2] = a.half_steps.map(|s| s * 2.0);
    let (d, cross): (Vector2<f64>, f64) = (b.shift - a.shift, s1.perp(&s2));
    (d.perp(&s2) / cross).abs().max((s1.perp(&d) / cross).abs())
}
