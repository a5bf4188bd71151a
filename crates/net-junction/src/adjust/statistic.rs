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
    /// Scatter by block, no less than its own: noisier parts of the picture have more twines that look gone.
    wide: Vec<f32>,
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
        self.wide.clone_from(&self.spread);
        for s in &mut self.spread {
            *s = (1.4826 * (0.5 * (*s * *s + overall * overall)).sqrt()).hypot(floor);
        }
    }

    /// Readies [`evidence`], once typical values and scatter are what they stay.
    pub fn finish(&mut self) {
        self.wide.iter_mut().zip(&self.spread).for_each(|(own, s)| *own = s.max(1.4826 * *own));
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
                self.wide[block] = self.wide[block].min(self.wide[best]);
            }
        }
    }
}

/// Log likelihood ratio, twine to no twine, of an edge's statistic by Student densities with five degrees of freedom, and by how many standard deviations its neighbourhood's differ.
pub(crate) fn evidence(twine: &Statistic, control: &Statistic, edge: usize, block: usize) -> (f32, f32) {
    let (p0, m0) = (twine.typical[block], control.typical[block]);
    let (sp, s0) = (twine.spread[block], control.spread[block]);
    let llr = control.log_spread[block] - twine.log_spread[block] + ratio(twine.values[edge], (p0, sp), (m0, s0));
    (llr, (p0 - m0) / sp.hypot(s0))
}

/// The same against a gap: there no amplitude is usual, while in small cells control lines lie between two twines, which look like the opposite of one.
pub(crate) fn evidence_of_gap(twine: &Statistic, control: &Statistic, edge: usize, block: usize) -> (f32, f32) {
    let (p0, m0) = (twine.typical[block], control.typical[block].max(0.0));
    let (sp, s0) = (twine.wide[block], control.wide[block]);
    let llr = (s0 / sp).ln() + ratio(twine.values[edge], (p0, sp), (m0, s0));
    (llr, (p0 - m0) / sp.hypot(s0))
}

/// Logarithm of the ratio of two Student densities, each of typical value and scatter, but for the ratio of their scatters.
fn ratio(value: f32, (p0, sp): (f32, f32), (m0, s0): (f32, f32)) -> f32 {
    // Stronger than usual twine is no less twine; weaker than no twine is no less missing.
    let x = value.min(p0).max(m0);
    let [present, missing] = [(p0, sp), (m0, s0)].map(|(at, scale)| 1.0 + ((x - at) / scale).powi(2) / 5.0);
    3.0 * (missing / present).ln()
}

/// Log likelihood ratio, twine to no twine, of normal densities of the same scatter, limited to [`VOTE_MAX`]: a sum of many needs no heavy tails.
pub(crate) fn vote(twine: &Statistic, control: &Statistic, edge: usize, block: usize) -> f32 {
    let (p0, m0) = (twine.typical[block], control.typical[block]);
    let variance = 0.5 * (twine.spread[block].powi(2) + control.spread[block].powi(2));
    let x = twine.values[edge] - 0.5 * (p0 + m0);
    (x * (p0 - m0).max(0.0) / variance).clamp(-VOTE_MAX, VOTE_MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statistic(values: &[f32], typical: f32, spread: f32, own: f32) -> Statistic {
        let mut statistic = Statistic {
            values: values.to_vec(),
            typical: vec![typical],
            spread: vec![spread],
            log_spread: Vec::new(),
            wide: vec![own / 1.4826],
        };
        statistic.finish();
        statistic
    }

    #[test]
    fn a_gap_is_no_amplitude_even_where_control_lines_have_less() {
        let twine = statistic(&[0.05, 0.95, f32::NAN], 0.9, 0.18, 0.1);
        let [between, clear] = [-0.4, 0.0].map(|typical| statistic(&[], typical, 0.15, 0.1));
        let beside = evidence(&twine, &between, 0, 0);
        let gap = evidence_of_gap(&twine, &between, 0, 0);
        assert!(gap.0 < beside.0 - 1.0, "{gap:?} {beside:?}");
        assert!(gap.1 < beside.1, "{gap:?} {beside:?}");
        // Where control lines show nothing, and blocks are no noisier than the picture, both are the same.
        let [gap, beside] = [evidence_of_gap(&twine, &clear, 0, 0), evidence(&twine, &clear, 0, 0)];
        assert!((gap.0 - beside.0).abs() < 1e-4 && gap.1 == beside.1, "{gap:?} {beside:?}");
        assert!(evidence_of_gap(&twine, &clear, 1, 0).0 > 3.0);
    }

    #[test]
    fn noisier_parts_of_a_picture_say_less() {
        let control = statistic(&[], 0.0, 0.15, 0.15);
        let [calm, noisy] = [0.18, 0.4].map(|own| statistic(&[0.05], 0.9, 0.18, own));
        let [calm, noisy] = [calm, noisy].map(|twine| evidence_of_gap(&twine, &control, 0, 0));
        assert!(noisy.0 > calm.0 + 1.0 && noisy.1 < calm.1, "{calm:?} {noisy:?}");
    }
}
