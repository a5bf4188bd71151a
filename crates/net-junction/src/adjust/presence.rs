//! Which twines are there: each against its neighbours, and against control lines half a cell aside where there is none.

use net_geometry::nalgebra::Vector2;
use net_image::GrayView;

use crate::adjust::config::AdjustConfig;
use crate::adjust::graph::{Graph, median, upper};
use crate::adjust::outside::Outside;
use crate::adjust::profile::{FINE_PX, Profiles, Source};

/// Steps that a profile may be shifted to fit its neighbours' mean: 1 px.
const SHIFT: usize = 2;
/// Part of the twine, from its middle to its ends, that is free of knots.
const MIDDLE: (f32, f32) = (0.12, 0.88);
/// Least scatter of relative amplitudes, of twines and of control lines.
const SCATTER_MIN: (f32, f32) = (0.06, 0.07);
/// Part of the next block's typical amplitude below which a block is no measure: at a net's end and in holes most twines are gone.
const TYPICAL_LEAST: f32 = 0.6;
/// Energy of a template, in parts of strong ones', below which there is no net: in clean pictures anything stands out from nothing.
const LEAST_ENERGY: f32 = 0.004;
/// A mesh whose level or spread is this many deviations off its surroundings' is covered by something.
const HIDDEN: f32 = 4.0;
/// Part of a template's extreme that it must reach on the line.
const FLAT_TOP: f32 = 0.8;
/// Structure beside a weak twine, in parts of the control lines', beyond which it is growth and no gap.
const CLUTTER: f32 = 2.0;

/// Most that one twine says of whether there is a net around it.
const VOTE_MAX: f32 = 2.0;

/// What is known of a twine between two neighbouring nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TwineState {
    /// The picture does not tell.
    #[default]
    Unknown,
    /// There.
    Present,
    /// Gone, or broken.
    Missing,
    /// Behind a fish or another object.
    Hidden,
    /// Overgrown.
    Fouled,
}

/// A twine with the evidence for its state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Twine {
    /// Node at its first end.
    pub index: (i32, i32),
    /// 0: to node `(i + 1, j)`, 1: to `(i, j + 1)`.
    pub direction: usize,
    /// What is known of it.
    pub state: TwineState,
    /// Log likelihood ratio, present to missing.
    pub llr: f32,
    /// How many standard deviations the neighbourhood's twines stand out from the control lines.
    pub contrast: f32,
}

/// Buffers of this stage, and what it found for each edge.
#[derive(Debug, Default)]
pub(crate) struct Presence {
    control_profiles: Profiles,
    means: Vec<f32>,
    valid: Vec<bool>,
    /// By block.
    templates: Vec<f32>,
    centred: Vec<bool>,
    amplitudes: Vec<f32>,
    row: Vec<f32>,
    twine: Lines,
    control: Lines,
    control_structure: Vec<f32>,
    deviations: Vec<f32>,
    levels: Vec<f32>,
    textures: Vec<f32>,
    typical: Vec<f32>,
    covered: Vec<f32>,
    outside: Outside,
    /// By edge: log likelihood ratio, net to no net, of the whole twine by normal densities, limited; NaN outside the picture.
    pub votes: Vec<f32>,
    /// The twines, in the graph's order.
    pub twines: Vec<Twine>,
}

