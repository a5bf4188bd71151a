//! Level of the water behind a mesh, from the openings of the meshes around it.

use std::collections::BTreeSet;

use net_geometry::nalgebra::{Matrix6, Vector6};

use crate::tile::PATCH;

/// Cells to each side over which water and twine are compared.
const RADIUS: i32 = 4;
/// Terms of the sheet: 1, x, y, x², xy, y², cells off the middle in parts of the radius.
const TERMS: usize = 6;
/// Rounds of reweighting: towards least absolute differences, and then, from there, such that what is far off hardly counts.
const ROUNDS: usize = 8;
const ABSOLUTE: usize = 5;
/// Grey levels below which differences are all alike, in either.
const FINE: f64 = 0.25;
const UNEVEN: f64 = 1.0;
/// What keeps slope and bend at zero where the cells around do not tell them, as parts of one look at each cell.
const STIFF: [f64; TERMS] = [0.0, 0.003, 0.003, 0.01, 0.01, 0.01];
type Terms = Vector6<f64>;
/// No cell here.
const NONE: u32 = u32::MAX;

/// The water's brightness in and around a cell.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Water {
    terms: [f32; TERMS],
}

impl Water {
    /// Level `x`, `y` cells off the middle.
    pub fn level(&self, x: f32, y: f32) -> f32 {
        let (x, y) = (x / RADIUS as f32, y / RADIUS as f32);
        let [a, b, c, d, e, f] = self.terms;
        a + x * (b + d * x + e * y) + y * (c + f * y)
    }

    /// Makes it brighter all over.
    pub fn raise(&mut self, by: f32) {
        self.terms[0] += by;
    }

    /// Level behind sample `(x, y)` of the cell.
    pub fn at(&self, x: usize, y: usize) -> f32 {
        let off = |k: usize| (k as f32 + 0.5) / PATCH as f32 - 0.5;
        self.level(off(x), off(y))
    }
}

/// The cells in view by their places.
#[derive(Debug, Default)]
pub(crate) struct Around {
    least: (i32, i32),
    most: (i32, i32),
    columns: i32,
    /// Number of the cell at a place of the span, less its corner.
    grid: Vec<u32>,
    hidden: Vec<bool>,
    values: Vec<f32>,
    looks: Vec<(Terms, f64)>,
}

impl Around {
    /// Takes the cells; those that something hides have no say.
    pub fn index(&mut self, seen: &[((i32, i32), f64, f64)], hidden: &BTreeSet<(i32, i32)>) {
        self.least = seen.iter().fold((i32::MAX, i32::MAX), |l, (c, ..)| (l.0.min(c.0), l.1.min(c.1)));
        self.most = seen.iter().fold((i32::MIN, i32::MIN), |l, (c, ..)| (l.0.max(c.0), l.1.max(c.1)));
        self.grid.clear();
        self.hidden.clear();
        if seen.is_empty() {
            return;
        }
        self.columns = self.most.0 - self.least.0 + 1;
        self.grid.resize((self.columns * (self.most.1 - self.least.1 + 1)) as usize, NONE);
        for (k, (cell, ..)) in seen.iter().enumerate() {
            self.grid[((cell.1 - self.least.1) * self.columns + cell.0 - self.least.0) as usize] = k as u32;
            self.hidden.push(hidden.contains(cell));
        }
    }

