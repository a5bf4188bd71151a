//! The lattice followed outwards from where it is sure, tile by tile. A sheet that bends is fitted by a polynomial, and one that only the middle of the
//! picture holds curls up outside: there the waves it predicts are not those that are there, and nothing is measured. What the neighbours of a tile
//! foretell is near enough to be measured, cycles are counted on the way (quality-guided phase unwrapping: Ghiglia and Pritt 1998), and a sheet fitted
//! to all of it does not curl.

use crate::lock::comb::Comb;
use crate::lock::demodulate::{Columns, TileSum};
use crate::lock::lockin::Measurement;
use crate::numeric::Normal;
use crate::picture::view::{BLOCK, Level, TileGrid};
use crate::sheet::map::{LANES, Strip};

/// Tiles to each side of one whose coordinates foretell its own.
const REACH: usize = 3;
/// Standard deviation of how much less they say the farther off they are, tiles.
const SOON: f64 = 1.6;
/// Known tiles from which a line, and a parabola, is drawn through them.
const LINE: usize = 4;
const PARABOLA: usize = 9;
/// Known tiles that touch one before it is looked at.
const TOUCHING: usize = 2;
/// Largest difference, cells, between what is foretold and what is found.
const SURPRISE: f64 = 0.2;
/// Power of both waves over that of noise from which a tile takes part: the clearest first, then, where those lead no farther, others.
const CLEAR: [f64; 3] = [12.0, 8.0, 5.0];
/// Share of the neighbours that must agree with a sheet where it is sure.
const SURE: f64 = 0.7;

/// Lattice coordinates measured in a tile.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Known {
    pub s: [f64; 2],
    pub snr: [f64; 2],
}

/// Coordinates about a tile, quadratic in the distance, tiles: value, along u, along v, u², uv, v².
type Local = [f64; 6];

/// Tiles known so far.
#[derive(Debug, Default)]
pub(crate) struct Spread {
    pub known: Vec<Option<Known>>,
    fresh: Vec<(usize, Known)>,
    queue: Vec<usize>,
    together: Vec<bool>,
}

impl Spread {
    /// Starts with the largest patch of tiles that agree with the sheet they were measured by, as their neighbours do. Returns its size.
    pub(crate) fn start(&mut self, measurements: &[Measurement], grid: &TileGrid) -> usize {
        let (nx, ny) = (grid.nx, grid.ny);
        let sure = |t: usize| {
            let (mut agree, mut all) = (0, 0);
            for n in around(t, 1, nx, ny).filter(|n| measurements[*n].good) {
                all += 1;
                agree += usize::from(measurements[n].aligned());
            }
            measurements[t].aligned() && all > TOUCHING && agree as f64 > SURE * all as f64
        };
        self.known.clear();
        self.known.resize(nx * ny, None);
        self.together.clear();
        self.together.resize(nx * ny, false);
        let mut largest = 0;
        for seed in 0..nx * ny {
            if self.together[seed] || !sure(seed) {
                continue;
            }
            self.queue.clear();
            self.queue.push(seed);
            self.together[seed] = true;
            let mut next = 0;
            while let Some(&t) = self.queue.get(next) {
                next += 1;
                for n in around(t, 1, nx, ny) {
                    if !self.together[n] && sure(n) {
                        self.together[n] = true;
                        self.queue.push(n);
                    }
                }
            }
            if self.queue.len() > largest {
                largest = self.queue.len();
                self.known.iter_mut().for_each(|k| *k = None);
                for &t in &self.queue {
                    let m = &measurements[t];
                    let s = std::array::from_fn(|f| m.predicted.s[f] + m.phase[f] / std::f64::consts::TAU);
                    self.known[t] = Some(Known { s, snr: m.snr });
                }
            }
        }
        largest
    }

    /// Measures the tiles that touch known ones where those foretell them, until none is new. Returns how many are known.
    pub(crate) fn grow(&mut self, level: &Level, grid: &TileGrid, comb: &Comb, gain: f32) -> usize {
        let (nx, ny) = (grid.nx, grid.ny);
        let per_px = spacing(grid);
        let mut clear = CLEAR.into_iter();
        let mut least = CLEAR[0];
        loop {
            self.fresh.clear();
            for t in (0..nx * ny).filter(|t| self.known[*t].is_none() && grid.sites[*t].valid) {
                if around(t, 1, nx, ny).filter(|n| self.known[*n].is_some()).count() < TOUCHING {
                    continue;
                }
                let Some(local) = self.foretold(t, grid) else { continue };
                let sum = demodulate(level, grid, t, gain, &local);
                if sum.count < 0.5 * grid.area {
                    continue;
                }
                let found = |f: usize| {
                    let k = (local[f][1] / per_px[0]).hypot(local[f][2] / per_px[1]) * level.scale;
                    comb.peak(f, &sum, k)
                };
                let ((off0, snr0), (off1, snr1)) = (found(0), found(1));
                if snr0.min(snr1) > least && off0.abs().max(off1.abs()) < SURPRISE {
                    let s = [local[0][0] + off0, local[1][0] + off1];
                    self.fresh.push((t, Known { s, snr: [snr0, snr1] }));
                }
            }
            if self.fresh.is_empty() {
                let Some(next) = clear.next() else { return self.known.iter().flatten().count() };
                least = next;
            }
            for (t, k) in &self.fresh {
                self.known[*t] = Some(*k);
            }
        }
    }

