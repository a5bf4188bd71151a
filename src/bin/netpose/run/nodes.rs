//! Where the lattice really is in a picture: the knots that were measured, and between them.
//!
//! A sheet that misfits a bent net does so in the same places of every picture. Laid out by it, pictures have in common what is wrong with the sheet, and the vote
//! would see a net that stands still. Laid out by the knots themselves they have only the net in common.

use net_geometry::JunctionState;
use net_geometry::nalgebra::Vector2;
use netpose::Junction;

/// Nodes each way whose displacement from the sheet stands in for that of a node that was not seen, and how many it takes.
const REACH: i32 = 2;
const FEWEST: usize = 3;
/// Largest span of nodes along either direction.
const MAX_SPAN: i64 = 1024;

/// The nodes of a frame.
#[derive(Debug, Default)]
pub struct Nodes {
    first: (i32, i32),
    columns: i32,
    rows: i32,
    /// Pixels, row by row along the first direction.
    pixels: Vec<Option<Vector2<f64>>>,
}

impl Nodes {
    /// From the knots that were seen, and where the sheet has each node.
    pub fn new(junctions: &[Junction], sheet: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>) -> Self {
        let seen = || {
            let measured = junctions.iter().filter(|j| j.state == JunctionState::Seen);
            measured.filter_map(|j| Some((j.index?, j.pixel)))
        };
        let least = seen().fold((i32::MAX, i32::MAX), |l, ((i, j), _)| (l.0.min(i), l.1.min(j)));
        let most = seen().fold((i32::MIN, i32::MIN), |l, ((i, j), _)| (l.0.max(i), l.1.max(j)));
        let span = |low: i32, high: i32| i64::from(high) - i64::from(low) + 1 + 2 * i64::from(REACH);
        let (columns, rows) = (span(least.0, most.0), span(least.1, most.1));
        if !(1..=MAX_SPAN).contains(&columns) || !(1..=MAX_SPAN).contains(&rows) {
            return Self::default();
        }
        let first = (least.0.saturating_sub(REACH), least.1.saturating_sub(REACH));
        let mut nodes = Self { first, columns: columns as i32, rows: rows as i32, pixels: Vec::new() };
        let n = (columns * rows) as usize;
        let name = |k: usize| {
            Vector2::new(
                f64::from(first.0) + (k % columns as usize) as f64,
                f64::from(first.1) + (k / columns as usize) as f64,
            )
        };
        nodes.pixels.resize(n, None);
        let mut shifts: Vec<Option<Vector2<f64>>> = vec![None; n];
        for ((i, j), pixel) in seen() {
            if let Some(k) = nodes.place(i, j) {
                nodes.pixels[k] = Some(pixel);
                shifts[k] = sheet(name(k)).map(|p| pixel - p);
            }
        }
        for k in 0..n {
            if nodes.pixels[k].is_some() {
                continue;
            }
            let (i, j) = (first.0 + k as i32 % nodes.columns, first.1 + k as i32 / nodes.columns);
            let around = (-REACH..=REACH).flat_map(|b| (-REACH..=REACH).map(move |a| (i + a, j + b)));
            let near: Vec<_> = around.filter_map(|(i, j)| shifts[nodes.place(i, j)?]).collect();
            if near.len() >= FEWEST {
                let mean = near.iter().sum::<Vector2<f64>>() / near.len() as f64;
                nodes.pixels[k] = sheet(name(k)).map(|p| p + mean);
            }
        }
        nodes
    }

    fn place(&self, i: i32, j: i32) -> Option<usize> {
        let (a, b) = (i.checked_sub(self.first.0)?, j.checked_sub(self.first.1)?);
        ((0..self.columns).contains(&a) && (0..self.rows).contains(&b)).then(|| (b * self.columns + a) as usize)
    }

    /// Pixel of a lattice point, bilinear between its four nodes; `None` where they are not known.
    pub fn pixel(&self, at: Vector2<f64>) -> Option<Vector2<f64>> {
        if at.amax() >= 1e9 || self.pixels.is_empty() {
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
        let nodes = Nodes::new(&junctions, sheet);
        for at in [Vector2::new(2.0, 2.0), Vector2::new(0.25, 1.5), Vector2::new(1.0, 1.0), Vector2::new(4.0, 2.0)] {
            let expected = at * 20.0 + Vector2::new(3.0, 0.0);
            let found = nodes.pixel(at).expect("near seen knots");
            assert!((found - expected).norm() < 1e-9, "{at} {found}");
        }
        assert_eq!(nodes.pixel(Vector2::new(30.0, 2.0)), None);
        assert_eq!(nodes.pixel(Vector2::new(f64::INFINITY, 2.0)), None);
        assert_eq!(Nodes::new(&[], sheet).pixel(Vector2::zeros()), None);
    }
}
