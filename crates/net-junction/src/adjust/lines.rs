//! Each line measured against its neighbourhood's template: twines, and control lines half a cell aside.

use crate::adjust::appearance::{Appearance, remove_line};
use crate::adjust::graph::Graph;
use crate::adjust::profile::Profiles;
use crate::adjust::statistic::Statistic;

/// Steps that a profile may be shifted to fit its neighbours' mean: 1 px.
pub(crate) const SHIFT: usize = 2;
/// How far beside its line a twine is looked for before it is called missing, cells: the neighbouring one is a whole cell off.
const BESIDE: f32 = 0.25;
/// Amplitude below which half of a twine may be gone.
const GONE: f32 = 0.3;
/// Part of the twine, at each end, that is the knot's: of its length, and at least so many px.
const KNOT: (f32, f32) = (0.12, 2.0);

/// Mean profiles of the lines' middles, `half + SHIFT` steps to each side.
#[derive(Debug, Default)]
pub(crate) struct Means {
    values: Vec<f32>,
    width: usize,
    /// Whether most of the line lies in the picture.
    pub inside: Vec<bool>,
}

impl Means {
    /// Takes them of all lines.
    pub fn take(&mut self, profiles: &Profiles, half: usize) {
        self.width = 2 * (half + SHIFT) + 1;
        let bins = middle_bins(profiles);
        let share = 1.0 / bins.len() as f32;
        let edges = profiles.inside.len() / profiles.bins;
        self.values.clear();
        self.values.resize(edges * self.width, 0.0);
        self.inside.clear();
        for (e, row) in self.values.chunks_exact_mut(self.width).enumerate() {
            for bin in bins.clone() {
                row.iter_mut().zip(&profiles.row(e, bin)[profiles.half - half - SHIFT..]).for_each(|(s, p)| *s += p);
            }
            row.iter_mut().for_each(|s| *s *= share);
            let inside = bins.clone().filter(|b| profiles.inside[e * profiles.bins + b]).count();
            self.inside.push(4 * inside > 3 * bins.len());
        }
    }

    /// The mean profile of a line.
    pub fn row(&self, line: usize) -> &[f32] {
        &self.values[line * self.width..][..self.width]
    }

    /// The shift at which a line is most like a template, and its amplitude there in parts of the template's.
    pub fn best(&self, line: usize, template: &[f32]) -> (usize, f32) {
        let energy = energy(template);
        let mut best = (SHIFT, f32::MIN);
        for (shift, part) in self.row(line).windows(template.len()).enumerate() {
            let amplitude = dot(part, template) / energy;
            if amplitude > best.1 {
                best = (shift, amplitude);
            }
        }
        best
    }
}

/// Per edge: amplitude with its knots, over the whole of it between them, the smallest over half of it, and the least structure of a half that may be gone.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    pub full: Statistic,
    pub whole: Statistic,
    pub weakest: Statistic,
    pub structure: Vec<f32>,
    /// Mean grey level of the weakest half, on the half of the width next to the line: growth is not much wider than twine.
    pub level: Vec<f32>,
    /// The largest amplitude over half of it.
    pub strongest: Vec<f32>,
    /// First bin of the weakest half.
    weakest_from: Vec<usize>,
    row: Vec<f32>,
    part: Vec<f32>,
    structures: Vec<f32>,
}

