//! Which junction is which: lattice indices by walking from mesh to mesh.
//!
//! Neighbouring openings share junctions, so one opening's indices give its neighbours' (a walk by steps of one cell cannot slip, however
//! far it goes). Islands that share no junction with the rest are joined by their distance, counted in cells, from the nearest
//! named junction. A junction that its openings name differently, or that does not lie where its neighbours say, stays without a name.

use std::collections::VecDeque;

use net_geometry::Basis;
use net_geometry::nalgebra::Vector2;

use crate::contour::cluster::{Knot, median};
use crate::contour::expectation::ExpectedNet;
use crate::contour::shape::CellBox;

/// How far, cells, an island may be from the named part of the net.
const ISLAND_REACH: f64 = 4.0;
/// How far, cells, counted distances may be from whole numbers.
const ISLAND_FRACTION: f64 = 0.25;
/// How far, cells, a junction may lie from where its neighbours say.
const NEIGHBOUR_RESIDUAL: f64 = 0.25;
/// How many junctions nearest to the middle tie the names to an anchored pose, at least; a quarter of them all if that is more.
const ANCHORS_MIN: usize = 12;
/// How far, cells, they may lie from where the pose has them, and which part of them must not lie farther.
const ANCHOR_FRACTION: f64 = 0.35;
const ANCHORS_AGREE: f64 = 0.7;

/// Index of a node or cell.
type Index = (i32, i32);

/// Buffers of this stage, and the names it gave.
#[derive(Debug, Default)]
pub(crate) struct Namer {
    names: Vec<Option<Index>>,
    /// Openings that agree with a knot's name less those that do not.
    votes: Vec<i32>,
    /// Corners by knot: where each knot's begin in `corners`.
    starts: Vec<u32>,
    corners: Vec<u32>,
    visited: Vec<bool>,
    queue: VecDeque<(u32, Basis)>,
    /// Knots of the island at hand.
    island: Vec<u32>,
    named: Vec<u32>,
    /// Squared distance of each box from the nearest named knot, px²; before any is named, from the middle.
    apart: Vec<f64>,
    by_index: Vec<(Index, u32)>,
    doubtful: Vec<u32>,
    /// Squared distance from the middle, px², and name less the pose's lattice coordinates.
    offsets: Vec<(f64, Vector2<f64>)>,
    scratch: Vec<f64>,
}

/// Index of the cell's corner that lies at signs `(+, +)` of the basis is the cell's plus one each.
fn corner_offset(corner: Vector2<f64>, basis: &Basis) -> Index {
    let cross = basis.b1.perp(&basis.b2);
    let (x, y) = (corner.perp(&basis.b2) / cross, basis.b1.perp(&corner) / cross);
    (i32::from(x > 0.0), i32::from(y > 0.0))
}

fn add(a: Index, b: Index) -> Index {
    (a.0.saturating_add(b.0), a.1.saturating_add(b.1))
}

fn subtract(a: Index, b: Index) -> Index {
    (a.0.saturating_sub(b.0), a.1.saturating_sub(b.1))
}

impl Namer {
    /// The name of each knot.
    pub fn names(&self) -> &[Option<Index>] {
        &self.names
    }

    /// Names the knots. `middle` is the pixel next to which `(0, 0)` shall lie, unless the expected net is anchored.
    pub fn name(
        &mut self,
        boxes: &[CellBox],
        knots: &[Knot],
        knot_of_corner: &[Option<u32>],
        net: Option<&ExpectedNet>,
        middle: Vector2<f64>,
    ) {
        self.names.clear();
        self.names.resize(knots.len(), None);
        self.votes.clear();
        self.votes.resize(knots.len(), 0);
        self.visited.clear();
        self.visited.resize(boxes.len(), false);
        self.named.clear();
        self.list_corners(knots.len(), knot_of_corner);
        self.apart.clear();
        self.apart.extend(boxes.iter().map(|found| (found.centre() - middle).norm_squared()));
        while let Some(seed) = self.next_seed(knot_of_corner) {
            let basis = match net.and_then(|n| n.basis_at(boxes[seed].centre())) {
                Some(basis) => basis,
                None => Self::basis_of(&boxes[seed]),
            };
            self.walk(seed, basis, boxes, knot_of_corner);
            if self.named.is_empty() || self.join(boxes, knots, net, seed) {
                self.come_nearer(boxes, knots);
                self.named.extend_from_slice(&self.island);
            } else {
                for &k in &self.island {
                    self.names[k as usize] = None;
                }
            }
        }
        for (name, &votes) in self.names.iter_mut().zip(&self.votes) {
            if votes <= 0 {
                *name = None;
            }
        }
        self.drop_doubles(knots);
        self.drop_misplaced(knots);
        self.move_origin(knots, net, middle);
    }

