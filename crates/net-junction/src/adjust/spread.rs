//! Outward from the knots that hold: each next knot is looked for where its neighbours' displacements lead, knot by knot.
//!
//! A polynomial follows a sheet that bends evenly. Where nets bend fast the prediction is a cell off within a few, but never within one: the
//! displacement of a knot is the continuation of those of the knots beside it. Farther on, where the prediction is worth nothing or ends, its place is the continuation of theirs.

mod continued;
mod cross;

use std::collections::VecDeque;

use net_geometry::nalgebra::{Matrix3, Matrix3x2, Vector2};

use crate::adjust::config::AdjustConfig;
use crate::adjust::graph::{Graph, Node};
use crate::adjust::source::Source;
use crate::adjust::template::{Kernels, Look};
use continued::{Continued, fit_around};

/// Knots each way that lead on, how many it takes to believe a knot that is where they lead, and how many to look for one.
const REACH: i32 = 3;
const FEWEST: usize = 3;
const FEWEST_TO_FIND: u32 = 5;
/// Standard deviation of displacements about a plane through them, in parts of how much they change from knot to knot.
const ROUGHNESS: f64 = 0.2;
/// A knot farther from where its neighbours lead than this, cells, is another one.
const ALIKE_CELLS: f64 = 0.15;
/// What is not seen may be farther off: in a hole nothing holds it.
const UNSEEN_CELLS: f64 = 0.25;
/// Difference of neighbours' displacements, cells, that no net has.
const SEAM_CELLS: f64 = 0.35;
/// From one step of the lattice to the next no net changes by more than this part.
const UNSTEADY: f64 = 0.3;
/// Ways from a node to those that come next: to the second, for one may be hidden.
const STEPS: [(i32, i32); 8] = [(1, 0), (-1, 0), (0, 1), (0, -1), (2, 0), (-2, 0), (0, 2), (0, -2)];
/// Knots that moved by this, cells, were named wrongly or not found.
const MOVED_CELLS: f64 = 0.2;
/// Rings of nodes that are not seen and have names all the same: a hole is not much wider.
const UNSEEN_RINGS: usize = 5;

/// What is known of a node of the graph.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Knot {
    /// Displacement from where the graph predicts it, px, as it was believed to be, and as it is found.
    believed: Vector2<f64>,
    shift: Vector2<f64>,
    known: bool,
    /// Whether twine stands out here so well that others may be looked for by it.
    leads: bool,
    /// Known neighbours when it was last looked for in vain.
    tried: u32,
    /// Amplitudes of both families' twines there, NaN before they are measured.
    amplitudes: [f32; 2],
}

/// Buffers of this stage, and where it leads.
#[derive(Debug, Default)]
pub(crate) struct Spreader {
    kernels: Kernels,
    knots: Vec<Knot>,
    named: Vec<bool>,
    /// Whether the graph's prediction is what knots led to: then their places lead, not how far they are off it.
    free: bool,
    doubtful: Vec<bool>,
    queue: VecDeque<u32>,
    found: Vec<(u32, Vector2<f64>)>,
    continued: Continued,
    profile: Vec<f32>,
    responses: Vec<f32>,
    values: Vec<f32>,
}

impl Spreader {
    /// Whether a node's name can be trusted: it lies where its neighbours lead, and so do they, to where the walk began.
    pub fn named(&self, node: usize) -> bool {
        self.named[node]
    }

    /// Walks outward from the seen nodes nearest to the graph's first one, which is next to the seed, naming those that lie where the ones before them
    /// lead, and looking for the others. `free` if the graph is itself made of where knots led. Returns how many were found elsewhere than they were believed to be.
    pub fn spread(
        &mut self,
        source: &Source,
        graph: &Graph,
        seen: impl Fn(usize) -> bool,
        strong: impl Fn(usize) -> bool,
        free: bool,
        look: &Look,
        config: &AdjustConfig,
    ) -> usize {
        self.free = free;
        self.kernels.start(look.coarse_px);
        self.knots.clear();
        self.knots.extend(graph.nodes.iter().map(|node| Knot {
            believed: node.shift,
            shift: node.shift,
            known: false,
            leads: false,
            tried: 0,
            amplitudes: [f32::NAN; 2],
        }));
        self.named.clear();
        self.named.resize(graph.nodes.len(), false);
        self.queue.clear();
        self.doubt(graph, &seen);
        self.begin(graph, &seen, &strong);
        let mut moved = 0;
        while let Some(k) = self.queue.pop_front() {
            let k = k as usize;
            if self.knots[k].known {
                continue;
            }
            let Some((led, steps, count)) = self.lead(graph, k) else { continue };
            let (node, believed) = (&graph.nodes[k], self.knots[k].believed);
            let near = |at: Vector2<f64>| (believed - at).norm() < ALIKE_CELLS * node.height;
            if seen(k) && near(led) && !self.doubtful[k] && self.steady(graph, k, believed) {
                self.named[k] = true;
                self.knots[k].leads = strong(k);
            } else if count as u32 <= self.knots[k].tried.max(FEWEST_TO_FIND - 1) || !node.inside {
                continue;
            } else {
                self.knots[k].tried = count as u32;
                let Some(off) = self.find(source, graph, k, led, steps, look, config) else { continue };
                if !self.steady(graph, k, led + off) {
                    continue;
                }
                self.knots[k].shift = led + off;
                self.knots[k].leads = true;
                self.named[k] = near(led + off);
                moved += usize::from((led + off - believed).norm() > MOVED_CELLS * node.height);
            }
            self.knots[k].known = true;
            self.go_on(graph, k);
        }
        self.name_unseen(graph);
        moved
    }

