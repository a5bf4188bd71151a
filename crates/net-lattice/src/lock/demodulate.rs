//! The picture multiplied by the predicted waves and summed over tiles: the lock-in's first half.
//!
//! Lattice coordinates are linear within a block, so a wave there is a product of one along u and one along v, and four sines and cosines stand for all of the block's
//! pixels. Blocks side by side are worked on at once.

use net_image::widely;

use crate::lock::comb::HARMONICS;
use crate::numeric::sin_cos_cycles;
use crate::picture::view::{BLOCK, Level};
use crate::picture::window::Window;
use crate::sheet::map::{LANES, Lanes, PhaseMap, Strip};

/// Sums over one tile.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct TileSum {
    /// Demodulated sums of both families by harmonic, real and imaginary.
    pub z: [[[f64; 2]; HARMONICS]; 2],
    /// Sum of squares, clipped.
    pub power: f64,
    /// The same without clipping.
    pub whole: f64,
    /// Pixels.
    pub count: f64,
}

impl TileSum {
    /// The sums at coordinates that are so many cells higher all over the tile.
    pub(crate) fn turn(&mut self, cells: [f64; 2]) {
        for (z, cells) in self.z.iter_mut().zip(cells) {
            let (sin, cos) = (cells * std::f64::consts::TAU).sin_cos();
            let (mut s, mut c) = (sin, cos);
            for z in z {
                *z = [z[0] * c + z[1] * s, z[1] * c - z[0] * s];
                (s, c) = (s * cos + c * sin, c * cos - s * sin);
            }
        }
    }
}

/// Sums over some strips, one below the other.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Columns {
    re: [[Lanes; HARMONICS]; 2],
    im: [[Lanes; HARMONICS]; 2],
    power: Lanes,
    whole: Lanes,
    blocks: Lanes,
}

/// Sine and cosine of an angle, or of a multiple of it.
type Turn = (Lanes, Lanes);

#[inline(always)]
fn lanes(f: impl Fn(usize) -> f32) -> Lanes {
    let mut out = [0.0; LANES];
    for (l, out) in out.iter_mut().enumerate() {
        *out = f(l);
    }
    out
}

#[inline(always)]
fn turn(cycles: &Lanes) -> Turn {
    let mut out = ([0.0; LANES], [0.0; LANES]);
    for l in 0..LANES {
        (out.0[l], out.1[l]) = sin_cos_cycles(cycles[l]);
    }
    out
}

/// The sum of two angles.
#[inline(always)]
fn turned(a: &Turn, b: &Turn) -> Turn {
    (lanes(|l| a.0[l] * b.1[l] + a.1[l] * b.0[l]), lanes(|l| a.1[l] * b.1[l] - a.0[l] * b.0[l]))
}

/// Thrice an angle.
#[inline(always)]
fn triple((s, c): &Turn) -> Turn {
    (lanes(|l| s[l] * (3.0 - 4.0 * s[l] * s[l])), lanes(|l| c[l] * (4.0 * c[l] * c[l] - 3.0)))
}

