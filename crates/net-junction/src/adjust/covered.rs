//! Which meshes something hides: their middles are unlike those around.

use net_geometry::nalgebra::Vector2;
use net_image::GrayView;

use crate::adjust::graph::{Edge, Graph, median};

/// Buffers of this stage.
#[derive(Debug, Default)]
pub(crate) struct Covered {
    levels: Vec<f32>,
    textures: Vec<f32>,
    typical: Vec<f32>,
    deviations: Vec<f32>,
    /// Kept at the mesh's first edge of family 0.
    covered: Vec<f32>,
}

impl Covered {
    /// Measures how far each mesh's middle is off its surroundings, in their deviations.
    pub fn find(&mut self, graph: &mut Graph, image: GrayView) {
        self.levels.clear();
        self.textures.clear();
        for edge in &graph.edges {
            let node = &graph.nodes[edge.nodes[0] as usize];
            let (level, texture) = if edge.family == 0 {
                let middle = node.pixel() + node.half_steps[0] + node.half_steps[1];
                mesh_level(image, middle, (0.2 * node.height).clamp(0.5, 6.0))
            } else {
                (f32::NAN, f32::NAN)
            };
            self.levels.push(level);
            self.textures.push(texture);
        }
        self.covered.clear();
        self.covered.resize(graph.edges.len(), 0.0);
        for (values, floor, signed) in [(&self.levels, 0.3, false), (&self.textures, 0.1, true)] {
            graph.blocks.local_median(values, &mut self.typical);
            let off = |e: usize| values[e] - self.typical[graph.blocks.of_edge(e)];
            self.deviations.clear();
            self.deviations.extend((0..values.len()).map(off).filter(|d| !d.is_nan()).map(f32::abs));
            let scale = 1.4826 * median(&mut self.deviations).unwrap_or(0.0) + floor;
            for (e, covered) in self.covered.iter_mut().enumerate() {
                let off = if signed { off(e) } else { off(e).abs() } / scale;
                *covered = covered.max(off);
            }
        }
    }

    /// That of the meshes beside a twine: the most.
    pub fn beside(&self, graph: &Graph, edge: &Edge) -> f32 {
        let (i, j) = graph.nodes[edge.nodes[0] as usize].index;
        self.most(graph, [(i, j), if edge.family == 0 { (i, j - 1) } else { (i - 1, j) }])
    }

    /// That of the other meshes at its ends: the most.
    pub fn at_ends(&self, graph: &Graph, edge: &Edge) -> f32 {
        let (i, j) = graph.nodes[edge.nodes[0] as usize].index;
        self.most(
            graph,
            if edge.family == 0 {
                [(i - 1, j), (i - 1, j - 1), (i + 1, j), (i + 1, j - 1)]
            } else {
                [(i, j - 1), (i - 1, j - 1), (i, j + 1), (i - 1, j + 1)]
            },
        )
    }

    fn most<const N: usize>(&self, graph: &Graph, cells: [(i32, i32); N]) -> f32 {
        let edges = cells.into_iter().filter_map(|c| graph.edge_from(graph.node_at(c)?, 0));
        edges.map(|k| self.covered[k]).fold(0.0, f32::max)
    }
}

/// Mean and standard deviation of nine values in a mesh's middle; NaN outside the picture.
fn mesh_level(image: GrayView, middle: Vector2<f64>, radius: f64) -> (f32, f32) {
    let around = [
        (0.0, 0.0),
        (1.0, 0.0),
        (-1.0, 0.0),
        (0.0, 1.0),
        (0.0, -1.0),
        (0.7, 0.7),
        (-0.7, 0.7),
        (0.7, -0.7),
        (-0.7, -0.7),
    ];
    let (mut sum, mut squares) = (0.0, 0.0);
    for (x, y) in around {
        let Some(value) = net_image::bilinear(image, middle.x + radius * x, middle.y + radius * y) else {
            return (f32::NAN, f32::NAN);
        };
        sum += value;
        squares += value * value;
    }
    let mean = sum / 9.0;
    (mean, (squares / 9.0 - mean * mean).max(0.0).sqrt())
}
