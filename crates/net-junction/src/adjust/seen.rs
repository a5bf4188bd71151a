//! Which knots are seen: by their own twines, and in weak pictures by what the twines around say together.

use crate::adjust::config::AdjustConfig;
use crate::adjust::graph::Graph;
use crate::adjust::presence::{Twine, TwineState};

/// Log odds that twine in the middle of a net is there, and the part of the gate that its neighbourhood must stand out by: fewer
/// twines are broken than that.
const LIKELY_PRIOR: f32 = 2.0;
const LIKELY_GATE: f32 = 0.7;
/// Nodes each way whose twines say whether there is a net at all.
const REACH: i32 = 2;
/// Contrast of the neighbourhood from which on twine speaks for itself, and does not need them.
const STRONG_CONTRAST: f32 = 2.5;
/// Least mean contrast around: water alone comes to 0.2 with a standard deviation of 0.15.
const REGION_CONTRAST: f32 = 0.4;
/// Log likelihood ratio, net to no net, that twines around must come to, and the most it counts: one twine in a hundred is broken.
const REGION_LLR: f32 = 3.0;
const REGION_MOST: f32 = 4.5;

/// Knots that are seen; keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct Witnesses {
    seen: Vec<bool>,
}

impl Witnesses {
    /// Whether a node is seen.
    pub fn saw(&self, node: usize) -> bool {
        self.seen[node]
    }

    /// Judges all nodes. `votes` are the twines' limited log likelihood ratios, net to no net.
    pub fn judge(&mut self, graph: &Graph, twines: &[Twine], votes: &[f32], config: &AdjustConfig) {
        self.seen.clear();
        self.seen.extend((0..graph.nodes.len()).map(|node| {
            let own = own_twines(graph, node);
            let by_itself = own.map(|edges| by_itself(edges, twines, config));
            by_itself == [true; 2]
                || may_be_helped(own, twines)
                    && (0..2).all(|f| by_itself[f] || by_region(graph, node, f, own[f], twines, votes, config))
        }));
    }
}

/// Twines of each family that meet at a node.
pub(crate) fn own_twines(graph: &Graph, node: usize) -> [[Option<usize>; 2]; 2] {
    let (i, j) = graph.nodes[node].index;
    let before = [(i - 1, j), (i, j - 1)];
    [0, 1].map(|f| [graph.edge_from(node, f), graph.node_at(before[f]).and_then(|n| graph.edge_from(n, f))])
}

/// Twine that is likely on both sides of the knot is as good as one that is certain.
fn by_itself(edges: [Option<usize>; 2], twines: &[Twine], config: &AdjustConfig) -> bool {
    let of = || edges.into_iter().flatten().map(|e| &twines[e]);
    let likely = of().filter(|t| t.state == TwineState::Unknown && t.contrast > LIKELY_GATE * config.gate as f32);
    of().any(|t| t.state == TwineState::Present)
        || likely.map(|t| t.llr).sum::<f32>() + LIKELY_PRIOR > config.present_llr as f32
}

/// Where twine stands out a fish is known by what it hides, and must not be voted away.
fn may_be_helped(own: [[Option<usize>; 2]; 2], twines: &[Twine]) -> bool {
    own.into_iter()
        .flatten()
        .flatten()
        .map(|e| &twines[e])
        .all(|t| t.contrast < STRONG_CONTRAST && !matches!(t.state, TwineState::Hidden | TwineState::Fouled))
}

fn by_region(
    graph: &Graph,
    node: usize,
    family: usize,
    own: [Option<usize>; 2],
    twines: &[Twine],
    votes: &[f32],
    config: &AdjustConfig,
) -> bool {
    let (i, j) = graph.nodes[node].index;
    let (mut region, mut contrast, mut count) = (0.0, 0.0, 0.0);
    for b in -REACH..=REACH {
        for a in -REACH..=REACH {
            let Some(edge) = graph.node_at((i + a, j + b)).and_then(|n| graph.edge_from(n, family)) else { continue };
            // None outside the picture.
            if votes[edge].is_nan() {
                continue;
            }
            contrast += twines[edge].contrast;
            count += 1.0;
            if !own.contains(&Some(edge)) {
                region += votes[edge];
            }
        }
    }
    let llr: f32 = own.into_iter().flatten().map(|e| twines[e].llr).sum();
    contrast > REGION_CONTRAST * count
        && region > REGION_LLR
        && region.min(REGION_MOST) + llr > config.present_llr as f32
}
