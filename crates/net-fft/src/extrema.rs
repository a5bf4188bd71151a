//! Running maximum and minimum over a rectangle.
//!
//! By doubling: the extremum over 2 n pixels is that of two extrema over n, whole rows at a time. A rectangle's cost grows with the logarithm of its sides, and
//! for all that are in use (3 to 64 px) it is less than that of the three comparisons of van Herk (1992), each of which waits for the one before.

use net_image::{Image, View};

/// Maximum or minimum over a sliding rectangle, buffers kept between calls.
///
/// The window of `size` pixels reaches from `-(size / 2)` to `size - 1 - size / 2`, as SciPy's filters do; outside the image there is nothing.
#[derive(Debug, Clone, Default)]
pub struct RunningExtrema {
    /// The image in a frame as wide as the window's reach, then the extrema over ever larger windows that begin at each pixel.
    here: Vec<u8>,
    next: Vec<u8>,
}

impl RunningExtrema {
    /// The largest value within `width` x `height` px round each pixel, into `out`. A size of zero counts as one.
    pub fn max(&mut self, image: View<'_, u8>, width: usize, height: usize, out: &mut Image<u8>) {
        self.filter(image, width, height, u8::MIN, u8::max, out);
    }

    /// The smallest value within `width` x `height` px round each pixel, into `out`. A size of zero counts as one.
    pub fn min(&mut self, image: View<'_, u8>, width: usize, height: usize, out: &mut Image<u8>) {
        self.filter(image, width, height, u8::MAX, u8::min, out);
    }

    /// With the larger or smaller of two, `pick`, of which `neutral` never is one.
    fn filter(
        &mut self,
        image: View<'_, u8>,
        width: usize,
        height: usize,
        neutral: u8,
        pick: impl Fn(u8, u8) -> u8,
        out: &mut Image<u8>,
    ) {
        let (columns, rows) = (image.width(), image.height());
        out.resize(columns, rows);
        // A window past both borders from anywhere sees the whole row; more would only cost memory.
        let (width, height) = (width.clamp(1, 2 * columns + 2), height.clamp(1, 2 * rows + 2));
        let stride = columns + width - 1;
        self.here.clear();
        self.here.resize(stride * (rows + height - 1), neutral);
        self.next.resize(self.here.len(), neutral);
        // Pixel (u, v)'s window begins at column u and row v of the framed image.
        for v in 0..rows {
            self.here[(v + height / 2) * stride + width / 2..][..columns].copy_from_slice(image.row(v));
        }
        self.widen(1, width, &pick);
        self.widen(stride, height, &pick);
        for v in 0..rows {
            out.row_mut(v).copy_from_slice(&self.here[v * stride..][..columns]);
        }
    }

    /// From extrema over single pixels to those over `size` of them, `step` apart. What reaches over the end of a row is of no pixel's window.
    fn widen(&mut self, step: usize, size: usize, pick: &impl Fn(u8, u8) -> u8) {
        let mut reach = 1;
        while reach < size {
            let further = reach.min(size - reach);
            let shift = further * step;
            let pairs = self.here.iter().zip(&self.here[shift..]);
            self.next.iter_mut().zip(pairs).for_each(|(to, (&a, &b))| *to = pick(a, b));
            let end = self.here.len() - shift;
            self.next[end..].copy_from_slice(&self.here[end..]);
            std::mem::swap(&mut self.here, &mut self.next);
            reach += further;
        }
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
