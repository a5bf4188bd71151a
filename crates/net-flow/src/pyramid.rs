//! Stage 1: the picture at full, half, quarter ... size.

use net_image::{GrayView, Image};

use crate::error::{Error, Result};

/// Shortest side of a level, px: below it a template no longer fits.
const SMALLEST_SIDE: usize = 24;

/// A picture and its reductions by two, each smoothed by the binomial 1 4 6 4 1 first. Pixel `(u, v)` of level `l` is pixel
/// `2^l (u, v)` of level 0. Owns its buffers: [`Pyramid::build`] allocates nothing.
#[derive(Debug, Clone)]
pub struct Pyramid {
    levels: Vec<Image<u8>>,
    /// One row after the vertical filter, sixteen-fold.
    row: Vec<u16>,
}

impl Pyramid {
    /// Buffers for pictures of `width` x `height` px and at most `levels` levels; fewer where the picture is too small for them.
    pub fn new(width: usize, height: usize, levels: usize) -> Self {
        let mut sizes = vec![(width, height)];
        let (mut w, mut h) = (width, height);
        while sizes.len() < levels {
            (w, h) = (w.div_ceil(2), h.div_ceil(2));
            if w.min(h) < SMALLEST_SIDE {
                break;
            }
            sizes.push((w, h));
        }
        Self { levels: sizes.into_iter().map(|(w, h)| Image::new(w, h)).collect(), row: vec![0; width] }
    }

    /// Fills all levels from `view`.
    ///
    /// # Errors
    /// [`Error::ImageSize`] for a picture of another size.
    pub fn build(&mut self, view: GrayView<'_>) -> Result<()> {
        let base = &mut self.levels[0];
        if (view.width(), view.height()) != (base.width(), base.height()) {
            return Err(Error::ImageSize {
                width: view.width(),
                height: view.height(),
                expected_width: base.width(),
                expected_height: base.height(),
            });
        }
        for (v, row) in view.rows().enumerate() {
            base.row_mut(v).copy_from_slice(row);
        }
        for l in 1..self.levels.len() {
            let (fine, coarse) = self.levels.split_at_mut(l);
            halve(&fine[l - 1], &mut coarse[0], &mut self.row);
        }
        Ok(())
    }

    /// Number of levels, at least 1.
    pub fn len(&self) -> usize {
        self.levels.len()
    }

    /// Never: there is always level 0.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Width of level 0, px.
    pub fn width(&self) -> usize {
        self.levels[0].width()
    }

    /// Height of level 0, px.
    pub fn height(&self) -> usize {
        self.levels[0].height()
    }

    /// Level `l`, the coarsest for larger `l`.
    pub fn level(&self, l: usize) -> &Image<u8> {
        &self.levels[l.min(self.levels.len() - 1)]
    }
}

/// Smooths by 1 4 6 4 1 along both axes and keeps every second pixel, edges repeated.
fn halve(fine: &Image<u8>, coarse: &mut Image<u8>, row: &mut [u16]) {
    let (width, height) = (fine.width(), fine.height());
    let row = &mut row[..width];
    for v in 0..coarse.height() {
        let tap = |d: isize| fine.row((2 * v as isize + d).clamp(0, height as isize - 1) as usize);
        let (a, b, c, d, e) = (tap(-2), tap(-1), tap(0), tap(1), tap(2));
        for (u, out) in row.iter_mut().enumerate() {
            let x = |r: &[u8]| u16::from(r[u]);
            *out = x(a) + x(e) + 4 * (x(b) + x(d)) + 6 * x(c);
        }
        let at = |u: isize| u32::from(row[u.clamp(0, width as isize - 1) as usize]);
        for (u, out) in coarse.row_mut(v).iter_mut().enumerate() {
            let u = 2 * u as isize;
            let sum = at(u - 2) + at(u + 2) + 4 * (at(u - 1) + at(u + 1)) + 6 * at(u);
            *out = ((sum + 128) >> 8) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_constants_and_slopes_where_they_are() {
        let data: Vec<u8> = (0..100 * 60).map(|i| (i % 100 + 30) as u8).collect();
        let mut pyramid = Pyramid::new(100, 60, 2);
        pyramid.build(GrayView::packed(&data, 100, 60).expect("a view")).expect("right size");
        let level = pyramid.level(1);
        assert_eq!((level.width(), level.height()), (50, 30));
        // Away from the edges a slope is untouched by a symmetric filter, and pixel u lies at 2 u.
        assert!((1..49).all(|u| level.row(7)[u] == (2 * u + 30) as u8));
    }

    #[test]
    fn small_pictures_get_fewer_levels_and_other_sizes_are_refused() {
        assert_eq!(Pyramid::new(1, 1, 4).len(), 1);
        assert_eq!(Pyramid::new(848, 480, 3).len(), 3);
        let data = [0u8; 12];
        let wrong = Pyramid::new(5, 3, 3).build(GrayView::packed(&data, 4, 3).expect("a view"));
        assert!(matches!(wrong, Err(Error::ImageSize { width: 4, expected_width: 5, .. })));
    }
}
