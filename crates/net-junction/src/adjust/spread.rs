//! Outward from the knots that hold: each next knot is looked for where its neighbours' displacements lead, knot by knot.
//!
//! A polynomial follows a sheet that bends evenly. Where nets bend fast the prediction is a cell off within a few, but never within one: the
//! displacement of a knot is the continuation of those of the knots beside it.

mod cross;

use std::collections::VecDeque;

use net_geometry::nalgebra::{Matrix3, Matrix3x2, Vector2, Vector3};

use crate::adjust::config::AdjustConfig;
use crate::adjust::graph::Graph;
use crate::adjust::map::LatticeMap;
use crate::adjust::source::Source;
use crate::adjust::template::{Kernels, Look};

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
/// Ways from a node to those that come next: to the second, for one may be hidden.
const STEPS: [(i32, i32); 8] = [(1, 0), (-1, 0), (0, 1), (0, -1), (2, 0), (-2, 0), (0, 2), (0, -2)];
/// Knots that moved by this, cells, were named wrongly or not found.
const MOVED_CELLS: f64 = 0.2;
/// Rings of nodes that are moved along without being found.
const FILL_RINGS: usize = 4;
/// Rings of nodes that are not seen and have names all the same: a hole is not much wider.
const UNSEEN_RINGS: usize = 5;

/// What is known of a node of the graph.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Knot {
    /// Where the map has it, px; from there all displacements count, for the graph's own prediction has been led.
    from: Vector2<f64>,
    /// Displacement as it was believed to be, and as it is found.
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
    doubtful: Vec<bool>,
    queue: VecDeque<u32>,
    found: Vec<(u32, Vector2<f64>)>,
    /// By index, in order: displacement from the map.
    places: Vec<((i32, i32), Vector2<f64>)>,
    profile: Vec<f32>,
    sums: Vec<i32>,
    responses: Vec<f32>,
    values: Vec<f32>,
}

impl Spreader {
    /// Whether a node's name can be trusted: it lies where its neighbours lead, and so do they, to where the walk began.
    pub fn named(&self, node: usize) -> bool {
        self.named[node]
    }

