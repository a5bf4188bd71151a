//! Which twines are there: each against its neighbours, and against control lines half a cell aside where there is none.

use net_geometry::nalgebra::Vector2;
use net_image::GrayView;

use crate::adjust::config::AdjustConfig;
use crate::adjust::graph::{Graph, median};
use crate::adjust::profile::{Profiles, STEP_PX};

/// Cells to each side over which twines are compared with each other, and meshes with meshes.
const RADIUS: i32 = 3;
const CELL_RADIUS: i32 = 4;
/// Steps that a profile may be shifted to fit its neighbours' mean: 1 px.
const SHIFT: usize = 2;
/// Part of the twine, from its middle to its ends, that is free of knots.
const MIDDLE: (f64, f64) = (0.12, 0.88);
/// Least scatter of relative amplitudes, of twines and of control lines.
const SCATTER_MIN: (f32, f32) = (0.06, 0.07);
/// A mesh whose level or spread is this many deviations off its surroundings' is covered by something.
const HIDDEN: f32 = 4.0;
/// Part of a template's extreme that it must reach on the line.
const FLAT_TOP: f32 = 0.8;
/// Structure beside a weak twine, in parts of the control lines', beyond which it is growth and no gap.
const CLUTTER: f32 = 2.0;

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
    means: Vec<f32>,
    valid: Vec<bool>,
    templates: Vec<f32>,
    centred: Vec<bool>,
    amplitudes: Vec<f32>,
    row: Vec<f32>,
    twine: Lines,
    control: Lines,
    typical: Vec<f32>,
    spread: Vec<f32>,
    control_typical: Vec<f32>,
    control_spread: Vec<f32>,
    deviations: Vec<f32>,
    levels: Vec<f32>,
    textures: Vec<f32>,
    covered: Vec<f32>,
    /// The twines, in the graph's order.
    pub twines: Vec<Twine>,
}

/// Per edge: smallest mean relative amplitude over half of it, and structure there.
#[derive(Debug, Default)]
struct Lines {
    weakest: Vec<f32>,
    structure: Vec<f32>,
}

impl Presence {
    /// Judges every twine.
    ///
    /// `half` is the template's length on each side, `beside` how far its extreme may lie off the line, both in steps.
    pub fn judge(
        &mut self,
        graph: &mut Graph,
        profiles: &mut Profiles,
        image: GrayView,
        half: usize,
        beside: usize,
        config: &AdjustConfig,
    ) {
        profiles.sample(graph, half + SHIFT, false, 1);
        self.mean_profiles(profiles, half);
        self.learn(graph, half, false);
        let mut twine = std::mem::take(&mut self.twine);
        self.reduce(profiles, half, &mut twine);
        // Once more without what looks absent.
        self.learn(graph, half, true);
        self.reduce(profiles, half, &mut twine);
        profiles.sample(graph, half + SHIFT, true, 1);
        let mut control = std::mem::take(&mut self.control);
        self.reduce(profiles, half, &mut control);
        (self.twine, self.control) = (twine, control);
        self.centre(half, beside);
        self.find_covered(graph, image);
        self.decide(graph, config);
    }

    /// Mean profile of each twine, free of constant and slope.
    fn mean_profiles(&mut self, profiles: &Profiles, half: usize) {
        let (edges, width) = (profiles.inside.len() / profiles.bins, 2 * half + 1);
        self.means.clear();
        self.valid.clear();
        for e in 0..edges {
            self.row.clear();
            self.row.resize(width, 0.0);
            let (mut count, mut inside) = (0, 0);
            for bin in middle_bins(profiles) {
                count += 1;
                inside += usize::from(profiles.inside[e * profiles.bins + bin]);
                let part = &profiles.row(e, bin)[SHIFT..SHIFT + width];
                self.row.iter_mut().zip(part).for_each(|(s, p)| *s += p);
            }
            self.row.iter_mut().for_each(|s| *s /= count as f32);
            remove_line(&mut self.row);
            self.means.extend_from_slice(&self.row);
            self.valid.push(4 * inside > 3 * count);
        }
    }

