//! Which twines are there: each against its neighbours, and against control lines half a cell aside where there is none.

pub use net_geometry::{Twine, TwineState};
use net_image::GrayView;

use crate::adjust::appearance::Appearance;
use crate::adjust::config::AdjustConfig;
use crate::adjust::covered::Covered;
use crate::adjust::foreign::Foreign;
use crate::adjust::graph::Graph;
use crate::adjust::lines::{Lines, Means, SHIFT};
use crate::adjust::outside::Outside;
use crate::adjust::profile::{FINE_PX, Profiles};
use crate::adjust::source::Source;
use crate::adjust::statistic::{evidence, evidence_of_gap, vote};
use crate::adjust::width::Widths;

/// Least scatter of relative amplitudes, of twines and of control lines.
const SCATTER_MIN: (f32, f32) = (0.06, 0.07);
/// A mesh whose level or spread is this many deviations off its surroundings' is covered by something.
const HIDDEN: f32 = 4.0;
/// Structure beside a weak twine, in parts of the control lines', beyond which it is growth and no gap.
const CLUTTER: f32 = 1.5;
/// A weak twine whose level is this many deviations off that of the meshes beside it is overgrown: in a gap one sees the same water. Drawn
/// nets lose no broken twine by it, compared with 4.
const FOREIGN: f32 = 2.5;
/// A gap has nothing of the usual amplitude left, in any bin between the knots, and its place is no more deviations off the meshes beside it. Flakes and tufts are
/// smaller than meshes, and of other brightness than water.
const GAP: (f32, f32) = (0.6, 1.2);
/// Parts of the usual amplitude between which are those of gaps and of what is left of broken twine. A flake that covers a part of twine looks like the opposite of twine, or
/// like thicker one.
const LEFT: (f32, f32) = (-0.45, 1.15);
/// Part of the usual amplitude that a weak half must have somewhere beside the line to be that of a twine which the line has missed. In cells of
/// 10 px and more that are drawn with broken twines, 99 in a hundred of these have less than a third.
const ASTRAY: f32 = 0.5;
/// Larger cells, px, may have more of it: stubs that hang from the knots are larger, and what lies before the net stands out better.
const CLUTTER_CELL_PX: f32 = 9.0;

/// What a twine that looks missing looks like.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Gap {
    /// How many things speak against one: that something is left, and that its place is unlike the meshes beside it or these are out of view.
    pub doubts: u32,
    /// What is left may be that of twine.
    pub stubs: bool,
    /// Log likelihood ratio, twine to gap, of what shows it best.
    pub llr: f32,
    /// How many standard deviations the neighbourhood's twines differ from gaps.
    pub contrast: f32,
}

/// Buffers of this stage, and what it found for each edge.
#[derive(Debug, Default)]
pub(crate) struct Presence {
    appearance: Appearance,
    control_profiles: Profiles,
    control_means: Means,
    twine: Lines,
    control: Lines,
    structures: Vec<f32>,
    control_structure: Vec<f32>,
    /// By edge: mean grey levels of control lines.
    levels: Vec<f32>,
    scratch: Vec<f32>,
    covered: Covered,
    foreign: Foreign,
    outside: Outside,
    widths: Widths,
    /// By edge: what speaks for a gap where it looks missing.
    gaps: Vec<Gap>,
    /// By edge: log likelihood ratio, net to no net, of the whole twine by normal densities, limited; NaN outside the picture.
    pub votes: Vec<f32>,
    /// The twines, in the graph's order.
    pub twines: Vec<Twine>,
}

