//! The predicted nodes in view, the twines between them, and medians over neighbourhoods of the lattice.

use std::collections::VecDeque;

use net_geometry::nalgebra::Vector2;

use crate::adjust::blocks::Blocks;
use crate::adjust::map::LatticeMap;

/// No node or edge here.
const NONE: u32 = u32::MAX;

/// A node of the lattice in view, or one cell outside it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Node {
    /// Lattice index.
    pub index: (i32, i32),
    /// Where it is predicted, px.
    pub predicted: Vector2<f64>,
    /// Where it is now believed to be, less where it was predicted, px.
    pub shift: Vector2<f64>,
    /// Distance between parallel twines of each family here, px.
    pub spacing: [f64; 2],
    /// The lesser of the two.
    pub height: f64,
    /// Pixels per metre.
    pub scale: f64,
    /// From here half a cell on along the first and second direction, px.
    pub half_steps: [Vector2<f64>; 2],
    /// Whether it is predicted inside the picture.
    pub inside: bool,
}

impl Node {
    /// Where it is now believed to be, px.
    pub fn pixel(&self) -> Vector2<f64> {
        self.predicted + self.shift
    }
}

/// A twine between two neighbouring nodes, one of them at least inside the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Edge {
    /// Nodes at its ends.
    pub nodes: [u32; 2],
    /// 0: along the first direction, 1: along the second.
    pub family: usize,
    /// Bow and S-bend, px, see [`bend`].
    pub bow: [f32; 2],
}

/// How far a twine lies off the chord at `along` from 0 to 1, for a bow and an S-bend of 1 px.
pub(crate) fn bend(along: f32) -> [f32; 2] {
    let hump = along * (1.0 - along);
    [4.0 * hump, 10.4 * hump * (1.0 - 2.0 * along)]
}

/// An index to try, and the pixel of the node inside from which it was reached.
type Candidate = ((i32, i32), Option<Vector2<f64>>);

/// Nodes and edges in view; keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct Graph {
    pub nodes: Vec<Node>,
    pub edges: Vec<Edge>,
    /// Neighbourhoods of edges.
    pub blocks: Blocks,
    /// Edges that leave each node along both directions.
    outgoing: Vec<[u32; 2]>,
    /// Node at index `seed + (i, j)`, within `reach` of the seed.
    grid: Vec<u32>,
    reach: i32,
    seed: (i32, i32),
    queue: VecDeque<Candidate>,
}

impl Graph {
    /// Room for as many cells as fit a picture of this size.
    pub fn new(width: usize, height: usize, cell_min_px: f64) -> Self {
        let reach = ((width + height) as f64 / cell_min_px).ceil() as i32 + 2;
        let side = 2 * reach as usize + 1;
        Self { grid: vec![NONE; side * side], reach, ..Self::default() }
    }

    fn slot(&self, index: (i32, i32)) -> Option<usize> {
        let (i, j) = (index.0.checked_sub(self.seed.0)?, index.1.checked_sub(self.seed.1)?);
        (i.abs() <= self.reach && j.abs() <= self.reach)
            .then(|| (i + self.reach) as usize * (2 * self.reach as usize + 1) + (j + self.reach) as usize)
    }

    /// The node with this index, if it is in view.
    pub fn node_at(&self, index: (i32, i32)) -> Option<usize> {
        let node = self.grid[self.slot(index)?];
        (node != NONE).then_some(node as usize)
    }

    /// The nodes with the indices `(i, j)` and those after it along the second direction, so many in all, each with its distance from the first; those out of reach are left out.
    pub fn nodes_from(&self, (i, j): (i32, i32), count: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let slot = |j: i32| self.slot((i, j));
        let last = j.saturating_add(count as i32 - 1);
        let (whole, each) = match slot(j).zip(slot(last)) {
            Some((first, last)) => (&self.grid[first..=last], 0),
            // Near the reach's end one after the other.
            None => (Default::default(), count),
        };
        let whole = whole.iter().enumerate().filter(|(_, n)| **n != NONE).map(|(k, n)| (k, *n as usize));
        whole.chain((0..each).filter_map(move |k| Some((k, self.node_at((i, j.checked_add(k as i32)?))?))))
    }

