//! Gaussian blur.

use crate::error::{Error, Result};
use crate::image::Image;
use crate::pixel::Pixel;
use crate::view::View;

/// Columns worked on at a time: enough for the compiler to use vector registers, few enough to stay in them.
const LANES: usize = 32;

/// Largest standard deviation, px. Beyond it lies a mistake, not a blur.
const MAX_SIGMA: f64 = 10_000.0;

/// Separable Gaussian blur of any width. Beyond its border the image goes on as its outermost pixel. Keeps its buffers:
/// images of a size seen before allocate nothing.
#[derive(Debug, Clone)]
pub struct GaussianBlur {
    /// Weight of the centre and of its neighbours to one side; all of them, both sides, sum to one.
    half_kernel: Vec<f32>,
    /// One row of the image, with its border.
    padded: Vec<f32>,
    /// The last rows, blurred along u: as many as the kernel is long.
    ring: Vec<f32>,
    /// Where in `ring` the rows above and below the current one are, by distance.
    offsets: Vec<(usize, usize)>,
}

impl GaussianBlur {
    /// A blur of standard deviation `sigma`, px, cut off at 4 sigma. Zero copies the image.
    ///
    /// # Errors
    /// [`Error::Value`] if `sigma` is not a number from 0 to 10,000.
    pub fn new(sigma: f64) -> Result<Self> {
        Self::with_radius(sigma, (4.0 * sigma + 0.5) as usize)
    }

    /// A blur of standard deviation `sigma`, px, cut off `radius` px from its centre. The time it takes grows with the
    /// radius.
    ///
    /// # Errors
    /// [`Error::Value`] if `sigma` is not a number from 0 to 10,000, or the radius above 40,000.
    pub fn with_radius(sigma: f64, radius: usize) -> Result<Self> {
        if !(0.0..=MAX_SIGMA).contains(&sigma) {
            return Err(Error::Value { field: "sigma of a blur", value: sigma, expected: "0 to 10000 px" });
        }
        if radius > 4 * MAX_SIGMA as usize {
            return Err(Error::Value { field: "radius of a blur", value: radius as f64, expected: "0 to 40000 px" });
        }
        let mut weights: Vec<f64> = (0..=radius).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
        // 0 / 0 at sigma zero.
        weights[0] = 1.0;
        let sum = 2.0 * weights.iter().sum::<f64>() - 1.0;
        Ok(Self {
            half_kernel: weights.iter().map(|w| (w / sum) as f32).collect(),
            padded: Vec::new(),
            ring: Vec::new(),
            offsets: Vec::new(),
        })
    }

    /// Pixels from the centre to the end of the kernel.
    pub fn radius(&self) -> usize {
        self.half_kernel.len() - 1
    }

    /// Blurs `image` into `out`, which takes its size.
    pub fn apply<T: Pixel>(&mut self, image: View<'_, T>, out: &mut Image<f32>) {
        let (width, height, radius) = (image.width(), image.height(), self.radius());
        out.resize(width, height);
        // Whole lanes, so that no row has a rest.
        let stride = width.next_multiple_of(LANES);
        let rows = (2 * radius + 1).min(height);
        self.padded.resize(stride + 2 * radius, 0.0);
        self.ring.resize(rows * stride, 0.0);
        let mut blurred = 0;
        for v in 0..height {
            while blurred < (v + radius + 1).min(height) {
                pad(image.row(blurred), radius, &mut self.padded);
                self.offsets.clear();
                self.offsets.extend((1..=radius).map(|k| (radius - k, radius + k)));
                let row = &mut self.ring[blurred % rows * stride..][..width];
                weigh(&self.half_kernel, &self.padded, radius, &self.offsets, row);
                blurred += 1;
            }
            let offset = |row: usize| row % rows * stride;
            self.offsets.clear();
            self.offsets.extend((1..=radius).map(|k| (offset(v.saturating_sub(k)), offset((v + k).min(height - 1)))));
            weigh(&self.half_kernel, &self.ring, offset(v), &self.offsets, out.row_mut(v));
        }
    }
}

/// A row between `radius` copies of its first and of its last pixel.
fn pad<T: Pixel>(row: &[T], radius: usize, padded: &mut [f32]) {
    let (left, rest) = padded.split_at_mut(radius);
    let (middle, right) = rest.split_at_mut(row.len());
    for (p, x) in middle.iter_mut().zip(row) {
        *p = x.to_f32();
    }
    left.fill(row[0].to_f32());
    right.fill(row[row.len() - 1].to_f32());
}

/// `out[x] = kernel[0] source[centre + x] + sum over k of kernel[k] (source[before_k + x] + source[after_k + x])`.
fn weigh(half_kernel: &[f32], source: &[f32], centre: usize, offsets: &[(usize, usize)], out: &mut [f32]) {
    let (middle, sides) = half_kernel.split_first().unwrap_or((&0.0, &[]));
    let sums = |start: usize| {
        let mut sums = lanes(source, centre + start).map(|x| middle * x);
        for (weight, &(before, after)) in sides.iter().zip(offsets) {
            let (before, after) = (lanes(source, before + start), lanes(source, after + start));
            for k in 0..LANES {
                sums[k] += weight * (before[k] + after[k]);
            }
        }
        sums
    };
    let (chunks, rest) = out.as_chunks_mut::<LANES>();
    let start_of_rest = chunks.len() * LANES;
    for (k, chunk) in chunks.iter_mut().enumerate() {
        *chunk = sums(k * LANES);
    }
    if !rest.is_empty() {
        rest.copy_from_slice(&sums(start_of_rest)[..rest.len()]);
    }
}

/// The values from `start` on. Rows are made of whole lanes, so there are as many.
#[inline]
fn lanes(source: &[f32], start: usize) -> &[f32; LANES] {
    source[start..].first_chunk().expect("rows are padded to whole lanes")
}
