//! What becomes of the picture where twines cross: waves at the sum and the difference of the two wave vectors, and in their middle.

use std::f64::consts::TAU;

use rustfft::num_complex::Complex64;

use crate::envelope::{Envelopes, cut_out, patch_radius};
use crate::evidence::{NEAREST_BINS, Reading, Section};
use crate::field::LatticeField;

/// How much higher the spectrum stands at sums and differences of the two wave vectors than at the weaker of them, nats; or, if that is more, twice what it has at half of
/// these. Two families of thin twines add up, so that a net has little at the sums and nothing at the halves; scales and hexagons, whose lattice fits as well, have as much
/// there as anywhere, and bricks, with another one in the middle of each cell, have it at the halves.
///
/// The sums are read twice, and the lower reading counts. Above the background: where noise hides them, nothing but this can be said. And as amplitudes of waves: in a picture
/// without noise even the rim of a smear stands far above the background, and there is no telling from heights how much is under it.
pub(crate) fn mixed_orders(field: &LatticeField, envelopes: &Envelopes, sections: &[Section]) -> f64 {
    let sums = risen(field, sections, 1.0, 1.0);
    let sums = amplitudes(field, envelopes, sections).map_or(sums, |ratio| ratio.min(sums));
    sums.max(risen(field, sections, 0.5, 2.0))
}

/// Rise, times `weight`, at `part` of the sum or the difference (the higher) less that at the weaker wave vector, in the mean over sections.
fn risen(field: &LatticeField, sections: &[Section], part: f64, weight: f32) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for section in sections {
        let Some([first, second]) = section.bins_of(field) else { continue };
        let bins = [first, second, (first + second) * part, (first - second) * part];
        if let [Some(a), Some(b), Some(c), Some(d)] = bins.map(|bin| section.rise(bin, Reading::Here)) {
            // One of the two is enough: in a wall seen askew the other may be weak.
            sum += f64::from(weight * c.max(d) - a.min(b));
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

/// Logarithm of the amplitude at the sum or the difference (the higher) over that of the weaker wave, which `envelopes` holds; of all sections by their power.
/// `None` if no section shows both waves, and their sum or difference.
fn amplitudes(field: &LatticeField, envelopes: &Envelopes, sections: &[Section]) -> Option<f64> {
    let (mut mixed, mut pure) = (0.0, 0.0);
    for (index, section) in sections.iter().enumerate() {
        let (Some(bins), Some(spread)) = (section.bins_of(field), section.spread_of(field)) else { continue };
        let waves = [0, 1].map(|family| envelopes.fundamental(index, family, field, section));
        let [Some(first), Some(second)] = waves else { continue };
        let half_way = 0.5 * bins[0].norm().min(bins[1].norm());
        let Some(radius) = patch_radius(spread[0] + spread[1], half_way) else { continue };
        let powers = [1.0, -1.0].map(|sign| {
            let at = bins[0] + bins[1] * sign;
            if at.norm() < NEAREST_BINS || section.ellipse.fraction(at) >= 1.0 {
                return None;
            }
            let points = cut_out(section, at, radius);
            let left = points.iter().zip(&section.view.grid_rays).map(|(z, ray)| {
                let [p, q] = field.phases(*ray);
                z * Complex64::cis(-TAU * (p + sign * q))
            });
            Some((left.sum::<Complex64>() / points.len() as f64).norm_sqr())
        });
        if let Some(highest) = powers.into_iter().flatten().reduce(f64::max) {
            mixed += highest;
            pure += first.norm_sqr().min(second.norm_sqr());
        }
    }
    (pure > 0.0).then(|| 0.5 * (mixed / pure).ln())
}
