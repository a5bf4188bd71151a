//! Lock-in: the picture multiplied by the predicted waves and summed over tiles. What phase is left over says where the lattice really is.

use crate::map::{PhaseMap, Plane};
use crate::numeric::{quantile, sin_cos_cycles};
use crate::surface::{Point, Surface};
use crate::view::{BLOCK, Level, Site, View};

/// Sums over one tile.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct TileSum {
    /// Demodulated sums of both families, real and imaginary, at the wave asked for.
    pub z: [[f64; 2]; 2],
    /// The same at twice its frequency.
    pub z2: [[f64; 2]; 2],
    /// Sum of squares, clipped.
    pub power: f64,
    /// The same without clipping.
    pub whole: f64,
    /// Pixels.
    pub count: f64,
}

/// What a tile says about the lattice.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measurement {
    pub site: Site,
    /// Predicted coordinates and depth.
    pub predicted: Point,
    /// Residual phases, rad: zero when the prediction is right (for bright twine).
    pub phase: [f64; 2],
    /// Residual phases of the second harmonic, rad.
    pub phase2: [f64; 2],
    /// Power in the wave against the mean of noise.
    pub snr: [f64; 2],
    /// Length of the wave vectors, cells per full-resolution px.
    pub k: [f64; 2],
    /// Magnitudes of the waves, and mean square of the high-passed picture without clipping; arbitrary units.
    pub amplitude: [f64; 2],
    pub power: f64,
    /// Whether it counts: enough of it shows the sheet, cells there are wider than 3 px, and it is not empty beside the others.
    pub good: bool,
    /// Next to nothing is in it.
    pub empty: bool,
}

impl Measurement {
    /// Whether both families are where they were predicted.
    pub(crate) fn aligned(&self) -> bool {
        self.good && self.phase[0].abs().max(self.phase[1].abs()) < 1.0
    }
}

/// Which part of the picture a lock-in looks at.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Window {
    /// Middle, full-resolution px.
    pub centre: [f64; 2],
    /// Standard deviation, full-resolution px.
    pub radius: f64,
}

impl Window {
    /// Everything.
    pub(crate) const ALL: Self = Self { centre: [0.0; 2], radius: f64::INFINITY };

    /// Weight of a place.
    pub(crate) fn weight(&self, pixel: [f64; 2]) -> f64 {
        let (u, v) = (pixel[0] - self.centre[0], pixel[1] - self.centre[1]);
        if self.radius.is_finite() { (-(u * u + v * v) / (2.0 * self.radius * self.radius)).exp() } else { 1.0 }
    }
}

/// Weight below which tiles are not looked at.
const NEGLIGIBLE: f64 = 0.01;

/// Demodulates `high` of a level over its tiles. `SECOND`: the second harmonic as well.
pub(crate) fn demodulate<const SECOND: bool>(
    level: &Level,
    tiling: usize,
    map: &PhaseMap,
    gain: f32,
    window: &Window,
    sums: &mut Vec<TileSum>,
) {
    let grid = &level.tiles[tiling];
    sums.clear();
    sums.resize(grid.nx * grid.ny, TileSum::default());
    let (bx, by) = level.blocks();
    for y in 0..by {
        let rows: [&[f32]; BLOCK] = std::array::from_fn(|r| level.thin.row(y * BLOCK + r));
        let first = usize::from(grid.row[y]) * grid.nx;
        let sites = &grid.sites[first..][..grid.nx];
        let tiles = &mut sums[first..][..grid.nx];
        let mut x = 0;
        while x < bx {
            let tx = usize::from(grid.column[x]);
            if window.weight(sites[tx].pixel) < NEGLIGIBLE {
                while x < bx && usize::from(grid.column[x]) == tx {
                    x += 1;
                }
                continue;
            }
            let tile = &mut tiles[tx];
            while x < bx && usize::from(grid.column[x]) == tx {
                if let Some(planes) = map.block(x, y) {
                    let pixels = std::array::from_fn(|r| std::array::from_fn(|c| rows[r][x * BLOCK + c]));
                    accumulate::<SECOND>(&pixels, gain, &planes, tile);
                }
                x += 1;
            }
        }
    }
}

/// One block's share.
#[inline]
fn accumulate<const SECOND: bool>(pixels: &[[f32; 4]; 4], gain: f32, planes: &[Plane; 2], tile: &mut TileSum) {
    let p = pixels.map(|row| row.map(|i| i * gain));
    tile.whole += f64::from(p.iter().flatten().map(|p| p * p).sum::<f32>());
    let p = p.map(|row| row.map(|i| i.clamp(-1.0, 1.0)));
    let power: f32 = p.iter().flatten().map(|p| p * p).sum();
    tile.power += f64::from(power);
    tile.count += (BLOCK * BLOCK) as f64;
    for (f, w) in planes.iter().enumerate() {
        let (s, c) = sin_cos_cycles(w.s);
        let first = wave(&p, w.du, w.dv);
        tile.z[f][0] += f64::from(first.0 * c + first.1 * s);
        tile.z[f][1] += f64::from(first.1 * c - first.0 * s);
        if SECOND {
            let (s2, c2) = (2.0 * s * c, 1.0 - 2.0 * s * s);
            let second = wave(&p, 2.0 * w.du, 2.0 * w.dv);
            tile.z2[f][0] += f64::from(second.0 * c2 + second.1 * s2);
            tile.z2[f][1] += f64::from(second.1 * c2 - second.0 * s2);
        }
    }
}

