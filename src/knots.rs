//! Where the lattice really is in a picture: the knots that were measured, and between them.
//!
//! A sheet that misfits a bent net does so in the same places of every picture. Laid out by it, pictures have in common what is wrong with the sheet, and a
//! comparison would see a net that stands still. Laid out by the knots themselves they have only the net in common.

use net_geometry::nalgebra::Vector2;
use net_geometry::{Junction, JunctionState};

/// Nodes each way whose displacement from the sheet stands in for that of a node that was not seen, and how many it takes.
const REACH: i32 = 2;
const FEWEST: usize = 3;
/// The same farther off, where the sheet is as far from all of them: to this many cells, root mean square.
const FAR_REACH: i32 = 6;
const FAR_FEWEST: usize = 6;
const ALIKE_CELLS: f64 = 0.06;
/// Most nodes of a picture, gaps and rim included.
const MAX_NODES: i64 = 1 << 16;

/// The nodes of a frame. Owns its buffers.
#[derive(Debug, Default)]
pub(crate) struct Knots {
    first: (i32, i32),
    columns: i32,
    rows: i32,
    /// Pixels, row by row along the first direction.
    pixels: Vec<Option<Vector2<f64>>>,
    /// How far the seen ones are from the sheet, as far as that was asked.
    shifts: Vec<Shift>,
}

/// A node's distance from the sheet.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Shift {
    /// None: it was not seen, or the sheet does not reach there.
    Unknown,
    /// Seen here; the sheet, which takes its time, was not asked.
    Unasked(Vector2<f64>),
    Known(Vector2<f64>),
}

/// Nodes that there is room for from the start: cells of a hundredth of the picture's width.
const ROOM: usize = 8192;

impl Knots {
    /// Without a node yet.
    pub fn new() -> Self {
        Self { pixels: Vec::with_capacity(ROOM), shifts: Vec::with_capacity(ROOM), ..Self::default() }
    }

    /// No node is known.
    pub fn clear(&mut self) {
        (self.columns, self.rows) = (0, 0);
        self.pixels.clear();
        self.shifts.clear();
    }

    /// From the knots that were seen, and where the sheet has each node.
    pub fn fill(&mut self, junctions: &[Junction], sheet: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>) {
        self.clear();
        let seen = || {
            let measured = junctions.iter().filter(|j| j.state == JunctionState::Seen);
            measured.filter_map(|j| Some((j.index?, j.pixel)))
        };
        let least = seen().fold((i32::MAX, i32::MAX), |l, ((i, j), _)| (l.0.min(i), l.1.min(j)));
        let most = seen().fold((i32::MIN, i32::MIN), |l, ((i, j), _)| (l.0.max(i), l.1.max(j)));
        let span = |low: i32, high: i32| i64::from(high) - i64::from(low) + 1 + 2 * i64::from(REACH);
        let (columns, rows) = (span(least.0, most.0), span(least.1, most.1));
        let fits = |n: i64| (1..=MAX_NODES).contains(&n);
        if !(fits(columns) && fits(rows) && fits(columns * rows)) {
            return;
        }
        self.first = (least.0.saturating_sub(REACH), least.1.saturating_sub(REACH));
        (self.columns, self.rows) = (columns as i32, rows as i32);
        let n = (columns * rows) as usize;
        self.pixels.resize(n, None);
        self.shifts.resize(n, Shift::Unknown);
        for ((i, j), pixel) in seen() {
            if let Some(k) = self.place(i, j) {
                self.pixels[k] = Some(pixel);
                self.shifts[k] = Shift::Unasked(pixel);
            }
        }
        for k in 0..n {
            if self.pixels[k].is_some() {
                continue;
            }
            let name = self.name(k);
            self.pixels[k] =
                self.around(k, REACH, FEWEST, &sheet).map(|(shift, _)| shift).and_then(|s| Some(sheet(name)? + s));
            if self.pixels[k].is_none()
                && let Some((shift, spread)) = self.around(k, FAR_REACH, FAR_FEWEST, &sheet)
                && let (Some(pixel), Some(next)) = (sheet(name), sheet(name + Vector2::x()))
            {
                self.pixels[k] = (spread < ALIKE_CELLS * (next - pixel).norm()).then(|| pixel + shift);
            }
        }
    }

