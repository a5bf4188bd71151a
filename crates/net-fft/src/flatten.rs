//! A spectrum with its background taken away, so that one threshold serves near and far, clear and murky, noise and shading.

use net_geometry::nalgebra::Vector2;
use net_image::{BoxFilter, Image};

use crate::bins::{Bins, log_magnitude, map_column};
use crate::error::Result;
use crate::fft2::HalfSpectrum;

/// Half side of the square over which the background is averaged, bins: wider than a peak (4), narrower than shading's slope.
const BACKGROUND_RADIUS_BINS: usize = 6;
/// What rises above the background by more than this counts as a peak and not as background, nats.
const CLIP_NATS: f32 = 1.0;
/// Within so many bins of the constant one there is no background to speak of: the spectrum of shading falls too steeply.
const CORE_BINS: f64 = 1.6;
/// Rings of a smaller radius are full of a near net's peaks, bins.
const SMALL_RINGS: usize = 16;
/// Ring of the core.
const CORE_RING: u16 = u16::MAX;

/// Takes the background off the logarithm of a spectrum: first its mean on rings round the constant bin (the slope of shading, lens and water), then the local mean,
/// both of what does not stand out. What is left is speckle round zero, and the net's peaks.
#[derive(Debug, Clone)]
pub struct Flattener {
    /// First and last `kx`, first and last `ky` of the image.
    ranges: [isize; 4],
    /// Size of the transformed pictures, px.
    size: (usize, usize),
    /// One over the power of the least noise.
    per_noise_power: f32,
    box_mean: BoxFilter<u8>,
    /// Ring of every bin, column by column of the spectrum; the core's is [`CORE_RING`].
    rings: Vec<u16>,
    sums: Vec<(i32, i32)>,
    /// Mean of every ring, 1/384 nat.
    profile: Vec<i16>,
    /// Logarithms, column by column: 1/24 nat, then blurred, 1/384 nat.
    logarithms: Vec<i16>,
    blurred: Vec<i16>,
    residual: Vec<u8>,
    clipped: Image<u8>,
    mean: Image<f32>,
}

impl Flattener {
    /// Level of the background in a flattened image.
    pub const ZERO: u8 = 64;
    /// Levels for a factor of e in magnitude.
    pub const LEVELS_PER_NAT: f32 = 24.0;

    /// For the `bins` of spectra of pictures of `width` x `height` px, with at least `noise_power` of noise in every bin ([`crate::SpectrumPlan::noise_power`]): in a spectrum of less, no
    /// background is lower than this, and no peak reaches higher above it.
    ///
    /// # Errors
    /// [`crate::Error::EmptySize`] if either is zero, [`crate::Error::Parameter`] for a power that is not above zero.
    pub fn new(width: usize, height: usize, bins: Bins, noise_power: f64) -> Result<Self> {
        let per_noise_power = (1.0 / noise_power) as f32;
        if !(per_noise_power > 0.0 && per_noise_power.is_finite()) {
            return Err(crate::Error::Parameter {
                field: "noise_power",
                value: noise_power,
                expected: "a finite number above 0",
            });
        }
        if width == 0 || height == 0 {
            return Err(crate::Error::EmptySize { width, height });
        }
        let ranges = bins.ranges(width, height);
        let [x0, x1, y0, y1] = ranges;
        // Bins are 1 / width and 1 / height of a cycle per pixel: rings are circles in cycles per pixel, one of the finer bins wide.
        let finest = width.max(height) as f64;
        let scale = Vector2::new(finest / width as f64, finest / height as f64);
        let ring = |kx: isize, ky: isize| {
            let bin = Vector2::new(kx as f64, ky as f64);
            let radius = bin.component_mul(&scale).norm() as usize;
            if bin.norm() < CORE_BINS { CORE_RING } else { radius.min(usize::from(CORE_RING) - 1) as u16 }
        };
        let rings: Vec<u16> = (x0..=x1).flat_map(|kx| (y0..=y1).map(move |ky| ring(kx, ky))).collect();
        let count = rings.iter().filter(|&&ring| ring != CORE_RING).max().map_or(0, |&last| usize::from(last) + 1);
        Ok(Self {
            ranges,
            size: (width, height),
            per_noise_power,
            box_mean: BoxFilter::new(BACKGROUND_RADIUS_BINS)?,
            rings,
            sums: vec![(0, 0); count],
            profile: vec![0; count],
            logarithms: Vec::new(),
            blurred: Vec::new(),
            residual: Vec::new(),
            clipped: Image::default(),
            mean: Image::default(),
        })
    }

    /// Column and row of the constant bin in the flattened image.
    pub fn constant_bin(&self) -> (usize, usize) {
        (-self.ranges[0] as usize, -self.ranges[2] as usize)
    }

