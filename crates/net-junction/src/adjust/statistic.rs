//! A number for each line, what is usual around it, and what it says for or against twine.

use crate::adjust::graph::{Graph, median};

/// Part of the next block's typical amplitude below which a block is no measure: at a net's end and in holes most twines are gone.
const TYPICAL_LEAST: f32 = 0.6;
/// Most that one twine says of whether there is a net around it.
const VOTE_MAX: f32 = 2.0;

/// A statistic of all lines, and by block its median and scatter.
#[derive(Debug, Default)]
pub(crate) struct Statistic {
    pub values: Vec<f32>,
    typical: Vec<f32>,
    spread: Vec<f32>,
    /// Logarithms of `spread`.
    log_spread: Vec<f32>,
}

impl Statistic {
    /// Local medians, and scatter about them half local, half over the picture.
    pub fn summarise(&mut self, graph: &mut Graph, floor: f32, deviations: &mut Vec<f32>) {
        graph.blocks.local_median(&self.values, &mut self.typical);
        deviations.clear();
        let blocks = &graph.blocks;
        deviations.extend(self.values.iter().enumerate().map(|(e, v)| (v - self.typical[blocks.of_edge(e)]).abs()));
        graph.blocks.local_median(deviations, &mut self.spread);
        deviations.retain(|d| !d.is_nan());
        let overall = median(deviations).unwrap_or(0.0);
        for s in &mut self.spread {
            *s = (1.4826 * (0.5 * (*s * *s + overall * overall)).sqrt()).hypot(floor);
        }
    }

    /// Readies [`evidence`], once typical values and scatter are what they stay.
    pub fn finish(&mut self) {
        self.log_spread.clear();
        self.log_spread.extend(self.spread.iter().map(|s| s.ln()));
    }

    /// What is usual around a block.
    pub fn typical(&self, block: usize) -> f32 {
        self.typical[block]
    }

    /// Blocks where most twines are gone take over what the best of their neighbours has.
    pub fn borrow(&mut self, graph: &Graph, typical: &mut Vec<f32>) {
        typical.clone_from(&self.typical);
        for block in 0..typical.len() {
            let around = graph.blocks.beside(block).into_iter().flatten();
            let around = around.filter(|&b| !graph.blocks.members(b).is_empty());
            let Some(best) = around.max_by(|&a, &b| typical[a].total_cmp(&typical[b])) else { continue };
            if typical[block] < TYPICAL_LEAST * typical[best] {
                self.typical[block] = typical[best];
                self.spread[block] = self.spread[block].min(self.spread[best]);
            }
        }
    }
}

/// Log likelihood ratio, twine to no twine, of an edge's statistic by Student densities with five degrees of freedom, and by how many standard deviations its neighbourhood's differ.
pub(crate) fn evidence(twine: &Statistic, control: &Statistic, edge: usize, block: usize) -> (f32, f32) {
    let (p0, sp) = (twine.typical[block], twine.spread[block]);
    let (m0, s0) = (control.typical[block], control.spread[block]);
    // Stronger than usual twine is no less twine; weaker than no twine is no less missing.
    let x = twine.values[edge].min(p0).max(m0);
    let [present, missing] = [(p0, sp), (m0, s0)].map(|(at, scale)| 1.0 + ((x - at) / scale).powi(2) / 5.0);
    let llr = control.log_spread[block] - twine.log_spread[block] + 3.0 * (missing / present).ln();
    (llr, (p0 - m0) / sp.hypot(s0))
}

/// Log likelihood ratio, twine to no twine, of normal densities of the same scatter, limited to [`VOTE_MAX`]: a sum of many needs no heavy tails.
pub(crate) fn vote(twine: &Statistic, control: &Statistic, edge: usize, block: usize) -> f32 {
    let (p0, m0) = (twine.typical[block], control.typical[block]);
    let variance = 0.5 * (twine.spread[block].powi(2) + control.spread[block].powi(2));
    let x = twine.values[edge] - 0.5 * (p0 + m0);
    (x * (p0 - m0).max(0.0) / variance).clamp(-VOTE_MAX, VOTE_MAX)
}
