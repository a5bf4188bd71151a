//! How well the spectra of all sections bear a lattice out.

use net_geometry::nalgebra::Vector2;

use crate::field::LatticeField;
use crate::filter::Ellipse;
use crate::flatten::Flattener;
use crate::section::{SectionSpectrum, level_at};
use crate::sections::SectionView;

/// A section: where it looks, and what it saw.
#[derive(Debug, Clone)]
pub struct Section {
    /// Where it looks.
    pub view: SectionView,
    /// Top-left pixel in the reduced picture.
    pub corner: (usize, usize),
    /// Width and height in the reduced picture, px.
    pub size: (usize, usize),
    /// How many times the picture was reduced.
    pub reduction: usize,
    /// Within which its peaks count.
    pub ellipse: Ellipse,
    /// What it saw.
    pub spectrum: SectionSpectrum,
}

/// Nearer to the constant bin than this a peak cannot be told from shading, bins: the half width of a peak, and a little.
pub(crate) const NEAREST_BINS: f64 = 2.6;

/// How high the flattened spectrum stands at a bin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reading {
    /// There.
    Here,
    /// At its highest within the neighbourhood of a peak: for fields that are not yet precise.
    Around,
}

impl Section {
    /// Nats above the background at `bin`. `None` beside the constant bin and beyond the ellipse.
    #[inline]
    pub(crate) fn rise(&self, bin: Vector2<f64>, reading: Reading) -> Option<f32> {
        if bin.norm_squared() < NEAREST_BINS * NEAREST_BINS || self.ellipse.fraction(bin) >= 1.0 {
            return None;
        }
        let levels = match reading {
            Reading::Here => &self.spectrum.levels,
            Reading::Around => &self.spectrum.highest,
        };
        let level = level_at(levels, self.spectrum.constant_bin(), bin)?;
        Some((level - f32::from(Flattener::ZERO)) * (1.0 / Flattener::LEVELS_PER_NAT))
    }

    /// Bins of the field's two wave vectors. `None` where it grazes the section's ray.
    #[inline]
    pub(crate) fn bins_of(&self, field: &LatticeField) -> Option<[Vector2<f64>; 2]> {
        Some(field.waves(self.view.ray)?.map(|wave| self.view.bin_from_ideal(wave)))
    }

    /// How far the two wave vectors wander within the part of the section that the window lets through, bins.
    pub(crate) fn spread_of(&self, field: &LatticeField) -> Option<[f64; 2]> {
        let centre = field.waves(self.view.ray)?;
        let mut spread = [0.0f64; 2];
        for (x, y) in [(-0.2, 0.0), (0.2, 0.0), (0.0, -0.2), (0.0, 0.2)] {
            let waves = field.waves(self.view.ray_at(Vector2::new(x, y)))?;
            for (spread, (wave, centre)) in spread.iter_mut().zip(waves.iter().zip(&centre)) {
                *spread = spread.max(self.view.bin_from_ideal(wave - centre).norm());
            }
        }
        Some(spread)
    }
}

/// Probability that the n-th harmonic of a net stands out at all: twine is thin, so the first few do; blur takes the later ones.
fn present(harmonic: u32) -> f32 {
    match harmonic {
        1 => 0.97,
        2 => 0.8,
        3 => 0.7,
        4 => 0.6,
        _ => 0.5,
    }
}

/// Logarithm of how much likelier a rise of `nats` is at a net's n-th harmonic than elsewhere.
///
/// Speckle stands at 0 ± 0.4 nats, or, at its highest within a neighbourhood, about 0.9; a wave that stands out reaches 1 to 4. The slope and its limits are those of a
/// ratio of two bells of that kind, with room for what is neither.
#[inline]
fn log_likelihood_ratio(nats: f32, harmonic: u32, reading: Reading) -> f32 {
    let ratio = match reading {
        Reading::Here => (2.4 * (nats - 0.6)).clamp(-5.0, 5.0),
        Reading::Around => (2.2 * (nats - 1.2)).clamp(-4.0, 4.0),
    };
    let present = present(harmonic);
    (1.0 - present + present * ratio.exp()).ln()
}