    fn list_corners(&mut self, knots: usize, knot_of_corner: &[Option<u32>]) {
        self.starts.clear();
        self.starts.resize(knots + 1, 0);
        for k in knot_of_corner.iter().flatten() {
            self.starts[*k as usize + 1] += 1;
        }
        for k in 0..knots {
            self.starts[k + 1] += self.starts[k];
        }
        self.corners.clear();
        self.corners.resize(self.starts[knots] as usize, 0);
        for (corner, knot) in knot_of_corner.iter().enumerate() {
            if let Some(k) = knot {
                let cursor = &mut self.starts[*k as usize];
                self.corners[*cursor as usize] = corner as u32;
                *cursor += 1;
            }
        }
        for k in (1..=knots).rev() {
            self.starts[k] = self.starts[k - 1];
        }
        self.starts[0] = 0;
    }

    /// The opening nearest to the middle, then the one nearest to what is named already: islands are joined from near to far.
    fn next_seed(&self, knot_of_corner: &[Option<u32>]) -> Option<usize> {
        let (corners, _) = knot_of_corner.as_chunks::<4>();
        let open = self.visited.iter().zip(corners).zip(&self.apart).enumerate();
        let open = open.filter(|(_, ((visited, corners), _))| !**visited && corners.iter().any(Option::is_some));
        open.min_by(|(_, (_, a)), (_, (_, b))| a.total_cmp(b)).map(|(b, _)| b)
    }

    /// Lowers the boxes' distances to those from the island's knots.
    fn come_nearer(&mut self, boxes: &[CellBox], knots: &[Knot]) {
        if self.named.is_empty() {
            self.apart.fill(f64::MAX);
        }
        for ((apart, found), _) in self.apart.iter_mut().zip(boxes).zip(&self.visited).filter(|(_, visited)| !**visited)
        {
            let centre = found.centre();
            for &k in &self.island {
                *apart = apart.min((knots[k as usize].pixel - centre).norm_squared());
            }
        }
    }

