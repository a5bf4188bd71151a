//! What lies where twines are gone together: the net's end, where no net encloses them, a fish, where most of them are hidden, or a hole.

use crate::adjust::config::AdjustConfig;
use crate::adjust::graph::Graph;
use crate::adjust::presence::{Gap, Twine, TwineState};

/// Missing twines in a region that reaches the end of the picture, from which on it is the net's end and no hole.
const TWINES: u32 = 8;

/// Twines that make a hole together: log likelihood ratio of each, and how many it takes.
const SEVERAL: (f32, u32) = (-2.0, 3);

/// Overgrown twines up to which a picture is clear of what covers twines, or one in how many: by chance some are called so. Of those that something small covers, one in eighty looks gone.
const CLEAR: (usize, usize) = (6, 750);
/// What it takes more for a twine to be gone in a clear picture, for each thing that speaks against a gap, and how many of these may: log likelihood ratio and contrast. On drawn
/// nets, of which a thousand pictures, most of them clear, had one false hole.
const MORE: (f64, f64) = (-1.0, 0.5);
const DOUBTS: u32 = 2;
/// The same in a picture that is not clear. There, nothing may speak against it.
const MORE_UNCLEAR: (f64, f64) = (-1.0, 2.7);

/// Hidden twines, at least as many as missing ones, that hide those too.
const HIDDEN: u32 = 2;

/// Meshes that twines which are not seen join, each named after its first node.
#[derive(Debug, Default)]
pub(crate) struct Outside {
    parent: Vec<u32>,
    /// Missing and hidden twines of a region, and its meshes at the end of the picture; kept at its root.
    missing: Vec<u32>,
    hidden: Vec<u32>,
    open: Vec<u32>,
    evidence: Vec<Evidence>,
}

/// What the missing twines of a region say together.
#[derive(Debug, Clone, Copy, Default)]
struct Evidence {
    /// Of log likelihood ratios.
    sum: f32,
    /// Twines below [`SEVERAL`].
    several: u32,
    /// Whether one of them is certain by itself.
    certain: bool,
}

impl Evidence {
    /// `unseen`: whether one of its knots is not seen; `clear`: whether the picture is.
    fn of(twine: &Twine, gap: &Gap, unseen: bool, clear: bool, config: &AdjustConfig) -> Self {
        let doubts = gap.doubts + u32::from(unseen);
        let (llr, contrast) =
            if clear { (f64::from(doubts) * MORE.0, f64::from(doubts) * MORE.1) } else { MORE_UNCLEAR };
        let certain = (doubts == 0 || clear && gap.stubs && doubts <= DOUBTS)
            && f64::from(gap.llr) < config.hole_one_llr + llr
            && f64::from(gap.contrast) > config.certain_contrast + contrast;
        Self { sum: twine.llr, several: u32::from(twine.llr < SEVERAL.0), certain }
    }

    fn add(&mut self, other: Self) {
        self.sum += other.sum;
        self.several += other.several;
        self.certain |= other.certain;
    }

    fn is_hole(&self, config: &AdjustConfig) -> bool {
        self.certain || self.several >= SEVERAL.1 && f64::from(self.sum) < config.hole_sum_llr
    }
}

impl Outside {
    /// Nothing is said of twines beyond the net's end, and what is missing amid hidden twines is hidden.
    pub fn mark(&mut self, graph: &Graph, twines: &mut [Twine]) {
        // Farther out nothing is told. (Twines out of the picture have no contrast; they would join all of its end.)
        let untold = |t: &Twine| t.state == TwineState::Unknown && t.llr <= 0.0 && t.contrast != 0.0;
        self.join(graph, twines, |t| t.state == TwineState::Missing || untold(t));
        self.change(graph, twines, TwineState::Unknown, |o, r| o.missing[r] >= TWINES && o.is_open(r));
        let covered = |t: &Twine| matches!(t.state, TwineState::Missing | TwineState::Hidden | TwineState::Fouled);
        self.join(graph, twines, |t| covered(t) || untold(t));
        self.change(graph, twines, TwineState::Hidden, |o, r| o.hidden[r] >= o.missing[r].max(HIDDEN));
    }

