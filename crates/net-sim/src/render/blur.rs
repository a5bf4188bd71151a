//! Gaussian blur of the whole picture.

/// Blurs with standard deviation `sigma` px, the border repeated; owns what that takes.
#[derive(Debug, Default)]
pub(crate) struct Blur {
    kernel: Vec<f32>,
    scratch: Vec<f32>,
    line: Vec<f32>,
}

impl Blur {
    pub(crate) fn apply(&mut self, picture: &mut [f32], width: usize, sigma: f64) {
        if sigma < 0.05 || width == 0 {
            return;
        }
        let height = picture.len() / width;
        let radius = (4.0 * sigma).ceil() as usize;
        self.kernel.clear();
        // The Gaussian's share of each pixel, so that little blur is right too.
        let below = |x: f64| 0.5 * libm::erfc(-x / sigma * std::f64::consts::FRAC_1_SQRT_2);
        self.kernel.extend((0..=radius).map(|k| (below(k as f64 + 0.5) - below(k as f64 - 0.5)) as f32));
        let sum = self.kernel[0] + 2.0 * self.kernel[1..].iter().sum::<f32>();
        self.kernel.iter_mut().for_each(|k| *k /= sum);
        // Along rows, with the border repeated in a longer line.
        for row in picture.chunks_exact_mut(width) {
            self.line.clear();
            self.line.extend(std::iter::repeat_n(row[0], radius));
            self.line.extend_from_slice(row);
            self.line.extend(std::iter::repeat_n(row[width - 1], radius));
            for (u, out) in row.iter_mut().enumerate() {
                *out = weigh(&self.kernel, &self.line[u..u + 2 * radius + 1]);
            }
        }
        // Along columns, a row at a time.
        self.scratch.clear();
        self.scratch.extend_from_slice(picture);
        for (v, out) in picture.chunks_exact_mut(width).enumerate() {
            out.fill(0.0);
            for offset in -(radius as isize)..=radius as isize {
                let from = (v as isize + offset).clamp(0, height as isize - 1) as usize;
                let weight = self.kernel[offset.unsigned_abs()];
                for (o, s) in out.iter_mut().zip(&self.scratch[from * width..][..width]) {
                    *o += weight * s;
                }
            }
        }
    }
}

/// Weighted sum of `2 n - 1` values by a symmetric kernel of `n` weights, the middle one first.
fn weigh(kernel: &[f32], values: &[f32]) -> f32 {
    let middle = kernel.len() - 1;
    let sides = kernel.iter().enumerate().skip(1).map(|(k, w)| w * (values[middle - k] + values[middle + k]));
    kernel[0] * values[middle] + sides.sum::<f32>()
}