    fn nearest_named(&self, at: Vector2<f64>, knots: &[Knot]) -> Option<(f64, u32)> {
        let distance = |k: u32| (knots[k as usize].pixel - at).norm_squared();
        self.named.iter().map(|&k| (distance(k), k)).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Basis of an opening without a pose: of its sides the one along u first.
    fn basis_of(found: &CellBox) -> Basis {
        let (side1, side2) = sides(found);
        let along_u = if side1.x.abs() * side2.norm() >= side2.x.abs() * side1.norm() { side1 } else { side2 };
        let other = if along_u == side1 { side2 } else { side1 };
        let b1 = if along_u.x < 0.0 { -along_u } else { along_u };
        Basis { b1, b2: if b1.perp(&other) < 0.0 { -other } else { other } }
    }

    /// Breadth first from box to box over shared knots; fills `names`, `votes` and `island`.
    fn walk(&mut self, seed: usize, basis: Basis, boxes: &[CellBox], knot_of_corner: &[Option<u32>]) {
        self.island.clear();
        self.queue.clear();
        self.visited[seed] = true;
        self.queue.push_back((seed as u32, basis));
        while let Some((b, basis)) = self.queue.pop_front() {
            let b = b as usize;
            let found = &boxes[b];
            let centre = found.centre();
            let offsets = found.corners.map(|c| corner_offset(c - centre, &basis));
            // The four corners must be four different ones in this basis.
            let mut seen = [false; 4];
            for o in offsets {
                seen[(o.0 + 2 * o.1) as usize] = true;
            }
            if seen != [true; 4] {
                continue;
            }
            let knots = &knot_of_corner[4 * b..4 * b + 4];
            // The cell's index: from its best supported named corner.
            let cell = (0..4)
                .filter_map(|k| {
                    let knot = knots[k]? as usize;
                    Some((self.votes[knot], subtract(self.names[knot]?, offsets[k])))
                })
                .max_by_key(|(votes, _)| *votes)
                .map_or((0, 0), |(_, cell)| cell);
            // This opening's own directions, labelled as the basis it came with.
            let mut own = Basis { b1: Vector2::zeros(), b2: Vector2::zeros() };
            for (corner, o) in found.corners.iter().zip(offsets) {
                own.b1 += corner * f64::from(2 * o.0 - 1) * 0.5;
                own.b2 += corner * f64::from(2 * o.1 - 1) * 0.5;
            }
            for k in 0..4 {
                let Some(knot) = knots[k] else { continue };
                let claim = add(cell, offsets[k]);
                match self.names[knot as usize] {
                    None => {
                        self.names[knot as usize] = Some(claim);
                        self.votes[knot as usize] = 1;
                        self.island.push(knot);
                    }
                    Some(name) => self.votes[knot as usize] += if name == claim { 1 } else { -1 },
                }
                let range = self.starts[knot as usize] as usize..self.starts[knot as usize + 1] as usize;
                for &corner in &self.corners[range] {
                    let next = (corner / 4) as usize;
                    if !std::mem::replace(&mut self.visited[next], true) {
                        self.queue.push_back((next as u32, own));
                    }
                }
            }
        }
    }

    /// Shifts the island's names so that they continue the named part's, if the cells between can be counted.
    fn join(&mut self, boxes: &[CellBox], knots: &[Knot], net: Option<&ExpectedNet>, seed: usize) -> bool {
        let mut nearest: Option<(f64, u32, u32)> = None;
        for &k in &self.island {
            if let Some((d, n)) = self.nearest_named(knots[k as usize].pixel, knots)
                && nearest.is_none_or(|(least, ..)| d < least)
            {
                nearest = Some((d, n, k));
            }
        }
        let Some((_, near, far)) = nearest else { return false };
        let (from, to) = (knots[near as usize].pixel, knots[far as usize].pixel);
        let step = match net {
            Some(net) => net.lattice_at(to).zip(net.lattice_at(from)).map(|(a, b)| a - b),
            None => {
                // An opening's sides are a twine short of a cell's.
                let basis = Self::basis_of(&boxes[seed]);
                let scale = boxes[seed].spacing / (0.5 * (basis.b1.norm() + basis.b2.norm()));
                let (b1, b2) = (basis.b1 * scale, basis.b2 * scale);
                let (d, cross) = (to - from, b1.perp(&b2));
                Some(Vector2::new(d.perp(&b2) / cross, b1.perp(&d) / cross))
            }
        };
        let Some(step) = step.filter(|s| s.x.abs().max(s.y.abs()) <= ISLAND_REACH) else { return false };
        let whole = step.map(f64::round);
        if (step - whole).amax() > ISLAND_FRACTION {
            return false;
        }
        let (Some(name), Some(old)) = (self.names[near as usize], self.names[far as usize]) else { return false };
        let shift = subtract(add(name, (whole.x as i32, whole.y as i32)), old);
        for &k in &self.island {
            self.names[k as usize] = self.names[k as usize].map(|n| add(n, shift));
        }
        true
    }

    fn sort_by_index(&mut self) {
        self.by_index.clear();
        self.by_index.extend(self.names.iter().enumerate().filter_map(|(k, n)| Some(((*n)?, k as u32))));
        self.by_index.sort_unstable();
    }

    /// Of knots with the same name the one with the most corners keeps it, if one has more.
    fn drop_doubles(&mut self, knots: &[Knot]) {
        self.sort_by_index();
        for same in self.by_index.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1) {
            let most = same.iter().map(|(_, k)| knots[*k as usize].corners).max().unwrap_or(0);
            let unique = same.iter().filter(|(_, k)| knots[*k as usize].corners == most).count() == 1;
            for &(_, k) in same {
                if !unique || knots[k as usize].corners < most {
                    self.names[k as usize] = None;
                }
            }
        }
    }

