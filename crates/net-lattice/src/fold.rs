//! All cells laid on top of each other: what the average cell looks like. Two families of twine make it a sum of a function of the first
//! coordinate and one of the second (but for the knots); bricks, scales, honeycombs and other lattices that are no net do not.
//!
//! The average is taken as a Fourier series over six cells by six, summed over the picture's own pixels: cells that are a whole number of
//! pixels wide show only a few phases, and bins that stay empty would look like cells that differ. Six are two by three: a lattice of
//! which only every second, third or fourth line exists shows in waves longer than a cell.

use crate::lockin::Measurement;
use crate::map::PhaseMap;
use crate::numeric::wrap;
use crate::view::{BLOCK, Level, TileGrid};

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

/// Sums over two halves of the picture, kept between pictures.
#[derive(Debug, Default)]
pub(crate) struct Folder {
    /// Two halves, the second coordinate runs fastest: brightness and number of pixels.
    sums: Vec<[f64; 2]>,
    /// cos and sin of a turn in `WIDE` steps.
    wave: Vec<[f64; 2]>,
    /// Transform along the second coordinate: half, bin of the first, order.
    rows: Vec<[f64; 2]>,
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
        let (bx, by) = level.blocks();
        const PER_CELL: f32 = (WIDE / CELLS) as f32;
        // Shifted by a whole fold above zero, where truncation is the floor.
        let bin = |s: f32| (s * PER_CELL + (2 * WIDE) as f32) as u32 as usize % WIDE;
        let near = |s: f32| wrap(s / CELLS as f32) * CELLS as f32;
        let mut total = [[0.0; 2]; 2];
        for y in 0..by {
            let tiles = &measurements[usize::from(grid.row[y]) * grid.nx..][..grid.nx];
            for x in 0..bx {
                if !tiles[usize::from(grid.column[x])].aligned() {
                    continue;
                }
                let Some([p, q]) = map.block(x, y) else { continue };
                let (p0, q0) = (near(p.s), near(q.s));
                let half = coin(x, y);
                let sums = &mut self.sums[half * WIDE * WIDE..][..WIDE * WIDE];
                for r in 0..BLOCK {
                    let row = &level.thin.row(y * BLOCK + r)[x * BLOCK..][..BLOCK];
                    let v = r as f32 - 1.5;
                    for (c, i) in row.iter().enumerate() {
                        let u = c as f32 - 1.5;
                        let k = bin(p0 + p.du * u + p.dv * v) * WIDE + bin(q0 + q.du * u + q.dv * v);
                        let value = f64::from((i * gain).clamp(-1.0, 1.0));
                        sums[k][0] += value;
                        sums[k][1] += 1.0;
                        total[half][0] += value;
                        total[half][1] += 1.0;
                    }
                }
            }
        }
        if total[0][1] == 0.0 || total[1][1] == 0.0 {
            return Fold::default();
        }
        self.along_second(total);
        self.summary(((0.5 * CELLS as f64 * cell).ceil() as usize).saturating_sub(1).clamp(CELLS, ORDERS))
    }

    /// Fourier sums along the second coordinate, orders 0 and up, of brightness less its mean, per pixel.
    fn along_second(&mut self, total: [[f64; 2]; 2]) {
        let wave = |k: usize| {
            let (s, c) = (std::f64::consts::TAU * k as f64 / WIDE as f64).sin_cos();
            [c, s]
        };
        if self.wave.is_empty() {
            self.wave.extend((0..WIDE).map(wave));
        }
        self.rows.clear();
        for (half, [sum, count]) in total.into_iter().enumerate() {
            let mean = sum / count;
            for line in self.sums[half * WIDE * WIDE..][..WIDE * WIDE].chunks_exact(WIDE) {
                for order in 0..=ORDERS {
                    let mut z = [0.0; 2];
                    for (k, [s, n]) in line.iter().enumerate() {
                        let w = self.wave[k * order % WIDE];
                        let value = (s - mean * n) / count;
                        z[0] += value * w[0];
                        z[1] -= value * w[1];
                    }
                    self.rows.push(z);
                }
            }
        }
    }

    /// Coefficient of a wave: order along the first coordinate (any sign), along the second (0 and up).
    fn coefficient(&self, half: usize, first: isize, second: usize) -> [f64; 2] {
        let mut z = [0.0; 2];
        for k in 0..WIDE {
            let r = self.rows[(half * WIDE + k) * (ORDERS + 1) + second];
            let w = self.wave[(k as isize * first).rem_euclid(WIDE as isize) as usize];
            z[0] += r[0] * w[0] + r[1] * w[1];
            z[1] += r[1] * w[0] - r[0] * w[1];
        }
        z
    }

    /// From all orders up to `highest`.
    fn summary(&self, highest: usize) -> Fold {
        let (mut along, mut repeats, mut differs, mut noise) = ([0.0f64; 2], 0.0, [[0.0f64; 2]; 3], 0.0);
        for second in 0..=highest {
            let least = if second == 0 { 1 } else { -(highest as isize) };
            for first in least..=highest as isize {
                let (a, b) = (self.coefficient(0, first, second), self.coefficient(1, first, second));
                let common = a[0] * b[0] + a[1] * b[1];
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
                noise += 0.25 * ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2));
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

/// Which half a block belongs to: without a pattern of its own that could beat with the net's.
fn coin(x: usize, y: usize) -> usize {
    let mut h = (x as u32).wrapping_mul(0x9e37_79b1) ^ (y as u32).wrapping_mul(0x85eb_ca77);
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
    ((h >> 15) & 1) as usize
}