    /// What is not seen has its name where it is believed to be where its neighbours lead, ring by ring.
    fn name_unseen(&mut self, graph: &Graph) {
        for _ in 0..UNSEEN_RINGS {
            self.found.clear();
            for k in 0..graph.nodes.len() {
                let node = &graph.nodes[k];
                if !self.named[k]
                    && !self.knots[k].known
                    && borders(graph, k, |n| self.knots[n].known)
                    && let Some((led, ..)) = self.lead(graph, k)
                    && (self.knots[k].believed - led).norm() < UNSEEN_CELLS * node.height
                    && self.steady(graph, k, self.knots[k].believed)
                {
                    self.found.push((k as u32, led));
                }
            }
            for &(k, _) in &self.found {
                self.named[k as usize] = true;
                self.knots[k as usize].known = true;
            }
        }
    }

    /// Takes what was found for the next prediction, [`Self::continued`], in a picture of this size. Returns how many nodes it has in the picture that the graph did not have there.
    pub fn settle(&mut self, graph: &Graph, size: (usize, usize), cell_min_px: f64) -> usize {
        let known = graph.nodes.iter().zip(&self.knots).filter(|(_, knot)| knot.known);
        let place = |(node, knot): (&Node, &Knot)| (node.index, (node.predicted + knot.shift).push(node.scale));
        self.continued.settle(graph, known.map(place), graph.nodes.first().map(|n| n.index), size, cell_min_px)
    }

    /// Where the known knots are, and where they lead.
    pub fn continued(&mut self) -> &Continued {
        self.continued.smooth();
        &self.continued
    }

    /// Around places where neighbours are displaced so differently that one of them has another twine's name. The walk must not
    /// slip round the end of such a seam.
    fn doubt(&mut self, graph: &Graph, seen: &impl Fn(usize) -> bool) {
        self.doubtful.clear();
        self.doubtful.resize(graph.nodes.len(), false);
        for edge in &graph.edges {
            let [a, b] = edge.nodes.map(|n| n as usize);
            let apart = (self.knots[a].believed - self.knots[b].believed).norm();
            if apart > SEAM_CELLS * graph.nodes[a].height && (seen(a) || seen(b)) {
                let (i, j) = graph.nodes[a].index;
                for (di, dj) in (-REACH..=REACH).flat_map(|di| (-REACH..=REACH).map(move |dj| (di, dj))) {
                    if let Some(n) = graph.node_at((i + di, j + dj)) {
                        self.doubtful[n] = true;
                    }
                }
            }
        }
    }

    /// The first nodes: a seen one and those around it that are displaced alike.
    fn begin(&mut self, graph: &Graph, seen: &impl Fn(usize) -> bool, strong: &impl Fn(usize) -> bool) {
        let Some(seed) = graph.nodes.first().map(|n| n.predicted) else { return };
        let distance = |n: usize| (graph.nodes[n].predicted - seed).norm_squared();
        let mut start = None;
        for n in (0..graph.nodes.len()).filter(|&n| seen(n)) {
            let away = distance(n);
            if start.is_none_or(|(_, least)| away < least) && self.alike(graph, n, seen).count() >= FEWEST {
                start = Some((n, away));
            }
        }
        let Some((start, _)) = start else { return };
        self.found.clear();
        let mut found = std::mem::take(&mut self.found);
        found.extend(self.alike(graph, start, seen).map(|k| (k as u32, Vector2::zeros())));
        for &(k, _) in &found {
            let k = k as usize;
            (self.knots[k].known, self.named[k]) = (true, true);
            self.knots[k].leads = strong(k);
        }
        for &(k, _) in &found {
            self.go_on(graph, k as usize);
        }
        self.found = found;
    }

