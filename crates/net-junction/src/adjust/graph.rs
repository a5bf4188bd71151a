//! The predicted nodes in view, the twines between them, and medians over neighbourhoods of the lattice.

use std::collections::VecDeque;

use net_geometry::nalgebra::Vector2;

use crate::adjust::map::LatticeMap;

/// No node or edge here.
const NONE: u32 = u32::MAX;

/// A node of the lattice in view.
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
    /// From here to the predicted node half a cell on along the first and second direction, px.
    pub half_steps: [Vector2<f64>; 2],
}

impl Node {
    /// Where it is now believed to be, px.
    pub fn pixel(&self) -> Vector2<f64> {
        self.predicted + self.shift
    }
}

/// A twine between two neighbouring nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Edge {
    /// Nodes at its ends.
    pub nodes: [u32; 2],
    /// 0: along the first direction, 1: along the second.
    pub family: usize,
    /// Bow and S-bend, px, see [`bend`].
    pub bow: [f64; 2],
}

/// How far a twine lies off the chord at `along` from 0 to 1, for a bow and an S-bend of 1 px.
pub(crate) fn bend(along: f64) -> [f64; 2] {
    let hump = along * (1.0 - along);
    [4.0 * hump, 10.4 * hump * (1.0 - 2.0 * along)]
}

/// Nodes and edges in view; keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct Graph {
    pub nodes: Vec<Node>,
    pub edges: Vec<Edge>,
    /// Edges that leave each node along both directions.
    outgoing: Vec<[u32; 2]>,
    /// Node at index `seed + (i, j)`, within `reach` of the seed.
    grid: Vec<u32>,
    reach: i32,
    seed: (i32, i32),
    queue: VecDeque<(i32, i32)>,
    scratch: Vec<f32>,
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

    /// The edge that leaves a node along a direction.
    pub fn edge_from(&self, node: usize, family: usize) -> Option<usize> {
        let edge = self.outgoing[node][family];
        (edge != NONE).then_some(edge as usize)
    }

    /// Fills in what is in view, growing outward from the map's seed, up to `radius` px from it.
    pub fn build(&mut self, map: &impl LatticeMap, width: usize, height: usize, cell_min_px: f64, radius: f64) {
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
                self.queue.push_back((seed.0 + i, seed.1 + j));
            }
        }
        let size = Vector2::new((width - 1) as f64, (height - 1) as f64);
        let Some(middle) = map.pixel(f64::from(seed.0), f64::from(seed.1)) else { return };
        while let Some(index) = self.queue.pop_front() {
            let Some(slot) = self.slot(index) else { continue };
            if self.grid[slot] != NONE {
                continue;
            }
            let Some(node) = predict(map, index) else { continue };
            let p = node.predicted;
            let inside = p.x >= 0.0 && p.y >= 0.0 && p.x <= size.x && p.y <= size.y;
            if !(inside && node.height >= cell_min_px && (p - middle).norm() <= radius) {
                continue;
            }
            self.grid[slot] = self.nodes.len() as u32;
            self.nodes.push(node);
            let (i, j) = index;
            self.queue.extend([(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)]);
        }
        for k in 0..self.nodes.len() {
            let (i, j) = self.nodes[k].index;
            let mut outgoing = [NONE; 2];
            for (family, next) in [(i + 1, j), (i, j + 1)].into_iter().enumerate() {
                if let Some(other) = self.node_at(next) {
                    outgoing[family] = self.edges.len() as u32;
                    self.edges.push(Edge { nodes: [k as u32, other as u32], family, bow: [0.0; 2] });
                }
            }
            self.outgoing.push(outgoing);
        }
    }

    /// Calls `visit` with every edge of the same family at most `radius` cells from an edge, itself included.
    #[inline]
    pub fn for_neighbours(&self, edge: usize, radius: i32, mut visit: impl FnMut(usize)) {
        let Edge { nodes, family, .. } = self.edges[edge];
        let (i, j) = self.nodes[nodes[0] as usize].index;
        for di in -radius..=radius {
            let Some(slot) = self.slot((i + di, j)) else { continue };
            let column = j - self.seed.1 + self.reach;
            let row = slot - column as usize;
            let (low, high) = ((column - radius).max(0), (column + radius).min(2 * self.reach));
            for &node in &self.grid[row + low as usize..=row + high as usize] {
                if node != NONE && self.outgoing[node as usize][family] != NONE {
                    visit(self.outgoing[node as usize][family] as usize);
                }
            }
        }
    }

    /// Median over each edge's neighbourhood into `out` (cleared first); NaN values do not count, and edges without any get the
    /// overall median, or 0 if there is none.
    pub fn local_median(&mut self, values: &[f32], radius: i32, out: &mut Vec<f32>) {
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.clear();
        scratch.extend(values.iter().filter(|v| !v.is_nan()));
        let overall = median(&mut scratch).unwrap_or(0.0);
        out.clear();
        for edge in 0..self.edges.len() {
            scratch.clear();
            self.for_neighbours(edge, radius, |e| {
                if !values[e].is_nan() {
                    scratch.push(values[e]);
                }
            });
            out.push(median(&mut scratch).unwrap_or(overall));
        }
        self.scratch = scratch;
    }
}

