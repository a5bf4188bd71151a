//! The picture cell by cell, its lattice subtracted.

use nalgebra::Vector2;
use net_image::Pyramid;

use super::cell::{CELL, SIDE, dot, knot};
use super::sample::sample;
use super::second_lattice::SecondLattice;

/// Cells either way whose mean is the lattice.
const NEIGHBOURS: usize = 3;
/// A cell takes part when it shows the lattice this strongly, relative to its neighbours: outside are fish and haze.
const AMPLITUDE: std::ops::Range<f32> = 0.4..2.5;
/// Fewest cells that make a frame.
pub(super) const MIN_CELLS: usize = 12;

/// What does not repeat, cell by cell.
#[derive(Debug, Clone)]
pub(super) struct Cells {
    pub columns: usize,
    pub rows: usize,
    /// Lattice coordinates of the first cell.
    pub corner: (i32, i32),
    /// Per cell `CELL` numbers of unit length in all.
    pub patches: Vec<[f32; CELL]>,
    /// Per cell the brightness of its knot against its neighbours', in deviations.
    pub knots: Vec<f32>,
    /// Which cells take part.
    pub valid: Vec<bool>,
}

impl Cells {
    pub(super) fn new(columns: usize, rows: usize) -> Self {
        let n = columns * rows;
        Self {
            columns,
            rows,
            corner: (0, 0),
            patches: vec![[0.0; CELL]; n],
            knots: vec![0.0; n],
            valid: vec![false; n],
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        !self.valid.contains(&true)
    }

    pub(super) fn clear(&mut self) {
        self.valid.fill(false);
    }

    /// Moves all cells' numbers.
    pub(super) fn renumber(&mut self, by: (i32, i32)) {
        self.corner = (self.corner.0.saturating_add(by.0), self.corner.1.saturating_add(by.1));
    }
}

/// Lays pictures out. Owns its buffers.
#[derive(Debug)]
pub(super) struct Layout {
    columns: usize,
    rows: usize,
    /// Sums over rows of neighbours, then over squares.
    across: Vec<[f32; CELL]>,
    /// How many cells are in each sum.
    counts: Vec<f32>,
    /// The cells as sampled, less their means.
    raw: Vec<[f32; CELL]>,
    deviations: Vec<f32>,
    sorted: Vec<f32>,
    second: SecondLattice,
}

impl Layout {
    pub(super) fn new(columns: usize, rows: usize) -> Self {
        let n = columns * rows;
        Self {
            columns,
            rows,
            across: vec![[0.0; CELL]; n],
            counts: vec![0.0; n],
            raw: vec![[0.0; CELL]; n],
            deviations: vec![0.0; n],
            sorted: Vec::with_capacity(n),
            second: SecondLattice::new(columns, rows),
        }
    }

    /// Fills `cells` from a picture; false when too few cells show a lattice.
    pub(super) fn fill(
        &mut self,
        picture: &Pyramid,
        corner: (i32, i32),
        pixel_from_lattice: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>,
        cells: &mut Cells,
    ) -> bool {
        cells.corner = corner;
        cells.clear();
        let at = |i: f64, j: f64| {
            let p = pixel_from_lattice(Vector2::new(f64::from(corner.0) + i, f64::from(corner.1) + j))?;
            (p.x.is_finite() && p.y.is_finite()).then_some(p)
        };
        // The level at which a sample of the cell nearest to the middle that can be laid out is about a pixel.
        let (columns, rows) = (self.columns as i32, self.rows as i32);
        let sides = |k: i32| {
            let (i, j) = (f64::from(k % columns), f64::from(k / columns));
            let (o, a, b) = (at(i, j)?, at(i + 1.0, j)?, at(i, j + 1.0)?);
            Some((
                (2 * (k % columns) - columns).pow(2) + (2 * (k / columns) - rows).pow(2),
                (a - o).norm().min((b - o).norm()),
            ))
        };
        let nearest = (0..columns * rows).filter_map(sides).min_by_key(|(from_middle, _)| *from_middle);
        let Some((_, cell_px)) = nearest else { return false };
        let Some(highest) = picture.len().checked_sub(1) else { return false };
        let level = (cell_px / SIDE as f64).log2().round().clamp(0.0, highest as f64) as usize;
        let Some(view) = picture.level(level) else { return false };
        let scale = f64::from(1u32 << level);
        for (k, (raw, valid)) in self.raw.iter_mut().zip(&mut cells.valid).enumerate() {
            let (i, j) = ((k % self.columns) as f64, (k / self.columns) as f64);
            // A cell is half a mesh either way round its knot.
            let place = |a: usize, b: usize| {
                at(i + 0.5 * (a as f64 - 1.0), j + 0.5 * (b as f64 - 1.0)).map(|pixel| pixel / scale)
            };
            *valid = sample(view, place, raw).is_some();
            let mean = raw.iter().sum::<f32>() / CELL as f32;
            raw.iter_mut().for_each(|x| *x = if *valid { *x - mean } else { 0.0 });
        }
        self.neighbours(&cells.valid);
        self.subtract_lattice(cells);
        cells.valid.iter().filter(|&&v| v).count() >= MIN_CELLS
    }