/// Sum of p exp(-2 pi j (du u + dv v)) over a block about its middle.
#[inline]
fn wave(p: &[[f32; 4]; 4], du: f32, dv: f32) -> (f32, f32) {
    let (s1, c1) = sin_cos_cycles(0.5 * du);
    let (s3, c3) = (s1 * (3.0 - 4.0 * s1 * s1), c1 * (4.0 * c1 * c1 - 3.0));
    let row = |r: &[f32; 4]| ((r[1] + r[2]) * c1 + (r[0] + r[3]) * c3, (r[1] - r[2]) * s1 + (r[0] - r[3]) * s3);
    let r: [(f32, f32); 4] = std::array::from_fn(|i| row(&p[i]));
    let (s1, c1) = sin_cos_cycles(0.5 * dv);
    let (s3, c3) = (s1 * (3.0 - 4.0 * s1 * s1), c1 * (4.0 * c1 * c1 - 3.0));
    // Row -1.5 carries exp(+3j a), row 1.5 exp(-3j a).
    let re = (r[1].0 + r[2].0) * c1 + (r[0].0 + r[3].0) * c3 - (r[1].1 - r[2].1) * s1 - (r[0].1 - r[3].1) * s3;
    let im = (r[1].1 + r[2].1) * c1 + (r[0].1 + r[3].1) * c3 + (r[1].0 - r[2].0) * s1 + (r[0].0 - r[3].0) * s3;
    (re, im)
}

/// Quantile of the tiles that counts as the strongest, and as the faintest.
const STRONG: f64 = 0.95;
const FAINT: f64 = 0.05;
/// A tile with less than this share of the power of the strongest, and less than thrice that of the faintest, says nothing, whatever its
/// phases: open water beside the net's end. Beside a bright tag on it a net has as little of the strongest, but more than water.
const EMPTY: f64 = 0.03;
/// Power of the noise that every picture is taken to have at least: one and a half of 255 grey levels.
const LEAST: f64 = 3.5e-5;

/// Turns sums into measurements.
///
/// `sign`: 1 for bright twine, -1 for dark. `gain`: that of the sums. `scratch` is overwritten.
pub(crate) fn measure(
    surface: &Surface,
    view: &View,
    (level, tiling): (usize, usize),
    sign: f64,
    gain: f32,
    sums: &[TileSum],
    scratch: &mut Vec<f64>,
    out: &mut Vec<Measurement>,
) {
    let chart = surface.chart();
    let level = &view.levels[level];
    let grid = &level.tiles[tiling];
    scratch.clear();
    scratch.extend(sums.iter().filter(|s| s.count > 0.0).map(|s| s.power / s.count));
    let strong = EMPTY * quantile(scratch, STRONG);
    let nothing = 3.0 * quantile(scratch, FAINT).max(LEAST * f64::from(gain).powi(2));
    let limit = strong.min(nothing);
    out.clear();
    for (site, sum) in grid.sites.iter().zip(sums) {
        let mut m = Measurement {
            site: *site,
            predicted: Point::default(),
            phase: [0.0; 2],
            phase2: [0.0; 2],
            snr: [0.0; 2],
            k: [f64::INFINITY; 2],
            amplitude: sum.z.map(|z| z[0].hypot(z[1]) / sum.count.max(1.0)),
            power: sum.whole / sum.count.max(1.0),
            good: false,
            empty: false,
        };
        let at = |r: &[f64; 2]| chart.at(r[0], r[1]);
        if let (true, Some(p), Some(pu), Some(pv)) = (site.valid, at(&site.ray), at(&site.next[0]), at(&site.next[1])) {
            m.predicted = p;
            for f in 0..2 {
                m.phase[f] = (sign * sum.z[f][1]).atan2(sign * sum.z[f][0]);
                m.phase2[f] = (sign * sum.z2[f][1]).atan2(sign * sum.z2[f][0]);
                m.snr[f] = (sum.z[f][0].powi(2) + sum.z[f][1].powi(2)) / (0.5 * sum.power + 1e-9);
                m.k[f] = (pu.s[f] - p.s[f]).hypot(pv.s[f] - p.s[f]);
            }
            let resolved = m.k[0].max(m.k[1]) < 1.0 / (3.0 * view.reduction as f64);
            m.empty = sum.power < limit * sum.count;
            m.good = sum.count > 0.5 * grid.area && resolved && !m.empty;
        }
        out.push(m);
    }
}
