//! What a peak says beyond its place: the wave it stands for, point by point in its section.
//!
//! In a tilted net the wave vector changes across a section, and the peak is a smear whose top lies near the section's nearest part: read there, distances come out short (by 6 % at 40
//! degrees in four sections). The smear holds all the same what is needed. Transformed back by itself, it is the wave as a complex amplitude over the section; taken off the phase that
//! the lattice foretells there, what is left of it drifts by as much as the lattice is wrong. No second transform of the picture is needed, and no bias is left.

use std::f64::consts::{PI, TAU};

use net_geometry::nalgebra::Vector2;
use rustfft::num_complex::Complex64;

use crate::bins::log_magnitude;
use crate::evidence::{NEAREST_BINS, Reading, Section};
use crate::field::LatticeField;
use crate::fit::{NormalEquations, Parameters, ParametersSquared};
use crate::sections::GRID;

const POINTS: usize = GRID.len() * GRID.len();
/// Way from one point of the grid to the next, sections.
const STEP: f64 = GRID[1] - GRID[0];
/// Harmonics that are followed: the n-th tells n times as much, where it can be seen.
const HARMONICS: usize = 3;
/// Half width of a peak under the window, bins.
const PEAK_BINS: f64 = 2.0;
/// Largest patch, bins to each side.
const LARGEST_PATCH_BINS: f64 = 9.0;
/// Standard deviation of a wave vector from a peak as high as the background, bins. Measured on the simulator.
const SIGMA_AT_BACKGROUND_BINS: f64 = 0.3;
/// And of one from the highest of peaks: twine is not straight, bins.
const SIGMA_AT_BEST_BINS: f64 = 0.03;

/// One harmonic of one family in one section.
#[derive(Debug, Clone, Copy)]
struct Wave {
    section: usize,
    family: usize,
    /// 1 is the fundamental.
    harmonic: usize,
    /// Complex amplitude at the points of [`GRID`], its phase that of the picture.
    amplitudes: [Complex64; POINTS],
    /// Root mean square of the amplitudes that the background alone would give.
    noise: f64,
    /// How much more the wave vector is off than its patch shows.
    gain: f64,
}

/// A patch around a foretold bin pulls what it shows towards that bin, the more the smaller it is. Of a Hann window's peak within a patch that falls to zero as a cosine at
/// `radius` bins, this many times the drift seen is the drift there is (fitted to within 3 % from 1.5 bins on, 10 % at 1.2). Without it the fit creeps, and stops on its way.
fn patch_gain(radius: f64) -> f64 {
    1.0 + 1.40 / radius.powi(2) + 3.78 / radius.powi(4)
}

impl Wave {
    /// Amplitudes with the field's phase taken off.
    fn demodulated(&self, field: &LatticeField, section: &Section) -> [Complex64; POINTS] {
        let mut left = self.amplitudes;
        for (left, ray) in left.iter_mut().zip(&section.view.grid_rays) {
            *left *= Complex64::cis(-TAU * field.phases(*ray)[self.family] * self.harmonic as f64);
        }
        left
    }
}

/// The waves of a lattice in all sections.
#[derive(Debug, Clone, Default)]
pub(crate) struct Envelopes {
    waves: Vec<Wave>,
}

impl Envelopes {
    /// With room for all waves of so many sections: how many are seen changes from picture to picture.
    pub(crate) fn with_room_for(sections: usize) -> Self {
        Self { waves: Vec::with_capacity(sections * 2 * HARMONICS) }
    }

    /// Cuts the waves of `field` out of the sections' spectra.
    pub(crate) fn extract(&mut self, field: &LatticeField, sections: &[Section]) {
        self.waves.clear();
        for (index, section) in sections.iter().enumerate() {
            let (Some(bins), Some(spread)) = (section.bins_of(field), section.spread_of(field)) else { continue };
            // Half way to the next peak at most, wherever that lies.
            let half_way = 0.5 * bins[0].norm().min(bins[1].norm());
            for family in 0..2 {
                for harmonic in 1..=HARMONICS {
                    let at = bins[family] * harmonic as f64;
                    if at.norm() < NEAREST_BINS || section.ellipse.fraction(at) >= 1.0 {
                        continue;
                    }
                    let Some(radius) = patch_radius(spread[family] * harmonic as f64, half_way) else { continue };
                    let amplitudes = cut_out(section, at, radius);
                    // The patch's weights, squared, sum to 0.3 of its circle's square, and the window lets 3/8 of the power through along each side.
                    let noise = background(section, at) * (0.4 * PI).sqrt() * radius;
                    let gain = patch_gain(radius);
                    self.waves.push(Wave { section: index, family, harmonic, amplitudes, noise, gain });
                }
            }
        }
    }

