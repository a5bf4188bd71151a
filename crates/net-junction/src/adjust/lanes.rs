//! Sums over short rows, eight values at once. To be inlined into what is compiled for wide instructions.

use wide::f32x8;

/// Values that are added at once.
pub(crate) const LANES: usize = 8;

/// Sum of products, as far as the shorter row goes.
#[inline(always)]
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let length = a.len().min(b.len());
    let (a, b) = (a[..length].as_chunks::<LANES>(), b[..length].as_chunks::<LANES>());
    let mut sums = f32x8::ZERO;
    for (a, b) in a.0.iter().zip(b.0) {
        sums += f32x8::from(*a) * f32x8::from(*b);
    }
    a.1.iter().zip(b.1).fold(total(sums.to_array()), |sum, (a, b)| sum + a * b)
}

/// Sum of all lanes.
#[inline(always)]
pub(crate) fn total(sums: [f32; LANES]) -> f32 {
    let [a, b, c, d, e, f, g, h] = sums;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

/// What constant and slope leave of rows of `2 half + 1` values.
#[derive(Debug, Clone, Default)]
pub(crate) struct Detrend {
    half: usize,
    /// One for each value of the row, and zeros up to a whole vector; the distance from the middle likewise.
    ones: Vec<f32>,
    ramp: Vec<f32>,
    /// Sum of squared distances.
    second: f32,
}

impl Detrend {
    /// For rows of this half length.
    pub fn new(half: usize) -> Self {
        let mut detrend = Self::default();
        detrend.start(half);
        detrend
    }

    /// The same, with the buffers there are.
    pub fn start(&mut self, half: usize) {
        let width = 2 * half + 1;
        self.half = half;
        self.ones.clear();
        self.ones.resize(width, 1.0);
        self.ramp.clear();
        self.ramp.extend((0..width).map(|k| k as f32 - half as f32));
        self.second = self.ramp.iter().map(|d| d * d).sum::<f32>().max(1e-9);
        self.ones.resize(width.next_multiple_of(LANES), 0.0);
        self.ramp.resize(width.next_multiple_of(LANES), 0.0);
    }

    /// Values on each side of a row's middle.
    pub fn half(&self) -> usize {
        self.half
    }

    /// Sum of squares that constant and slope leave. Whole vectors are read; what lies beyond the row's end need only be numbers.
    #[inline(always)]
    pub fn rest(&self, row: &[f32]) -> f32 {
        // About the middle value, so that squares of large grey levels do not cancel.
        let base = row[self.half];
        let (mut sum, mut squares, mut slope) = (f32x8::ZERO, f32x8::ZERO, f32x8::ZERO);
        let parts = self.ones.as_chunks::<LANES>().0.iter().zip(self.ramp.as_chunks::<LANES>().0);
        for (values, (ones, ramp)) in row.as_chunks::<LANES>().0.iter().zip(parts) {
            let off = f32x8::from(*values) - f32x8::splat(base);
            let value = off * f32x8::from(*ones);
            sum += value;
            squares += value * value;
            slope += off * f32x8::from(*ramp);
        }
        let [sum, squares, slope] = [sum, squares, slope].map(|lanes| total(lanes.to_array()));
        (squares - sum * sum / (2 * self.half + 1) as f32 - slope * slope / self.second).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_leaves_nothing_and_a_bump_what_it_is() {
        let mut detrend = Detrend::default();
        for half in 2..12 {
            detrend.start(half);
            let mut row: Vec<f32> = (0..2 * half + 1 + LANES).map(|k| 100.0 + 2.5 * k as f32).collect();
            row[2 * half + 1..].fill(-1e3);
            // Single precision of grey levels.
            assert!(detrend.rest(&row) < 1e-2, "{half}");
            row[half] += 3.0;
            let expected = 9.0 * (1.0 - 1.0 / (2 * half + 1) as f32);
            assert!((detrend.rest(&row) - expected).abs() < 2e-2, "{half}");
        }
    }

    #[test]
    fn all_products_are_added() {
        for length in 0..30 {
            let (a, b): (Vec<f32>, Vec<f32>) = (0..length).map(|k| (k as f32, 2.0)).unzip();
            assert_eq!(dot(&a, &b), (length * (length.max(1) - 1)) as f32);
        }
    }
}