impl Presence {
    /// Judges every twine.
    ///
    /// `half` is the template's length on each side, `beside` how far its extreme may lie off the line, both in steps. `profiles` are
    /// those of the twines.
    pub fn judge(
        &mut self,
        graph: &mut Graph,
        profiles: &Profiles,
        source: &Source,
        image: GrayView,
        half: usize,
        beside: usize,
        config: &AdjustConfig,
    ) {
        let half = half.min(profiles.half.saturating_sub(SHIFT)).max(1);
        self.appearance.learn(graph, profiles, half, beside);
        self.twine.reduce(graph, profiles, &self.appearance.means, &self.appearance);
        self.control_profiles.sample(source, graph, (half + SHIFT, FINE_PX), true, 1, Some(profiles.bins));
        self.control_means.take(&self.control_profiles, half);
        self.control.reduce(graph, &self.control_profiles, &self.control_means, &self.appearance);
        self.covered.find(graph, image);
        self.structures.clear();
        self.levels.clear();
        for e in 0..graph.edges.len() {
            let inside = self.control_means.inside[e];
            let (structure, level) = if inside {
                (self.control.structure(e, &self.control_profiles), self.control.level(e, &self.control_profiles))
            } else {
                (f32::NAN, f32::NAN)
            };
            self.structures.push(structure);
            self.levels.push(level);
        }
        self.foreign.find(graph, &self.levels);
        self.decide(graph, profiles, config);
        self.outside.mark(graph, &mut self.twines);
    }

    /// What looks gone is gone where it is certain.
    pub fn claim(&mut self, graph: &Graph, seen: impl Fn(usize) -> bool, config: &AdjustConfig) {
        self.outside.claim(graph, &mut self.twines, &self.gaps, seen, config);
    }

    /// Measures the twines' apparent widths. `profiles` are those that were judged.
    pub fn widths(&mut self, graph: &mut Graph, profiles: &Profiles) {
        let looks = [(profiles, &self.appearance.means), (&self.control_profiles, &self.control_means)];
        let bins = self.twine.middle();
        self.widths.measure(graph, looks, bins, &self.appearance, &self.levels, &mut self.twines);
    }