    /// Adds to the normal equations what the phases left after demodulation say. Returns how well they agree; `None` if there are too few.
    /// Residuals of `tolerance` bins and more count less and less (Cauchy).
    pub(crate) fn measure(
        &self,
        equations: &mut NormalEquations,
        sections: &[Section],
        tolerance: f64,
    ) -> Option<Agreement> {
        let field = equations.field;
        let mut agreement = Agreement::default();
        let (mut squares, mut weights) = (0.0, 0.0);
        let (mut section_gradient, mut current) = (Parameters::zeros(), usize::MAX);
        for wave in &self.waves {
            if wave.section != current {
                agreement.close_section(&mut section_gradient);
                current = wave.section;
            }
            let section = &sections[wave.section];
            let left = wave.demodulated(&field, section);
            let power = left.iter().map(|z| z.norm_sqr()).sum::<f64>() / POINTS as f64;
            let ratio = power.sqrt() / wave.noise;
            for axis in 0..2 {
                let (mut drift, mut total) = (Complex64::default(), 0.0);
                // By the pair's first point.
                let mut weights_of = [0.0; POINTS];
                for_neighbours(axis, |a, b| {
                    let product = left[b] * left[a].conj();
                    drift += product;
                    weights_of[a] = product.norm_sqr().sqrt();
                    total += weights_of[a];
                });
                if !(total > 0.0 && ratio.is_finite()) {
                    continue;
                }
                // Cycles per section are bins; of the fundamental, whichever harmonic tells them.
                let n = wave.harmonic as f64;
                let residual = wave.gain * drift.arg() / TAU / STEP / n;
                let mean_change = |field: &LatticeField| {
                    let phases = section.view.grid_rays.map(|ray| field.phases(ray)[wave.family]);
                    let mut sum = 0.0;
                    for_neighbours(axis, |a, b| sum += weights_of[a] * (phases[b] - phases[a]));
                    Some(sum / total / STEP)
                };
                let coherence = drift.norm() / total;
                let sigma =
                    (SIGMA_AT_BACKGROUND_BINS / ratio.max(0.3) / coherence.max(0.1)).hypot(SIGMA_AT_BEST_BINS) / n;
                // Far off is another wave: a second net's, a rope's.
                let certainty = 1.0 / (1.0 + (residual / (3.0 * sigma).max(tolerance)).powi(2));
                let weight = certainty / (sigma * sigma);
                let (_, derivatives) = equations.derive(mean_change)?;
                equations.add(residual, &derivatives, weight);
                section_gradient.axpy(weight * residual, &derivatives, 1.0);
                squares += weight * residual * residual;
                weights += weight;
                agreement.measurements += 1;
                agreement.misfit += (residual / sigma).powi(2).ln_1p();
            }
        }
        agreement.close_section(&mut section_gradient);
        agreement.residual_bins = (squares / weights).sqrt();
        (agreement.measurements >= 8).then_some(agreement)
    }

    /// Mean amplitude of a family's fundamental in a section, the field's phase taken off. `None` if it was not cut out there.
    pub(crate) fn fundamental(
        &self,
        index: usize,
        family: usize,
        field: &LatticeField,
        section: &Section,
    ) -> Option<Complex64> {
        let wave = self.waves.iter().find(|w| (w.section, w.family, w.harmonic) == (index, family, 1))?;
        Some(wave.demodulated(field, section).iter().sum::<Complex64>() / POINTS as f64)
    }

    /// How well the second harmonic's phase follows from the first's, per family: thin twine puts both in step (light on dark) or out of step (dark on light), and nothing else does. The sum
    /// of the cosines over sections times `sqrt(2 / n)`, and n: about standard normal without a net. The fit has no hand in it.
    pub(crate) fn second_harmonic(&self, field: &LatticeField, sections: &[Section]) -> [(f64, u32); 2] {
        let mut sums = [(0.0, 0u32); 2];
        for pair in self.waves.windows(2) {
            let [first, second] = pair else { continue };
            let same = (first.section, first.family) == (second.section, second.family);
            if !same || (first.harmonic, second.harmonic) != (1, 2) {
                continue;
            }
            let section = &sections[first.section];
            let (one, two) = (first.demodulated(field, section), second.demodulated(field, section));
            let sum: Complex64 = one.iter().zip(&two).map(|(one, two)| two * (one * one).conj()).sum();
            if sum.norm() > 0.0 {
                let entry = &mut sums[first.family];
                *entry = (entry.0 + sum.re / sum.norm(), entry.1 + 1);
            }
        }
        sums.map(|(sum, count)| (sum * (2.0 / f64::from(count.max(1))).sqrt(), count))
    }
}

/// How well the waves of all sections agree on one lattice.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Agreement {
    /// Weighted root mean square of what is left of the wave vectors, bins of the fundamental.
    pub(crate) residual_bins: f64,
    /// Logarithms of the residuals over their sigmas, summed: falls as a fit gets better, and a few outliers do not matter. Half a logarithm of likelihood.
    pub(crate) misfit: f64,
    /// Numbers that were compared.
    pub(crate) measurements: u32,
    /// Sections that had one.
    pub(crate) sections: u32,
    /// Sum over sections of the outer products of their gradients: the middle of the sandwich.
    pub(crate) scatter: ParametersSquared,
}

