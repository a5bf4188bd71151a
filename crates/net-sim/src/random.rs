//! Random numbers by address: the same place in the net or the water always gets the same number, in whatever order and in
//! whichever frame it is asked for. (The sensor's noise, which has no address, comes from ChaCha.)

/// What a number is for; keeps the streams apart.
#[derive(Debug, Clone, Copy)]
#[repr(u64)]
pub(crate) enum Stream {
    JitterX = 1,
    JitterY,
    SlackIn,
    SlackOut,
    TwineGrey,
    Broken,
    Stub,
    Growth,
    Tuft,
    Knot,
    Snow,
    Mottle,
    Rays,
    Caustic,
    Texture,
    Object,
    Noise,
}

/// Numbers that belong to one seed and stream.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Addressed(u64);

impl Addressed {
    pub(crate) fn new(seed: u64, stream: Stream) -> Self {
        Self(scramble(seed.wrapping_add(scramble(stream as u64))))
    }

    /// All 64 bits of place `(a, b, c)`.
    #[inline]
    pub(crate) fn bits(self, a: i64, b: i64, c: i64) -> u64 {
        let mix = |h: u64, x: i64| scramble(h ^ (x as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15));
        mix(mix(mix(self.0, a), b), c)
    }

    /// Uniform in `[0, 1)`.
    #[inline]
    pub(crate) fn uniform(self, a: i64, b: i64, c: i64) -> f64 {
        (self.bits(a, b, c) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in `[low, high)`.
    #[inline]
    pub(crate) fn between(self, low: f64, high: f64, a: i64, b: i64, c: i64) -> f64 {
        low + (high - low) * self.uniform(a, b, c)
    }

    /// Standard normal (Box and Muller 1958).
    pub(crate) fn normal(self, a: i64, b: i64, c: i64) -> f64 {
        let angle = std::f64::consts::TAU * self.uniform(a, b, c);
        // In (0, 1]: its logarithm is finite.
        let radius = 1.0 - Self(!self.0).uniform(a, b, c);
        (-2.0 * radius.ln()).sqrt() * angle.cos()
    }

    /// Smooth noise of the plane with features of about unit size: mean 0, standard deviation 1. Soft bumps of either sign at random
    /// places (sparse convolution, Lewis 1989): unlike noise made on a grid it has no directions of its own, which nets have.
    pub(crate) fn smooth(self, x: f64, y: f64, layer: i64) -> f64 {
        /// Bumps per unit cell.
        const BUMPS: i64 = 3;
        let (i, j) = (x.floor() as i64, y.floor() as i64);
        let mut sum = 0.0;
        for (a, b) in (-1..=1).flat_map(|b| (-1..=1).map(move |a| (i.wrapping_add(a), j.wrapping_add(b)))) {
            let mut bits = self.bits(a, b, layer);
            for _ in 0..BUMPS {
                bits = scramble(bits);
                // 21 bits each for the place and the height.
                let part = |shift: u32| ((bits >> shift) & 0x1F_FFFF) as f64 * (1.0 / (1u64 << 21) as f64);
                let (dx, dy) = (a as f64 + part(0) - x, b as f64 + part(21) - y);
                let rest = 1.0 - dx * dx - dy * dy;
                if rest > 0.0 {
                    sum += (part(42) - 0.5) * (rest * rest * rest);
                }
            }
        }
        // Variance: bumps per area, times pi/7 for a bump's square, times 1/12 for its height's.
        sum / (BUMPS as f64 * std::f64::consts::PI / 84.0).sqrt()
    }

    /// Smooth noise with finer detail added, each octave half as large and half as strong.
    pub(crate) fn fractal(self, x: f64, y: f64, octaves: u32) -> f64 {
        let (mut sum, mut scale, mut weight) = (0.0, 1.0, 1.0);
        for octave in 0..octaves {
            sum += weight * self.smooth(x * scale, y * scale, i64::from(octave));
            scale *= 2.03;
            weight *= 0.5;
        }
        sum * 0.87
    }
}

/// A bijection of 64 bits in which each bit depends on all (the finaliser of SplitMix64, Steele et al. 2014).
fn scramble(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_moments_they_should() {
        let source = Addressed::new(7, Stream::JitterX);
        let n = 40_000;
        // Five standard errors of a mean of 40,000: 5 / sqrt(n) = 0.025; of a variance: sqrt(2) times that.
        let normals: Vec<f64> = (0..n).map(|k| source.normal(k % 200, k / 200, 3)).collect();
        let mean = normals.iter().sum::<f64>() / n as f64;
        let variance = normals.iter().map(|x| x * x).sum::<f64>() / n as f64;
        assert!(mean.abs() < 0.025 && (variance - 1.0).abs() < 0.036, "{mean} {variance}");
        // Neighbours are unrelated.
        let product = normals.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n as f64;
        assert!(product.abs() < 0.025, "{product}");
        let smooth: Vec<f64> = (0..n).map(|k| source.smooth(k as f64 * 0.37, k as f64 * 0.011, 0)).collect();
        let mean = smooth.iter().sum::<f64>() / n as f64;
        let deviation = (smooth.iter().map(|x| x * x).sum::<f64>() / n as f64).sqrt();
        // Neighbouring samples are alike: about a tenth of them count.
        assert!(mean.abs() < 0.1 && (0.8..1.2).contains(&deviation), "{mean} {deviation}");
    }
}
