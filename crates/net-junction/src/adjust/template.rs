//! Matched filter for twine across its direction.

use pulp::{Arch, Simd, WithSimd};

use crate::adjust::lanes::{Detrend, LANES};

/// Ratio of widths of neighbouring classes is `e` to this.
const CLASS: f64 = 0.15;

/// How twine looks in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Look {
    /// Diameter, m.
    pub twine_m: f64,
    /// Way of the net across twines of each family while the shutter was open, m.
    pub blur_m: [f64; 2],
    /// Standard deviation of the point spread, px.
    pub spread_px: f64,
    /// Distance between values across the twine to find it, px.
    pub coarse_px: f64,
}

impl Look {
    /// Length of the template on each side, px, for twine of this width in cells of this height that the picture's motion smears over `blur`, all px: wide
    /// enough for twine and blur, not for its neighbours.
    pub fn window_px(&self, width: f64, cell: f64, blur: f64) -> f64 {
        let room = (0.3 * cell + 0.25 * blur).min(0.5 * cell);
        room.max(2.0).min(0.8 * width + 3.0 * self.spread_px + 1.5 + 0.5 * blur)
    }
}

/// A twine's profile, freed of constant and slope, on `2 half + 1` steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Kernel {
    /// Class of width, motion blur in quarters of a pixel, and steps on each side of its middle.
    class: (i32, i32, usize),
    /// Widths of its class, px.
    widths: (f64, f64),
    start: usize,
    /// Sum of squares.
    energy: f32,
}

impl Kernel {
    /// Sum of squares that twine of this amplitude explains.
    pub fn gain(&self, amplitude: f32) -> f32 {
        amplitude * amplitude * self.energy
    }

    /// Steps on each side of the kernel's middle.
    pub fn half(&self) -> usize {
        self.class.2
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
#[derive(Debug)]
pub(crate) struct Kernels {
    kernels: Vec<Kernel>,
    /// The kernels' values over their energies: their products with a profile are amplitudes.
    taps: Vec<f32>,
    /// By half length of the kernel.
    detrends: Vec<Detrend>,
    step_px: f64,
    arch: Arch,
}

impl Default for Kernels {
    fn default() -> Self {
        Self { kernels: Vec::new(), taps: Vec::new(), detrends: Vec::new(), step_px: 1.0, arch: Arch::new() }
    }
}

impl Kernels {
    /// Forgets all kernels; new ones have steps of this size.
    pub fn start(&mut self, step_px: f64) {
        self.step_px = step_px;
        self.kernels.clear();
        self.taps.clear();
    }

    /// Distance between values, px.
    pub fn step_px(&self) -> f64 {
        self.step_px
    }

    /// The kernel for twine `width` px wide, blurred over `blur` px by motion and by a point spread of `sigma` px, on `half` steps to each side.
    pub fn get(&mut self, width: f64, sigma: f64, blur: f64, half: usize) -> Kernel {
        let (width, blurred, half) = (width.max(1e-3), (4.0 * blur).round() as i32, half.max(2));
        let same = |k: &&Kernel| k.widths.0 <= width && width < k.widths.1 && (k.class.1, k.class.2) == (blurred, half);
        if let Some(kernel) = self.kernels.iter().find(same) {
            return *kernel;
        }
        let class = ((width.ln() / CLASS).round() as i32, blurred, half);
        let end = |class: f64| (class * CLASS).exp();
        let widths = (end(f64::from(class.0) - 0.5), end(f64::from(class.0) + 0.5));
        let (width, blur, half) = ((f64::from(class.0) * CLASS).exp(), 0.25 * f64::from(class.1), class.2 as i32);
        let sigma = sigma.hypot(spread_of_means(self.step_px));
        let edge = |x: f64| normal_cdf(x / sigma);
        // Integral of `edge`.
        let ramp = |x: f64| x * edge(x) + sigma * (-0.5 * (x / sigma).powi(2)).exp() / std::f64::consts::TAU.sqrt();
        let start = self.taps.len();
        let profile = |k: i32| {
            let q = f64::from(k) * self.step_px;
            if blur < 0.5 {
                return edge(q + 0.5 * width) - edge(q - 0.5 * width);
            }
            let (sum, difference) = (0.5 * (width + blur), 0.5 * (width - blur));
            (ramp(q + sum) - ramp(q + difference) - ramp(q - difference) + ramp(q - sum)) / blur
        };
        // Even in k: free of slope already.
        let mean = (-half..=half).map(profile).sum::<f64>() / f64::from(2 * half + 1);
        self.taps.extend((-half..=half).map(|k| (profile(k) - mean) as f32));
        let energy = self.taps[start..].iter().map(|t| t * t).sum::<f32>().max(1e-12);
        self.taps[start..].iter_mut().for_each(|t| *t /= energy);
        if self.detrends.len() <= class.2 {
            let made = self.detrends.len();
            self.detrends.extend((made..=class.2).map(Detrend::new));
        }
        let kernel = Kernel { class, widths, start, energy };
        self.kernels.push(kernel);
        kernel
    }

    fn taps(&self, kernel: &Kernel) -> &[f32] {
        &self.taps[kernel.start..][..2 * kernel.half() + 1]
    }

    /// Amplitudes with the kernel's middle at each of `out.len()` successive values of a profile, the first at `first`.
    pub fn amplitudes(&self, kernel: &Kernel, profile: &[f32], first: usize, out: &mut [f32]) {
        let profile = &profile[first - kernel.half()..][..out.len() + 2 * kernel.half()];
        self.arch.dispatch(Filter { taps: self.taps(kernel), profile, out });
    }

    /// [`Self::amplitudes`] for callers that are compiled for wide instructions themselves.
    #[inline(always)]
    pub fn amplitudes_inline(&self, kernel: &Kernel, profile: &[f32], first: usize, out: &mut [f32]) {
        filter(self.taps(kernel), &profile[first - kernel.half()..][..out.len() + 2 * kernel.half()], out);
    }

    /// Matches the kernel with its middle at value `at` of the profile, which must hold it whole.
    pub fn match_at(&self, kernel: &Kernel, profile: &[f32], at: usize) -> Match {
        let part = &profile[at - kernel.half()..][..2 * kernel.half() + 1];
        let amplitude = self.taps(kernel).iter().zip(part).map(|(t, p)| t * p).sum::<f32>();
        Match { amplitude, gain: kernel.gain(amplitude), rest: self.rest(kernel, &profile[at - kernel.half()..]) }
    }

    /// Sum of squares that constant and slope leave of the first values of a profile, as many as the kernel has.
    #[inline(always)]
    pub fn rest(&self, kernel: &Kernel, profile: &[f32]) -> f32 {
        self.detrends[kernel.half()].rest(profile)
    }
}

/// A kernel to be run over a profile.
struct Filter<'a> {
    taps: &'a [f32],
    profile: &'a [f32],
    out: &'a mut [f32],
}

impl WithSimd for Filter<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { taps, profile, out } = self;
        filter(taps, profile, out);
    }
}

