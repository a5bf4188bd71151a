//! What repeats in its own way is taken out: a second net, its lattice seen through the meshes of the first.

use std::sync::Arc;

use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

use super::cell::{CELL, SIDE};

/// Waves are cut down to this many times the median of those of about their length and direction. Of noise a fifth are cut a little; a bent lattice's are spread over
/// many that are hardly stronger. At 3 three times as many frames with a net behind are in doubt, and at 0.7 noise is raised so far that names slip.
const STRONG: f32 = 1.5;

/// Cuts strong waves in the picture laid out cell by cell. Owns its buffers.
pub(super) struct SecondLattice {
    columns: usize,
    rows: usize,
    /// The picture is real: of the other half of the waves each is the conjugate of one of these.
    along_rows: (Arc<dyn RealToComplex<f32>>, Arc<dyn ComplexToReal<f32>>),
    /// Forth and back.
    along_columns: [Arc<dyn Fft<f32>>; 2],
    picture: Vec<f32>,
    row: Vec<Complex32>,
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
        let (width, height) = (columns * SIDE, rows * SIDE);
        let (mut real, mut complex) = (RealFftPlanner::new(), FftPlanner::new());
        let along_rows = (real.plan_fft_forward(width), real.plan_fft_inverse(width));
        let along_columns = [complex.plan_fft_forward(height), complex.plan_fft_inverse(height)];
        let scratch = along_columns.iter().map(|f| f.get_inplace_scratch_len());
        let scratch =
            scratch.chain([along_rows.0.get_scratch_len(), along_rows.1.get_scratch_len()]).max().unwrap_or(0);
        let (zero, waves) = (Complex32::new(0.0, 0.0), width / 2 + 1);
        Self {
            columns,
            rows,
            along_rows,
            along_columns,
            picture: vec![0.0; width * height],
            row: vec![zero; waves],
            by_columns: vec![zero; waves * height],
            scratch: vec![zero; scratch],
            sorted: Vec::with_capacity(columns * rows),
        }
    }

    /// Takes strong waves out of the cells that take part; of the others nothing is known.
    pub(super) fn remove(&mut self, patches: &mut [[f32; CELL]], valid: &[bool]) {
        let (width, height, columns) = (self.columns * SIDE, self.rows * SIDE, self.columns);
        let place = |k: usize, v: usize| (k / columns * SIDE + v) * width + k % columns * SIDE;
        for (k, (patch, valid)) in patches.iter().zip(valid).enumerate() {
            for (v, row) in patch.as_chunks::<SIDE>().0.iter().enumerate() {
                let out = &mut self.picture[place(k, v)..][..SIDE];
                if *valid { out.copy_from_slice(row) } else { out.fill(0.0) }
            }
        }
        // Lengths are those that were planned for, and what is no picture's spectrum by a rounding error is taken for one.
        for (y, pixels) in self.picture.chunks_exact_mut(width).enumerate() {
            let _ = self.along_rows.0.process_with_scratch(pixels, &mut self.row, &mut self.scratch);
            self.by_columns[y..].iter_mut().step_by(height).zip(&self.row).for_each(|(to, from)| *to = *from);
        }
        self.along_columns[0].process_with_scratch(&mut self.by_columns, &mut self.scratch);
        self.cut(height);
        self.along_columns[1].process_with_scratch(&mut self.by_columns, &mut self.scratch);
        for (y, pixels) in self.picture.chunks_exact_mut(width).enumerate() {
            self.row.iter_mut().zip(self.by_columns[y..].iter().step_by(height)).for_each(|(to, from)| *to = *from);
            let _ = self.along_rows.1.process_with_scratch(&mut self.row, pixels, &mut self.scratch);
        }
        let scale = 1.0 / (width * height) as f32;
        for (k, (patch, valid)) in patches.iter_mut().zip(valid).enumerate() {
            let scale = if *valid { scale } else { 0.0 };
            for (v, row) in patch.as_chunks_mut::<SIDE>().0.iter_mut().enumerate() {
                row.iter_mut().zip(&self.picture[place(k, v)..][..SIDE]).for_each(|(x, w)| *x = scale * w);
            }
        }
    }

    /// In each square of one cycle a cell, down to so many times the median.
    fn cut(&mut self, height: usize) {
        let (columns, rows) = (self.columns, self.rows);
        for square in 0..CELL / 2 {
            let (a, b) = (square / SIDE * columns, square % SIDE * rows);
            let waves = &mut self.by_columns[a * height..][..columns * height];
            self.sorted.clear();
            for column in waves.chunks_exact(height) {
                self.sorted.extend(column[b..][..rows].iter().map(|wave| wave.norm_sqr()));
            }
            let middle = self.sorted.len() / 2;
            let most = STRONG * STRONG * *self.sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
            for column in waves.chunks_exact_mut(height) {
                for wave in &mut column[b..][..rows] {
                    let power = wave.norm_sqr();
                    if power > most {
                        *wave *= (most / power).sqrt();
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vote::cell::dot;

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