    /// Seen nodes around one, itself included, that are displaced as it is.
    fn alike<'a>(
        &'a self,
        graph: &'a Graph,
        k: usize,
        seen: &'a impl Fn(usize) -> bool,
    ) -> impl Iterator<Item = usize> + 'a {
        let (i, j) = graph.nodes[k].index;
        let around = (-2..=2).flat_map(|a| (-2..=2).map(move |b| (a, b)));
        around.filter_map(move |(a, b): (i32, i32)| {
            let n = graph.node_at((i + a, j + b)).filter(|&n| seen(n))?;
            let off = (self.knots[n].believed - self.knots[k].believed).norm();
            (off <= ALIKE_CELLS * graph.nodes[k].height * f64::from(1.max(a.abs().max(b.abs())))).then_some(n)
        })
    }

    /// Whether the steps of the lattice to a node that lies `shift` off its prediction are like those before them. Where nothing but knots leads, a twine that is left out is not
    /// noticed otherwise.
    fn steady(&self, graph: &Graph, k: usize, shift: Vector2<f64>) -> bool {
        let (i, j) = graph.nodes[k].index;
        let at = |a, b| {
            let n = graph.node_at((i + a, j + b)).filter(|&n| self.knots[n].known)?;
            Some(graph.nodes[n].predicted + self.knots[n].shift)
        };
        let here = graph.nodes[k].predicted + shift;
        !self.free
            || STEPS[..4].iter().all(|&(a, b)| match (at(a, b), at(2 * a, 2 * b)) {
                (Some(next), Some(after)) => ((here - next) - (next - after)).norm() < UNSTEADY * (next - after).norm(),
                _ => true,
            })
    }

    /// What lies next to a node, and next to that, comes next.
    fn go_on(&mut self, graph: &Graph, k: usize) {
        let (i, j) = graph.nodes[k].index;
        let steps = if self.free { &STEPS[..4] } else { &STEPS };
        for (a, b) in steps {
            if let Some(n) = graph.node_at((i + a, j + b)).filter(|&n| !self.knots[n].known) {
                self.queue.push_back(n as u32);
            }
        }
    }

    /// Where a node's known neighbours lead: its displacement, the steps of the lattice there, and how many they are.
    fn lead(&self, graph: &Graph, k: usize) -> Option<(Vector2<f64>, [Vector2<f64>; 2], usize)> {
        let (i, j) = graph.nodes[k].index;
        if self.free {
            let known = |a, b| graph.node_at((i + a, j + b)).filter(|&n| self.knots[n].known);
            let (fit, count) = fit_around(|a, b| {
                known(a, b).map(|n| (graph.nodes[n].predicted + self.knots[n].shift).push(graph.nodes[n].scale))
            })?;
            let row = |r: usize| Vector2::new(fit[(r, 0)], fit[(r, 1)]);
            return Some((row(0) - graph.nodes[k].predicted, [row(1), row(2)], count));
        }
        let (mut moments, mut right, mut count) = ([0.0; 6], [Vector2::zeros(); 3], 0);
        for a in -REACH..=REACH {
            for (b, n) in graph.nodes_from((i.saturating_add(a), j.saturating_sub(REACH)), 2 * REACH as usize + 1) {
                let b = b as i32 - REACH;
                if (a, b) == (0, 0) || !self.knots[n].known {
                    continue;
                }
                let weight = 1.0 / f64::from(a * a + b * b);
                let (along, across) = (f64::from(a), f64::from(b));
                let (by_a, by_b) = (weight * along, weight * across);
                let terms = [weight, by_a, by_b, by_a * along, by_a * across, by_b * across];
                moments.iter_mut().zip(terms).for_each(|(m, t)| *m += t);
                right.iter_mut().zip(terms).for_each(|(r, t)| *r += self.knots[n].shift * t);
                count += 1;
            }
        }
        let [w, a, b, aa, ab, bb] = moments;
        let mut normal = Matrix3::new(w, a, b, a, aa, ab, b, ab, bb);
        let right = Matrix3x2::from_rows(&right.map(|r| r.transpose()));
        if count < FEWEST {
            return None;
        }
        normal[(1, 1)] += ROUGHNESS.powi(2);
        normal[(2, 2)] += ROUGHNESS.powi(2);
        let fit = normal.cholesky()?.solve(&right);
        let row = |r: usize| Vector2::new(fit[(r, 0)], fit[(r, 1)]);
        let steps = [0, 1].map(|f| self.step(graph, k, f) + row(1 + f));
        Some((row(0), steps, count))
    }
}

/// Whether one of a node's four neighbours is such.
fn borders(graph: &Graph, k: usize, such: impl Fn(usize) -> bool) -> bool {
    let (i, j) = graph.nodes[k].index;
    [(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)].into_iter().any(|n| graph.node_at(n).is_some_and(&such))
}