    /// The edge that leaves a node along a direction.
    pub fn edge_from(&self, node: usize, family: usize) -> Option<usize> {
        let edge = self.outgoing[node][family];
        (edge != NONE).then_some(edge as usize)
    }

    /// Fills in what is in view and one cell more, growing outward from the map's seed.
    pub fn build(&mut self, map: &impl LatticeMap, width: usize, height: usize, cell_min_px: f64) {
        for k in 0..self.nodes.len() {
            if let Some(slot) = self.slot(self.nodes[k].index) {
                self.grid[slot] = NONE;
            }
        }
        self.nodes.clear();
        self.edges.clear();
        self.outgoing.clear();
        self.queue.clear();
        let Some(seed) = map.seed().filter(|s| s.0.abs() < 1 << 29 && s.1.abs() < 1 << 29) else { return };
        self.seed = seed;
        // The seed may itself be just outside: its neighbours are tried too.
        for i in -1..=1 {
            for j in -1..=1 {
                self.queue.push_back(((seed.0 + i, seed.1 + j), None));
            }
        }
        let size = Vector2::new((width - 1) as f64, (height - 1) as f64);
        while let Some((index, from)) = self.queue.pop_front() {
            let Some(slot) = self.slot(index) else { continue };
            if self.grid[slot] != NONE {
                continue;
            }
            let Some((p, scale)) = map.place(f64::from(index.0), f64::from(index.1)) else { continue };
            let inside = p.x >= 0.0 && p.y >= 0.0 && p.x <= size.x && p.y <= size.y;
            // Twines are no farther apart than the nodes on them.
            let step = from.map_or(f64::MAX, |from| (p - from).norm());
            let near = inside || from.is_some() && step < size.x + size.y;
            if !(near && scale > 0.0 && scale.is_finite() && step >= cell_min_px) {
                continue;
            }
            self.grid[slot] = self.nodes.len() as u32;
            self.nodes.push(Node {
                index,
                predicted: p,
                shift: Vector2::zeros(),
                spacing: [0.0; 2],
                height: 0.0,
                scale,
                half_steps: [Vector2::zeros(); 2],
                inside,
            });
            if inside {
                let (i, j) = index;
                self.queue.extend([(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)].map(|n| (n, Some(p))));
            }
        }
        self.measure_cells();
        self.drop_small(cell_min_px);
        for k in 0..self.nodes.len() {
            let (i, j) = self.nodes[k].index;
            let mut outgoing = [NONE; 2];
            for (family, next) in [(i + 1, j), (i, j + 1)].into_iter().enumerate() {
                if let Some(other) = self.node_at(next)
                    && (self.nodes[k].inside || self.nodes[other].inside)
                {
                    outgoing[family] = self.edges.len() as u32;
                    self.edges.push(Edge { nodes: [k as u32, other as u32], family, bow: [0.0; 2] });
                }
            }
            self.outgoing.push(outgoing);
        }
        self.blocks.build(&self.nodes, &self.edges);
    }

    /// Half steps and spacings from the predicted neighbours.
    fn measure_cells(&mut self) {
        for k in 0..self.nodes.len() {
            let (i, j) = self.nodes[k].index;
            let here = self.nodes[k].predicted;
            let at = |index| self.node_at(index).map(|n| self.nodes[n].predicted);
            let half =
                [[(i + 1, j), (i - 1, j)], [(i, j + 1), (i, j - 1)]].map(|[next, last]| match (at(next), at(last)) {
                    (Some(next), Some(last)) => (next - last) * 0.25,
                    (Some(next), None) => (next - here) * 0.5,
                    (None, Some(last)) => (here - last) * 0.5,
                    (None, None) => Vector2::zeros(),
                });
            let node = &mut self.nodes[k];
            let area = 4.0 * half[0].perp(&half[1]).abs();
            node.half_steps = half;
            node.spacing = half.map(|step| area / (2.0 * step.norm()));
            node.height = node.spacing[0].min(node.spacing[1]);
        }
        // A node outside often has one neighbour only: cells are those of that neighbour.
        for k in 0..self.nodes.len() {
            if self.nodes[k].inside {
                continue;
            }
            let (i, j) = self.nodes[k].index;
            let around = [(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)];
            let neighbour = around.into_iter().filter_map(|n| self.node_at(n)).find(|&n| self.nodes[n].inside);
            if let Some(n) = neighbour {
                let Node { spacing, height, half_steps, .. } = self.nodes[n];
                self.nodes[k] = Node { spacing, height, half_steps, ..self.nodes[k] };
            }
        }
    }