/// Per edge: amplitude over the whole of it, the smallest over half of it, and structure there.
#[derive(Debug, Default)]
struct Lines {
    whole: Statistic,
    weakest: Statistic,
    structure: Vec<f32>,
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
        self.mean_profiles(profiles, half);
        self.learn(graph, half, false);
        let mut twine = std::mem::take(&mut self.twine);
        self.reduce(graph, profiles, half, &mut twine);
        // Once more without what looks absent.
        self.learn(graph, half, true);
        self.reduce(graph, profiles, half, &mut twine);
        let mut control_profiles = std::mem::take(&mut self.control_profiles);
        control_profiles.sample(source, graph, (half + SHIFT, FINE_PX), true, 1, Some(profiles.bins));
        let mut control = std::mem::take(&mut self.control);
        self.reduce(graph, &control_profiles, half, &mut control);
        (self.twine, self.control, self.control_profiles) = (twine, control, control_profiles);
        self.centre(half, beside);
        self.find_covered(graph, image);
        self.decide(graph, config);
        self.outside.mark(graph, &mut self.twines);
    }

    /// Mean profile of each twine's middle, free of constant and slope.
    fn mean_profiles(&mut self, profiles: &Profiles, half: usize) {
        let (edges, width) = (profiles.inside.len() / profiles.bins, 2 * half + 1);
        let bins = middle_bins(profiles);
        let count = bins.len();
        self.means.clear();
        self.means.resize(edges * width, 0.0);
        self.valid.clear();
        for (e, row) in self.means.chunks_exact_mut(width).enumerate() {
            let mut inside = 0;
            for bin in bins.clone() {
                inside += usize::from(profiles.inside[e * profiles.bins + bin]);
                row.iter_mut().zip(part(profiles, e, bin, half, SHIFT)).for_each(|(s, p)| *s += p);
            }
            row.iter_mut().for_each(|s| *s /= count as f32);
            remove_line(row);
            self.valid.push(4 * inside > 3 * count);
        }
    }

    /// Template of each block: the mean of the profiles around; with `known` only of those that look like twine.
    fn learn(&mut self, graph: &Graph, half: usize, known: bool) {
        let width = 2 * half + 1;
        self.templates.clear();
        self.templates.resize(graph.blocks.count() * width, 0.0);
        for (block, template) in self.templates.chunks_exact_mut(width).enumerate() {
            if graph.blocks.members(block).is_empty() {
                continue;
            }
            let mut count = 0.0_f32;
            for &e in graph.blocks.around(block).into_iter().flatten() {
                let e = e as usize;
                if self.valid[e] && (!known || (0.4..2.5).contains(&self.amplitudes[e])) {
                    template.iter_mut().zip(&self.means[e * width..][..width]).for_each(|(s, m)| *s += m);
                    count += 1.0;
                }
            }
            template.iter_mut().for_each(|s| *s /= count.max(1.0));
        }
    }

    /// Amplitude of each line in parts of its template's, at the best common shift.
    fn reduce(&mut self, graph: &Graph, profiles: &Profiles, half: usize, lines: &mut Lines) {
        let width = 2 * half + 1;
        let edges = self.valid.len();
        lines.whole.values.clear();
        lines.weakest.values.clear();
        lines.structure.clear();
        let bins = middle_bins(profiles);
        let (first, count) = (bins.start, bins.len());
        let window = count.div_ceil(2).max(1);
        for e in 0..edges {
            let inside = bins.clone().filter(|b| profiles.inside[e * profiles.bins + b]).count();
            if 4 * inside <= 3 * count {
                lines.whole.values.push(f32::NAN);
                lines.weakest.values.push(f32::NAN);
                lines.structure.push(f32::NAN);
                continue;
            }
            let template = &self.templates[graph.blocks.of_edge(e) * width..][..width];
            let energy: f32 = template.iter().map(|t| t * t).sum::<f32>() + 1e-9;
            let dot = |bin: usize, shift: usize| {
                part(profiles, e, bin, half, shift).iter().zip(template).map(|(p, t)| p * t).sum::<f32>() / energy
            };
            let mut best = (SHIFT, f32::MIN);
            for shift in 0..=2 * SHIFT {
                let mean = bins.clone().map(|b| dot(b, shift)).sum::<f32>() / count as f32;
                if mean > best.1 {
                    best = (shift, mean);
                }
            }
            lines.whole.values.push(best.1);
            self.row.clear();
            self.row.extend(bins.clone().map(|b| dot(b, best.0)));
            // The weakest half: a broken twine leaves stubs.
            let mut weakest = (f32::MAX, 0);
            for (start, part) in self.row.windows(window).enumerate() {
                let sum: f32 = part.iter().sum();
                if sum < weakest.0 {
                    weakest = (sum, start);
                }
            }
            lines.weakest.values.push(weakest.0 / window as f32);
            let structure: f32 = (weakest.1..weakest.1 + window)
                .map(|b| {
                    self.row.clear();
                    self.row.extend_from_slice(part(profiles, e, first + b, half, SHIFT));
                    remove_line(&mut self.row);
                    (self.row.iter().map(|r| r * r).sum::<f32>() / width as f32).sqrt()
                })
                .sum();
            lines.structure.push(structure / window as f32);
        }
        self.amplitudes.clone_from(&lines.whole.values);
    }

    /// Learned templates fit whatever neighbours have in common, also twine beside the line: what differs most from the template's ends must
    /// lie on the line.
    fn centre(&mut self, half: usize, beside: usize) {
        self.centred.clear();
        let energy = |template: &[f32]| template.iter().map(|t| t * t).sum::<f32>();
        self.row.clear();
        self.row.extend(self.templates.chunks_exact(2 * half + 1).map(energy).filter(|&e| e > 0.0));
        let least = LEAST_ENERGY * upper(&mut self.row).unwrap_or(0.0);
        for template in self.templates.chunks_exact(2 * half + 1) {
            // Broad twine reaches far to both sides: beyond it is zero, not at the mean.
            let end = 0.5 * (template[0] + template[2 * half]);
            let smooth = |k: usize| 0.25 * (template[k - 1] + 2.0 * template[k] + template[k + 1]) - end;
            let extreme =
                (1..2 * half).map(smooth).fold(0.0_f32, |most, t| if t.abs() > most.abs() { t } else { most });
            let near = half.saturating_sub(beside).max(1)..=(half + beside).min(2 * half - 1);
            // Broad twine, blurred by motion, has a flat top whose highest point means nothing.
            let on_line = near.into_iter().any(|k| smooth(k) * extreme >= FLAT_TOP * extreme * extreme);
            let alike = (template[0] - template[2 * half]).abs() < extreme.abs();
            self.centred.push(on_line && alike && energy(template) > least);
        }
    }

    /// How far each mesh's middle is off its surroundings, in their deviations; kept at the mesh's first edge of family 0.
    fn find_covered(&mut self, graph: &mut Graph, image: GrayView) {
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

    fn decide(&mut self, graph: &mut Graph, config: &AdjustConfig) {
        for e in (0..graph.edges.len()).filter(|&e| !self.centred[graph.blocks.of_edge(e)]) {
            (self.twine.whole.values[e], self.twine.weakest.values[e]) = (f32::NAN, f32::NAN);
        }
        for (lines, floor) in [(&mut self.twine, SCATTER_MIN.0), (&mut self.control, SCATTER_MIN.1)] {
            lines.whole.summarise(graph, floor, &mut self.deviations);
            lines.weakest.summarise(graph, floor, &mut self.deviations);
        }
        // Twice: at a net's corner the blocks beside are themselves at its end.
        for _ in 0..2 {
            self.twine.whole.borrow(graph, &mut self.deviations);
            self.twine.weakest.borrow(graph, &mut self.deviations);
        }
        graph.blocks.local_median(&self.control.structure, &mut self.control_structure);
        self.twines.clear();
        self.votes.clear();
        for (e, edge) in graph.edges.iter().enumerate() {
            let index = graph.nodes[edge.nodes[0] as usize].index;
            let block = graph.blocks.of_edge(e);
            let (weak_llr, contrast) = evidence(&self.twine.weakest, &self.control.weakest, e, block);
            let (whole_llr, whole_contrast) = evidence(&self.twine.whole, &self.control.whole, e, block);
            let beside = if edge.family == 0 { (index.0, index.1 - 1) } else { (index.0 - 1, index.1) };
            let of_cells = |cells: &[(i32, i32)]| {
                let edges = cells.iter().filter_map(|&c| graph.edge_from(graph.node_at(c)?, 0));
                edges.map(|k| self.covered[k]).fold(0.0, f32::max)
            };
            let covered = of_cells(&[index, beside]);
            let (i, j) = index;
            let touching = if edge.family == 0 {
                [(i - 1, j), (i - 1, j - 1), (i + 1, j), (i + 1, j - 1)]
            } else {
                [(i, j - 1), (i - 1, j - 1), (i, j + 1), (i - 1, j + 1)]
            };
            let near = of_cells(&touching).max(covered);
            let clutter = self.twine.structure[e] / (self.control_structure[block] + 1e-6);
            let known = !self.twine.weakest.values[e].is_nan() && self.centred[block];
            let told = known && f64::from(contrast) > config.gate;
            let told_whole = known && f64::from(whole_contrast) > config.gate;
            // Half of a twine shows a break, the whole of it that it is there.
            let llr = if told && f64::from(weak_llr) < config.missing_llr || !told_whole {
                weak_llr
            } else {
                weak_llr.max(whole_llr)
            };
            let llr = if known { llr } else { 0.0 };
            let state = match f64::from(llr) {
                l if (told || told_whole) && l > config.present_llr => TwineState::Present,
                l if l > 0.0 && told && covered <= HIDDEN => TwineState::Unknown,
                _ if !told && covered <= HIDDEN => TwineState::Unknown,
                _ if covered > HIDDEN => TwineState::Hidden,
                l if l < config.missing_llr && clutter > CLUTTER => TwineState::Fouled,
                // What hides a mesh may hide a twine at its corner.
                l if l < config.missing_llr && near > HIDDEN => TwineState::Hidden,
                l if l < config.missing_llr => TwineState::Missing,
                _ => TwineState::Unknown,
            };
            // None for what is outside the picture.
            let contrast = if self.valid[e] { contrast.max(whole_contrast) } else { 0.0 };
            let vote = if known { vote(&self.twine.whole, &self.control.whole, e, block) } else { 0.0 };
            self.votes.push(if self.valid[e] { vote } else { f32::NAN });
            self.twines.push(Twine { index, direction: edge.family, state, llr, contrast });
        }
    }
}

