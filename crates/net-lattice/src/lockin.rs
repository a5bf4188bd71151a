//! Lock-in: the picture multiplied by the predicted waves and summed over tiles. What phase is left over says where the lattice really is.

use crate::comb::{Comb, HARMONICS};
use crate::map::{PhaseMap, Plane};
use crate::numeric::{quantile, sin_cos_cycles};
use crate::surface::{Point, Surface};
use crate::view::{BLOCK, Level, Site, View};

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

/// What tells where a tile's twines are.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Probe {
    /// The fundamental, and the second harmonic by itself; 1 for bright twine, -1 for dark.
    Waves(f64),
    /// All harmonics together.
    Comb(Comb),
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

    /// Whether a place is within one radius.
    pub(crate) fn holds(&self, pixel: [f64; 2]) -> bool {
        (pixel[0] - self.centre[0]).hypot(pixel[1] - self.centre[1]) <= self.radius
    }

    /// Weight of a place.
    pub(crate) fn weight(&self, pixel: [f64; 2]) -> f64 {
        let (u, v) = (pixel[0] - self.centre[0], pixel[1] - self.centre[1]);
        if self.radius.is_finite() { (-(u * u + v * v) / (2.0 * self.radius * self.radius)).exp() } else { 1.0 }
    }
}

/// Weight below which tiles are not looked at.
const NEGLIGIBLE: f64 = 0.01;

/// Demodulates `thin` of a level over its tiles, by all harmonics.
pub(crate) fn demodulate(
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
            let looked_at = window.weight(sites[tx].pixel) >= NEGLIGIBLE;
            let mut run = Run::default();
            while x < bx && usize::from(grid.column[x]) == tx {
                if let Some(planes) = looked_at.then(|| map.block(x, y)).flatten() {
                    let pixels = std::array::from_fn(|r| std::array::from_fn(|c| gain * rows[r][x * BLOCK + c]));
                    run.add(&pixels, &planes);
                }
                x += 1;
            }
            run.flush(&mut tiles[tx]);
        }
    }
}

/// Both families' harmonics side by side: first family's 1, 2, ..., second family's.
const LANES: usize = 2 * HARMONICS;
type Lanes = [f32; LANES];

/// Sums over the blocks of one tile in one row of blocks.
#[derive(Default)]
pub(crate) struct Run {
    re: Lanes,
    im: Lanes,
    power: f32,
    whole: f32,
    blocks: u32,
}

impl Run {
    pub(crate) fn add(&mut self, pixels: &[[f32; BLOCK]; BLOCK], planes: &[Plane; 2]) {
        self.whole += pixels.iter().flatten().map(|p| p * p).sum::<f32>();
        let p = pixels.map(|row| row.map(|i| i.clamp(-1.0, 1.0)));
        self.power += p.iter().flatten().map(|p| p * p).sum::<f32>();
        self.blocks += 1;
        // Sums and differences of the columns right and left of the middle, inner and outer; then the same of the rows.
        let e = p.map(|r| [r[1] + r[2], r[0] + r[3], r[1] - r[2], r[0] - r[3]]);
        let of = |f: &dyn Fn(usize) -> f32| -> [f32; 4] { std::array::from_fn(f) };
        let (even1, even3) = (of(&|k| e[1][k] + e[2][k]), of(&|k| e[0][k] + e[3][k]));
        let (odd1, odd3) = (of(&|k| e[1][k] - e[2][k]), of(&|k| e[0][k] - e[3][k]));
        // Half a pixel and one and a half off the middle.
        let (su1, cu1) = multiples(planes.each_ref().map(|w| 0.5 * w.du));
        let (sv1, cv1) = multiples(planes.each_ref().map(|w| 0.5 * w.dv));
        let (s, c) = multiples(planes.each_ref().map(|w| w.s));
        for l in 0..LANES {
            let triple = |s: f32, c: f32| (s * (3.0 - 4.0 * s * s), c * (4.0 * c * c - 3.0));
            let ((su3, cu3), (sv3, cv3)) = (triple(su1[l], cu1[l]), triple(sv1[l], cv1[l]));
            let even = |m: &[f32; 4]| m[0] * cu1[l] + m[1] * cu3;
            let odd = |m: &[f32; 4]| m[2] * su1[l] + m[3] * su3;
            // Rows above the middle carry exp(+j a), those below exp(-j a).
            let re = even(&even1) * cv1[l] + even(&even3) * cv3 - odd(&odd1) * sv1[l] - odd(&odd3) * sv3;
            let im = odd(&even1) * cv1[l] + odd(&even3) * cv3 + even(&odd1) * sv1[l] + even(&odd3) * sv3;
            self.re[l] += re * c[l] + im * s[l];
            self.im[l] += im * c[l] - re * s[l];
        }
    }

    pub(crate) fn flush(&self, tile: &mut TileSum) {
        for (l, (re, im)) in self.re.iter().zip(&self.im).enumerate() {
            let z = &mut tile.z[l / HARMONICS][l % HARMONICS];
            z[0] += f64::from(*re);
            z[1] += f64::from(*im);
        }
        tile.power += f64::from(self.power);
        tile.whole += f64::from(self.whole);
        tile.count += f64::from(self.blocks) * (BLOCK * BLOCK) as f64;
    }
}

/// Sines and cosines of the multiples of both families' angles, cycles.
#[inline]
fn multiples(x: [f32; 2]) -> (Lanes, Lanes) {
    let (mut sines, mut cosines) = ([0.0; LANES], [0.0; LANES]);
    for (f, x) in x.into_iter().enumerate() {
        let (s1, c1) = sin_cos_cycles(x);
        let (mut s, mut c) = (s1, c1);
        for l in f * HARMONICS..(f + 1) * HARMONICS {
            (sines[l], cosines[l]) = (s, c);
            (s, c) = (s * c1 + c * s1, c * c1 - s * s1);
        }
    }
    (sines, cosines)
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
/// `gain`: that of the sums. `scratch` is overwritten.
pub(crate) fn measure(
    surface: &Surface,
    view: &View,
    (level, tiling): (usize, usize),
    probe: Probe,
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
            amplitude: sum.z.map(|z| z[0][0].hypot(z[0][1]) / sum.count.max(1.0)),
            power: sum.whole / sum.count.max(1.0),
            good: false,
            empty: false,
        };
        let at = |r: &[f64; 2]| chart.at(r[0], r[1]);
        if let (true, Some(p), Some(pu), Some(pv)) = (site.valid, at(&site.ray), at(&site.next[0]), at(&site.next[1])) {
            m.predicted = p;
            for f in 0..2 {
                m.k[f] = (pu.s[f] - p.s[f]).hypot(pv.s[f] - p.s[f]);
                match probe {
                    Probe::Waves(sign) => {
                        let [first, second, ..] = sum.z[f].map(|z| z.map(|z| sign * z));
                        m.phase[f] = first[1].atan2(first[0]);
                        m.phase2[f] = second[1].atan2(second[0]);
                        m.snr[f] = (first[0].powi(2) + first[1].powi(2)) / (0.5 * sum.power + 1e-9);
                    }
                    Probe::Comb(comb) => {
                        let (off, snr) = comb.peak(f, sum, m.k[f] * level.scale);
                        m.phase[f] = off * std::f64::consts::TAU;
                        m.snr[f] = snr;
                    }
                }
            }
            let resolved = m.k[0].max(m.k[1]) < 1.0 / (3.0 * view.reduction as f64);
            m.empty = sum.power < limit * sum.count;
            m.good = sum.count > 0.5 * grid.area && resolved && !m.empty;
        }
        out.push(m);
    }
}
