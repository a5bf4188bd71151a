//! Whether what lies in a twine's place is the water that the meshes beside it show.

use crate::adjust::graph::{Graph, median};

/// Least scatter of levels, grey levels.
const SCATTER_MIN: f32 = 0.4;

/// Buffers of this stage.
#[derive(Debug, Default)]
pub(crate) struct Foreign {
    /// By edge, of control lines: how far each is off those on both sides.
    null: Vec<f32>,
    scatter: Vec<f32>,
    scratch: Vec<f32>,
    overall: f32,
}

impl Foreign {
    /// From the mean grey levels of control lines, each half a cell beside its twine.
    pub fn find(&mut self, graph: &mut Graph, control: &[f32]) {
        self.null.clear();
        self.null.extend((0..graph.edges.len()).map(|e| {
            let [last, next] = beside(graph, e).map(|e| e.map_or(f32::NAN, |e| control[e]));
            (control[e] - 0.5 * (last + next)).abs()
        }));
        self.scratch.clear();
        self.scratch.extend(self.null.iter().filter(|d| !d.is_nan()));
        self.overall = 1.4826 * median(&mut self.scratch).unwrap_or(0.0) + SCATTER_MIN;
        graph.blocks.local_median(&self.null, &mut self.scatter);
    }

    /// How many deviations a twine's place of mean grey level `twine` is off the meshes beside it; NaN where they are out of view.
    pub fn of(&self, graph: &Graph, edge: usize, twine: f32, control: &[f32]) -> f32 {
        let last = beside(graph, edge)[0].map_or(f32::NAN, |e| control[e]);
        let scatter = 1.4826 * self.scatter[graph.blocks.of_edge(edge)] + SCATTER_MIN;
        (twine - 0.5 * (last + control[edge])).abs() / scatter.max(self.overall)
    }
}

/// The twines of the same family on both sides of one.
pub(crate) fn beside(graph: &Graph, edge: usize) -> [Option<usize>; 2] {
    let edge = &graph.edges[edge];
    let (i, j) = graph.nodes[edge.nodes[0] as usize].index;
    let indices = if edge.family == 0 { [(i, j - 1), (i, j + 1)] } else { [(i - 1, j), (i + 1, j)] };
    indices.map(|index| graph.edge_from(graph.node_at(index)?, edge.family))
}