    /// Both coordinates about a tile, from the known ones within reach.
    fn foretold(&self, tile: usize, grid: &TileGrid) -> Option<[Local; 2]> {
        let per_px = spacing(grid);
        let near = || around(tile, REACH, grid.nx, grid.ny).filter_map(|n| Some((n, self.known[n]?)));
        let count = near().count();
        let terms = if count >= PARABOLA { 6 } else { 3 };
        if count < LINE {
            return None;
        }
        let at = grid.sites[tile].pixel;
        let mut local = [[0.0; 6]; 2];
        for (f, local) in local.iter_mut().enumerate() {
            let mut normal = Normal::<6>::new();
            for (n, known) in near() {
                let p = grid.sites[n].pixel;
                let (u, v) = ((p[0] - at[0]) / per_px[0], (p[1] - at[1]) / per_px[1]);
                let row = [1.0, u, v, u * u, u * v, v * v];
                let w = (-(u * u + v * v) / (2.0 * SOON * SOON)).exp() * known.snr[f].sqrt();
                for a in 0..terms {
                    for b in 0..=a {
                        normal.a[a][b] += w * row[a] * row[b];
                    }
                    normal.b[a] += w * row[a] * known.s[f];
                }
            }
            *local = normal.solve(terms)?.0;
        }
        Some(local)
    }
}

/// Tiles up to `reach` columns and rows off one, but itself.
fn around(tile: usize, reach: usize, nx: usize, ny: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (tile % nx, tile / nx);
    let rows = y.saturating_sub(reach)..(y + reach + 1).min(ny);
    rows.flat_map(move |b| (x.saturating_sub(reach)..(x + reach + 1).min(nx)).map(move |a| b * nx + a))
        .filter(move |n| *n != tile)
}

/// Full-resolution px from tile to tile, along u and v.
fn spacing(grid: &TileGrid) -> [f64; 2] {
    let (first, last) = (grid.sites[0].pixel, grid.sites[grid.sites.len() - 1].pixel);
    [(last[0] - first[0]) / (grid.nx - 1).max(1) as f64, (last[1] - first[1]) / (grid.ny - 1).max(1) as f64]
}

/// The sums of one tile at coordinates foretold about its middle.
fn demodulate(level: &Level, grid: &TileGrid, tile: usize, gain: f32, local: &[Local; 2]) -> TileSum {
    let (tx, ty) = ((tile % grid.nx) as u16, (tile / grid.nx) as u16);
    let (at, per_px) = (grid.sites[tile].pixel, spacing(grid));
    let range = |of: &[u16], t: u16| of.partition_point(|c| *c < t)..of.partition_point(|c| *c <= t);
    let (rows, columns) = (range(&grid.row, ty), range(&grid.column, tx));
    let middle = |b: usize| ((b * BLOCK) as f64 + 0.5 * BLOCK as f64) * level.scale - 0.5;
    let mut sum = TileSum::default();
    for first in columns.clone().step_by(LANES) {
        let lanes = columns.end.min(first + LANES) - first;
        let mut sums = Columns::default();
        for y in rows.clone() {
            let mut strip = Strip::default();
            let v = (middle(y) - at[1]) / per_px[1];
            for l in 0..lanes {
                let u = (middle(first + l) - at[0]) / per_px[0];
                strip.seen[l] = 1.0;
                for (f, [c, a, b, uu, uv, vv]) in local.iter().enumerate() {
                    strip.s[f][l] = (c + u * (a + uu * u + uv * v) + v * (b + vv * v)) as f32;
                    strip.du[f][l] = ((a + 2.0 * uu * u + uv * v) / per_px[0] * level.scale) as f32;
                    strip.dv[f][l] = ((b + uv * u + 2.0 * vv * v) / per_px[1] * level.scale) as f32;
                }
            }
            let rows = std::array::from_fn(|r| &level.thin.row(y * BLOCK + r)[first * BLOCK..]);
            sums.add(&rows, gain, &strip);
        }
        (0..lanes).for_each(|l| sums.flush(l, &mut sum));
    }
    sum
}
