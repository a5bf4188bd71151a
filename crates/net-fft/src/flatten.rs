//! A spectrum with its background taken away, so that one threshold serves near and far, clear and murky, noise and shading.

use net_geometry::nalgebra::Vector2;
use net_image::{BoxFilter, Image, View};

use crate::error::Result;
use crate::spectrum::SpectrumImage;

/// Half side of the square over which the background is averaged, bins: wider than a peak (4), narrower than shading's slope.
const BACKGROUND_RADIUS_BINS: usize = 6;
/// What rises above the background by more than this counts as a peak and not as background, nats.
const CLIP_NATS: f32 = 1.0;
/// Within so many bins of the constant one there is no background to speak of: the spectrum of shading falls too steeply.
const CORE_BINS: f64 = 1.6;

/// Takes the background off the logarithm of a spectrum: first its mean on rings round the constant bin (the slope of shading, lens and water), then the local mean,
/// both of what does not stand out. What is left is speckle round zero, and the net's peaks.
#[derive(Debug, Clone)]
pub struct Flattener {
    /// Width of the transformed picture, px, over its height: rings are circles in cycles per pixel.
    aspect: f64,
    box_mean: BoxFilter<u8>,
    /// Ring of every bin of the image; the core's is [`CORE_RING`].
    rings: Image<u16>,
    /// What `rings` was drawn for: size and constant bin of the image.
    drawn_for: (usize, usize, (usize, usize)),
    sums: Vec<(i64, u32)>,
    profile: Vec<i32>,
    residual: Image<u8>,
    clipped: Image<u8>,
    mean: Image<f32>,
}

const CORE_RING: u16 = u16::MAX;

impl Flattener {
    /// Level of the background in a flattened image.
    pub const ZERO: u8 = 64;
    /// Levels for a factor of e in magnitude.
    pub const LEVELS_PER_NAT: f32 = 32.0;

    /// For spectra of pictures of `width` x `height` px.
    ///
    /// # Errors
    /// Never in practice: the size of the averaging square is in range.
    pub fn new(width: usize, height: usize) -> Result<Self> {
        Ok(Self {
            aspect: width as f64 / height.max(1) as f64,
            box_mean: BoxFilter::new(BACKGROUND_RADIUS_BINS)?,
            rings: Image::default(),
            drawn_for: Default::default(),
            sums: Vec::new(),
            profile: Vec::new(),
            residual: Image::default(),
            clipped: Image::default(),
            mean: Image::default(),
        })
    }

    /// Flattens a logarithmic `spectrum`: level [`Self::ZERO`] is the background, and [`Self::LEVELS_PER_NAT`] levels a factor of e above it.
    pub fn flatten(&mut self, spectrum: &SpectrumImage, out: &mut Image<u8>) {
        let Some(image) = spectrum.view() else { return out.resize(0, 0) };
        self.draw_rings(image, spectrum.constant_bin());
        let per_level = spectrum.per_level() * Self::LEVELS_PER_NAT;
        let nats: [i32; 256] = std::array::from_fn(|level| (level as f32 * per_level).round() as i32);
        self.ring_profile(image, &nats);

        let (width, height) = (image.width(), image.height());
        self.residual.resize(width, height);
        for v in 0..height {
            let bins = self.residual.row_mut(v).iter_mut().zip(image.row(v)).zip(self.rings.row(v));
            for ((to, &level), &ring) in bins {
                let floor = self.profile.get(usize::from(ring)).copied();
                *to = floor.map_or(Self::ZERO, |floor| {
                    (nats[usize::from(level)] - floor + i32::from(Self::ZERO)).clamp(0, 255) as u8
                });
            }
        }
        let clip = (CLIP_NATS * Self::LEVELS_PER_NAT) as u8;
        self.clipped.resize(width, height);
        for (to, &from) in self.clipped.data_mut().iter_mut().zip(self.residual.data()) {
            *to = from.min(Self::ZERO + clip);
        }
        // Neither image is empty: `spectrum` has pixels.
        let (Some(clipped), zero) = (self.clipped.view(), f32::from(Self::ZERO)) else { return };
        self.box_mean.mean(clipped, &mut self.mean);
        out.resize(width, height);
        for ((to, &from), &mean) in out.data_mut().iter_mut().zip(self.residual.data()).zip(self.mean.data()) {
            *to = (f32::from(from) - mean + zero + 0.5) as u8;
        }
    }