    /// Mean displacement of the seen nodes around a place, and their spread.
    fn around(
        &mut self,
        k: usize,
        reach: i32,
        fewest: usize,
        sheet: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>,
    ) -> Option<(Vector2<f64>, f64)> {
        let (i, j) = (self.first.0 + k as i32 % self.columns, self.first.1 + k as i32 / self.columns);
        let (mut sum, mut squares, mut n) = (Vector2::zeros(), 0.0, 0);
        for b in -reach..=reach {
            for a in -reach..=reach {
                let Some(place) = self.place(i + a, j + b) else { continue };
                if let Shift::Unasked(pixel) = self.shifts[place] {
                    self.shifts[place] = sheet(self.name(place)).map_or(Shift::Unknown, |p| Shift::Known(pixel - p));
                }
                if let Shift::Known(shift) = self.shifts[place] {
                    sum += shift;
                    squares += shift.norm_squared();
                    n += 1;
                }
            }
        }
        let mean = sum / f64::from(n.max(1));
        let spread = (squares / f64::from(n.max(1)) - mean.norm_squared()).max(0.0).sqrt();
        (n as usize >= fewest).then_some((mean, spread))
    }

    /// Moves all names.
    pub fn renumber(&mut self, by: (i32, i32)) {
        self.first = (self.first.0.saturating_add(by.0), self.first.1.saturating_add(by.1));
    }

    fn name(&self, k: usize) -> Vector2<f64> {
        let (i, j) = (k as i32 % self.columns, k as i32 / self.columns);
        Vector2::new(f64::from(self.first.0) + f64::from(i), f64::from(self.first.1) + f64::from(j))
    }

    fn place(&self, i: i32, j: i32) -> Option<usize> {
        let (a, b) = (i.checked_sub(self.first.0)?, j.checked_sub(self.first.1)?);
        ((0..self.columns).contains(&a) && (0..self.rows).contains(&b)).then(|| (b * self.columns + a) as usize)
    }

    /// Pixel of a lattice point, bilinear between its four nodes; `None` where they are not known.
    pub fn pixel(&self, at: Vector2<f64>) -> Option<Vector2<f64>> {
        // The largest of them would hide what is not a number.
        if !at.iter().all(|x| x.abs() < 1e9) || self.pixels.is_empty() {
            return None;
        }
        let (i, j) = (at.x.floor() as i32, at.y.floor() as i32);
        let (x, y) = (at.x - at.x.floor(), at.y - at.y.floor());
        let node = |di: i32, dj: i32, share: f64| {
            // A node that has no share need not be known.
            if share == 0.0 { Some(Vector2::zeros()) } else { Some(self.pixels[self.place(i + di, j + dj)?]? * share) }
        };
        Some(
            node(0, 0, (1.0 - x) * (1.0 - y))?
                + node(1, 0, x * (1.0 - y))?
                + node(0, 1, (1.0 - x) * y)?
                + node(1, 1, x * y)?,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knots_have_the_last_word_and_the_sheet_fills_gaps() {
        // The sheet is off by three pixels everywhere; one knot was not seen, and far away nothing was.
        let sheet = |at: Vector2<f64>| Some(at * 20.0);
        let knot = |k: i32| Junction {
            pixel: Vector2::new(f64::from(k % 4) * 20.0 + 3.0, f64::from(k / 4) * 20.0),
            index: Some((k % 4, k / 4)),
            sigma_px: 0.1,
            state: if k == 5 { JunctionState::Hidden } else { JunctionState::Seen },
        };
        let junctions: Vec<_> = (0..16).map(knot).collect();
        let mut knots = Knots::new();
        knots.fill(&junctions, sheet);
        for at in [Vector2::new(2.0, 2.0), Vector2::new(0.25, 1.5), Vector2::new(1.0, 1.0), Vector2::new(4.0, 2.0)] {
            let expected = at * 20.0 + Vector2::new(3.0, 0.0);
            let found = knots.pixel(at).expect("near seen knots");
            assert!((found - expected).norm() < 1e-9, "{at} {found}");
            knots.renumber((7, -2));
            assert_eq!(knots.pixel(at + Vector2::new(7.0, -2.0)), Some(found));
            knots.renumber((-7, 2));
        }
        assert_eq!(knots.pixel(Vector2::new(30.0, 2.0)), None);
        assert_eq!(knots.pixel(Vector2::new(f64::INFINITY, 2.0)), None);
        assert_eq!(knots.pixel(Vector2::new(f64::NAN, 2.0)), None);
        knots.fill(&[], sheet);
        assert_eq!(knots.pixel(Vector2::zeros()), None);
    }
}
