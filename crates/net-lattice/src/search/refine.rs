//! Hypotheses of the search refined on the unblurred spectra, joined by their rivals and put in order.

use net_geometry::nalgebra::{Rotation3, Vector3};

use crate::search::score::score;
use crate::search::spectra::Bank;
use crate::search::table::{Candidate, Scope};

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
    best.score = score(bank, scale, scope, &best);
    for round in rounds {
        let step = [0.06, 0.06, 0.03, 0.03, 0.07].map(|s| s * 0.6f64.powi(round));
        for p in 0..5 {
            if p == 4 && scope.angle_sigma <= 0.0 {
                continue;
            }
            for sign in [1.0, -1.0] {
                let before = best.score;
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
                    next.score = score(bank, scale, scope, &next);
                    if next.score > best.score + 1e-9 {
                        best = next;
                    } else {
                        break;
                    }
                }
                // The other way it has come from.
                if best.score > before {
                    break;
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