impl Columns {
    /// Adds the blocks of a strip: `BLOCK` rows that start at its first pixel.
    #[inline(always)]
    pub(crate) fn add(&mut self, rows: &[&[f32]; BLOCK], gain: f32, strip: &Strip) {
        let mut p = [[[0.0; LANES]; BLOCK]; BLOCK];
        for (p, row) in p.iter_mut().zip(rows) {
            for (l, block) in row.chunks_exact(BLOCK).take(LANES).enumerate() {
                for (p, pixel) in p.iter_mut().zip(block) {
                    p[l] = strip.seen[l] * gain * pixel;
                }
            }
        }
        for l in 0..LANES {
            self.blocks[l] += strip.seen[l];
        }
        for pixels in p.iter_mut().flatten() {
            for l in 0..LANES {
                self.whole[l] += pixels[l] * pixels[l];
                pixels[l] = pixels[l].clamp(-1.0, 1.0);
                self.power[l] += pixels[l] * pixels[l];
            }
        }
        // Sums and differences of the pixels on either side of the middle, inner and outer, along u; then the same along v.
        let sum = |a: &Lanes, b: &Lanes| lanes(|l| a[l] + b[l]);
        let difference = |a: &Lanes, b: &Lanes| lanes(|l| a[l] - b[l]);
        let e = p.map(|r| [sum(&r[1], &r[2]), sum(&r[0], &r[3]), difference(&r[1], &r[2]), difference(&r[0], &r[3])]);
        let along: [_; 4] = std::array::from_fn(|k| {
            [
                sum(&e[1][k], &e[2][k]),
                sum(&e[0][k], &e[3][k]),
                difference(&e[1][k], &e[2][k]),
                difference(&e[0][k], &e[3][k]),
            ]
        });
        let [even1, even3, odd1, odd3] = along;
        for f in 0..2 {
            // Half a pixel off the middle along both sides, and the middle itself.
            let first = [turn(&strip.du[f].map(|d| 0.5 * d)), turn(&strip.dv[f].map(|d| 0.5 * d)), turn(&strip.s[f])];
            let mut now = first;
            for h in 0..HARMONICS {
                let [(su, cu), (sv, cv), (s, c)] = &now;
                // One and a half pixels off.
                let ((su3, cu3), (sv3, cv3)) = (triple(&now[0]), triple(&now[1]));
                let (re, im) = (&mut self.re[f][h], &mut self.im[f][h]);
                for l in 0..LANES {
                    // Even and odd along u, by evenness along v: inner and outer rows.
                    let even = |k: usize| even1[k][l] * cu[l] + even3[k][l] * cu3[l];
                    let odd = |k: usize| odd1[k][l] * su[l] + odd3[k][l] * su3[l];
                    // Rows above the middle carry exp(+j a), those below exp(-j a).
                    let x = even(0) * cv[l] + even(1) * cv3[l] - odd(2) * sv[l] - odd(3) * sv3[l];
                    let y = odd(0) * cv[l] + odd(1) * cv3[l] + even(2) * sv[l] + even(3) * sv3[l];
                    re[l] += x * c[l] + y * s[l];
                    im[l] += y * c[l] - x * s[l];
                }
                if h + 1 < HARMONICS {
                    now = std::array::from_fn(|k| turned(&now[k], &first[k]));
                }
            }
        }
    }

    /// Adds what one of the columns has to a tile.
    pub(crate) fn flush(&self, l: usize, tile: &mut TileSum) {
        for f in 0..2 {
            for h in 0..HARMONICS {
                tile.z[f][h][0] += f64::from(self.re[f][h][l]);
                tile.z[f][h][1] += f64::from(self.im[f][h][l]);
            }
        }
        tile.power += f64::from(self.power[l]);
        tile.whole += f64::from(self.whole[l]);
        tile.count += f64::from(self.blocks[l]) * (BLOCK * BLOCK) as f64;
    }
}

widely! {
    /// Demodulates `thin` of a level over its tiles, by all harmonics.
    pub(crate) fn demodulate<'a>(
        level: &'a Level,
        tiling: usize,
        map: &'a PhaseMap,
        gain: f32,
        window: &'a Window,
        columns: &'a mut Vec<Columns>,
        sums: &'a mut Vec<TileSum>,
    ) -> () {
        let grid = &level.tiles[tiling];
        sums.clear();
        sums.resize(grid.nx * grid.ny, TileSum::default());
        let (bx, by) = level.blocks();
        let mut y = 0;
        while y < by {
            let row = usize::from(grid.row[y]);
            let sites = &grid.sites[row * grid.nx..][..grid.nx];
            let looked_at = |x: &u16| window.reaches(sites[usize::from(*x)].pixel);
            columns.clear();
            columns.resize(bx.div_ceil(LANES), Columns::default());
            let end = y + grid.row[y..].iter().take_while(|r| usize::from(**r) == row).count();
            for (k, column) in columns.iter_mut().enumerate() {
                // The last strip ends with the picture; what the one before has is not seen twice.
                let x = (k * LANES).min(bx - LANES);
                let twice = k * LANES - x;
                if !grid.column[x..][twice..LANES].iter().any(looked_at) {
                    continue;
                }
                for y in y..end {
                    let rows = std::array::from_fn(|r| &level.thin.row(y * BLOCK + r)[x * BLOCK..]);
                    let mut strip = map.strip(x, y);
                    strip.seen[..twice].fill(0.0);
                    column.add(&rows, gain, &strip);
                }
            }
            for x in 0..bx {
                let tile = usize::from(grid.column[x]);
                if looked_at(&grid.column[x]) {
                    let k = x / LANES;
                    columns[k].flush(x - (k * LANES).min(bx - LANES), &mut sums[row * grid.nx + tile]);
                }
            }
            y = end;
        }
    }
}
