//! Gaussian smoothing at the price of its smallest resolution: average down, blur, interpolate up.

use net_image::Image;

use crate::numeric::magnitude_quantiles;

/// Blurs with its buffers kept.
#[derive(Debug, Default)]
pub(crate) struct Smoother {
    small: Image<f32>,
    half: Image<f32>,
    kernel: Vec<f32>,
    line: Vec<f32>,
    square: Image<f32>,
    energy: Image<f32>,
}

impl Smoother {
    /// Divides a high-passed picture by its local deviation over `sigma` px, of which the `FAINT` quantile of the picture is the least. Outlines
    /// of fish are many times as strong as twine, and there is more noise in one part of a picture than in another; a place has as much say
    /// as it is like a net, not as it is bright (divisive normalisation).
    pub(crate) fn equalize(&mut self, image: &mut Image<f32>, sigma: f32, histogram: &mut Vec<u32>) {
        const FAINT: f64 = 0.3;
        let (mut square, mut energy) = (std::mem::take(&mut self.square), std::mem::take(&mut self.energy));
        square.resize(image.width(), image.height());
        for (s, h) in square.data_mut().iter_mut().zip(image.data()) {
            *s = h * h;
        }
        self.blur(&square, sigma, &mut energy);
        let [least] = magnitude_quantiles(energy.data().iter().copied(), [FAINT], histogram);
        for (h, e) in image.data_mut().iter_mut().zip(energy.data()) {
            *h /= (e + least + 1e-12).sqrt();
        }
        (self.square, self.energy) = (square, energy);
    }

    /// `out = image - blur(image)`, Gaussian of `sigma` px, edges mirrored.
    pub(crate) fn subtract_blur(&mut self, image: &Image<f32>, sigma: f32, out: &mut Image<f32>) {
        out.resize(image.width(), image.height());
        let f = self.reduce(image, sigma);
        self.expand(f, image.width(), image.height(), |v, u0, values| {
            let src = &image.row(v)[u0..];
            let dst = &mut out.row_mut(v)[u0..];
            for ((d, s), b) in dst.iter_mut().zip(src).zip(values) {
                *d = s - b;
            }
        });
    }

    /// `out = blur(image)`.
    pub(crate) fn blur(&mut self, image: &Image<f32>, sigma: f32, out: &mut Image<f32>) {
        out.resize(image.width(), image.height());
        let f = self.reduce(image, sigma);
        self.expand(f, image.width(), image.height(), |v, u0, values| {
            out.row_mut(v)[u0..][..values.len()].copy_from_slice(values)
        });
    }

    /// Fills `small` with the blurred picture, a factor smaller, and returns the factor.
    fn reduce(&mut self, image: &Image<f32>, sigma: f32) -> usize {
        let (w, h) = (image.width(), image.height());
        let mut f = 1;
        while sigma / (2 * f) as f32 >= 2.0 && w / (2 * f) >= 8 && h / (2 * f) >= 8 {
            f *= 2;
        }
        let (sw, sh) = (w.div_ceil(f), h.div_ceil(f));
        self.small.resize(sw, sh);
        self.half.resize(sw, sh);
        for y in 0..sh {
            let rows = (h - y * f).min(f);
            self.line.clear();
            self.line.extend_from_slice(image.row(y * f));
            for r in 1..rows {
                for (sum, p) in self.line.iter_mut().zip(image.row(y * f + r)) {
                    *sum += p;
                }
            }
            for (o, block) in self.small.row_mut(y).iter_mut().zip(self.line.chunks(f)) {
                *o = block.iter().sum::<f32>() / (block.len() * rows) as f32;
            }
        }
        // The average over f px is itself a blur of (f² - 1) / 12, the interpolation one of about f² / 6.
        let ff = (f * f) as f32;
        let s = if f > 1 { (sigma * sigma - (ff - 1.0) / 12.0 - ff / 6.0).max(0.04) } else { sigma * sigma }.sqrt()
            / f as f32;
        self.gauss(s);
        f
    }

