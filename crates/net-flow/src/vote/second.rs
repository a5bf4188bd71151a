//! What repeats in its own way is taken out: a second net, its lattice seen through the meshes of the first.

use std::sync::Arc;

use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

use super::cells::{CELL, SIDE};

/// Waves are cut down to this many times the median of those of about their length and direction. Of noise a fifth are cut a little; a bent lattice's are spread over
/// many that are hardly stronger. At 3 three times as many frames with a net behind are in doubt, and at 0.7 noise is raised so far that names slip.
const STRONG: f32 = 1.5;

/// Cuts strong waves in the picture laid out cell by cell. Owns its buffers.
pub(super) struct SecondLattice {
    columns: usize,
    rows: usize,
    /// Forth and back along the rows, and along the columns.
    along_rows: [Arc<dyn Fft<f32>>; 2],
    along_columns: [Arc<dyn Fft<f32>>; 2],
    by_rows: Vec<Complex32>,
    by_columns: Vec<Complex32>,
    scratch: Vec<Complex32>,
    sorted: Vec<f32>,
}

impl std::fmt::Debug for SecondLattice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "SecondLattice({} x {} cells)", self.columns, self.rows)
    }
}

impl SecondLattice {
    pub(super) fn new(columns: usize, rows: usize) -> Self {
        let mut planner = FftPlanner::new();
        let mut both = |n: usize| [planner.plan_fft_forward(n), planner.plan_fft_inverse(n)];
        let (along_rows, along_columns) = (both(columns * SIDE), both(rows * SIDE));
        let scratch = along_rows.iter().chain(&along_columns).map(|f| f.get_inplace_scratch_len()).max().unwrap_or(0);
        let zero = Complex32::new(0.0, 0.0);
        Self {
            columns,
            rows,
            along_rows,
            along_columns,
            by_rows: vec![zero; columns * rows * CELL],
            by_columns: vec![zero; (columns * SIDE / 2 + 1) * rows * SIDE],
            scratch: vec![zero; scratch],
            sorted: Vec::with_capacity(columns * rows),
        }
    }

    /// Takes strong waves out of the cells that take part; of the others nothing is known.
    pub(super) fn remove(&mut self, patches: &mut [[f32; CELL]], valid: &[bool]) {
        let (width, height) = (self.columns * SIDE, self.rows * SIDE);
        let columns = self.columns;
        let place = |k: usize, v: usize| (k / columns * SIDE + v) * width + k % columns * SIDE;
        for (k, (patch, valid)) in patches.iter().zip(valid).enumerate() {
            for (v, row) in patch.as_chunks::<SIDE>().0.iter().enumerate() {
                let out = &mut self.by_rows[place(k, v)..][..SIDE];
                out.iter_mut().zip(row).for_each(|(o, x)| *o = Complex32::new(if *valid { *x } else { 0.0 }, 0.0));
            }
        }
        self.along_rows[0].process_with_scratch(&mut self.by_rows, &mut self.scratch);
        // The picture is real: of the other half of the waves each is the conjugate of one of these.
        let half = width / 2 + 1;
        for (x, column) in self.by_columns.chunks_exact_mut(height).enumerate() {
            column.iter_mut().zip(self.by_rows[x..].iter().step_by(width)).for_each(|(to, from)| *to = *from);
        }
        self.along_columns[0].process_with_scratch(&mut self.by_columns, &mut self.scratch);
        self.cut(height);
        self.along_columns[1].process_with_scratch(&mut self.by_columns, &mut self.scratch);
        for (y, row) in self.by_rows.chunks_exact_mut(width).enumerate() {
            let (first, second) = row.split_at_mut(half);
            first.iter_mut().zip(self.by_columns[y..].iter().step_by(height)).for_each(|(to, from)| *to = *from);
            second.iter_mut().rev().zip(&first[1..]).for_each(|(to, from)| *to = from.conj());
        }
        self.along_rows[1].process_with_scratch(&mut self.by_rows, &mut self.scratch);
        let scale = 1.0 / (width * height) as f32;
        for (k, (patch, valid)) in patches.iter_mut().zip(valid).enumerate() {
            for (v, row) in patch.as_chunks_mut::<SIDE>().0.iter_mut().enumerate() {
                let from = &self.by_rows[place(k, v)..][..SIDE];
                row.iter_mut().zip(from).for_each(|(x, w)| *x = if *valid { w.re * scale } else { 0.0 });
            }
        }
    }