    fn decide(&mut self, graph: &mut Graph, profiles: &Profiles, config: &AdjustConfig) {
        for e in (0..graph.edges.len()).filter(|&e| !self.appearance.centred[graph.blocks.of_edge(e)]) {
            for statistic in [&mut self.twine.full, &mut self.twine.whole, &mut self.twine.weakest] {
                statistic.values[e] = f32::NAN;
            }
        }
        for (lines, floor) in [(&mut self.twine, SCATTER_MIN.0), (&mut self.control, SCATTER_MIN.1)] {
            lines.full.summarise(graph, floor, &mut self.scratch);
            lines.whole.summarise(graph, floor, &mut self.scratch);
            lines.weakest.summarise(graph, floor, &mut self.scratch);
        }
        // Twice: at a net's corner the blocks beside are themselves at its end.
        for _ in 0..2 {
            self.twine.full.borrow(graph, &mut self.scratch);
            self.twine.whole.borrow(graph, &mut self.scratch);
            self.twine.weakest.borrow(graph, &mut self.scratch);
        }
        for lines in [&mut self.twine, &mut self.control] {
            lines.whole.finish();
            lines.weakest.finish();
        }
        graph.blocks.local_median(&self.structures, &mut self.control_structure);
        self.twines.clear();
        self.votes.clear();
        self.gaps.clear();
        for (e, edge) in graph.edges.iter().enumerate() {
            let index = graph.nodes[edge.nodes[0] as usize].index;
            let block = graph.blocks.of_edge(e);
            let (weak_llr, contrast) = evidence(&self.twine.weakest, &self.control.weakest, e, block);
            let (whole_llr, whole_contrast) = evidence(&self.twine.whole, &self.control.whole, e, block);
            // Half of a twine shows a break that leaves stubs, the whole of it one that leaves none.
            let gap = [(&self.twine.weakest, &self.control.weakest), (&self.twine.whole, &self.control.whole)];
            let gap = gap.map(|(twine, control)| evidence_of_gap(twine, control, e, block));
            let gap = gap.into_iter().fold((f32::MAX, f32::MIN), |a, b| (a.0.min(b.0), a.1.max(b.1)));
            let covered = self.covered.beside(graph, edge);
            let known = !self.twine.weakest.values[e].is_nan() && self.appearance.centred[block];
            let told = known && f64::from(contrast) > config.gate;
            let told_whole = known && f64::from(whole_contrast) > config.gate;
            let llr = if told && f64::from(weak_llr) < config.missing_llr || !told_whole {
                weak_llr
            } else {
                weak_llr.max(whole_llr)
            };
            let looks_gone = told && f64::from(gap.0) < config.missing_llr;
            let llr = if known { llr } else { 0.0 };
            let state = match f64::from(llr) {
                l if (told || told_whole) && l > config.present_llr => TwineState::Present,
                l if l > 0.0 && told && covered <= HIDDEN => TwineState::Unknown,
                _ if !told && covered <= HIDDEN => TwineState::Unknown,
                _ if covered > HIDDEN => TwineState::Hidden,
                l if l < config.missing_llr || looks_gone => self.look_again(graph, profiles, e),
                _ => TwineState::Unknown,
            };
            // A twine that lies elsewhere within reach is not gone; where it runs is not known either.
            let height = graph.nodes[edge.nodes[0] as usize].height as f32;
            let astray = state == TwineState::Missing
                && self.twine.elsewhere(e, self.appearance.template(block), profiles, height)
                    > ASTRAY * self.twine.weakest.typical(block);
            let (state, llr) = if astray { (TwineState::Unknown, 0.0) } else { (state, llr) };
            let gone = state == TwineState::Missing;
            self.gaps.push(if gone { self.look_of_gap(graph, profiles, e, gap) } else { Gap::default() });
            // None for what is outside the picture.
            let contrast = if self.appearance.means.inside[e] { contrast.max(whole_contrast) } else { 0.0 };
            let vote = if known { vote(&self.twine.full, &self.control.full, e, block) } else { 0.0 };
            self.votes.push(if self.appearance.means.inside[e] { vote } else { f32::NAN });
            self.twines.push(Twine { index, direction: edge.family, state, llr, contrast, width_px: None });
        }
    }

    /// What a twine that looks missing, by a log likelihood ratio and a contrast, has where it should be.
    fn look_of_gap(&self, graph: &Graph, profiles: &Profiles, e: usize, (llr, contrast): (f32, f32)) -> Gap {
        let usual = self.twine.weakest.typical(graph.blocks.of_edge(e));
        let (least, most) = self.twine.left(e, profiles);
        let alike = self.foreign_at(graph, profiles, e) < GAP.1;
        Gap {
            doubts: u32::from(most >= GAP.0 * usual) + u32::from(!alike),
            stubs: least > LEFT.0 * usual && most < LEFT.1 * usual,
            llr,
            contrast,
        }
    }

    /// What hides a twine that looks missing, if anything does.
    fn look_again(&mut self, graph: &Graph, profiles: &Profiles, e: usize) -> TwineState {
        let edge = &graph.edges[e];
        let height = graph.nodes[edge.nodes[0] as usize].height as f32;
        let too_much = CLUTTER * (height / CLUTTER_CELL_PX).max(1.0);
        let structure = self.control_structure[graph.blocks.of_edge(e)] + 1e-6;
        if self.twine.structure(e, profiles) > too_much * structure
            // In a gap one sees what lies beside it.
            || self.foreign_at(graph, profiles, e) > FOREIGN
        {
            TwineState::Fouled
        } else if self.covered.at_ends(graph, edge) > HIDDEN {
            // What hides a mesh may hide a twine at its corner.
            TwineState::Hidden
        } else {
            TwineState::Missing
        }
    }

    fn foreign_at(&self, graph: &Graph, profiles: &Profiles, e: usize) -> f32 {
        self.foreign.of(graph, e, self.twine.level(e, profiles), &self.levels)
    }
}