    /// Separable Gaussian on `small`, mirrored edges.
    fn gauss(&mut self, sigma: f32) {
        let radius = ((3.2 * sigma).ceil() as usize).max(1);
        self.kernel.clear();
        self.kernel.extend((0..=radius).map(|k| (-0.5 * (k as f32 / sigma).powi(2)).exp()));
        let sum: f32 = self.kernel[0] + 2.0 * self.kernel[1..].iter().sum::<f32>();
        self.kernel.iter_mut().for_each(|k| *k /= sum);
        let (w, h) = (self.small.width(), self.small.height());
        let mirror = |i: isize, n: usize| {
            let period = 2 * n as isize;
            let m = i.rem_euclid(period);
            (if m < n as isize { m } else { period - 1 - m }) as usize
        };
        for y in 0..h {
            self.line.clear();
            let row = self.small.row(y);
            self.line.extend((-(radius as isize)..(w + radius) as isize).map(|i| row[mirror(i, w)]));
            let out = self.half.row_mut(y);
            for (x, o) in out.iter_mut().enumerate() {
                *o = self.kernel[0] * self.line[x + radius];
            }
            for (k, g) in self.kernel.iter().enumerate().skip(1) {
                let (a, b) = (&self.line[radius - k..][..w], &self.line[radius + k..][..w]);
                for ((o, a), b) in out.iter_mut().zip(a).zip(b) {
                    *o += g * (a + b);
                }
            }
        }
        for y in 0..h {
            let out = self.small.row_mut(y);
            for (o, a) in out.iter_mut().zip(self.half.row(y)) {
                *o = self.kernel[0] * a;
            }
            for (k, g) in self.kernel.iter().enumerate().skip(1) {
                let a = self.half.row(mirror(y as isize - k as isize, h));
                let b = self.half.row(mirror((y + k) as isize, h));
                for ((o, a), b) in out.iter_mut().zip(a).zip(b) {
                    *o += g * (a + b);
                }
            }
        }
    }

    /// Interpolates `small` bilinearly and hands out each row from column 0.
    fn expand(&mut self, f: usize, width: usize, height: usize, mut sink: impl FnMut(usize, usize, &[f32])) {
        if f == 1 {
            for v in 0..height {
                sink(v, 0, self.small.row(v));
            }
            return;
        }
        let (sw, sh) = (self.small.width(), self.small.height());
        let per = 1.0 / f as f32;
        let offset = 0.5 * per - 0.5;
        self.half.resize(width, 1);
        for v in 0..height {
            let y = (v as f32 * per + offset).clamp(0.0, (sh - 1) as f32);
            let (y0, fy) = (y as usize, y.fract());
            let (a, b) = (self.small.row(y0), self.small.row((y0 + 1).min(sh - 1)));
            self.line.clear();
            self.line.extend(a.iter().zip(b).map(|(a, b)| a + fy * (b - a)));
            let out = self.half.row_mut(0);
            // Half a block at each end is constant; between, every block of f px runs from one sample to the next.
            let lead = f / 2;
            out[..lead.min(width)].fill(self.line[0]);
            let mut u = lead;
            let mut x = 0;
            while u < width {
                let (p, q) = (self.line[x], self.line[(x + 1).min(sw - 1)]);
                let n = f.min(width - u);
                let step = (q - p) * per;
                for (i, o) in out[u..u + n].iter_mut().enumerate() {
                    *o = p + step * (i as f32 + 0.5);
                }
                u += n;
                x += 1;
            }
            sink(v, 0, out);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blur_keeps_planes_and_smooths_like_a_gaussian() {
        let (w, h) = (203, 117);
        for sigma in [1.5f32, 4.0, 9.0, 25.0] {
            let mut smoother = Smoother::default();
            let mut image = Image::new(w, h);
            image.fill(0.7);
            let mut out = Image::default();
            smoother.blur(&image, sigma, &mut out);
            assert!(out.data().iter().all(|x| (x - 0.7).abs() < 1e-4), "constant at {sigma}");
            // A wave of wavelength 8 sigma is damped by exp(-2 pi² / 64) = 0.735.
            for v in 0..h {
                for (u, p) in image.row_mut(v).iter_mut().enumerate() {
                    *p = (std::f32::consts::TAU * u as f32 / (8.0 * sigma)).cos();
                }
            }
            smoother.blur(&image, sigma, &mut out);
            let u = (8.0 * sigma).round() as usize;
            if u + 3 * (sigma as usize) < w {
                let expected = 0.735 * (std::f32::consts::TAU * u as f32 / (8.0 * sigma)).cos();
                // bilinear interpolation between samples two sigma apart leaves a few percent
                assert!((out.row(h / 2)[u] - expected).abs() < 0.05, "{sigma}: {}", out.row(h / 2)[u]);
            }
        }
    }
}