    /// Takes names away where the neighbours on a line disagree with the place by more than a quarter of a cell.
    fn drop_misplaced(&mut self, knots: &[Knot]) {
        self.sort_by_index();
        let by_index = &self.by_index;
        let at = |index: Index| {
            let found = by_index.binary_search_by_key(&index, |e| e.0).ok()?;
            Some(knots[by_index[found].1 as usize].pixel)
        };
        self.doubtful.clear();
        for &(index, k) in by_index {
            let knot = &knots[k as usize];
            let (mut sum, mut count) = (Vector2::zeros(), 0.0);
            for direction in [(1, 0), (0, 1)] {
                let (next, last) = (add(index, direction), subtract(index, direction));
                let beyond = |a: Index, d: Index| Some(at(a)? * 2.0 - at(d)?);
                let said = match (at(last), at(next)) {
                    (Some(a), Some(b)) => Some((a + b) * 0.5),
                    (Some(_), None) => beyond(last, subtract(last, direction)),
                    (None, Some(_)) => beyond(next, add(next, direction)),
                    (None, None) => None,
                };
                if let Some(said) = said {
                    sum += said;
                    count += 1.0;
                }
            }
            if count > 0.0 && (sum / count - knot.pixel).norm() > NEIGHBOUR_RESIDUAL * knot.spacing {
                self.doubtful.push(k);
            }
        }
        for &k in &self.doubtful {
            self.names[k as usize] = None;
        }
    }

    /// Moves `(0, 0)` to the pose's origin if it is anchored, else to the named junction nearest to the middle. Takes all names away where
    /// an anchored pose does not tell which junction is which.
    fn move_origin(&mut self, knots: &[Knot], net: Option<&ExpectedNet>, middle: Vector2<f64>) {
        let origin = match net.filter(|n| n.anchored) {
            Some(net) => self.anchor(knots, net, middle),
            None => self.nearest_name(knots, middle),
        };
        for name in &mut self.names {
            *name = name.zip(origin).map(|(name, origin)| subtract(name, origin));
        }
    }

    fn nearest_name(&self, knots: &[Knot], middle: Vector2<f64>) -> Option<Index> {
        let named = self.names.iter().zip(knots).filter_map(|(n, k)| Some(((*n)?, (k.pixel - middle).norm_squared())));
        named.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(name, _)| name)
    }

    /// The name that the pose's origin has, if most junctions near the middle (where the pose is the net's tangent) agree on it.
    fn anchor(&mut self, knots: &[Knot], net: &ExpectedNet, middle: Vector2<f64>) -> Option<Index> {
        self.offsets.clear();
        for (name, knot) in self.names.iter().zip(knots) {
            if let (Some((i, j)), Some(at)) = (*name, net.lattice_at(knot.pixel)) {
                let offset = Vector2::new(f64::from(i), f64::from(j)) - at;
                self.offsets.push(((knot.pixel - middle).norm_squared(), offset));
            }
        }
        self.offsets.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        self.offsets.truncate(ANCHORS_MIN.max(self.offsets.len() / 4));
        let mut axis = |pick: fn(&Vector2<f64>) -> f64| {
            self.scratch.clear();
            self.scratch.extend(self.offsets.iter().map(|(_, o)| pick(o)));
            median(&mut self.scratch)
        };
        let whole = Vector2::new(axis(|o| o.x)?, axis(|o| o.y)?).map(f64::round);
        let agreeing = self.offsets.iter().filter(|(_, o)| (o - whole).amax() < ANCHOR_FRACTION).count();
        (agreeing as f64 > ANCHORS_AGREE * self.offsets.len() as f64).then_some((whole.x as i32, whole.y as i32))
    }
}

/// Mean of opposite sides of a box.
fn sides(found: &CellBox) -> (Vector2<f64>, Vector2<f64>) {
    let [a, b, c, d] = found.corners;
    ((b - a + c - d) * 0.5, (d - a + c - b) * 0.5)
}