impl Lines {
    /// Amplitude of each line in parts of its template's, at the best common shift. `means` are those of the profiles.
    pub fn reduce(&mut self, graph: &Graph, profiles: &Profiles, means: &Means, appearance: &Appearance) {
        let Self { full, whole, weakest, strongest, structure, level, .. } = self;
        self.weakest_from.clear();
        self.weakest_from.resize(graph.edges.len(), 0);
        for values in [&mut full.values, &mut whole.values, &mut weakest.values, strongest, structure, level] {
            values.clear();
            values.resize(graph.edges.len(), f32::NAN);
        }
        let (bins, half) = (middle_bins(profiles), appearance.half);
        let window = bins.len().div_ceil(2);
        let first = profiles.half - half - SHIFT;
        let width = 2 * half + 1;
        let middle = half / 2..width - half / 2;
        for e in (0..graph.edges.len()).filter(|&e| means.inside[e]) {
            let template = appearance.template(graph.blocks.of_edge(e));
            let energy = energy(template);
            let (shift, whole) = means.best(e, template);
            self.whole.values[e] = whole;
            self.row.clear();
            self.row.extend((0..profiles.bins).map(|b| {
                let part = &profiles.row(e, b)[first + shift..][..width];
                dot(part, template) / energy
            }));
            self.full.values[e] = self.row.iter().sum::<f32>() / profiles.bins as f32;
            self.structures.clear();
            for b in bins.clone() {
                self.part.clear();
                self.part.extend_from_slice(&profiles.row(e, b)[first + SHIFT..][..width]);
                remove_line(&mut self.part);
                self.structures.push((dot(&self.part, &self.part) / width as f32).sqrt());
            }
            // The weakest half: a broken twine leaves stubs.
            let amplitudes = self.row[bins.clone()].windows(window).map(|half| half.iter().sum::<f32>());
            let weakest = amplitudes.clone().enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
            self.strongest[e] = amplitudes.clone().fold(f32::MIN, f32::max) / window as f32;
            self.weakest.values[e] = weakest.1 / window as f32;
            self.weakest_from[e] = bins.start + weakest.0;
            // The quietest of those that may be gone: stubs hang beside the line.
            let structures = self.structures.windows(window).map(|half| half.iter().sum::<f32>());
            let gone = amplitudes.map(|sum| sum <= weakest.1.max(GONE * window as f32));
            let quietest = structures.zip(gone).filter(|(_, gone)| *gone).map(|(structure, _)| structure);
            self.structure[e] = quietest.fold(f32::MAX, f32::min) / window as f32;
            let half = self.weakest_from[e]..self.weakest_from[e] + window;
            let mut level = 0.0;
            for b in half {
                level += profiles.row(e, b)[first + SHIFT..][middle.clone()].iter().sum::<f32>();
            }
            self.level[e] = level / (window * middle.len()) as f32;
        }
    }
}

impl Lines {
    /// The largest amplitude, in parts of the template's, that the weakest half of a line has within [`BESIDE`] cells of `height` px, as far as it was sampled.
    pub fn elsewhere(&self, e: usize, template: &[f32], profiles: &Profiles, height: f32) -> f32 {
        let window = middle_bins(profiles).len().div_ceil(2);
        let bins = self.weakest_from[e]..self.weakest_from[e] + window;
        let amplitude = |shift: usize| {
            let sum = bins.clone().map(|b| dot(&profiles.row(e, b)[shift..][..template.len()], template)).sum::<f32>();
            sum / (energy(template) * window as f32)
        };
        let middle = profiles.half - template.len() / 2;
        let most = ((BESIDE * height / profiles.step_px as f32) as usize).min(middle);
        (middle - most..=middle + most).map(amplitude).fold(f32::MIN, f32::max)
    }
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn energy(template: &[f32]) -> f32 {
    dot(template, template) + 1e-9
}

/// Bins in the middle part of the twine; of one bin, or where knots leave nothing, all.
fn middle_bins(profiles: &Profiles) -> std::ops::Range<usize> {
    let end = KNOT.0.max(KNOT.1 / profiles.length_px).min(0.3);
    let in_middle = |b: &usize| profiles.along[*b] > end && profiles.along[*b] < 1.0 - end;
    match ((0..profiles.bins).find(in_middle), (0..profiles.bins).rfind(in_middle)) {
        (Some(first), Some(last)) => first..last + 1,
        _ => 0..profiles.bins,
    }
}
