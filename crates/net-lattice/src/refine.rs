//! Hypotheses of the search scored on the unblurred spectra, refined, joined by their rivals and put in order.

use net_geometry::nalgebra::{Rotation3, Vector3};

use crate::numeric::log2_rough;
use crate::search::{Candidate, NOTHING, Scope, gradient};
use crate::spectra::{Bank, COLUMNS, HIGHEST, SIZE};

/// Whitened power from which a wave's vote grows with the logarithm only.
const SOFT: f32 = 4.0;

/// Score of one hypothesis on the unblurred spectra.
pub(crate) fn fine_score(bank: &Bank, scale: f64, scope: &Scope, c: &Candidate) -> f64 {
    let d = 0.5 * (std::f64::consts::FRAC_PI_2 - c.angle);
    let (sd, cd) = d.sin_cos();
    let det = cd * cd - sd * sd;
    let sides = scope.sides;
    let dual = [[cd / det / sides[0], -sd / det / sides[0]], [-sd / det / sides[1], cd / det / sides[1]]];
    let mut sum = [[0.0f64; 6]; 2];
    let mut count = [[0.0f64; 6]; 2];
    let n = SIZE as f64;
    for (t, site) in bank.sites.iter().enumerate() {
        let Some(g) = gradient(&c.rotation, site) else { continue };
        let power = bank.tile(t);
        for f in 0..2 {
            let k = |i: usize| (dual[f][0] * g[0][i] + dual[f][1] * g[1][i]) * c.depth * scale;
            let (mut x, mut y) = (k(0), k(1));
            if x < 0.0 {
                (x, y) = (-x, -y);
            }
            let len = (x * x + y * y).sqrt();
            if len * (bank.length as f64) < 0.4 {
                continue;
            }
            for order in 0..6 {
                let h = (order + 1) as f64;
                if h * len > HIGHEST {
                    break;
                }
                if h * len * (bank.length as f64) < 2.2 {
                    continue;
                }
                let (px, py) = (h * x * n, h * y * n + n / 2.0);
                let (ix, iy) = (px as usize, py as usize);
                if ix + 1 >= COLUMNS || iy + 1 >= SIZE {
                    continue;
                }
                let (fx, fy) = ((px - ix as f64) as f32, (py - iy as f64) as f32);
                let a = &power[ix * SIZE + iy..][..2];
                let b = &power[(ix + 1) * SIZE + iy..][..2];
                let p = (1.0 - fx) * (a[0] + fy * (a[1] - a[0])) + fx * (b[0] + fy * (b[1] - b[0]));
                // Clipped softly: a plateau would hide where strong waves are highest.
                sum[f][order] += f64::from(SOFT * log2_rough(1.0 + p / SOFT)) - 1.1;
                count[f][order] += 1.0;
            }
        }
    }
    // Blur leaves the lowest harmonics only: as many are counted as do the hypothesis good.
    let family = |f: usize| {
        let (mut s, mut n, mut best) = (0.0, 0.0, f64::from(NOTHING));
        for (sum, count) in sum[f].iter().zip(&count[f]) {
            s += sum;
            n += count;
            if n >= 4.0 {
                best = f64::max(best, s / n.sqrt());
            }
        }
        best
    };
    let (a, b) = (family(0), family(1));
    if a.min(b) <= f64::from(NOTHING) {
        return f64::from(NOTHING);
    }
    let prior = if scope.angle_sigma > 0.0 { (c.angle - scope.angle) / (1.2 * scope.angle_sigma) } else { 0.0 };
    0.5 * a.min(b) + 0.25 * (a + b) - 0.5 * prior * prior
}

/// Rounds of a refinement that tell good candidates from others, and those that are worth it only for the good.
pub(crate) const ROUGHLY: std::ops::Range<i32> = 0..2;
pub(crate) const FINELY: std::ops::Range<i32> = 2..6;

/// Coordinate ascent on rotation, depth and crossing angle, with ever shorter steps.
pub(crate) fn refine(
    bank: &Bank,
    scale: f64,
    scope: &Scope,
    start: &Candidate,
    rounds: std::ops::Range<i32>,
) -> Candidate {
    let mut best = *start;
    best.score = fine_score(bank, scale, scope, &best);
    for round in rounds {
        let step = [0.06, 0.06, 0.03, 0.03, 0.07].map(|s| s * 0.6f64.powi(round));
        for p in 0..5 {
            if p == 4 && scope.angle_sigma <= 0.0 {
                continue;
            }
            for sign in [1.0, -1.0] {
                for _ in 0..20 {
                    let mut next = best;
                    let s = sign * step[p];
                    if p < 3 {
                        let mut w = Vector3::zeros();
                        w[p] = s;
                        next.rotation = Rotation3::new(w).into_inner() * best.rotation;
                    } else if p == 3 {
                        next.depth *= s.exp();
                    } else {
                        next.angle += s;
                    }
                    if next.rotation[(2, 2)] < 0.2 || !(0.3..=2.84).contains(&next.angle) {
                        break;
                    }
                    next.score = fine_score(bank, scale, scope, &next);
                    if next.score > best.score + 1e-9 {
                        best = next;
                    } else {
                        break;
                    }
                }
            }
        }
    }
    best
}

/// Depths at which the same picture scores nearly as well, because harmonics coincide: refined, and added when they do.
pub(crate) fn add_rivals(bank: &Bank, scale: f64, scope: &Scope, range: (f64, f64), found: &mut Vec<Candidate>) {
    found.sort_unstable_by(|a, b| b.score.total_cmp(&a.score).then(a.depth.total_cmp(&b.depth)));
    for k in 0..found.len().min(3) {
        let best = found[k];
        for m in [0.5, 2.0 / 3.0, 1.5, 2.0, 3.0, 4.0] {
            let mut rival = best;
            rival.depth *= m;
            if rival.depth < range.0 || rival.depth > range.1 {
                continue;
            }
            let rival = refine(bank, scale, scope, &rival, ROUGHLY);
            if rival.score > 0.6 * best.score {
                found.push(rival);
            }
        }
    }
}

/// Sorts by score and drops near copies.
pub(crate) fn distinct(found: &mut Vec<Candidate>) {
    found.sort_unstable_by(|a, b| b.score.total_cmp(&a.score).then(a.depth.total_cmp(&b.depth)));
    let mut kept = 0;
    for i in 0..found.len() {
        let c = found[i];
        let same = |k: &Candidate| {
            (c.depth / k.depth).ln().abs() < 0.03
                && c.rotation.column(2).dot(&k.rotation.column(2)).clamp(-1.0, 1.0).acos() < 0.06
                && (c.angle - k.angle).abs() < 0.05
                && c.rotation.column(0).dot(&k.rotation.column(0)).abs() > 0.98
        };
        if !found[..kept].iter().any(same) {
            found[kept] = c;
            kept += 1;
        }
    }
    found.truncate(kept);
}

/// Puts the best by score and the best by how far it is above its background in turn: the first finds plain nets, the second nets behind fish.
pub(crate) fn interleave(found: &mut [Candidate]) {
    for k in (1..found.len()).step_by(2) {
        let best = (k..found.len()).rev().max_by(|a, b| found[*a].above.total_cmp(&found[*b].above)).unwrap_or(k);
        found[k..=best].rotate_right(1);
    }
}