    /// Cells around `cell`, it included: steps to them and their numbers; those in plain view, if there is any.
    fn near(&self, cell: (i32, i32)) -> impl Iterator<Item = ((i32, i32), usize)> + '_ {
        let all = move || {
            ((cell.1 - RADIUS).max(self.least.1)..=(cell.1 + RADIUS).min(self.most.1)).flat_map(move |j| {
                ((cell.0 - RADIUS).max(self.least.0)..=(cell.0 + RADIUS).min(self.most.0)).filter_map(move |i| {
                    let k = self.grid[((j - self.least.1) * self.columns + i - self.least.0) as usize];
                    (k != NONE).then_some(((i - cell.0, j - cell.1), k as usize))
                })
            })
        };
        let any = all().any(|(_, k)| !self.hidden[k]);
        all().filter(move |&(_, k)| !any || !self.hidden[k])
    }

    /// Median of the cells' values around one.
    pub fn median(&mut self, cell: (i32, i32), of: &[f32]) -> f32 {
        let mut values = std::mem::take(&mut self.values);
        values.clear();
        values.extend(self.near(cell).map(|(_, k)| of[k]));
        let median = crate::patch::quantile(&mut values, 0.5);
        self.values = values;
        median
    }

    /// The water around a cell: the quadric through the levels of the openings, fitted robustly: fish and growth over less than half of them
    /// do not count.
    pub fn sheet(&mut self, cell: (i32, i32), levels: &[f32]) -> Water {
        let start = self.median(cell, levels);
        let mut looks = std::mem::take(&mut self.looks);
        looks.clear();
        looks.extend(self.near(cell).map(|((i, j), k)| {
            let (x, y) = (f64::from(i) / f64::from(RADIUS), f64::from(j) / f64::from(RADIUS));
            (Terms::from([1.0, x, y, x * x, x * y, y * y]), f64::from(levels[k] - start))
        }));
        let mut terms = Terms::zeros();
        for round in 0..ROUNDS {
            let (mut sums, mut right) = (Matrix6::zeros(), Terms::zeros());
            for (of, value) in &looks {
                let off = (value - of.dot(&terms)).abs();
                let weight = match round {
                    0 => 1.0,
                    1..ABSOLUTE => 1.0 / off.max(FINE),
                    _ => 1.0 / (off * off).max(UNEVEN * UNEVEN),
                };
                sums.ger(weight, of, of, 1.0);
                right.axpy(weight * value, of, 1.0);
            }
            let stiff = Terms::from(STIFF) * sums[(0, 0)];
            sums += Matrix6::from_diagonal(&stiff);
            terms = sums.cholesky().map_or(terms, |sums| sums.solve(&right));
        }
        self.looks = looks;
        terms[0] += f64::from(start);
        Water { terms: terms.map(|t| t as f32).into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Levels of a bent field of light, at the corner of the view too, whatever a third of the cells show.
    #[test]
    fn water_is_read_through_growth_from_one_side() {
        let field = |i: i32, j: i32| {
            let (x, y) = (i as f32, j as f32);
            100.0 + 3.0 * x - 2.0 * y + 0.1 * x * x - 0.05 * x * y
        };
        let cells: Vec<((i32, i32), f64, f64)> =
            (0..12).flat_map(|j| (0..14).map(move |i| ((i - 3, j), 20.0, 1.0))).collect();
        let grown = |(i, j): (i32, i32)| (i * 5 + j * 7).rem_euclid(3) == 0;
        let levels: Vec<f32> =
            cells.iter().map(|&(c, ..)| field(c.0, c.1) - if grown(c) { 40.0 } else { 0.0 }).collect();
        let mut around = Around::default();
        around.index(&cells, &BTreeSet::new());
        for cell in [(-3, 0), (10, 11), (3, 5), (-3, 6)] {
            let water = around.sheet(cell, &levels);
            let off = water.level(0.0, 0.0) - field(cell.0, cell.1);
            assert!(off.abs() < 1.0, "{cell:?}: {off}");
        }
        // Fish before more than half have no say where they are known.
        let fish: BTreeSet<_> = cells.iter().map(|c| c.0).filter(|c| c.0 < 4).collect();
        let levels: Vec<f32> =
            cells.iter().map(|&(c, ..)| if fish.contains(&c) { 30.0 } else { field(c.0, c.1) }).collect();
        around.index(&cells, &fish);
        let off = around.sheet((3, 5), &levels).level(0.0, 0.0) - field(3, 5);
        assert!(off.abs() < 1.0, "{off}");
    }

    #[test]
    fn one_cell_or_one_row_is_a_sheet_too() {
        let mut around = Around::default();
        for n in [1, 2, 5] {
            let cells: Vec<_> = (0..n).map(|i| ((i, 7), 20.0, 1.0)).collect();
            around.index(&cells, &BTreeSet::new());
            let levels: Vec<f32> = (0..n).map(|i| 50.0 + 2.0 * i as f32).collect();
            let level = around.sheet((0, 7), &levels).level(0.0, 0.0);
            assert!((level - 50.0).abs() < 2.0, "{n}: {level}");
        }
        around.index(&[], &BTreeSet::new());
    }
}
