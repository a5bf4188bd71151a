//! Lock-in: what phase is left over of the demodulated picture says where the lattice really is.

use crate::lock::comb::Comb;
use crate::lock::demodulate::TileSum;
use crate::numeric::quantile;
use crate::picture::view::{Site, View};
use crate::sheet::chart::Point;
use crate::sheet::surface::Surface;

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
    /// Whether it counts: enough of it shows the sheet, which is described as far as that, cells there are wider than 3 px, and it is not empty beside the others.
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
    /// The fundamental, and the second harmonic by itself; 1 for a family of bright twine, -1 for dark.
    Waves([f64; 2]),
    /// All harmonics together.
    Comb(Comb),
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
                        let [first, second, ..] = sum.z[f].map(|z| z.map(|z| sign[f] * z));
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
            let described = chart.described(site.ray, p.depth);
            m.good = sum.count > 0.5 * grid.area && resolved && !m.empty && described;
        }
        out.push(m);
    }
}
