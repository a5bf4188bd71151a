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

/// Probability that what has such support is a net with the right pose: logistic, its weights fitted to the simulator's random scenes and rounded (`examples/spectrum_study.rs`).
pub(crate) fn probability(support: &Support) -> f64 {
    let mean = |family: usize| support.evidence.families[family] / f64::from(support.evidence.terms[family].max(1));
    let [light, dark] =
        [1.0, -1.0].map(|sign| (sign * support.second_harmonic[0]).min(sign * support.second_harmonic[1]));
    let logit = -4.2
        + 0.3 * mean(0).min(mean(1)).min(3.0)
        + 0.5 * support.sections_seeing
        // Preferring a rival speaks against the period; no rival at all, as far away, speaks for nothing.
        + support.period_margin_nats.clamp(-1.0, 0.0)
        + 0.4 * light.max(dark).clamp(-1.0, 4.0)
        // Noise alone leaves 0.4, a good fit of twine that is not straight 1.
        - 3.5 * (support.misfit - 1.5).max(0.0)
        - 4.2 * support.mixed_orders_nats.clamp(-1.6, 1.0)
        - 0.2 * (support.angle_sigmas.abs() - 1.0).clamp(0.0, 3.0)
        - 1.2 * (20.0 * support.ratio_off.abs()).min(3.0);
    1.0 / (1.0 + (-logit).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::Evidence;

    /// A clear net, as the simulator draws it a metre away.
    fn clear() -> Support {
        Support {
            evidence: Evidence { families: [60.0, 55.0], terms: [20, 20] },
            sections_seeing: 1.0,
            period_margin_nats: 1.2,
            second_harmonic: [4.5, 4.4],
            mixed_orders_nats: -2.0,
            misfit: 0.5,
            measurements: 120,
            ..Support::default()
        }
    }

    #[test]
    fn a_clear_net_is_sure_and_every_single_doubt_lowers_it() {
        let sure = probability(&clear());
        assert!(sure > 0.99, "{sure}");
        for doubt in [
            Support { evidence: Evidence { families: [60.0, 5.0], terms: [20, 20] }, ..clear() },
            Support { sections_seeing: 0.3, ..clear() },
            Support { period_margin_nats: -0.5, ..clear() },
            Support { second_harmonic: [4.5, -4.4], ..clear() },
            Support { mixed_orders_nats: -0.5, ..clear() },
            Support { misfit: 3.0, ..clear() },
            Support { angle_sigmas: -3.0, ..clear() },
            Support { ratio_off: 0.1, ..clear() },
        ] {
            assert!(probability(&doubt) < sure, "{doubt:?}");
        }
    }

    #[test]
    fn nothing_seen_is_no_net() {
        assert!(probability(&Support::default()) < 0.05);
    }
}
