//! Gaussian smoothing at the price of its smallest resolution: average down, blur, interpolate up.

use net_image::{Image, widely};

use crate::numeric::magnitude_quantiles;

/// Blurs with its buffers kept.
#[derive(Debug, Default)]
pub(crate) struct Smoother {
    small: Image<f32>,
    half: Image<f32>,
    kernel: Vec<f32>,
    line: Vec<f32>,
}

impl Smoother {
    /// Divides a high-passed picture by its local deviation over `sigma` px, of which the `FAINT` quantile of the picture is the least. Outlines
    /// of fish are many times as strong as twine, and there is more noise in one part of a picture than in another; a place has as much say
    /// as it is like a net, not as it is bright (divisive normalisation).
    pub(crate) fn equalize(&mut self, image: &mut Image<f32>, sigma: f32, histogram: &mut Vec<u32>) {
        const FAINT: f64 = 0.3;
        let f = self.reduce(image, sigma, |p| p * p);
        let [least] = magnitude_quantiles(self.small.data().iter().copied(), [FAINT], histogram);
        self.expand(f, image.width(), image.height(), |v, energy| {
            for (h, e) in image.row_mut(v).iter_mut().zip(energy) {
                *h /= (e + least + 1e-12).sqrt();
            }
        });
    }

    /// `out = image - blur(image)`, Gaussian of `sigma` px, edges mirrored.
    pub(crate) fn subtract_blur(&mut self, image: &Image<f32>, sigma: f32, out: &mut Image<f32>) {
        out.resize(image.width(), image.height());
        let f = self.reduce(image, sigma, |p| p);
        self.expand(f, image.width(), image.height(), |v, smooth| {
            for ((d, s), b) in out.row_mut(v).iter_mut().zip(image.row(v)).zip(smooth) {
                *d = s - b;
            }
        });
    }

    /// `out = blur(image)`.
    pub(crate) fn blur(&mut self, image: &Image<f32>, sigma: f32, out: &mut Image<f32>) {
        out.resize(image.width(), image.height());
        let f = self.reduce(image, sigma, |p| p);
        self.expand(f, image.width(), image.height(), |v, smooth| out.row_mut(v).copy_from_slice(smooth));
    }

    /// Fills `small` with a blurred function of the picture, a factor smaller, and returns the factor, a power of 2.
    fn reduce(&mut self, image: &Image<f32>, sigma: f32, of: impl Fn(f32) -> f32) -> usize {
        let (w, h) = (image.width(), image.height());
        let mut f = 1;
        while sigma / (2 * f) as f32 >= 2.0 && w / (2 * f) >= 8 && h / (2 * f) >= 8 {
            f *= 2;
        }
        let (sw, sh) = (w.div_ceil(f), h.div_ceil(f));
        self.small.resize(sw, sh);
        self.half.resize(sw, sh);
        self.line.resize(sw * f, 0.0);
        for y in 0..sh {
            let rows = (h - y * f).min(f);
            self.line.fill(0.0);
            for r in 0..rows {
                for (sum, p) in self.line.iter_mut().zip(image.row(y * f + r)) {
                    *sum += of(*p);
                }
            }
            // Sums of two, of four, ...
            let mut n = sw * f;
            while n > sw {
                n /= 2;
                for x in 0..n {
                    self.line[x] = self.line[2 * x] + self.line[2 * x + 1];
                }
            }
            let small = self.small.row_mut(y);
            let per = 1.0 / (f * rows) as f32;
            for (o, sum) in small.iter_mut().zip(&self.line) {
                *o = sum * per;
            }
            // The last ones may be narrower.
            small[sw - 1] *= f as f32 / (w - (sw - 1) * f) as f32;
        }
        // The average over f px is itself a blur of (f² - 1) / 12, the interpolation one of about f² / 6.
        let ff = (f * f) as f32;
        let s = if f > 1 { (sigma * sigma - (ff - 1.0) / 12.0 - ff / 6.0).max(0.04) } else { sigma * sigma }.sqrt()
            / f as f32;
        gauss(self, s);
        f
    }

    /// Separable Gaussian on `small`, mirrored edges.
    #[inline(always)]
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
            let (left, right) = (-(radius as isize)..0, w as isize..(w + radius) as isize);
            self.line.extend(left.map(|i| row[mirror(i, w)]));
            self.line.extend_from_slice(row);
            self.line.extend(right.map(|i| row[mirror(i, w)]));
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

    /// Interpolates `small` bilinearly and hands out row by row.
    fn expand(&mut self, f: usize, width: usize, height: usize, mut sink: impl FnMut(usize, &[f32])) {
        if f == 1 {
            for v in 0..height {
                sink(v, self.small.row(v));
            }
            return;
        }
        let sh = self.small.height();
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
            match f {
                2 => stretch::<2>(&self.line, out),
                4 => stretch::<4>(&self.line, out),
                8 => stretch::<8>(&self.line, out),
                _ => stretch_by(f, &self.line, out),
            }
            sink(v, out);
        }
    }
}

widely! {
    fn gauss<'a>(smoother: &'a mut Smoother, sigma: f32) -> () {
        smoother.gauss(sigma);
    }
}

/// A line stretched by a factor that the compiler knows.
fn stretch<const F: usize>(line: &[f32], out: &mut [f32]) {
    stretch_by(F, line, out);
}

/// A line linearly interpolated to `f` times as many samples. Half a block at each end is constant; between, every block of `f` runs from one sample to the next.
#[inline(always)]
fn stretch_by(f: usize, line: &[f32], out: &mut [f32]) {
    let per = 1.0 / f as f32;
    let lead = (f / 2).min(out.len());
    let (head, body) = out.split_at_mut(lead);
    head.fill(line[0]);
    let whole = body.len() / f * f;
    let (blocks, tail) = body.split_at_mut(whole);
    for (block, ends) in blocks.chunks_exact_mut(f).zip(line.windows(2)) {
        let step = (ends[1] - ends[0]) * per;
        for (i, o) in block.iter_mut().enumerate() {
            *o = ends[0] + step * (i as f32 + 0.5);
        }
    }
    let x = whole / f;
    let (p, q) = (line[x.min(line.len() - 1)], line[(x + 1).min(line.len() - 1)]);
    for (i, o) in tail.iter_mut().enumerate() {
        *o = p + (q - p) * per * (i as f32 + 0.5);
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
