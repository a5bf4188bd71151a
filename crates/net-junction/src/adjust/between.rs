//! Knots of which the picture does not tell, between others of which it does.

use crate::adjust::graph::Graph;
use crate::adjust::presence::{Twine, TwineState};
use crate::adjust::seen::own_twines;

/// Steps of the lattice within which a knot must be seen.
const REACH: i32 = 4;
/// Of the four directions of the lattice, those in which one must be: of three two are opposite, so that nothing is continued beyond what is seen.
const DIRECTIONS: usize = 3;

/// How much less a node between seen ones is known than a neighbour of one: the variance of its displacement in parts of that of one step, if displacements wander from knot to knot. `None` for
/// a node that is not between them, or of whose twines something is known that speaks against a knot in plain view.
pub(crate) fn steps(graph: &Graph, node: usize, twines: &[Twine], seen: impl Fn(usize) -> bool) -> Option<f64> {
    let own = own_twines(graph, node).into_iter().flatten().flatten();
    let plain = own.map(|e| twines[e].state).all(|s| matches!(s, TwineState::Unknown | TwineState::Present));
    if !plain {
        return None;
    }
    let (i, j) = graph.nodes[node].index;
    let (mut directions, mut precision) = (0, 0.0);
    for (a, b) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
        let next = (1..=REACH).find(|k| graph.node_at((i + k * a, j + k * b)).is_some_and(&seen));
        directions += usize::from(next.is_some());
        precision += next.map_or(0.0, |k| 1.0 / f64::from(k));
    }
    (directions >= DIRECTIONS).then(|| 1.0 / precision)
}
