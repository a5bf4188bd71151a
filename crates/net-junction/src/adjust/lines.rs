//! Each line measured against its neighbourhood's template: twines, and control lines half a cell aside.

use net_image::widely;

use crate::adjust::appearance::Appearance;
use crate::adjust::graph::Graph;
use crate::adjust::lanes::{Detrend, LANES, dot};
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
        self.values.resize(edges * self.width + LANES, 0.0);
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
    #[inline(always)]
    pub fn best(&self, line: usize, template: &[f32], energy: f32) -> (usize, f32) {
        let mut best = (SHIFT, f32::MIN);
        for shift in 0..=2 * SHIFT {
            let amplitude = dot(&self.values[line * self.width + shift..], template) / energy;
            if amplitude > best.1 {
                best = (shift, amplitude);
            }
        }
        best
    }
}

/// Per edge: amplitude with its knots, over the whole of it between them, and the smallest over half of it.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    pub full: Statistic,
    pub whole: Statistic,
    pub weakest: Statistic,
    /// First bin of the weakest half.
    weakest_from: Vec<u32>,
    /// By edge and bin: amplitudes.
    amplitudes: Vec<f32>,
    detrend: Detrend,
    /// Bins between the knots.
    middle: std::ops::Range<usize>,
    structures: Vec<f32>,
}

widely! {
    /// Amplitude of each line in parts of its template's, at the best common shift. `means` are those of the profiles.
    fn reduce<'a>(
        lines: &'a mut Lines,
        graph: &'a Graph,
        profiles: &'a Profiles,
        means: &'a Means,
        appearance: &'a Appearance,
    ) -> () {
        let Lines { full, whole, weakest, weakest_from, amplitudes, middle, .. } = lines;
        let (bins, window) = (profiles.bins, middle.len().div_ceil(2));
        let first = profiles.half - appearance.half - SHIFT;
        for e in (0..graph.edges.len()).filter(|&e| means.inside[e]) {
            let (template, energy) = appearance.template(graph.blocks.of_edge(e));
            let (shift, best) = means.best(e, template, energy);
            whole.values[e] = best;
            let row = &mut amplitudes[e * bins..][..bins];
            for (b, amplitude) in row.iter_mut().enumerate() {
                *amplitude = dot(profiles.from(e, b, first + shift), template) / energy;
            }
            full.values[e] = row.iter().sum::<f32>() / bins as f32;
            // The weakest half: a broken twine leaves stubs.
            let mut least = (0, f32::MAX);
            for (from, half) in row[middle.clone()].windows(window).enumerate() {
                let sum = half.iter().sum::<f32>();
                least = if sum < least.1 { (from, sum) } else { least };
            }
            weakest.values[e] = least.1 / window as f32;
            weakest_from[e] = (middle.start + least.0) as u32;
        }
    }
}

impl Lines {
    /// Measures all lines.
    pub fn reduce(&mut self, graph: &Graph, profiles: &Profiles, means: &Means, appearance: &Appearance) {
        let edges = graph.edges.len();
        for values in [&mut self.full.values, &mut self.whole.values, &mut self.weakest.values] {
            values.clear();
            values.resize(edges, f32::NAN);
        }
        self.weakest_from.clear();
        self.weakest_from.resize(edges, 0);
        self.amplitudes.resize(edges * profiles.bins, 0.0);
        self.middle = middle_bins(profiles);
        self.detrend.start(appearance.half);
        reduce(self, graph, profiles, means, appearance);
    }

    /// Bins between the knots.
    pub fn middle(&self) -> std::ops::Range<usize> {
        self.middle.clone()
    }

    fn window(&self) -> usize {
        self.middle.len().div_ceil(2)
    }

    fn weakest_bins(&self, e: usize) -> std::ops::Range<usize> {
        let from = self.weakest_from[e] as usize;
        from..from + self.window()
    }

    /// The least structure of a half of a line that may be gone: what constant and slope leave, root of mean squares. The quietest of those, for stubs hang beside
    /// the line.
    #[inline(always)]
    pub fn structure(&mut self, e: usize, profiles: &Profiles) -> f32 {
        let (half, window) = (self.detrend.half(), self.window());
        let width = (2 * half + 1) as f32;
        let Self { structures, detrend, middle, .. } = self;
        structures.clear();
        structures
            .extend(middle.clone().map(|b| (detrend.rest(profiles.from(e, b, profiles.half - half)) / width).sqrt()));
        let amplitudes = self.amplitudes[e * profiles.bins..][..profiles.bins][self.middle.clone()].windows(window);
        let most = self.weakest.values[e].max(GONE);
        let gone = amplitudes.map(|half| half.iter().sum::<f32>() / window as f32 <= most);
        let of_halves = self.structures.windows(window).zip(gone).filter(|(_, gone)| *gone);
        of_halves.map(|(half, _)| half.iter().sum::<f32>()).fold(f32::MAX, f32::min) / window as f32
    }

    /// The least and the largest amplitude of a bin between the knots, in parts of the template's.
    pub fn left(&self, e: usize, profiles: &Profiles) -> (f32, f32) {
        let bins = &self.amplitudes[e * profiles.bins..][..profiles.bins];
        bins[self.middle.clone()].iter().fold((f32::MAX, f32::MIN), |(least, most), &a| (least.min(a), most.max(a)))
    }

    /// Mean grey level of the weakest half, on the half of the width next to the line: growth is not much wider than twine.
    pub fn level(&self, e: usize, profiles: &Profiles) -> f32 {
        let (bins, half) = (self.weakest_bins(e), self.detrend.half());
        let (from, width) = (profiles.half - (half - half / 2), 2 * (half - half / 2) + 1);
        let count = bins.len() * width;
        bins.map(|b| profiles.row(e, b)[from..][..width].iter().sum::<f32>()).sum::<f32>() / count as f32
    }

    /// The largest amplitude, in parts of the template's, that the weakest half of a line has within [`BESIDE`] cells of `height` px, as far as it was sampled.
    pub fn elsewhere(&self, e: usize, (template, energy): (&[f32], f32), profiles: &Profiles, height: f32) -> f32 {
        let bins = self.weakest_bins(e);
        let amplitude = |shift: usize| {
            let sum = bins.clone().map(|b| dot(profiles.from(e, b, shift), template)).sum::<f32>();
            sum / (energy * bins.len() as f32)
        };
        let middle = profiles.half - self.detrend.half();
        let most = ((BESIDE * height / profiles.step_px as f32) as usize).min(middle);
        (middle - most..=middle + most).map(amplitude).fold(f32::MIN, f32::max)
    }
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
