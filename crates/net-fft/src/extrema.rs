//! Running maximum and minimum over a rectangle (van Herk 1992, Gil and Werman 1993).
//!
//! Three comparisons a pixel and direction, whatever the size of the rectangle.

use net_image::{Image, View};

/// Maximum or minimum over a sliding rectangle, buffers kept between calls.
///
/// The window of `size` pixels reaches from `-(size / 2)` to `size - 1 - size / 2`, as SciPy's filters do; outside the image there is nothing.
#[derive(Debug, Clone, Default)]
pub struct RunningExtrema {
    /// Extremum from the start of the block to here.
    forward: Vec<u8>,
    /// Extremum from here to the end of the block.
    backward: Vec<u8>,
    /// Image after the first direction.
    between: Image<u8>,
}

impl RunningExtrema {
    /// The largest value within `width` x `height` px round each pixel, into `out`. A size of zero counts as one.
    pub fn max(&mut self, image: View<'_, u8>, width: usize, height: usize, out: &mut Image<u8>) {
        self.filter::<true>(image, width, height, out);
    }

    /// The smallest value within `width` x `height` px round each pixel, into `out`. A size of zero counts as one.
    pub fn min(&mut self, image: View<'_, u8>, width: usize, height: usize, out: &mut Image<u8>) {
        self.filter::<false>(image, width, height, out);
    }

    fn filter<const MAX: bool>(&mut self, image: View<'_, u8>, width: usize, height: usize, out: &mut Image<u8>) {
        let (columns, rows) = (image.width(), image.height());
        out.resize(columns, rows);
        self.between.resize(columns, rows);
        // A window past both borders from anywhere sees the whole row; more would only cost memory.
        let (width, height) = (width.clamp(1, 2 * columns + 2), height.clamp(1, 2 * rows + 2));
        for v in 0..rows {
            self.along_row::<MAX>(image.row(v), width, v);
        }
        self.along_columns::<MAX>(height, out);
    }

    /// One row of the first direction.
    fn along_row<const MAX: bool>(&mut self, row: &[u8], size: usize, v: usize) {
        let before = size / 2;
        // Pixel u's window starts at index u of the padded row.
        let padded = (row.len() + size - 1).next_multiple_of(size);
        self.backward.clear();
        self.backward.resize(padded, neutral::<MAX>());
        self.backward[before..before + row.len()].copy_from_slice(row);
        self.forward.clear();
        self.forward.extend_from_slice(&self.backward);
        for (forward, backward) in self.forward.chunks_exact_mut(size).zip(self.backward.chunks_exact_mut(size)) {
            let (mut left, mut right) = (neutral::<MAX>(), neutral::<MAX>());
            for (ahead, back) in forward.iter_mut().zip(backward.iter_mut().rev()) {
                left = pick::<MAX>(left, *ahead);
                *ahead = left;
                right = pick::<MAX>(right, *back);
                *back = right;
            }
        }
        let ends = &self.forward[size - 1..];
        for ((to, &start), &end) in self.between.row_mut(v).iter_mut().zip(&self.backward).zip(ends) {
            *to = pick::<MAX>(start, end);
        }
    }

    /// The second direction, whole rows at a time.
    fn along_columns<const MAX: bool>(&mut self, size: usize, out: &mut Image<u8>) {
        let (columns, rows) = (out.width(), out.height());
        let before = size / 2;
        let padded = (rows + size - 1).next_multiple_of(size);
        for buffer in [&mut self.forward, &mut self.backward] {
            buffer.clear();
            buffer.resize(padded * columns, neutral::<MAX>());
            buffer[before * columns..][..rows * columns].copy_from_slice(self.between.data());
        }
        for block in self.forward.chunks_exact_mut(size * columns) {
            for v in 1..size {
                let (done, rest) = block.split_at_mut(v * columns);
                combine::<MAX>(&mut rest[..columns], &done[(v - 1) * columns..]);
            }
        }
        for block in self.backward.chunks_exact_mut(size * columns) {
            for v in (1..size).rev() {
                let (rest, done) = block.split_at_mut(v * columns);
                combine::<MAX>(&mut rest[(v - 1) * columns..], &done[..columns]);
            }
        }
        for v in 0..rows {
            let row = out.row_mut(v);
            row.copy_from_slice(&self.backward[v * columns..][..columns]);
            combine::<MAX>(row, &self.forward[(v + size - 1) * columns..][..columns]);
        }
    }
}

/// What never wins.
const fn neutral<const MAX: bool>() -> u8 {
    if MAX { u8::MIN } else { u8::MAX }
}

#[inline(always)]
fn pick<const MAX: bool>(a: u8, b: u8) -> u8 {
    if MAX { a.max(b) } else { a.min(b) }
}

#[inline(always)]
fn combine<const MAX: bool>(to: &mut [u8], other: &[u8]) {
    for (to, &other) in to.iter_mut().zip(other) {
        *to = pick::<MAX>(*to, other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn naive(image: &Image<u8>, width: usize, height: usize, max: bool) -> Vec<u8> {
        let window = |at: usize, size: usize, length: usize| {
            let start = at.saturating_sub(size / 2);
            start..(at + size - size / 2).min(length)
        };
        let mut out = Vec::new();
        for v in 0..image.height() {
            for u in 0..image.width() {
                let values = window(v, height, image.height())
                    .flat_map(|y| window(u, width, image.width()).map(move |x| (x, y)))
                    .map(|(x, y)| image.row(y)[x]);
                out.push(if max { values.max() } else { values.min() }.expect("the pixel itself is in its window"));
            }
        }
        out
    }

    proptest! {
        #[test]
        fn equals_the_naive_filter(
            columns in 1usize..40, rows in 1usize..40, width in 1usize..50, height in 1usize..50, seed in any::<u64>(),
        ) {
            let data = (0..columns * rows).map(|i| (seed.wrapping_mul(i as u64 * 2 + 1) >> 37) as u8).collect();
            let image = Image::from_vec(data, columns, rows).expect("a whole image");
            let (mut filter, mut out) = (RunningExtrema::default(), Image::default());
            filter.max(image.view().expect("pixels"), width, height, &mut out);
            prop_assert_eq!(out.data(), naive(&image, width, height, true));
            filter.min(image.view().expect("pixels"), width, height, &mut out);
            prop_assert_eq!(out.data(), naive(&image, width, height, false));
        }
    }
}
