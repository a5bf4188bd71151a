//! Which twines are broken, and what is left of them.

use crate::random::{Addressed, Stream};
use crate::scene::Net;

/// A piece of twine from knot `(i, j)` to the next one along the first (`family` 0) or second (1) mesh direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Edge {
    pub(crate) i: i32,
    pub(crate) j: i32,
    pub(crate) family: usize,
}

impl Edge {
    /// The knots it joins.
    pub(crate) fn ends(self) -> [(i32, i32); 2] {
        let next = if self.family == 0 { (self.i + 1, self.j) } else { (self.i, self.j + 1) };
        [(self.i, self.j), next]
    }

    /// A number of its own for stream `stream`.
    pub(crate) fn address(self, k: i64) -> (i64, i64, i64) {
        (i64::from(self.i), i64::from(self.j), self.family as i64 + 2 * k)
    }
}

/// The breaks of one net.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Damage<'a> {
    net: &'a Net,
    single: Addressed,
    stub: Addressed,
}

impl<'a> Damage<'a> {
    pub(crate) fn of(net: &'a Net) -> Self {
        let single = Addressed::new(net.seed, Stream::Broken);
        Self { net, single, stub: Addressed::new(net.seed, Stream::Stub) }
    }

    /// Whether any twine is broken.
    pub(crate) fn any(&self) -> bool {
        self.net.broken > 0.0 || !self.net.holes.is_empty()
    }

    /// Whether this piece is broken.
    #[inline]
    pub(crate) fn broken(&self, edge: Edge) -> bool {
        if !self.any() {
            return false;
        }
        let half = |family: usize| if edge.family == family { 0.5 } else { 0.0 };
        let (i, j) = (f64::from(edge.i) + half(0), f64::from(edge.j) + half(1));
        let (a, b, c) = edge.address(0);
        self.net.holes.iter().any(|hole| hole.contains(i, j)) || self.single.uniform(a, b, c) < self.net.broken
    }

    /// Whether the net has a piece of twine there, broken or not.
    fn made(&self, edge: Edge) -> bool {
        let inside = |at: i32, ends: Option<[i32; 2]>| ends.is_none_or(|[first, last]| (first..=last).contains(&at));
        let (columns, rows) = (self.net.extent.columns(), self.net.extent.rows());
        edge.ends().iter().all(|&(i, j)| inside(i, columns) && inside(j, rows))
    }

    /// Whether all twines of knot `(i, j)` are broken.
    pub(crate) fn gone(&self, i: i32, j: i32) -> bool {
        if !self.any() {
            return false;
        }
        let around = [(i, j, 0), (i - 1, j, 0), (i, j, 1), (i, j - 1, 1)].map(|(i, j, family)| Edge { i, j, family });
        around.iter().all(|&edge| !self.made(edge) || self.broken(edge))
    }

    /// What is left of a broken piece at its first (`end` 0) or second (1) knot: length as a share of the side, and two numbers
    /// within ±1 for where it dangles. Nothing at a knot that is gone too.
    pub(crate) fn stub(&self, edge: Edge, end: usize) -> Option<(f64, [f64; 2])> {
        let (i, j) = edge.ends()[end];
        if self.gone(i, j) {
            return None;
        }
        let number = |k: i64, low: f64, high: f64| {
            let (a, b, c) = edge.address(end as i64 + 2 * k);
            self.stub.between(low, high, a, b, c)
        };
        Some((number(0, 0.08, 0.4), [number(1, -1.0, 1.0), number(2, -1.0, 1.0)]))
    }
}
