//! How twine looks in each neighbourhood, learned from it: whatever light, blur and colour do.

use net_image::widely;

use crate::adjust::graph::{Graph, upper};
use crate::adjust::lanes::LANES;
use crate::adjust::lines::{Means, SHIFT};
use crate::adjust::profile::Profiles;

/// Energy of a template, in parts of strong ones', below which there is no net: in clean pictures anything stands out from nothing.
const LEAST_ENERGY: f32 = 0.004;
/// Part of a template's extreme that it must reach on the line.
const FLAT_TOP: f32 = 0.8;
/// Relative amplitudes of what looks like twine.
const ALIKE: std::ops::Range<f32> = 0.4..2.5;

/// Templates; keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct Appearance {
    pub means: Means,
    /// By block, `2 half + 1` values, free of constant and slope, and zeros up to a whole vector.
    templates: Vec<f32>,
    /// By block: sum of squares.
    energies: Vec<f32>,
    /// By block: whether the template is twine on the line.
    pub centred: Vec<bool>,
    amplitudes: Vec<f32>,
    rows: Vec<f32>,
    block_sums: Vec<f32>,
    sum: Vec<f32>,
    strong: Vec<f32>,
    pub half: usize,
}

impl Appearance {
    /// The template of a block, with zeros up to a whole vector, and its sum of squares.
    #[inline(always)]
    pub fn template(&self, block: usize) -> (&[f32], f32) {
        let width = self.padded();
        (&self.templates[block * width..][..width], self.energies[block])
    }

    fn padded(&self) -> usize {
        (2 * self.half + 1).next_multiple_of(LANES)
    }

    /// Learns templates of `half` steps to each side, whose extreme may lie `beside` steps off the line.
    pub fn learn(&mut self, graph: &Graph, profiles: &Profiles, half: usize, beside: usize) {
        self.half = half;
        self.means.take(profiles, half);
        self.average(graph, false);
        // Once more without what looks absent.
        let mut amplitudes = std::mem::take(&mut self.amplitudes);
        best_amplitudes(self, graph, &mut amplitudes);
        self.amplitudes = amplitudes;
        self.average(graph, true);
        self.centre(beside);
    }

    /// Template of each block: the mean of the profiles around; with `known` only of those that look like twine.
    fn average(&mut self, graph: &Graph, known: bool) {
        let width = 2 * self.half + 1;
        // Of each line as many values, and whether they are there.
        let row_width = width + 1;
        self.rows.clear();
        for e in 0..graph.edges.len() {
            let known = self.means.inside[e] && (!known || ALIKE.contains(&self.amplitudes[e]));
            self.rows.extend(self.means.row(e)[SHIFT..][..width].iter().map(|m| if known { *m } else { 0.0 }));
            self.rows.push(f32::from(known));
        }
        let padded = self.padded();
        let Self { rows, block_sums, sum, templates, energies, .. } = self;
        graph.blocks.sum_members(row_width, |e| rows.get(e * row_width..)?.get(..row_width), block_sums);
        graph.blocks.sum_neighbours(row_width, block_sums, sum);
        templates.clear();
        templates.resize(graph.blocks.count() * padded, 0.0);
        energies.clear();
        energies.resize(graph.blocks.count(), 1e-9);
        for (block, template) in templates.chunks_exact_mut(padded).enumerate() {
            let template = &mut template[..width];
            if graph.blocks.members(block).is_empty() {
                continue;
            }
            let sum = &block_sums[block * row_width..][..row_width];
            let share = 1.0 / sum[width].max(1.0);
            template.iter_mut().zip(sum.iter()).for_each(|(t, s)| *t = share * s);
            remove_line(template);
            energies[block] += template.iter().map(|t| t * t).sum::<f32>();
        }
    }

    /// Learned templates fit whatever neighbours have in common, also twine beside the line: what differs most from the template's ends must
    /// lie on the line.
    fn centre(&mut self, beside: usize) {
        let half = self.half;
        self.centred.clear();
        self.strong.clear();
        self.strong.extend(self.energies.iter().filter(|&&e| e > 1e-9));
        let least = LEAST_ENERGY * upper(&mut self.strong).unwrap_or(0.0);
        for (template, &energy) in self.templates.chunks_exact(self.padded()).zip(&self.energies) {
            // Broad twine reaches far to both sides: beyond it is zero, not at the mean.
            let end = 0.5 * (template[0] + template[2 * half]);
            let smooth = |k: usize| 0.25 * (template[k - 1] + 2.0 * template[k] + template[k + 1]) - end;
            let extreme =
                (1..2 * half).map(smooth).fold(0.0_f32, |most, t| if t.abs() > most.abs() { t } else { most });
            let near = half.saturating_sub(beside).max(1)..=(half + beside).min(2 * half - 1);
            // Broad twine, blurred by motion, has a flat top whose highest point means nothing.
            let on_line = near.into_iter().any(|k| smooth(k) * extreme >= FLAT_TOP * extreme * extreme);
            self.centred.push(on_line && energy > least);
        }
    }
}

widely! {
    /// The amplitude of each line's mean profile in parts of its template's.
    fn best_amplitudes<'a>(appearance: &'a Appearance, graph: &'a Graph, out: &'a mut Vec<f32>) -> () {
        out.clear();
        out.extend((0..graph.edges.len()).map(|e| {
            let (template, energy) = appearance.template(graph.blocks.of_edge(e));
            appearance.means.best(e, template, energy).1
        }));
    }
}

/// Takes constant and slope away.
fn remove_line(values: &mut [f32]) {
    let n = values.len() as f32;
    let middle = 0.5 * (n - 1.0);
    let mean = values.iter().sum::<f32>() / n;
    let (mut product, mut squares) = (0.0, 0.0);
    for (k, v) in values.iter().enumerate() {
        let d = k as f32 - middle;
        product += d * v;
        squares += d * d;
    }
    let slope = if squares > 0.0 { product / squares } else { 0.0 };
    for (k, v) in values.iter_mut().enumerate() {
        *v -= mean + slope * (k as f32 - middle);
    }
}
