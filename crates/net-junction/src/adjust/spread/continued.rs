//! Where known knots are, and where they lead beyond what was predicted, ring by ring.

use net_geometry::nalgebra::{Matrix6, Matrix6x3, Vector2, Vector3, Vector6};

use crate::adjust::graph::Graph;
use crate::adjust::map::LatticeMap;
use crate::adjust::spread::REACH;

/// Rings of nodes beyond the known ones that one walk may enter: with 5 it takes twice as many walks, with 16 the last rings lie where no twine is.
const RINGS: usize = 10;
/// What is entered anew has cells larger than the smallest by this, for they are only known roughly.
const LARGER: f64 = 1.2;
/// Knots each way that it takes to lead on.
const FEWEST: usize = 5;
/// Scatter of knots, in parts of how much steps of the lattice change from one to the next.
const SCATTER: f64 = 0.6;

/// A node's index, and its pixel and pixels per metre.
type Place = ((i32, i32), Vector3<f64>);

/// A prediction of the known nodes and those around them; nothing else.
#[derive(Debug, Default)]
pub(crate) struct Continued {
    /// In order of index.
    places: Vec<Place>,
    ring: Vec<(i32, i32)>,
    next: Vec<Place>,
    seed: Option<(i32, i32)>,
}

impl Continued {
    /// Takes places of known nodes, in any order, and continues them to the end of a picture of this size. Returns how many nodes are now in the picture that the graph did not have
    /// there.
    pub fn settle(
        &mut self,
        graph: &Graph,
        known: impl Iterator<Item = Place>,
        seed: Option<(i32, i32)>,
        (width, height): (usize, usize),
        cell_min_px: f64,
    ) -> usize {
        self.places.clear();
        self.next.clear();
        self.ring.clear();
        // Room from the first picture on for what others may need: most pictures need none of it.
        let room = (4 * graph.nodes.len()).next_power_of_two();
        self.places.reserve(room);
        self.next.reserve(room);
        self.ring.reserve(room);
        self.places.extend(known);
        self.places.sort_unstable_by_key(|p| p.0);
        let away = |(i, j): (i32, i32)| seed.map(|s| i.abs_diff(s.0).max(j.abs_diff(s.1)));
        self.seed = self.places.iter().map(|p| p.0).min_by_key(|&index| away(index));
        let size = Vector2::new((width - 1) as f64, (height - 1) as f64);
        let inside = |at: &Vector3<f64>| at.x >= 0.0 && at.y >= 0.0 && at.x <= size.x && at.y <= size.y;
        self.next.extend_from_slice(&self.places);
        let mut fresh = 0;
        for _ in 0..RINGS {
            self.ring.clear();
            for ((i, j), _) in self.next.iter().filter(|(_, at)| inside(at)) {
                let around = [(i + 1, *j), (i - 1, *j), (*i, j + 1), (*i, j - 1)];
                self.ring.extend(around.into_iter().filter(|&n| find(&self.places, n).is_none()));
            }
            self.ring.sort_unstable();
            self.ring.dedup();
            self.next.clear();
            for &index in &self.ring {
                let Some((at, cell)) = lead(&self.places, index) else { continue };
                let new = graph.node_at(index).is_none_or(|n| !graph.nodes[n].inside);
                if !new || cell > LARGER * cell_min_px {
                    fresh += usize::from(inside(&at) && new);
                    self.next.push((index, at));
                }
            }
            self.places.extend_from_slice(&self.next);
            self.places.sort_unstable_by_key(|p| p.0);
        }
        fresh
    }

    /// Makes it as smooth as a prediction must be: what a knot is off by is measured again, and must not be believed beforehand.
    pub fn smooth(&mut self) {
        self.next.clear();
        self.next.extend(self.places.iter().map(|&(index, at)| (index, lead(&self.places, index).map_or(at, |l| l.0))));
        self.places.clone_from(&self.next);
    }

    fn at(&self, index: (i32, i32)) -> Option<Vector3<f64>> {
        find(&self.places, index)
    }
}

fn find(places: &[Place], index: (i32, i32)) -> Option<Vector3<f64>> {
    places.binary_search_by_key(&index, |p| p.0).ok().map(|k| places[k].1)
}

/// Where a place and those around it lead, and the distance of parallel twines there, px.
fn lead(places: &[Place], index: (i32, i32)) -> Option<(Vector3<f64>, f64)> {
    let (fit, _) = fit_around(|a, b| find(places, (index.0 + a, index.1 + b)))?;
    let at = fit.row(0).transpose();
    let (a, b) = (fit.row(1).transpose().xy(), fit.row(2).transpose().xy());
    let cell = a.perp(&b).abs() / a.norm().max(b.norm());
    (at.iter().all(|x| x.is_finite()) && at.z > 0.0).then_some((at, cell))
}

/// A polynomial of second degree through what `at` knows some steps aside: rows for the value in the middle, its two slopes and three bends; and through how many.
pub(super) fn fit_around(at: impl Fn(i32, i32) -> Option<Vector3<f64>>) -> Option<(Matrix6x3<f64>, usize)> {
    let (mut normal, mut right, mut count) = (Matrix6::zeros(), Matrix6x3::zeros(), 0);
    for (a, b) in (-REACH..=REACH).flat_map(|a| (-REACH..=REACH).map(move |b| (a, b))) {
        let Some(at) = at(a, b) else { continue };
        let (x, y) = (f64::from(a), f64::from(b));
        let terms = Vector6::new(1.0, x, y, 0.5 * x * x, x * y, 0.5 * y * y);
        let weight = 1.0 / (x * x + y * y).max(1.0);
        normal += terms * terms.transpose() * weight;
        right += terms * at.transpose() * weight;
        count += 1;
    }
    for k in 3..6 {
        normal[(k, k)] += SCATTER.powi(2);
    }
    let solver = (count >= FEWEST).then(|| normal.cholesky()).flatten()?;
    Some((solver.solve(&right), count))
}

impl LatticeMap for Continued {
    fn pixel(&self, i: f64, j: f64) -> Option<Vector2<f64>> {
        self.place(i, j).map(|p| p.0)
    }
    fn pixels_per_metre(&self, i: f64, j: f64) -> Option<f64> {
        self.place(i, j).map(|p| p.1)
    }
    fn place(&self, i: f64, j: f64) -> Option<(Vector2<f64>, f64)> {
        self.at((i.round() as i32, j.round() as i32)).map(|at| (at.xy(), at.z))
    }
    fn seed(&self) -> Option<(i32, i32)> {
        self.seed
    }
}