    /// The mean cell of the neighbourhood of each, into `across`.
    fn neighbours(&mut self, valid: &[bool]) {
        let (columns, rows) = (self.columns, self.rows);
        // Sums along rows into `across`, counts beside.
        for k in 0..columns * rows {
            let (i, j) = (k % columns, k / columns);
            let mut sum = [0.0f32; CELL];
            let mut count = 0.0;
            for i in i.saturating_sub(NEIGHBOURS)..=(i + NEIGHBOURS).min(columns - 1) {
                if valid[j * columns + i] {
                    count += 1.0;
                    sum.iter_mut().zip(&self.raw[j * columns + i]).for_each(|(s, x)| *s += x);
                }
            }
            (self.across[k], self.counts[k]) = (sum, count);
        }
    }

    /// Subtracts each cell's share of its neighbourhood's mean cell; normalises what is left.
    fn subtract_lattice(&mut self, cells: &mut Cells) {
        let (columns, rows) = (self.columns, self.rows);
        for k in 0..columns * rows {
            if !cells.valid[k] {
                continue;
            }
            let (i, j) = (k % columns, k / columns);
            let mut mean = [0.0f32; CELL];
            let mut count = 0.0;
            for j in j.saturating_sub(NEIGHBOURS)..=(j + NEIGHBOURS).min(rows - 1) {
                count += self.counts[j * columns + i];
                mean.iter_mut().zip(&self.across[j * columns + i]).for_each(|(s, x)| *s += x);
            }
            mean.iter_mut().for_each(|x| *x /= f32::max(count, 1.0));
            let amplitude = dot(&self.raw[k], &mean) / (dot(&mean, &mean) + 1e-9);
            let patch = &mut cells.patches[k];
            let share = amplitude.clamp(0.0, 3.0);
            patch.iter_mut().zip(self.raw[k].iter().zip(&mean)).for_each(|(p, (x, m))| *p = x - share * m);
            let own = patch.iter().sum::<f32>() / CELL as f32;
            patch.iter_mut().for_each(|x| *x -= own);
            self.deviations[k] = (dot(patch, patch) / CELL as f32).sqrt();
            cells.knots[k] = knot(&self.raw[k]) - knot(&mean);
            cells.valid[k] = AMPLITUDE.contains(&amplitude);
        }
        let of = |values: &[f32], sorted: &mut Vec<f32>| {
            sorted.clear();
            sorted.extend(values.iter().zip(&cells.valid).filter(|(_, v)| **v).map(|(x, _)| x.abs()));
            let middle = sorted.len() / 2;
            if sorted.is_empty() { 1.0 } else { sorted.select_nth_unstable_by(middle, f32::total_cmp).1.max(1e-6) }
        };
        let typical = of(&self.deviations, &mut self.sorted);
        let spread = 1.4826 * of(&cells.knots, &mut self.sorted);
        for k in (0..columns * rows).filter(|&k| cells.valid[k]) {
            cells.knots[k] = (cells.knots[k] / spread).clamp(-4.0, 4.0);
            let patch = &mut cells.patches[k];
            // Outliers are cut, and then every cell has one voice.
            patch.iter_mut().for_each(|x| *x = (*x / typical).clamp(-3.0, 3.0));
        }
        self.second.remove(&mut cells.patches, &cells.valid);
        for k in (0..columns * rows).filter(|&k| cells.valid[k]) {
            let patch = &mut cells.patches[k];
            let norm = dot(patch, patch).sqrt().max(1e-6);
            patch.iter_mut().for_each(|x| *x /= norm);
        }
    }
}