/// Upper median; reorders.
pub(crate) fn median(values: &mut [f32]) -> Option<f32> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// The node with this index where the map predicts it.
pub(crate) fn predict(map: &impl LatticeMap, index: (i32, i32)) -> Option<Node> {
    let (i, j) = (f64::from(index.0), f64::from(index.1));
    let predicted = map.pixel(i, j)?;
    let (a, b) = (map.pixel(i + 0.5, j)?, map.pixel(i, j + 0.5)?);
    let half_steps = [a - predicted, b - predicted];
    let area = 4.0 * half_steps[0].perp(&half_steps[1]).abs();
    let spacing = half_steps.map(|step| area / (2.0 * step.norm()));
    let height = spacing[0].min(spacing[1]);
    let scale = map.pixels_per_metre(i, j)?;
    (predicted.x.is_finite() && predicted.y.is_finite() && height.is_finite() && scale.is_finite() && scale > 0.0)
        .then_some(Node { index, predicted, shift: Vector2::zeros(), spacing, height, scale, half_steps })
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
            graph.build(&Flat(10.0), 100, 60, 4.5, f64::MAX);
            // u from 0 to 90, v from 0 to 50.
            assert_eq!(graph.nodes.len(), 10 * 6);
            assert_eq!(graph.edges.len(), 9 * 6 + 10 * 5);
            assert_eq!(graph.nodes[graph.node_at((0, 0)).expect("in view")].predicted, Vector2::new(10.0, 20.0));
            assert!(graph.node_at((9, 0)).is_none());
            assert!(graph.node_at((i32::MAX, i32::MIN)).is_none());
        }
        graph.build(&Flat(4.0), 100, 60, 4.5, f64::MAX);
        assert!(graph.nodes.is_empty());
    }

    #[test]
    fn the_median_is_over_neighbours_of_the_same_family() {
        let mut graph = Graph::new(100, 60, 4.5);
        graph.build(&Flat(10.0), 100, 60, 4.5, f64::MAX);
        let value = |e: &Edge| if e.family == 0 { graph.nodes[e.nodes[0] as usize].index.0 as f32 } else { f32::NAN };
        let values: Vec<_> = graph.edges.iter().map(value).collect();
        let mut out = Vec::new();
        graph.local_median(&values, 1, &mut out);
        let middle = graph.node_at((3, 1)).expect("in view");
        assert_eq!(out[graph.edge_from(middle, 0).expect("in view")], 3.0);
        // No value at all among the second family: the overall median, of 0 to 7 and -1.
        assert_eq!(out[graph.edge_from(middle, 1).expect("in view")], 3.0);
    }
}
