//! Where the net ends: twines that are not there, in a region that no net encloses.

use crate::adjust::graph::Graph;
use crate::adjust::presence::{Twine, TwineState};

/// Missing twines in a region that reaches the end of the picture, from which on it is the net's end and no hole.
const TWINES: u32 = 8;

/// Meshes that missing twines, and those of which nothing is told, join, each named after its first node.
#[derive(Debug, Default)]
pub(crate) struct Outside {
    parent: Vec<u32>,
    /// Missing twines of a region, and whether it reaches the end of the picture; kept at its root.
    count: Vec<u32>,
    open: Vec<bool>,
}

impl Outside {
    /// Nothing is said of twines beyond the net's end.
    pub fn mark(&mut self, graph: &Graph, twines: &mut [Twine]) {
        self.parent.clear();
        self.parent.extend(0..graph.nodes.len() as u32);
        self.count.clear();
        self.count.resize(graph.nodes.len(), 0);
        self.open.clear();
        self.open.extend(graph.nodes.iter().map(|node| {
            let (i, j) = node.index;
            let corners = [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)];
            !corners.into_iter().all(|c| graph.node_at(c).is_some_and(|n| graph.nodes[n].inside))
        }));
        for twine in twines.iter() {
            // Farther out nothing is told. (Twines out of the picture have no contrast; they would join all of its end.)
            let missing = u32::from(twine.state == TwineState::Missing);
            if missing == 0 && (twine.state != TwineState::Unknown || twine.llr > 0.0 || twine.contrast == 0.0) {
                continue;
            }
            match beside(graph, twine) {
                [Some(a), Some(b)] => {
                    let (a, b) = (self.root(a), self.root(b));
                    self.count[a] += missing;
                    if a != b {
                        self.parent[b] = a as u32;
                        self.count[a] += self.count[b];
                        self.open[a] |= self.open[b];
                    }
                }
                [Some(a), None] | [None, Some(a)] => {
                    let a = self.root(a);
                    self.count[a] += missing;
                    self.open[a] = true;
                }
                [None, None] => (),
            }
        }
        for twine in twines.iter_mut().filter(|t| t.state == TwineState::Missing) {
            let Some(cell) = beside(graph, twine).into_iter().flatten().next() else { continue };
            let root = self.root(cell);
            if self.open[root] && self.count[root] >= TWINES {
                twine.state = TwineState::Unknown;
            }
        }
    }

    fn root(&mut self, cell: usize) -> usize {
        let mut cell = cell as u32;
        while self.parent[cell as usize] != cell {
            let above = self.parent[cell as usize];
            self.parent[cell as usize] = self.parent[above as usize];
            cell = above;
        }
        cell as usize
    }
}

/// The meshes on both sides of a twine.
fn beside(graph: &Graph, twine: &Twine) -> [Option<usize>; 2] {
    let (i, j) = twine.index;
    let other = if twine.direction == 0 { (i, j - 1) } else { (i - 1, j) };
    [(i, j), other].map(|c| graph.node_at(c))
}