    /// Missing twines that do not make a hole together are doubtful: of the thousands in a picture, some look gone by chance. In pictures that are not clear, only empty gaps count.
    pub fn claim(
        &mut self,
        graph: &Graph,
        twines: &mut [Twine],
        gaps: &[Gap],
        seen: impl Fn(usize) -> bool,
        config: &AdjustConfig,
    ) {
        let gone = |t: &Twine| t.state == TwineState::Missing;
        self.join(graph, twines, gone);
        self.evidence.clear();
        self.evidence.resize(graph.nodes.len(), Evidence::default());
        let covered = twines.iter().filter(|t| t.state == TwineState::Fouled).count();
        let clear = covered <= CLEAR.0.max(twines.len() / CLEAR.1);
        for (e, twine) in twines.iter().enumerate().filter(|(e, t)| gone(t) && (clear || gaps[*e].doubts == 0)) {
            // A twine between knots that are not seen may as well be one where there is no net.
            let ends = graph.edges[e].nodes.iter().filter(|&&n| seen(n as usize)).count();
            if ends > 0
                && let Some(cell) = beside(graph, twine)[0]
            {
                let root = self.root(cell);
                self.evidence[root].add(Evidence::of(twine, &gaps[e], ends < 2, clear, config));
            }
        }
        self.change(graph, twines, TwineState::Doubtful, |o, r| !o.evidence[r].is_hole(config));
        for (twine, gap) in twines.iter_mut().zip(gaps).filter(|(t, _)| gone(t)) {
            twine.llr = twine.llr.min(gap.llr);
        }
    }

    /// Joins the meshes on both sides of the twines that belong.
    fn join(&mut self, graph: &Graph, twines: &[Twine], belongs: impl Fn(&Twine) -> bool) {
        self.parent.clear();
        self.parent.extend(0..graph.nodes.len() as u32);
        for counts in [&mut self.missing, &mut self.hidden] {
            counts.clear();
            counts.resize(graph.nodes.len(), 0);
        }
        self.open.clear();
        self.open.extend(graph.nodes.iter().map(|node| {
            let (i, j) = node.index;
            let corners = [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)];
            u32::from(!corners.into_iter().all(|c| graph.node_at(c).is_some_and(|n| graph.nodes[n].inside)))
        }));
        for twine in twines.iter().filter(|t| belongs(t)) {
            let [a, b] = beside(graph, twine).map(|cell| cell.map(|c| self.root(c)));
            let Some(root) = a.or(b) else { continue };
            self.missing[root] += u32::from(twine.state == TwineState::Missing);
            self.hidden[root] += u32::from(matches!(twine.state, TwineState::Hidden | TwineState::Fouled));
            match [a, b] {
                [Some(a), Some(b)] if a != b => {
                    self.parent[b] = a as u32;
                    self.missing[a] += self.missing[b];
                    self.hidden[a] += self.hidden[b];
                    self.open[a] += self.open[b];
                }
                [Some(_), Some(_)] => (),
                _ => self.open[root] += 1,
            }
        }
    }

    /// Gives another state to the missing twines of some regions, known by their roots.
    fn change(
        &mut self,
        graph: &Graph,
        twines: &mut [Twine],
        state: TwineState,
        concerned: impl Fn(&Self, usize) -> bool,
    ) {
        for twine in twines.iter_mut().filter(|t| t.state == TwineState::Missing) {
            let Some(cell) = beside(graph, twine).into_iter().flatten().next() else { continue };
            let root = self.root(cell);
            if concerned(self, root) {
                twine.state = state;
            }
        }
    }

    /// Whether a region goes on beyond the picture. What a straight end of the net cuts off, a corner at the least, lies along the picture's end with twice the root of
    /// its twines or more, half of a round hole with 1.1 times.
    fn is_open(&self, root: usize) -> bool {
        self.open[root].saturating_pow(2) > self.missing[root]
    }

    fn root(&mut self, cell: usize) -> usize {
        let mut cell = cell as u32;
        while self.parent[cell as usize] != cell {
            let above = self.parent[cell as usize];
            self.parent[cell as usize] = self.parent[above as usize];
            cell = above;
        }
        cell as usize
    }
}

/// The meshes on both sides of a twine.
fn beside(graph: &Graph, twine: &Twine) -> [Option<usize>; 2] {
    let (i, j) = twine.index;
    let other = if twine.direction == 0 { (i, j - 1) } else { (i - 1, j) };
    [(i, j), other].map(|c| graph.node_at(c))
}