    fn draw_rings(&mut self, image: View<'_, u8>, constant_bin: (usize, usize)) {
        let (width, height) = (image.width(), image.height());
        if self.drawn_for == (width, height, constant_bin) {
            return;
        }
        self.drawn_for = (width, height, constant_bin);
        self.rings.resize(width, height);
        let mut last = 0;
        for v in 0..height {
            for (u, ring) in self.rings.row_mut(v).iter_mut().enumerate() {
                let bin = Vector2::new(u as f64 - constant_bin.0 as f64, v as f64 - constant_bin.1 as f64);
                // Bins are 1 / width and 1 / height of a cycle per pixel: measure in the finer of the two.
                let radius = if self.aspect > 1.0 {
                    bin.x.hypot(bin.y * self.aspect)
                } else {
                    (bin.x / self.aspect).hypot(bin.y)
                };
                *ring = if bin.norm() < CORE_BINS {
                    CORE_RING
                } else {
                    (radius as usize).min(usize::from(CORE_RING) - 1) as u16
                };
                if *ring != CORE_RING {
                    last = last.max(usize::from(*ring));
                }
            }
        }
        self.sums = vec![(0, 0); last + 1];
        self.profile = vec![0; last + 1];
    }

    /// Mean of every ring, first of all its bins, then of those not far above that.
    fn ring_profile(&mut self, image: View<'_, u8>, nats: &[i32; 256]) {
        self.profile.fill(i32::MAX / 2);
        let clip = (CLIP_NATS * Self::LEVELS_PER_NAT) as i32;
        for _ in 0..2 {
            self.sums.fill((0, 0));
            for (levels, rings) in image.rows().zip(self.rings.data().chunks_exact(image.width())) {
                for (&level, &ring) in levels.iter().zip(rings) {
                    if let Some(sum) = self.sums.get_mut(usize::from(ring)) {
                        let value = nats[usize::from(level)].min(self.profile[usize::from(ring)] + clip);
                        *sum = (sum.0 + i64::from(value), sum.1 + 1);
                    }
                }
            }
            for (mean, &(sum, count)) in self.profile.iter_mut().zip(&self.sums) {
                *mean = (sum / i64::from(count.max(1))) as i32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fft2::HalfSpectrum;
    use crate::spectrum::{Bins, SpectrumImageConfig, SpectrumPlan, Window};

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

    fn flat(wave: f32) -> (Image<u8>, (usize, usize)) {
        let (width, height) = (160, 120);
        let data = picture(width, height, wave);
        let mut plan = SpectrumPlan::new(width, height, Window::Hann).unwrap();
        let (mut spectrum, mut image, mut out) = (HalfSpectrum::default(), SpectrumImage::default(), Image::default());
        plan.transform(View::packed(&data, width, height).unwrap(), &mut spectrum).unwrap();
        image.draw(&spectrum, Bins::Half { left: 8, right: 60, vertical: 50 }, SpectrumImageConfig::default());
        Flattener::new(width, height).unwrap().flatten(&image, &mut out);
        (out, image.constant_bin())
    }

    #[test]
    fn the_background_is_level_and_a_peak_stands_out() {
        let (out, (cx, cy)) = flat(0.0);
        let zero = f64::from(Flattener::ZERO);
        let mean = |from: usize, to: usize| {
            let levels = (0..out.height()).flat_map(|v| out.row(v)[cx + from..cx + to].to_vec());
            let (sum, count) = levels.fold((0.0, 0.0), |(sum, count), level| (sum + f64::from(level), count + 1.0));
            (sum / count - zero) / f64::from(Flattener::LEVELS_PER_NAT)
        };
        // The random walk's spectrum falls by four nats from the fifth to the fiftieth bin. A tenth of a nat is 10 % of a magnitude.
        assert!(mean(5, 15).abs() < 0.1, "near the centre: {}", mean(5, 15));
        assert!(mean(40, 50).abs() < 0.1, "far out: {}", mean(40, 50));

        let (out, _) = flat(1.0);
        let at = out.row(cy + 9)[cx + 20];
        let highest = *out.data().iter().max().unwrap();
        assert_eq!(at, highest, "the wave is the highest point");
        assert!(f64::from(at) > zero + 1.5 * f64::from(Flattener::LEVELS_PER_NAT), "and well above: {at}");
    }
}
