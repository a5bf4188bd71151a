//! All cells laid on top of each other: what the average cell looks like. Two families of twine make it a sum of a function of the first
//! coordinate and one of the second (but for the knots); bricks, scales, honeycombs and other lattices that are no net do not.
//!
//! The average is taken as a Fourier series over six cells by six, summed over the picture's own pixels: cells that are a whole number of
//! pixels wide show only a few phases, and bins that stay empty would look like cells that differ. Six are two by three: a lattice of
//! which only every second, third or fourth line exists shows in waves longer than a cell.

use std::sync::Arc;

use realfft::{RealFftPlanner, RealToComplex};
use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner};

use net_image::widely;

use crate::lock::lockin::Measurement;
use crate::numeric::wrap;
use crate::picture::view::{BLOCK, Level, TileGrid};
use crate::sheet::map::{PhaseMap, Plane};

/// Cells folded side by side.
const CELLS: usize = 6;
/// Bins along them.
const WIDE: usize = 16 * CELLS;
/// Highest harmonic of the cell.
const HARMONICS: usize = 3;
/// The same in units of the wave as long as all the cells.
const ORDERS: usize = CELLS * HARMONICS;

/// The average cell in numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Fold {
    /// Share of its power in waves along one family's coordinate alone.
    pub separable: f64,
    /// Power along the weaker family over that along the stronger.
    pub balance: f64,
    /// Share of the power in waves two or three cells long and their harmonics: bricks, and lattices of which only every second or third
    /// line exists.
    pub unlike: f64,
    /// Power over that of noise.
    pub snr: f64,
}

/// Sums over two halves of the picture, kept between pictures, and the transform of them.
pub(crate) struct Folder {
    /// Two halves, the second coordinate runs fastest: brightness and number of pixels.
    sums: Vec<[f32; 2]>,
    second: Arc<dyn RealToComplex<f64>>,
    first: Arc<dyn Fft<f64>>,
    line: Vec<f64>,
    half: Vec<Complex64>,
    scratch: Vec<Complex64>,
    /// Coefficients: half, order along the second coordinate, along the first.
    waves: Vec<Complex64>,
}

impl Default for Folder {
    fn default() -> Self {
        let second = RealFftPlanner::new().plan_fft_forward(WIDE);
        let first = FftPlanner::new().plan_fft_forward(WIDE);
        Self {
            sums: Vec::new(),
            line: vec![0.0; WIDE],
            half: second.make_output_vec(),
            scratch: vec![Complex64::default(); second.get_scratch_len().max(first.get_inplace_scratch_len())],
            waves: vec![Complex64::default(); 2 * (ORDERS + 1) * WIDE],
            second,
            first,
        }
    }
}

impl std::fmt::Debug for Folder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Folder")
    }
}

impl Folder {
    /// Folds the high-passed picture of a level. Two random halves of it are folded apart and only what they have in common counts, so
    /// noise adds nothing on average. Only tiles count in which the lattice is, of a grid and the measurements over it: fish repeat with no
    /// cell, but they would add to every wave. `cell`: its length on the axis, px of the level; waves beyond the pixels' own limit are left
    /// out.
    pub(crate) fn fold(
        &mut self,
        level: &Level,
        map: &PhaseMap,
        gain: f32,
        grid: &TileGrid,
        measurements: &[Measurement],
        cell: f64,
    ) -> Fold {
        self.sums.clear();
        self.sums.resize(2 * WIDE * WIDE, [0.0; 2]);
        gather(&mut self.sums, level, map, gain, grid, measurements);
        let mut total = [[0.0; 2]; 2];
        for (total, sums) in total.iter_mut().zip(self.sums.chunks_exact(WIDE * WIDE)) {
            for sum in sums {
                total[0] += f64::from(sum[0]);
                total[1] += f64::from(sum[1]);
            }
        }
        if total[0][1] == 0.0 || total[1][1] == 0.0 {
            return Fold::default();
        }
        self.transform(total);
        self.summary(((0.5 * CELLS as f64 * cell).ceil() as usize).saturating_sub(1).clamp(CELLS, ORDERS))
    }

    /// Fourier sums of brightness less its mean, per pixel.
    fn transform(&mut self, total: [[f64; 2]; 2]) {
        let halves = self.sums.chunks_exact(WIDE * WIDE).zip(self.waves.chunks_exact_mut((ORDERS + 1) * WIDE));
        for ((sums, waves), [sum, count]) in halves.zip(total) {
            let mean = sum / count;
            for (bin, line) in sums.chunks_exact(WIDE).enumerate() {
                for (out, [s, n]) in self.line.iter_mut().zip(line) {
                    *out = (f64::from(*s) - mean * f64::from(*n)) / count;
                }
                // The lengths come from the plan itself, so this cannot fail.
                let done = self.second.process_with_scratch(&mut self.line, &mut self.half, &mut self.scratch);
                debug_assert!(done.is_ok());
                for (waves, z) in waves.chunks_exact_mut(WIDE).zip(&self.half) {
                    waves[bin] = *z;
                }
            }
            waves.chunks_exact_mut(WIDE).for_each(|w| self.first.process_with_scratch(w, &mut self.scratch));
        }
    }