    fn drop_small(&mut self, cell_min_px: f64) {
        let mut kept = 0;
        for k in 0..self.nodes.len() {
            let node = self.nodes[k];
            // False for NaN.
            let large = node.height >= cell_min_px;
            if let Some(slot) = self.slot(node.index) {
                self.grid[slot] = if large { kept as u32 } else { NONE };
            }
            if large {
                self.nodes[kept] = node;
                kept += 1;
            }
        }
        self.nodes.truncate(kept);
    }
}

/// The value that four of five do not exceed; reorders. Of a picture that is half water it is one of net.
pub(crate) fn upper(values: &mut [f32]) -> Option<f32> {
    if values.is_empty() {
        return None;
    }
    let at = values.len() * 4 / 5;
    Some(*values.select_nth_unstable_by(at, f32::total_cmp).1)
}

/// The value that nine of ten reach; reorders.
pub(crate) fn lower(values: &mut [f32]) -> Option<f32> {
    if values.is_empty() {
        return None;
    }
    let at = values.len() / 10;
    Some(*values.select_nth_unstable_by(at, f32::total_cmp).1)
}

/// Upper median; reorders.
pub(crate) fn median(values: &mut [f32]) -> Option<f32> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of `side` px, node (0, 0) at (10, 20).
    struct Flat(f64);

    impl LatticeMap for Flat {
        fn pixel(&self, i: f64, j: f64) -> Option<Vector2<f64>> {
            Some(Vector2::new(10.0 + i * self.0, 20.0 + j * self.0))
        }
        fn pixels_per_metre(&self, _: f64, _: f64) -> Option<f64> {
            Some(self.0 / 0.05)
        }
        fn seed(&self) -> Option<(i32, i32)> {
            Some((2, 2))
        }
    }

    #[test]
    fn every_node_in_the_picture_is_there_once() {
        let mut graph = Graph::new(100, 60, 4.5);
        for _ in 0..2 {
            graph.build(&Flat(10.0), 100, 60, 4.5);
            // u from 0 to 90, v from 0 to 50; around them one more.
            assert_eq!(graph.nodes.iter().filter(|n| n.inside).count(), 10 * 6);
            assert_eq!(graph.nodes.len(), 10 * 6 + 2 * 10 + 2 * 6);
            assert_eq!(graph.edges.len(), 11 * 6 + 10 * 7);
            assert_eq!(graph.nodes[graph.node_at((0, 0)).expect("in view")].predicted, Vector2::new(10.0, 20.0));
            assert!(graph.nodes.iter().all(|n| n.height == 10.0));
            assert!(graph.node_at((10, 0)).is_none());
            assert!(graph.node_at((i32::MAX, i32::MIN)).is_none());
        }
        graph.build(&Flat(4.0), 100, 60, 4.5);
        assert!(graph.edges.is_empty());
    }

    #[test]
    fn the_median_is_over_neighbours_of_the_same_family() {
        let mut graph = Graph::new(100, 60, 4.5);
        graph.build(&Flat(10.0), 100, 60, 4.5);
        let value = |e: &Edge| if e.family == 0 { graph.nodes[e.nodes[0] as usize].index.0 as f32 } else { f32::NAN };
        let values: Vec<_> = graph.edges.iter().map(value).collect();
        let mut out = Vec::new();
        graph.blocks.local_median(&values, &mut out);
        let middle = graph.node_at((3, 1)).expect("in view");
        let of = |family| {
            let edge = graph.edge_from(middle, family).expect("in view");
            out[graph.blocks.of_edge(edge)]
        };
        // Columns -2 to 8 in blocks of three from -2 on: around the one of 1 to 3 lie -2 to 6.
        assert_eq!(of(0), 2.0);
        // No value at all among the second family: the overall median, of -2 to 8.
        assert_eq!(of(1), 3.0);
    }
}
