//! Gaussian smoothing at the price of its smallest resolution: average down, blur, interpolate up.

use net_image::{Image, widely};

use crate::numeric::magnitude_quantiles;

/// Blurs with its buffers kept.
#[derive(Debug)]
pub(crate) struct Smoother {
    /// Least standard deviation, samples, of the Gaussian on averaged samples. Of a wave of two samples, the shortest there is, [`Self::QUICK`] leaves 6e-5, but a
    /// line from sample to sample is a per cent off.
    pub least: f32,
    small: Image<f32>,
    half: Image<f32>,
    kernel: Vec<f32>,
    line: Vec<f32>,
    pairs: Vec<f32>,
}

impl Default for Smoother {
    fn default() -> Self {
        let (small, half) = (Image::default(), Image::default());
        Self { least: Self::FINE, small, half, kernel: Vec::new(), line: Vec::new(), pairs: Vec::new() }
    }
}

impl Smoother {
    pub(crate) const FINE: f32 = 2.0;
    pub(crate) const QUICK: f32 = 1.4;

    /// Divides a high-passed picture by its local deviation over `sigma` px, of which the `FAINT` quantile of the picture is the least. Outlines
    /// of fish are many times as strong as twine, and there is more noise in one part of a picture than in another; a place has as much say
    /// as it is like a net, not as it is bright (divisive normalisation).
    pub(crate) fn equalize(&mut self, image: &mut Image<f32>, sigma: f32, histogram: &mut Vec<u32>) {
        const FAINT: f64 = 0.3;
        let f = reduce_squares(self, image, sigma);
        let [least] = magnitude_quantiles(self.small.data().iter().copied(), [FAINT], histogram);
        divide_by_root(self, f, least, image);
    }

    /// `out = image - blur(image)`, Gaussian of `sigma` px, edges mirrored.
    pub(crate) fn subtract_blur(&mut self, image: &Image<f32>, sigma: f32, out: &mut Image<f32>) {
        out.resize(image.width(), image.height());
        subtract_blur(self, image, sigma, out);
    }

    /// `out = blur(image)`.
    pub(crate) fn blur(&mut self, image: &Image<f32>, sigma: f32, out: &mut Image<f32>) {
        out.resize(image.width(), image.height());
        blur(self, image, sigma, out);
    }

    /// Fills `small` with a blurred function of the picture, a factor smaller, and returns the factor, a power of 2.
    #[inline(always)]
    fn reduce(&mut self, image: &Image<f32>, sigma: f32, of: impl Fn(f32) -> f32) -> usize {
        let (w, h) = (image.width(), image.height());
        let mut f = 1;
        while sigma / (2 * f) as f32 >= self.least && w / (2 * f) >= 8 && h / (2 * f) >= 8 {
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
                self.pairs.clear();
                self.pairs.extend(self.line[..2 * n].chunks_exact(2).map(|p| p[0] + p[1]));
                self.line[..n].copy_from_slice(&self.pairs);
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
        self.gauss(s);
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
            if (0..n as isize).contains(&i) {
                return i as usize;
            }
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
            let line = &self.line;
            weigh(&self.kernel, self.half.row_mut(y), |k| (&line[radius - k..][..w], &line[radius + k..][..w]));
        }
        for y in 0..h {
            let half = &self.half;
            let row = |y: isize| half.row(mirror(y, h));
            weigh(&self.kernel, self.small.row_mut(y), |k| (row(y as isize - k as isize), row((y + k) as isize)));
        }
    }

    /// Interpolates `small` bilinearly and hands out row by row.
    #[inline(always)]
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

/// Outputs side by side that are summed at once.
const SIDE: usize = 32;

/// The weighted sum of a line and of the lines on either side of it; `pair` gives those `k` away.
#[inline(always)]
fn weigh<'a>(kernel: &[f32], out: &mut [f32], pair: impl Fn(usize) -> (&'a [f32], &'a [f32])) {
    let w = out.len();
    let mut x = 0;
    while x < w {
        // The last ones may be summed twice.
        let first = if x + SIDE > w { w.saturating_sub(SIDE) } else { x };
        let wide = SIDE.min(w);
        let mut sums = [0.0; SIDE];
        let middle = pair(0).0;
        if wide < SIDE {
            for (k, g) in kernel.iter().enumerate() {
                let (a, b) = pair(k);
                for (i, sum) in sums[..wide].iter_mut().enumerate() {
                    *sum += if k == 0 { g * middle[i] } else { g * (a[i] + b[i]) };
                }
            }
            out.copy_from_slice(&sums[..wide]);
            return;
        }
        let lane = |line: &'a [f32]| -> &'a [f32] { &line[first..][..SIDE] };
        sums.iter_mut().zip(lane(middle)).for_each(|(sum, p)| *sum = kernel[0] * p);
        for (k, g) in kernel.iter().enumerate().skip(1) {
            let (a, b) = pair(k);
            let (a, b) = (lane(a), lane(b));
            for i in 0..SIDE {
                sums[i] += g * (a[i] + b[i]);
            }
        }
        out[first..][..SIDE].copy_from_slice(&sums);
        x += SIDE;
    }
}

widely! {
    fn reduce_squares<'a>(smoother: &'a mut Smoother, image: &'a Image<f32>, sigma: f32) -> usize {
        smoother.reduce(image, sigma, |p| p * p)
    }
}
widely! {
    fn divide_by_root<'a>(smoother: &'a mut Smoother, f: usize, least: f32, image: &'a mut Image<f32>) -> () {
        smoother.expand(f, image.width(), image.height(), |v, energy| {
            for (h, e) in image.row_mut(v).iter_mut().zip(energy) {
                *h /= (e + least + 1e-12).sqrt();
            }
        });
    }
}
widely! {
    fn subtract_blur<'a>(smoother: &'a mut Smoother, image: &'a Image<f32>, sigma: f32, out: &'a mut Image<f32>) -> () {
        let f = smoother.reduce(image, sigma, |p| p);
        smoother.expand(f, image.width(), image.height(), |v, smooth| {
            for ((d, s), b) in out.row_mut(v).iter_mut().zip(image.row(v)).zip(smooth) {
                *d = s - b;
            }
        });
    }
}
widely! {
    fn blur<'a>(smoother: &'a mut Smoother, image: &'a Image<f32>, sigma: f32, out: &'a mut Image<f32>) -> () {
        let f = smoother.reduce(image, sigma, |p| p);
        smoother.expand(f, image.width(), image.height(), |v, smooth| out.row_mut(v).copy_from_slice(smooth));
    }
}

/// A line stretched by a factor that the compiler knows.
#[inline(always)]
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
