//! Is it a net, and is it right?

use net_geometry::nalgebra::Vector2;

use crate::estimate::Support;
use crate::evidence::{NEAREST_BINS, Reading, Section};
use crate::field::LatticeField;

/// A wave that rises at least so far above the background is seen, nats: one speckle in twenty does.
const SEEN_NATS: f32 = 0.7;

/// Share of the sections, of those in whose spectrum both families lie, that see both at the fundamental or its double.
pub(crate) fn sections_seeing(field: &LatticeField, sections: &[Section]) -> f64 {
    let (mut able, mut seeing) = (0.0, 0.0);
    for section in sections {
        let Some(bins) = section.bins_of(field) else { continue };
        let rise = |bin: Vector2<f64>| match (section.rise(bin, Reading::Here), section.rise(bin * 2.0, Reading::Here))
        {
            (Some(first), Some(second)) => Some(first.max(second - 0.2)),
            (one, other) => one.or(other),
        };
        let far_enough = bins.iter().all(|bin| bin.norm() > 0.5 * NEAREST_BINS);
        if let (true, Some(first), Some(second)) = (far_enough, rise(bins[0]), rise(bins[1])) {
            able += 1.0;
            if first > SEEN_NATS && second > SEEN_NATS {
                seeing += 1.0;
            }
        }
    }
    if able > 0.0 { seeing / able } else { 0.0 }
}

/// Features
pub(crate) fn features(support: &Support) -> [f64; 6] {
    let mean = |family: usize| support.evidence.families[family] / f64::from(support.evidence.terms[family].max(1));
    let [light, dark] =
        [1.0, -1.0].map(|sign| (sign * support.second_harmonic[0]).min(sign * support.second_harmonic[1]));
    [
        mean(0).min(mean(1)),
        f64::from(support.evidence.terms[0].min(support.evidence.terms[1])).max(1.0).ln(),
        support.sections_seeing,
        support.period_margin_nats.clamp(-0.5, 1.0),
        light.max(dark).clamp(-1.0, 4.0),
        support.residual_bins.min(1.0),
    ]
}

/// Probability that what has such support is a net with the right pose.
pub(crate) fn probability(support: &Support) -> f64 {
    let mut logit: f64 = -4.0;
    for (feature, weight) in features(support).into_iter().zip([1.0, 0.0, 3.0, 1.0, 0.5, -1.0]) {
        logit += weight * feature;
    }
    1.0 / (1.0 + (-logit).exp())
}