    /// In each square of one cycle a cell, down to so many times the median.
    fn cut(&mut self, height: usize) {
        let (columns, rows) = (self.columns, self.rows);
        for square in 0..CELL / 2 {
            let (a, b) = (square / SIDE * columns, square % SIDE * rows);
            let place = |k: usize| (a + k / rows) * height + b + k % rows;
            self.sorted.clear();
            self.sorted.extend((0..columns * rows).map(|k| self.by_columns[place(k)].norm_sqr()));
            let middle = self.sorted.len() / 2;
            let most = STRONG * STRONG * *self.sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
            for k in 0..columns * rows {
                let wave = &mut self.by_columns[place(k)];
                let power = wave.norm_sqr();
                if power > most {
                    *wave *= (most / power).sqrt();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vote::cells::dot;

    const COLUMNS: usize = 18;
    const ROWS: usize = 12;

    /// Growth: noise of its own in every cell, and a lattice of another net as strong as all of it, a wave every 0.7 and 0.63 of a cell.
    fn laid_out(growth: f32, second: f32) -> Vec<[f32; CELL]> {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 23) as f32 - 1.0
        };
        let side = SIDE as f32;
        (0..COLUMNS * ROWS)
            .map(|cell| {
                std::array::from_fn(|k| {
                    let x = (cell % COLUMNS * SIDE + k % SIDE) as f32 / side;
                    let y = (cell / COLUMNS * SIDE + k / SIDE) as f32 / side;
                    let wave = |cycles: f32| (std::f32::consts::TAU * cycles).cos();
                    growth * random() + second * (wave((x + 0.1 * y) / 0.7) + wave((y - 0.1 * x) / 0.63))
                })
            })
            .collect()
    }

    fn alike(a: &[[f32; CELL]], b: &[[f32; CELL]]) -> f32 {
        let sum = |a: &[[f32; CELL]], b: &[[f32; CELL]]| a.iter().zip(b).map(|(a, b)| dot(a, b)).sum::<f32>();
        sum(a, b) / (sum(a, a) * sum(b, b)).sqrt()
    }

    #[test]
    fn a_second_lattice_goes_and_growth_stays() {
        let valid = [true; COLUMNS * ROWS];
        let mut second = SecondLattice::new(COLUMNS, ROWS);
        let growth = laid_out(1.0, 0.0);
        let mut alone = growth.clone();
        second.remove(&mut alone, &valid);
        // What is cut of noise is a few per cent.
        assert!(alike(&alone, &growth) > 0.95, "{}", alike(&alone, &growth));
        let both = laid_out(1.0, 1.0);
        assert!(alike(&both, &growth) < 0.55, "three quarters of the power are the second net's");
        let mut left = both;
        second.remove(&mut left, &valid);
        // Waves that end at the rim of the picture leak a little.
        assert!(alike(&left, &growth) > 0.9, "{}", alike(&left, &growth));
    }

    #[test]
    fn cells_that_take_no_part_stay_out_of_it() {
        let mut valid = [true; COLUMNS * ROWS];
        valid[17] = false;
        let mut patches = laid_out(1.0, 0.0);
        patches[17] = [f32::NAN; CELL];
        SecondLattice::new(COLUMNS, ROWS).remove(&mut patches, &valid);
        assert!(patches[17].iter().all(|x| *x == 0.0) && patches.iter().flatten().all(|x| x.is_finite()));
        let mut nothing = vec![[0.0; CELL]; COLUMNS * ROWS];
        SecondLattice::new(COLUMNS, ROWS).remove(&mut nothing, &[false; COLUMNS * ROWS]);
        assert!(nothing.iter().flatten().all(|x| *x == 0.0));
    }
}