/// What the sections say of a field.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Evidence {
    /// Sum of log-likelihood ratios over sections and harmonics, per family.
    pub families: [f64; 2],
    /// Number of terms, per family.
    pub terms: [u32; 2],
}

impl Evidence {
    /// One number to compare fields by. Two families of twines make a net, so the weaker one counts more.
    pub fn total(&self) -> f64 {
        self.families[0].min(self.families[1]) + 0.5 * (self.families[0] + self.families[1])
    }
}

/// Evidence of `sections` for `field`, from the first `harmonics` of both families; only of sections within `reach` of the ray `near` where that is given.
pub(crate) fn evidence(
    field: &LatticeField,
    sections: &[Section],
    near: Option<(Vector2<f64>, f64)>,
    harmonics: u32,
    reading: Reading,
) -> Evidence {
    let mut found = Evidence::default();
    for section in sections {
        if near.is_some_and(|(ray, reach)| (section.view.ray.xy() - ray).norm_squared() > reach * reach) {
            continue;
        }
        let Some(bins) = section.bins_of(field) else { continue };
        for (family, bin) in bins.into_iter().enumerate() {
            for harmonic in 1..=harmonics {
                let Some(nats) = section.rise(bin * f64::from(harmonic), reading) else { continue };
                found.families[family] += f64::from(log_likelihood_ratio(nats, harmonic, reading));
                found.terms[family] += 1;
            }
        }
    }
    found
}

/// By how much the sections prefer `field` to the same with all its wave vectors times `numerator / denominator` (a range times that), nats: how much higher the spectrum
/// stands at the harmonics that only the field has than at those that only its rival has, in the mean over sections and families. Negative: the rival is right.
///
/// Where one's harmonics are all the other's too, those that both have take the place of the missing ones, times [`NEIGHBOURS`]: the double of a true wave vector misses
/// harmonics that are as high as those it has, its half adds places that are much lower (not empty: twine that is not quite straight fills the beam between its peaks).
pub(crate) fn preference(field: &LatticeField, sections: &[Section], numerator: u32, denominator: u32) -> f64 {
    let last = (2 * numerator.max(denominator)).max(6);
    let (mut sum, mut count) = (0.0, 0);
    for section in sections {
        let (Some(bins), Some(spread)) = (section.bins_of(field), section.spread_of(field)) else { continue };
        for (bin, spread) in bins.into_iter().zip(spread) {
            // The field's harmonics are every `denominator`-th place, the rival's every `numerator`-th.
            let place = bin / f64::from(denominator);
            let spread = spread / f64::from(denominator);
            let (mut own, mut rival, mut both) = (Mean::default(), Mean::default(), Mean::default());
            for index in 1..=last {
                // A peak as wide as the way to the next place would be read there too.
                if place.norm() < NEAREST_BINS + spread * f64::from(index) {
                    break;
                }
                let group = match (index % denominator == 0, index % numerator == 0) {
                    (true, true) => &mut both,
                    (true, false) => &mut own,
                    (false, true) => &mut rival,
                    (false, false) => continue,
                };
                if let Some(nats) = section.rise(place * f64::from(index), Reading::Here) {
                    group.add(f64::from(nats.clamp(-0.5, 4.0)));
                }
            }
            let lowered = both.value().map(|nats| nats * NEIGHBOURS);
            let (own, rival) = match (numerator, denominator) {
                (_, 1) => (own.value(), lowered),
                (1, _) => (lowered, rival.value()),
                _ => (own.value(), rival.value()),
            };
            if let (Some(own), Some(rival)) = (own, rival) {
                sum += own - rival;
                count += 1;
            }
        }
    }
    if count > 0 { sum / f64::from(count) } else { 0.0 }
}

/// Harmonics next to one another rise (in nats) to at least this part of each other; what is lower beside one is none.
const NEIGHBOURS: f64 = 0.55;

#[derive(Default)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1.0;
    }

    fn value(&self) -> Option<f64> {
        (self.count > 0.0).then(|| self.sum / self.count)
    }
}
