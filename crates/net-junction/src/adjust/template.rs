//! Matched filter for twine across its direction.

use crate::adjust::profile::STEP_PX;

/// Ratio of widths of neighbouring classes is `e` to this.
const CLASS: f64 = 0.15;

/// A twine's profile, freed of constant and slope, on `2 half + 1` steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Kernel {
    /// Class of width, and steps on each side of its middle.
    class: (i32, usize),
    start: usize,
    /// Sum of squares.
    energy: f32,
    /// Sum of squared distances, steps².
    second: f32,
}

impl Kernel {
    /// Steps on each side of the kernel's middle.
    pub fn half(&self) -> usize {
        self.class.1
    }
}

/// What a kernel finds at a place of a profile.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Match {
    /// Grey levels of twine against its surroundings.
    pub amplitude: f32,
    /// Explained sum of squares.
    pub gain: f32,
    /// Sum of squares that constant and slope leave.
    pub rest: f32,
}

/// Kernels by twine width; keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct Kernels {
    kernels: Vec<Kernel>,
    taps: Vec<f32>,
}

impl Kernels {
    /// Forgets all kernels.
    pub fn clear(&mut self) {
        self.kernels.clear();
        self.taps.clear();
    }

    /// The kernel for twine `width` px wide seen through a point spread of `sigma` px, on `half` steps to each side.
    pub fn get(&mut self, width: f64, sigma: f64, half: usize) -> Kernel {
        let class = ((width.max(1e-3).ln() / CLASS).round() as i32, half.max(2));
        if let Some(kernel) = self.kernels.iter().find(|k| k.class == class) {
            return *kernel;
        }
        let (width, half) = ((f64::from(class.0) * CLASS).exp(), class.1 as i32);
        let edge = |x: f64| normal_cdf(x / sigma);
        let start = self.taps.len();
        let profile = |k: i32| {
            let q = f64::from(k) * STEP_PX;
            edge(q + 0.5 * width) - edge(q - 0.5 * width)
        };
        // Even in k: free of slope already.
        let mean = (-half..=half).map(profile).sum::<f64>() / f64::from(2 * half + 1);
        self.taps.extend((-half..=half).map(|k| (profile(k) - mean) as f32));
        let energy = self.taps[start..].iter().map(|t| t * t).sum::<f32>().max(1e-12);
        let second = (-half..=half).map(|k| (k * k) as f32).sum();
        let kernel = Kernel { class, start, energy, second };
        self.kernels.push(kernel);
        kernel
    }

    /// Matches the kernel with its middle at value `at` of the profile, which must hold it whole.
    #[inline]
    pub fn match_at(&self, kernel: &Kernel, profile: &[f32], at: usize) -> Match {
        let half = kernel.half();
        let taps = &self.taps[kernel.start..][..2 * half + 1];
        let part = &profile[at - half..][..2 * half + 1];
        // About the first value, so that squares of large grey levels do not cancel.
        let base = part[half];
        let (mut product, mut sum, mut squares, mut slope) = (0.0_f32, 0.0_f32, 0.0_f32, 0.0_f32);
        let mut distance = -(half as f32);
        for (&t, &p) in taps.iter().zip(part) {
            let p = p - base;
            product += t * p;
            sum += p;
            squares += p * p;
            slope += distance * p;
            distance += 1.0;
        }
        let amplitude = product / kernel.energy;
        let rest = squares - sum * sum / taps.len() as f32 - slope * slope / kernel.second;
        Match { amplitude, gain: amplitude * product, rest: rest.max(0.0) }
    }
}

/// Standard normal distribution, to 1e-7 (Abramowitz and Stegun 26.2.17).
fn normal_cdf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.2316419 * x.abs());
    let poly = t * (0.319381530 + t * (-0.356563782 + t * (1.781477937 + t * (-1.821255978 + t * 1.330274429))));
    let tail = (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt() * poly;
    if x > 0.0 { 1.0 - tail } else { tail }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amplitude_is_found_whatever_the_background_does() {
        let mut kernels = Kernels::default();
        let kernel = kernels.get(1.5, 0.75, 8);
        let width = (f64::from(kernel.class.0) * CLASS).exp();
        let profile: Vec<f32> = (-20..=20)
            .map(|k| {
                let q = f64::from(k) * STEP_PX;
                let twine = normal_cdf((q + 0.5 * width) / 0.75) - normal_cdf((q - 0.5 * width) / 0.75);
                (120.0 + 3.0 * q - 40.0 * twine) as f32
            })
            .collect();
        let found = kernels.match_at(&kernel, &profile, 20);
        // Single precision of grey levels.
        assert!((found.amplitude + 40.0).abs() < 1e-2, "{found:?}");
        assert!((found.gain / found.rest - 1.0).abs() < 1e-3, "{found:?}");
        // Three steps aside it explains less.
        assert!(kernels.match_at(&kernel, &profile, 23).gain < 0.8 * found.gain);
    }

    #[test]
    fn kernels_are_made_once() {
        let mut kernels = Kernels::default();
        let a = kernels.get(2.0, 0.75, 6);
        assert_eq!(kernels.get(2.01, 0.75, 6), a);
        assert_ne!(kernels.get(4.0, 0.75, 6), a);
        assert_eq!(kernels.kernels.len(), 2);
    }
}