impl Agreement {
    /// By how much the misfit is smaller than the other's: mean to mean, times the fewer measurements, for not all fits compare the same.
    pub(crate) fn gain_over(&self, other: &Self) -> f64 {
        let mean = |agreement: &Self| agreement.misfit / f64::from(agreement.measurements.max(1));
        (mean(other) - mean(self)) * f64::from(self.measurements.min(other.measurements))
    }

    /// Whether a fit from elsewhere should take the other's place: little of a wrong fit is left in the right one, and it leaves few waves out.
    pub(crate) fn is_clearly_better_than(&self, other: &Self) -> bool {
        let mean = |agreement: &Self| agreement.misfit / f64::from(agreement.measurements.max(1));
        mean(self) < 0.75 * mean(other) && 4 * self.measurements >= 3 * other.measurements
    }

    fn close_section(&mut self, gradient: &mut Parameters) {
        if *gradient != Parameters::zeros() {
            self.scatter.ger(1.0, gradient, gradient, 1.0);
            self.sections += 1;
            gradient.fill(0.0);
        }
    }
}

/// Half width of the patch that holds a wave whose vector wanders by `spread` bins, no wider than `half_way` to the next one. `None` where it cannot be told from that.
pub(crate) fn patch_radius(spread: f64, half_way: f64) -> Option<f64> {
    let wanted = PEAK_BINS + 1.3 * spread;
    let radius = wanted.min(half_way).min(LARGEST_PATCH_BINS);
    (radius >= 1.2 && wanted <= 2.0 * radius).then_some(radius)
}

/// Transforms the bins within `radius` of `at` back to the points of the grid.
pub(crate) fn cut_out(section: &Section, at: Vector2<f64>, radius: f64) -> [Complex64; POINTS] {
    let spectrum = section.spectrum.transform();
    let (width, height) = (spectrum.width() as f64, spectrum.height() as f64);
    let range = |centre: f64| (centre - radius).ceil() as isize..=(centre + radius).floor() as isize;
    // Turns per bin at the points, and the turn from one bin to the next.
    let turns = |side: f64| GRID.map(|part| TAU * ((part + 0.5) * side - 0.5) / side);
    let (turns_u, turns_v) = (turns(width), turns(height));
    let (steps_u, steps_v) = (turns_u.map(Complex64::cis), turns_v.map(Complex64::cis));
    let first = [at.x, at.y].map(|centre| (centre - radius).ceil());
    let mut waves_u = turns_u.map(|turn| Complex64::cis(turn * first[0]));
    let first_waves_v = turns_v.map(|turn| Complex64::cis(turn * first[1]));
    let mut amplitudes = [Complex64::default(); POINTS];
    for kx in range(at.x) {
        let mut column = [Complex64::default(); GRID.len()];
        let mut waves_v = first_waves_v;
        for ky in range(at.y) {
            let away = Vector2::new(kx as f64, ky as f64) - at;
            let distance = away.norm() / radius;
            if distance < 1.0 {
                // Falls to zero at the rim: a patch that ends sharply rings.
                let weight = (0.5 * PI * distance).cos();
                let bin = spectrum.bin(kx, ky);
                let bin = Complex64::new(f64::from(bin.re), f64::from(bin.im)) * weight;
                column.iter_mut().zip(&waves_v).for_each(|(sum, wave)| *sum += bin * wave);
            }
            waves_v.iter_mut().zip(&steps_v).for_each(|(wave, step)| *wave *= step);
        }
        for (row, &sum) in amplitudes.chunks_exact_mut(GRID.len()).zip(&column) {
            row.iter_mut().zip(&waves_u).for_each(|(amplitude, wave)| *amplitude += sum * wave);
        }
        waves_u.iter_mut().zip(&steps_u).for_each(|(wave, step)| *wave *= step);
    }
    amplitudes
}

/// Magnitude of a bin of the background near `at`: what the spectrum has there, less what stands out.
fn background(section: &Section, at: Vector2<f64>) -> f64 {
    let rise = section.rise(at, Reading::Here).unwrap_or(0.0);
    let (kx, ky) = (at.x.round() as isize, at.y.round() as isize);
    let least = section.spectrum.least_magnitude;
    let per_power = (1.0 / (least * least)) as f32;
    let mut sum = 0.0;
    // Blurred as the flattened spectrum is.
    for (dv, weight_v) in [(-1, 0.25), (0, 0.5), (1, 0.25)] {
        for (du, weight_u) in [(-1, 0.25), (0, 0.5), (1, 0.25)] {
            let bin = section.spectrum.transform().bin(kx + du, ky + dv);
            sum += weight_u * weight_v * log_magnitude(bin.norm_sqr() * per_power);
        }
    }
    f64::from(sum - rise).exp() * least
}

/// Calls `with` for every pair of grid points next to one another along the axis (0: u, 1: v).
fn for_neighbours(axis: usize, mut with: impl FnMut(usize, usize)) {
    let side = GRID.len();
    for index in 0..POINTS {
        let (column, row) = (index % side, index / side);
        if axis == 0 && column + 1 < side {
            with(index, index + 1);
        } else if axis == 1 && row + 1 < side {
            with(index, index + side);
        }
    }
}