/// A bin's profile over the template's length, from `shift` steps on; [`SHIFT`] is the line itself.
fn part(profiles: &Profiles, edge: usize, bin: usize, half: usize, shift: usize) -> &[f32] {
    &profiles.row(edge, bin)[profiles.half - half - SHIFT + shift..][..2 * half + 1]
}

/// Bins in the middle part of the twine, or all if there are few.
fn middle_bins(profiles: &Profiles) -> std::ops::Range<usize> {
    let in_middle = |b: &usize| profiles.along[*b] > MIDDLE.0 && profiles.along[*b] < MIDDLE.1;
    if profiles.bins <= 3 {
        return 0..profiles.bins;
    }
    let first = (0..profiles.bins).find(in_middle).unwrap_or(0);
    let last = (0..profiles.bins).rfind(in_middle).unwrap_or(profiles.bins - 1);
    first..last + 1
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

/// A statistic of all lines, and by block its median and scatter.
#[derive(Debug, Default)]
struct Statistic {
    values: Vec<f32>,
    typical: Vec<f32>,
    spread: Vec<f32>,
}

impl Statistic {
    /// Local medians, and scatter about them half local, half over the picture.
    fn summarise(&mut self, graph: &mut Graph, floor: f32, deviations: &mut Vec<f32>) {
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
}

impl Statistic {
    /// Blocks where most twines are gone take over what the best of their neighbours has.
    fn borrow(&mut self, graph: &Graph, typical: &mut Vec<f32>) {
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

/// Log likelihood ratio, twine to no twine, of an edge's statistic, and by how many standard deviations its neighbourhood's differ.
fn evidence(twine: &Statistic, control: &Statistic, edge: usize, block: usize) -> (f32, f32) {
    let (p0, sp) = (twine.typical[block], twine.spread[block]);
    let (m0, s0) = (control.typical[block], control.spread[block]);
    // Stronger than usual twine is no less twine; weaker than no twine is no less missing.
    let x = twine.values[edge].min(p0).max(m0);
    (log_student(x, p0, sp) - log_student(x, m0, s0), (p0 - m0) / sp.hypot(s0))
}

/// Log likelihood ratio, twine to no twine, of normal densities of the same scatter, limited to [`VOTE_MAX`]: a sum of many needs no heavy tails.
fn vote(twine: &Statistic, control: &Statistic, edge: usize, block: usize) -> f32 {
    let (p0, m0) = (twine.typical[block], control.typical[block]);
    let variance = 0.5 * (twine.spread[block].powi(2) + control.spread[block].powi(2));
    let x = twine.values[edge] - 0.5 * (p0 + m0);
    (x * (p0 - m0) / variance).clamp(-VOTE_MAX, VOTE_MAX)
}

/// Logarithm of Student's density with five degrees of freedom, up to a constant.
fn log_student(x: f32, location: f32, scale: f32) -> f32 {
    -scale.ln() - 3.0 * (((x - location) / scale).powi(2) / 5.0).ln_1p()
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