    /// Flattens the logarithm of `spectrum`, blurred like a [`crate::SpectrumImage`]: level [`Self::ZERO`] is the background, and [`Self::LEVELS_PER_NAT`] levels
    /// a factor of e above it.
    ///
    /// # Errors
    /// [`crate::Error::Size`] if it is the spectrum of a picture of another size than planned.
    pub fn flatten(&mut self, spectrum: &HalfSpectrum, out: &mut Image<u8>) -> Result<()> {
        let (width, height) = (spectrum.width(), spectrum.height());
        if (width, height) != self.size {
            let (expected_width, expected_height) = self.size;
            return Err(crate::Error::Size { expected_width, expected_height, width, height });
        }
        let [x0, x1, y0, y1] = self.ranges;
        let (columns, rows) = ((x1 - x0 + 1) as usize, (y1 - y0 + 1) as usize);
        self.logarithms.resize(columns * rows, 0);
        for (kx, to) in (x0..=x1).zip(self.logarithms.chunks_exact_mut(rows)) {
            map_column(spectrum, kx, y0, to, |bins, to| {
                for (to, bin) in to.iter_mut().zip(bins) {
                    // At most 45 nats of a float's square root.
                    *to = (log_magnitude(bin.norm_sqr() * self.per_noise_power) * Self::LEVELS_PER_NAT + 0.5) as i16;
                }
            });
        }
        blur(&self.logarithms, rows, &mut self.blurred);
        self.ring_profile(columns, rows);

        let zero = i16::from(Self::ZERO) * 16 + 8;
        self.residual.resize(columns * rows, 0);
        for ((to, &value), &ring) in self.residual.iter_mut().zip(&self.blurred).zip(&self.rings) {
            let floor = self.profile.get(usize::from(ring)).copied();
            *to = floor.map_or(Self::ZERO, |floor| ((value - floor + zero) >> 4).clamp(0, 255) as u8);
        }
        // Turned upright on the way: the spectrum's columns are the image's.
        let clip = Self::ZERO + (CLIP_NATS * Self::LEVELS_PER_NAT) as u8;
        out.resize(columns, rows);
        transpose::transpose(&self.residual, out.data_mut(), rows, columns);
        self.clipped.resize(columns, rows);
        for (to, &from) in self.clipped.data_mut().iter_mut().zip(out.data()) {
            *to = from.min(clip);
        }
        // Not empty: there is at least the constant bin.
        let Some(clipped) = self.clipped.view() else { return Ok(()) };
        self.box_mean.mean(clipped, &mut self.mean);
        let zero = f32::from(Self::ZERO) + 0.5;
        for (level, &mean) in out.data_mut().iter_mut().zip(self.mean.data()) {
            *level = (f32::from(*level) - mean + zero) as u8;
        }
        Ok(())
    }

    /// Mean of every ring: of all its bins, and of a small ring, which a few peaks fill, again of those not far above that.
    fn ring_profile(&mut self, columns: usize, rows: usize) {
        self.sums.fill((0, 0));
        for (&value, &ring) in self.blurred.iter().zip(&self.rings) {
            if let Some(sum) = self.sums.get_mut(usize::from(ring)) {
                *sum = (sum.0 + i32::from(value), sum.1 + 1);
            }
        }
        let mean = |&(sum, count): &(i32, i32)| (sum / count.max(1)) as i16;
        self.profile.iter_mut().zip(&self.sums).for_each(|(to, sum)| *to = mean(sum));

        let clip = (0.5 * CLIP_NATS * Self::LEVELS_PER_NAT * 16.0) as i16;
        let inner = SMALL_RINGS.min(self.sums.len());
        let (cu, cv) = self.constant_bin();
        for _ in 0..2 {
            self.sums[..inner].fill((0, 0));
            for u in cu.saturating_sub(SMALL_RINGS)..(cu + SMALL_RINGS).min(columns) {
                let column = u * rows + cv.saturating_sub(SMALL_RINGS)..u * rows + (cv + SMALL_RINGS).min(rows);
                for (&value, &ring) in self.blurred[column.clone()].iter().zip(&self.rings[column]) {
                    let ring = usize::from(ring);
                    if ring < inner {
                        let value = value.min(self.profile[ring].saturating_add(clip));
                        self.sums[ring] = (self.sums[ring].0 + i32::from(value), self.sums[ring].1 + 1);
                    }
                }
            }
            self.profile.iter_mut().zip(&self.sums[..inner]).for_each(|(to, sum)| *to = mean(sum));
        }
    }
}