    /// Walks outward from the seen nodes nearest to the graph's first one, which is next to the seed, naming those that lie where the ones before them
    /// lead, and looking for the others. Returns how many were found elsewhere than they were believed to be.
    pub fn spread(
        &mut self,
        source: &Source,
        graph: &Graph,
        map: &impl LatticeMap,
        seen: impl Fn(usize) -> bool,
        strong: impl Fn(usize) -> bool,
        look: &Look,
        config: &AdjustConfig,
    ) -> usize {
        self.kernels.start(look.coarse_px);
        self.knots.clear();
        self.knots.extend(graph.nodes.iter().map(|node| {
            let (i, j) = node.index;
            let from = map.place(f64::from(i), f64::from(j)).map_or(node.predicted, |p| p.0);
            let believed = node.pixel() - from;
            Knot { from, believed, shift: believed, known: false, leads: false, tried: 0, amplitudes: [f32::NAN; 2] }
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
            let Some((led, slope, count)) = self.lead(graph, k) else { continue };
            let (node, believed) = (&graph.nodes[k], self.knots[k].believed);
            let near = |at: Vector2<f64>| (believed - at).norm() < ALIKE_CELLS * node.height;
            if seen(k) && near(led) && !self.doubtful[k] {
                self.named[k] = true;
                self.knots[k].leads = strong(k);
            } else if count as u32 <= self.knots[k].tried.max(FEWEST_TO_FIND - 1) || !node.inside {
                continue;
            } else {
                self.knots[k].tried = count as u32;
                let Some(off) = self.find(source, graph, k, led, slope, look, config) else { continue };
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

    /// Takes what was found for the places of nodes by index, as displacements from the map.
    pub fn settle(&mut self, graph: &Graph) {
        self.fill(graph);
        self.places.clear();
        let known = graph.nodes.iter().zip(&self.knots).filter(|(_, knot)| knot.known);
        self.places.extend(known.map(|(node, knot)| (node.index, knot.shift)));
        self.places.sort_unstable_by_key(|p| p.0);
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
        let start = (0..graph.nodes.len())
            .filter(|&n| seen(n) && self.alike(graph, n, seen).count() >= FEWEST)
            .min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        let Some(start) = start else { return };
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

    /// What lies next to a node, and next to that, comes next.
    fn go_on(&mut self, graph: &Graph, k: usize) {
        let (i, j) = graph.nodes[k].index;
        for (a, b) in STEPS {
            if let Some(n) = graph.node_at((i + a, j + b)).filter(|&n| !self.knots[n].known) {
                self.queue.push_back(n as u32);
            }
        }
    }

    /// Where a node's known neighbours lead: its displacement, how that changes along both directions, and how many they are.
    fn lead(&self, graph: &Graph, k: usize) -> Option<(Vector2<f64>, [Vector2<f64>; 2], usize)> {
        let (i, j) = graph.nodes[k].index;
        let (mut normal, mut right, mut count) = (Matrix3::zeros(), Matrix3x2::zeros(), 0);
        for b in -REACH..=REACH {
            for a in -REACH..=REACH {
                let Some(n) = graph.node_at((i + a, j + b)).filter(|&n| n != k && self.knots[n].known) else {
                    continue;
                };
                let terms = Vector3::new(1.0, f64::from(a), f64::from(b));
                let weight = 1.0 / f64::from(a * a + b * b);
                normal += terms * terms.transpose() * weight;
                right += terms * self.knots[n].shift.transpose() * weight;
                count += 1;
            }
        }
        if count < FEWEST {
            return None;
        }
        normal[(1, 1)] += ROUGHNESS.powi(2);
        normal[(2, 2)] += ROUGHNESS.powi(2);
        let fit = normal.cholesky()?.solve(&right);
        let row = |r: usize| Vector2::new(fit[(r, 0)], fit[(r, 1)]);
        Some((row(0), [row(1), row(2)], count))
    }

    /// Nodes around those that are known are taken along.
    fn fill(&mut self, graph: &Graph) {
        for _ in 0..FILL_RINGS {
            self.found.clear();
            for k in 0..graph.nodes.len() {
                if !self.knots[k].known
                    && borders(graph, k, |n| self.knots[n].known)
                    && let Some((led, ..)) = self.lead(graph, k)
                {
                    self.found.push((k as u32, led));
                }
            }
            for &(k, shift) in &self.found {
                (self.knots[k as usize].shift, self.knots[k as usize].known) = (shift, true);
            }
        }
    }

    /// Displacement of a node from the map: its own, or the mean of those near it.
    fn at(&self, index: (i32, i32)) -> Option<Vector2<f64>> {
        let own = |index| self.places.binary_search_by_key(&index, |p| p.0).ok().map(|k| self.places[k].1);
        own(index).or_else(|| {
            (1..=2).find_map(|reach| {
                let around = (-reach..=reach).flat_map(|a| (-reach..=reach).map(move |b| (a, b)));
                let near = around.filter_map(|(a, b)| own((index.0 + a, index.1 + b)));
                let (sum, count) = near.fold((Vector2::zeros(), 0), |(s, n), d| (s + d, n + 1));
                (count > 0).then(|| sum / f64::from(count))
            })
        })
    }
}

/// Whether one of a node's four neighbours is such.
fn borders(graph: &Graph, k: usize, such: impl Fn(usize) -> bool) -> bool {
    let (i, j) = graph.nodes[k].index;
    [(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)].into_iter().any(|n| graph.node_at(n).is_some_and(&such))
}

/// A prediction, moved to where knots lead.
pub(crate) struct Led<'a, M> {
    pub map: &'a M,
    pub spreader: &'a Spreader,
}

impl<M: LatticeMap> LatticeMap for Led<'_, M> {
    fn pixel(&self, i: f64, j: f64) -> Option<Vector2<f64>> {
        self.place(i, j).map(|p| p.0)
    }
    fn pixels_per_metre(&self, i: f64, j: f64) -> Option<f64> {
        self.map.pixels_per_metre(i, j)
    }
    fn place(&self, i: f64, j: f64) -> Option<(Vector2<f64>, f64)> {
        let (p, scale) = self.map.place(i, j)?;
        let moved = self.spreader.at((i.round() as i32, j.round() as i32)).unwrap_or_default();
        Some((p + moved, scale))
    }
    fn seed(&self) -> Option<(i32, i32)> {
        self.map.seed()
    }
}