    /// Template of each twine: the mean of its neighbours' profiles; with `known` only of those that look like twine.
    fn learn(&mut self, graph: &Graph, half: usize, known: bool) {
        let width = 2 * half + 1;
        self.templates.clear();
        for e in 0..graph.edges.len() {
            self.row.clear();
            self.row.resize(width, 0.0);
            let mut count = 0.0_f32;
            graph.for_neighbours(e, RADIUS, |n| {
                if self.valid[n] && (!known || (0.4..2.5).contains(&self.amplitudes[n])) {
                    let mean = &self.means[n * width..][..width];
                    self.row.iter_mut().zip(mean).for_each(|(s, m)| *s += m);
                    count += 1.0;
                }
            });
            self.templates.extend(self.row.iter().map(|s| s / count.max(1.0)));
        }
    }

    /// Amplitude of each line in parts of its template's, at the best common shift.
    fn reduce(&mut self, profiles: &Profiles, half: usize, lines: &mut Lines) {
        let width = 2 * half + 1;
        let edges = self.valid.len();
        lines.weakest.clear();
        lines.structure.clear();
        self.amplitudes.clear();
        let bins = middle_bins(profiles);
        let count = bins.clone().count();
        let window = count.div_ceil(2).max(1);
        for e in 0..edges {
            let template = &self.templates[e * width..][..width];
            let energy: f32 = template.iter().map(|t| t * t).sum::<f32>() + 1e-9;
            let inside = bins.clone().filter(|b| profiles.inside[e * profiles.bins + b]).count();
            if 4 * inside <= 3 * count {
                lines.weakest.push(f32::NAN);
                lines.structure.push(f32::NAN);
                self.amplitudes.push(f32::NAN);
                continue;
            }
            let relative = |bin: usize, shift: usize| {
                let part = &profiles.row(e, bin)[shift..shift + width];
                part.iter().zip(template).map(|(p, t)| p * t).sum::<f32>() / energy
            };
            let mean = |shift: usize| bins.clone().map(|b| relative(b, shift)).sum::<f32>() / count as f32;
            let (shift, amplitude) =
                (0..=2 * SHIFT).map(|s| (s, mean(s))).fold((SHIFT, f32::MIN), |a, b| if b.1 > a.1 { b } else { a });
            self.amplitudes.push(amplitude);
            // The weakest half: a broken twine leaves stubs.
            let mut weakest = (f32::MAX, 0);
            let first = bins.start;
            for start in 0..=count - window {
                let sum: f32 = (start..start + window).map(|b| relative(first + b, shift)).sum();
                if sum < weakest.0 {
                    weakest = (sum, start);
                }
            }
            lines.weakest.push(weakest.0 / window as f32);
            let structure: f32 = (weakest.1..weakest.1 + window)
                .map(|b| {
                    self.row.clear();
                    self.row.extend_from_slice(&profiles.row(e, first + b)[SHIFT..SHIFT + width]);
                    remove_line(&mut self.row);
                    (self.row.iter().map(|r| r * r).sum::<f32>() / width as f32).sqrt()
                })
                .sum();
            lines.structure.push(structure / window as f32);
        }
    }

    /// Learned templates fit whatever neighbours have in common, also twine beside the line: its extreme must lie on the line.
    fn centre(&mut self, half: usize, beside: usize) {
        self.centred.clear();
        for template in self.templates.chunks_exact(2 * half + 1) {
            let smooth = |k: usize| template[k - 1] + 2.0 * template[k] + template[k + 1];
            let extreme =
                (1..2 * half).map(smooth).fold(0.0_f32, |most, t| if t.abs() > most.abs() { t } else { most });
            let near = half.saturating_sub(beside).max(1)..=(half + beside).min(2 * half - 1);
            // Broad twine, blurred by motion, has a flat top whose highest point means nothing.
            self.centred.push(near.into_iter().any(|k| smooth(k) * extreme >= FLAT_TOP * extreme * extreme));
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
            graph.local_median(values, CELL_RADIUS, &mut self.typical);
            self.deviations.clear();
            let pairs = || values.iter().zip(&self.typical).map(|(v, t)| v - t);
            self.deviations.extend(pairs().filter(|d| !d.is_nan()).map(f32::abs));
            let scale = 1.4826 * median(&mut self.deviations).unwrap_or(0.0) + floor;
            for (covered, d) in self.covered.iter_mut().zip(pairs()) {
                let off = if signed { d } else { d.abs() } / scale;
                *covered = covered.max(off);
            }
        }
    }

