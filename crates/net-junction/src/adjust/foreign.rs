//! Whether what lies in a twine's place is the water that the meshes beside it show.

use crate::adjust::graph::{Graph, median};

/// Least scatter of levels, grey levels.
const SCATTER_MIN: f32 = 0.4;

/// Buffers of this stage.
#[derive(Debug, Default)]
pub(crate) struct Foreign {
    off: Vec<f32>,
    /// By edge, of control lines: how far each is off those on both sides.
    null: Vec<f32>,
    scatter: Vec<f32>,
    scratch: Vec<f32>,
}

impl Foreign {
    /// From the mean grey levels of twines and of the control lines, each half a cell beside its twine.
    pub fn find(&mut self, graph: &mut Graph, twine: &[f32], control: &[f32]) {
        self.off.clear();
        self.null.clear();
        for (e, edge) in graph.edges.iter().enumerate() {
            let (i, j) = graph.nodes[edge.nodes[0] as usize].index;
            let [last, next] = if edge.family == 0 { [(i, j - 1), (i, j + 1)] } else { [(i - 1, j), (i + 1, j)] };
            let of = |index| graph.node_at(index).and_then(|n| graph.edge_from(n, edge.family)).map(|e| control[e]);
            let (last, next) = (of(last).unwrap_or(f32::NAN), of(next).unwrap_or(f32::NAN));
            self.off.push((twine[e] - 0.5 * (last + control[e])).abs());
            self.null.push((control[e] - 0.5 * (last + next)).abs());
        }
        self.scratch.clear();
        self.scratch.extend(self.null.iter().filter(|d| !d.is_nan()));
        let overall = 1.4826 * median(&mut self.scratch).unwrap_or(0.0) + SCATTER_MIN;
        graph.blocks.local_median(&self.null, &mut self.scatter);
        for (e, off) in self.off.iter_mut().enumerate() {
            *off /= (1.4826 * self.scatter[graph.blocks.of_edge(e)] + SCATTER_MIN).max(overall);
        }
    }

    /// How many deviations a twine's place is off the meshes beside it; NaN where they are out of view.
    pub fn at(&self, edge: usize) -> f32 {
        self.off[edge]
    }
}