/// Weights 1 2 1 along both directions, borders repeated, not divided by their sum of 16.
fn blur(image: &[i16], width: usize, out: &mut Vec<i16>) {
    let height = image.len() / width;
    out.resize(image.len(), 0);
    let row = |v: usize| &image[v * width..][..width];
    for (v, to) in out.chunks_exact_mut(width).enumerate() {
        let (above, here, below) = (row(v.saturating_sub(1)), row(v), row((v + 1).min(height - 1)));
        let column = |u: usize| above[u] + 2 * here[u] + below[u];
        for u in [0, width - 1] {
            to[u] = column(u.saturating_sub(1)) + 2 * column(u) + column((u + 1).min(width - 1));
        }
        let inner = to.iter_mut().skip(1).take(width.saturating_sub(2));
        for (((to, above), here), below) in inner.zip(above.windows(3)).zip(here.windows(3)).zip(below.windows(3)) {
            let column = |i: usize| above[i] + 2 * here[i] + below[i];
            *to = column(0) + 2 * column(1) + column(2);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::{SpectrumPlan, Window};
    use net_image::View;

    /// Noise whose spectrum falls like a shaded picture's, with or without a wave on it.
    fn picture(width: usize, height: usize, wave: f32) -> Vec<f32> {
        let mut state = 0x0123_4567_89AB_CDEF_u64;
        let mut walk = vec![0.0f32; width * height];
        for v in 0..height {
            for u in 0..width {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                let noise = (state >> 40) as f32 / (1u64 << 24) as f32 - 0.5;
                let left = if u > 0 { walk[v * width + u - 1] } else { 0.0 };
                let above = if v > 0 { walk[(v - 1) * width + u] } else { 0.0 };
                walk[v * width + u] = 0.48 * (left + above) + noise * 4.0;
            }
        }
        for (i, value) in walk.iter_mut().enumerate() {
            let (u, v) = ((i % width) as f32, (i / width) as f32);
            *value += wave * (std::f32::consts::TAU * (20.0 * u / width as f32 + 9.0 * v / height as f32)).cos();
        }
        walk
    }

    fn flat(width: usize, height: usize, wave: f32) -> (Image<u8>, (usize, usize)) {
        let data = picture(width, height, wave);
        let mut plan = SpectrumPlan::new(width, height, Window::Hann).unwrap();
        let (mut spectrum, mut out) = (HalfSpectrum::default(), Image::default());
        plan.transform(View::packed(&data, width, height).unwrap(), &mut spectrum).unwrap();
        let bins = Bins::Half { left: 8, right: 60, vertical: 50 };
        let mut flattener = Flattener::new(width, height, bins, 1.0).unwrap();
        flattener.flatten(&spectrum, &mut out).unwrap();
        (out, flattener.constant_bin())
    }

    #[test]
    fn the_background_is_level_and_a_peak_stands_out() {
        let (out, (cx, cy)) = flat(160, 120, 0.0);
        let zero = f64::from(Flattener::ZERO);
        let mean = |from: usize, to: usize| {
            let levels = (0..out.height()).flat_map(|v| out.row(v)[cx + from..cx + to].to_vec());
            let (sum, count) = levels.fold((0.0, 0.0), |(sum, count), level| (sum + f64::from(level), count + 1.0));
            (sum / count - zero) / f64::from(Flattener::LEVELS_PER_NAT)
        };
        // The random walk's spectrum falls by four nats from the fifth to the fiftieth bin. A tenth of a nat is 10 % of a magnitude.
        assert!(mean(5, 15).abs() < 0.1, "near the centre: {}", mean(5, 15));
        assert!(mean(40, 50).abs() < 0.1, "far out: {}", mean(40, 50));

        let (out, _) = flat(160, 120, 1.0);
        let at = out.row(cy + 9)[cx + 20];
        let highest = *out.data().iter().max().unwrap();
        assert_eq!(at, highest, "the wave is the highest point");
        assert!(f64::from(at) > zero + 1.5 * f64::from(Flattener::LEVELS_PER_NAT), "and well above: {at}");
    }

    #[test]
    fn small_pictures_and_wrong_ones_do_not_panic() {
        for (width, height) in [(1, 1), (1, 3), (5, 2), (16, 9)] {
            let (out, (cx, cy)) = flat(width, height, 1.0);
            assert_eq!((out.width(), out.height()), (width, height));
            assert_eq!((cx, cy), (width / 2, height / 2));
        }
        let mut flattener = Flattener::new(8, 8, Bins::All, 1.0).unwrap();
        assert!(flattener.flatten(&HalfSpectrum::default(), &mut Image::default()).is_err());
        assert!(Flattener::new(0, 8, Bins::All, 1.0).is_err());
        assert!(Flattener::new(8, 8, Bins::All, 0.0).is_err());
    }
}