#[inline(always)]
fn filter(taps: &[f32], profile: &[f32], out: &mut [f32]) {
    if let Some(last) = out.len().checked_sub(LANES) {
        // The last values of a profile that is not a whole number of vectors long are those of an earlier vector, too.
        for start in (0..last).step_by(LANES).chain([last]) {
            let mut sums = [0.0_f32; LANES];
            for (tap, part) in taps.iter().zip(profile[start..].windows(LANES)) {
                for (sum, p) in sums.iter_mut().zip(part) {
                    *sum += tap * p;
                }
            }
            out[start..start + LANES].copy_from_slice(&sums);
        }
    } else {
        for (o, part) in out.iter_mut().zip(profile.windows(taps.len())) {
            *o = taps.iter().zip(part).map(|(t, p)| t * p).sum();
        }
    }
}

/// Standard deviation, px, of what pixels this large, which are means of others, and linear interpolation between them spread beyond what single pixels do.
fn spread_of_means(step_px: f64) -> f64 {
    (0.25 * (step_px * step_px - 1.0)).max(0.0).sqrt()
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
        kernels.start(1.0);
        let kernel = kernels.get(1.5, 0.75, 0.0, 5);
        let width = (f64::from(kernel.class.0) * CLASS).exp();
        let profile: Vec<f32> = (-12..=12)
            .map(|k| {
                let q = f64::from(k);
                let twine = normal_cdf((q + 0.5 * width) / 0.75) - normal_cdf((q - 0.5 * width) / 0.75);
                (120.0 + 3.0 * q - 40.0 * twine) as f32
            })
            .collect();
        let found = kernels.match_at(&kernel, &profile, 12);
        // Single precision of grey levels.
        assert!((found.amplitude + 40.0).abs() < 1e-2, "{found:?}");
        assert!((found.gain / found.rest - 1.0).abs() < 1e-3, "{found:?}");
        // Two steps aside it explains less.
        assert!(kernels.match_at(&kernel, &profile, 14).gain < 0.8 * found.gain);
        let mut all = [0.0; 15];
        kernels.amplitudes(&kernel, &profile, 5, &mut all);
        for (k, amplitude) in all.into_iter().enumerate() {
            assert!((amplitude - kernels.match_at(&kernel, &profile, 5 + k).amplitude).abs() < 1e-2, "{k}");
        }
    }

    #[test]
    fn motion_is_a_mean_of_places() {
        let (mut kernels, half) = (Kernels::default(), 12);
        kernels.start(0.5);
        let kernel = kernels.get(1.0, 0.75, 6.0, half);
        let taps = &kernels.taps[kernel.start..][..2 * half + 1];
        let sharp = |q: f64| normal_cdf((q + 0.5) / 0.75) - normal_cdf((q - 0.5) / 0.75);
        let places = |k: i32| {
            let at = |n: i32| 0.5 * f64::from(k) + 6.0 * (f64::from(n) + 0.5) / 200.0 - 3.0;
            (0..200).map(|n| sharp(at(n))).sum::<f64>() / 200.0
        };
        let half = half as i32;
        let mean = (-half..=half).map(places).sum::<f64>() / f64::from(2 * half + 1);
        for k in -half..=half {
            // The normal distribution is good to 1e-7, the mean of 200 places to their distance squared.
            let expected = places(k) - mean;
            let tap = f64::from(taps[(k + half) as usize] * kernel.energy);
            assert!((tap - expected).abs() < 1e-4, "{k}");
        }
    }

    #[test]
    fn kernels_are_made_once() {
        let mut kernels = Kernels::default();
        kernels.start(1.0);
        let a = kernels.get(2.0, 0.75, 0.0, 6);
        assert_eq!(kernels.get(2.01, 0.75, 0.0, 6), a);
        assert_ne!(kernels.get(4.0, 0.75, 0.0, 6), a);
        assert_eq!(kernels.kernels.len(), 2);
    }
}