    /// Coefficient of a wave: order along the first coordinate (any sign), along the second (0 and up).
    fn coefficient(&self, half: usize, first: isize, second: usize) -> Complex64 {
        self.waves[(half * (ORDERS + 1) + second) * WIDE + first.rem_euclid(WIDE as isize) as usize]
    }

    /// From all orders up to `highest`.
    fn summary(&self, highest: usize) -> Fold {
        let (mut along, mut repeats, mut differs, mut noise) = ([0.0f64; 2], 0.0, [[0.0f64; 2]; 3], 0.0);
        for second in 0..=highest {
            let least = if second == 0 { 1 } else { -(highest as isize) };
            for first in least..=highest as isize {
                let (a, b) = (self.coefficient(0, first, second), self.coefficient(1, first, second));
                let common = a.re * b.re + a.im * b.im;
                // Steps of two or three along both: periods of three or two cells.
                let coarse = |step: usize| first.unsigned_abs().is_multiple_of(step) && second.is_multiple_of(step);
                let kind = match (coarse(2), coarse(3)) {
                    (true, true) => None,
                    (true, false) => Some(0),
                    (false, true) => Some(1),
                    (false, false) => Some(2),
                };
                if let Some(kind) = kind {
                    differs[kind][0] += common;
                    differs[kind][1] += 1.0;
                    continue;
                }
                repeats += common;
                noise += 0.25 * (a - b).norm_sqr();
                if second == 0 {
                    along[0] += common;
                } else if first == 0 {
                    along[1] += common;
                }
            }
        }
        if repeats <= 0.0 {
            return Fold::default();
        }
        let [a, b] = along.map(|p| p.max(0.0));
        // Waves six cells long and their harmonics are neither: what is in them leaked, where few cells are in view or fish cover some.
        let leak = (differs[2][0] / f64::max(differs[2][1], 1.0)).max(0.0);
        let unlike = |kind: usize| {
            let d = (differs[kind][0] - leak * differs[kind][1]).max(0.0);
            d / (repeats + d)
        };
        Fold {
            separable: (a + b) / repeats,
            balance: a.min(b) / a.max(b).max(1e-12),
            unlike: unlike(0).max(unlike(1)),
            snr: repeats / noise.max(1e-12),
        }
    }
}

widely! {
    /// Adds what the tiles show in which the lattice is.
    fn gather<'a>(
        sums: &'a mut [[f32; 2]],
        level: &'a Level,
        map: &'a PhaseMap,
        gain: f32,
        grid: &'a TileGrid,
        measurements: &'a [Measurement],
    ) -> () {
        let (bx, by) = level.blocks();
        for y in 0..by {
            let tiles = &measurements[usize::from(grid.row[y]) * grid.nx..][..grid.nx];
            for x in 0..bx {
                if !tiles[usize::from(grid.column[x])].aligned() {
                    continue;
                }
                let Some([p, q]) = map.block(x, y) else { continue };
                let (p, q) = (bins(&p), bins(&q));
                let half = &mut sums[coin(x, y) * WIDE * WIDE..][..WIDE * WIDE];
                for r in 0..BLOCK {
                    let row = &level.thin.row(y * BLOCK + r)[x * BLOCK..][..BLOCK];
                    for (c, i) in row.iter().enumerate() {
                        let k = r * BLOCK + c;
                        let sum = &mut half[p[k] as usize * WIDE + q[k] as usize];
                        sum[0] += (i * gain).clamp(-1.0, 1.0);
                        sum[1] += 1.0;
                    }
                }
            }
        }
    }
}

/// Bins of a block's pixels along one coordinate.
#[inline(always)]
fn bins(plane: &Plane) -> [i32; BLOCK * BLOCK] {
    let mut bins = [0; BLOCK * BLOCK];
    for (k, bin) in bins.iter_mut().enumerate() {
        let (u, v) = ((k % BLOCK) as f32 - 1.5, (k / BLOCK) as f32 - 1.5);
        let turns = wrap((plane.s + plane.du * u + plane.dv * v) * (1.0 / CELLS as f32)) + 0.5;
        *bin = ((turns * WIDE as f32) as i32).min(WIDE as i32 - 1);
    }
    bins
}

/// Which half a block belongs to: without a pattern of its own that could beat with the net's.
fn coin(x: usize, y: usize) -> usize {
    let mut h = (x as u32).wrapping_mul(0x9e37_79b1) ^ (y as u32).wrapping_mul(0x85eb_ca77);
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
    ((h >> 15) & 1) as usize
}
