//! Wave vectors from the peaks of all sections.

use net_geometry::nalgebra::Vector2;

use crate::evidence::{NEAREST_BINS, Section};
use crate::fit::NormalEquations;
use crate::flatten::Flattener;

/// Harmonics whose peaks are measured: the n-th has a n-th of the error.
const HARMONICS: u32 = 4;
/// A peak lower than this above the background is speckle, nats.
const LOWEST_NATS: f64 = 0.7;
/// Standard deviation of a peak's place, bins.
const SIGMA_BINS: f64 = 0.15;

/// Adds the wave vectors that the sections (only those near a ray, where given) show within `radius` bins of the field's; returns their root mean square distance from
/// the field's, bins of the fundamental. `None` if there are too few.
pub(crate) fn measure_peaks(
    equations: &mut NormalEquations,
    sections: &[Section],
    near: Option<(Vector2<f64>, f64)>,
    radius: f64,
) -> Option<f64> {
    let field = equations.field;
    let (mut sum, mut weights, mut count) = (0.0, 0.0, 0);
    for section in sections {
        if near.is_some_and(|(ray, reach)| (section.view.ray.xy() - ray).norm_squared() > reach * reach) {
            continue;
        }
        let Some(bins) = section.bins_of(&field) else { continue };
        // No farther than half way to the next peak.
        let radius = radius.min(0.45 * bins[0].norm()).min(0.45 * bins[1].norm()).max(1.0);
        for (family, bin) in bins.into_iter().enumerate() {
            let Some((found, weight)) = wave_near(section, bin, radius) else { continue };
            let off = found - bin;
            // A peak at the rim of what was searched is as likely another's.
            let weight = weight / (1.0 + off.norm_squared() / (0.5 * radius).powi(2));
            for axis in 0..2 {
                let of = |field: &crate::field::LatticeField| Some(section.bins_of(field)?[family][axis]);
                let Some((value, derivatives)) = equations.derive(of) else { continue };
                equations.add(found[axis] - value, &derivatives, weight / (SIGMA_BINS * SIGMA_BINS));
            }
            sum += weight * off.norm_squared();
            weights += weight;
            count += 1;
        }
    }
    (count >= 4).then(|| (sum / weights).sqrt())
}

/// The wave vector nearest to `bin`, from its peak and its harmonics' with the square of their number as weight; and the sum of weights.
pub(crate) fn wave_near(section: &Section, bin: Vector2<f64>, radius: f64) -> Option<(Vector2<f64>, f64)> {
    let (mut sum, mut weights) = (Vector2::zeros(), 0.0);
    for harmonic in 1..=HARMONICS {
        let n = f64::from(harmonic);
        if (bin * n).norm() < NEAREST_BINS || section.ellipse.fraction(bin * n) >= 1.0 {
            continue;
        }
        if let Some((peak, nats)) = peak_near(section, bin * n, radius) {
            let weight = (nats - LOWEST_NATS / 2.0).min(3.0);
            sum += peak * (n * weight);
            weights += n * n * weight;
        }
    }
    (weights > 0.0).then(|| (sum / weights, weights.min(20.0)))
}

/// The highest point of the flattened spectrum within `radius` of `bin`, between bins by a parabola, and its height in nats.
fn peak_near(section: &Section, bin: Vector2<f64>, radius: f64) -> Option<(Vector2<f64>, f64)> {
    // Only the right half is drawn; the left one is its mirror image.
    let sign = if bin.x < 0.0 { -1.0 } else { 1.0 };
    let (cu, cv) = section.spectrum.constant_bin();
    let centre = bin * sign + Vector2::new(cu as f64, cv as f64);
    let levels = section.spectrum.levels();
    let last = |length: usize| length as f64 - 2.0;
    let range = |centre: f64, length: usize| {
        let (low, high) = ((centre - radius).round().max(1.0), (centre + radius).round().min(last(length)));
        low as usize..=high.max(0.0) as usize
    };
    let mut best = (0, 0, 0);
    for v in range(centre.y, levels.height()) {
        let row = levels.row(v);
        for u in range(centre.x, levels.width()) {
            if row[u] > best.0 {
                best = (row[u], u, v);
            }
        }
    }
    let (level, u, v) = best;
    let nats = (f64::from(level) - f64::from(Flattener::ZERO)) / f64::from(Flattener::LEVELS_PER_NAT);
    if nats < LOWEST_NATS {
        return None;
    }
    let at = |u: usize, v: usize| f64::from(levels.row(v)[u]);
    let along_u = summit(at(u - 1, v), at(u, v), at(u + 1, v));
    let along_v = summit(at(u, v - 1), at(u, v), at(u, v + 1));
    let peak = Vector2::new(u as f64 - cu as f64 + along_u, v as f64 - cv as f64 + along_v);
    Some((peak * sign, nats))
}

/// Where the parabola through three neighbours has its top, from the middle one.
fn summit(before: f64, here: f64, after: f64) -> f64 {
    let bend = before - 2.0 * here + after;
    if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.6, 0.6) } else { 0.0 }
}