    fn decide(&mut self, graph: &mut Graph, config: &AdjustConfig) {
        location_and_scatter(
            graph,
            &self.twine.weakest,
            SCATTER_MIN.0,
            &mut self.deviations,
            &mut self.typical,
            &mut self.spread,
        );
        location_and_scatter(
            graph,
            &self.control.weakest,
            SCATTER_MIN.1,
            &mut self.deviations,
            &mut self.control_typical,
            &mut self.control_spread,
        );
        graph.local_median(&self.control.structure, RADIUS, &mut self.deviations);
        self.twines.clear();
        for (e, edge) in graph.edges.iter().enumerate() {
            let index = graph.nodes[edge.nodes[0] as usize].index;
            let (p0, sp) = (self.typical[e], self.spread[e]);
            let (m0, s0) = (self.control_typical[e], self.control_spread[e]);
            let w = self.twine.weakest[e];
            // Stronger than usual twine is no less twine; weaker than no twine is no less missing.
            let x = w.min(p0).max(m0);
            let llr = log_student(x, p0, sp) - log_student(x, m0, s0);
            let contrast = (p0 - m0) / sp.hypot(s0);
            let beside = if edge.family == 0 { (index.0, index.1 - 1) } else { (index.0 - 1, index.1) };
            let covered = [index, beside]
                .into_iter()
                .filter_map(|i| graph.edge_from(graph.node_at(i)?, 0))
                .map(|k| self.covered[k])
                .fold(0.0, f32::max);
            let clutter = self.twine.structure[e] / (self.deviations[e] + 1e-6);
            let told = !w.is_nan() && f64::from(contrast) > config.gate && self.centred[e];
            let state = match f64::from(llr) {
                l if told && l > config.present_llr => TwineState::Present,
                l if l > 0.0 && told && covered <= HIDDEN => TwineState::Unknown,
                _ if !told && covered <= HIDDEN => TwineState::Unknown,
                _ if covered > HIDDEN => TwineState::Hidden,
                l if l < config.missing_llr && clutter > CLUTTER => TwineState::Fouled,
                l if l < config.missing_llr => TwineState::Missing,
                _ => TwineState::Unknown,
            };
            self.twines.push(Twine { index, direction: edge.family, state, llr, contrast });
        }
    }
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

/// Local median, and scatter about it half local, half over the picture.
fn location_and_scatter(
    graph: &mut Graph,
    values: &[f32],
    floor: f32,
    deviations: &mut Vec<f32>,
    typical: &mut Vec<f32>,
    spread: &mut Vec<f32>,
) {
    graph.local_median(values, RADIUS, typical);
    deviations.clear();
    deviations.extend(values.iter().zip(typical.iter()).map(|(v, t)| (v - t).abs()));
    graph.local_median(deviations, RADIUS, spread);
    deviations.retain(|d| !d.is_nan());
    let overall = median(deviations).unwrap_or(0.0);
    for s in spread.iter_mut() {
        *s = 1.4826 * (0.5 * (*s * *s + overall * overall)).sqrt();
        *s = s.hypot(floor);
    }
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

/// Steps of the template on each side, for twine of this width in cells of this height, px.
pub(crate) fn template_half(height: f64, width: f64, sigma: f64) -> usize {
    let half = (0.3 * height).max(2.0).min(0.8 * width + 3.0 * sigma + 1.5);
    (half / STEP_PX).round() as usize
}
