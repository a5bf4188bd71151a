//! Image pyramid.

use crate::image::Image;
use crate::view::{GrayView, View};

/// A grey image and its halves, quarters and so on. Keeps its buffers: images of a size seen before allocate nothing.
///
/// Each level is the one below blurred with (1, 4, 6, 4, 1) / 16 along both axes (Burt and Adelson 1983), every other
/// pixel kept: pixel `(u, v)` of level k is centred on pixel `(2^k u, 2^k v)` of the image, without an offset of
/// halves. Beyond its border an image goes on as its outermost pixel.
#[derive(Debug, Clone)]
pub struct Pyramid {
    /// Room for all levels; `used` of them are of this image.
    levels: Vec<Image<u8>>,
    used: usize,
    /// One row, weighted along v, in sixteenths, with its border.
    wide: Vec<u16>,
}

impl Pyramid {
    /// An empty pyramid of at most `levels` levels, the image itself counted (so at least one).
    pub fn new(levels: usize) -> Self {
        // 2^32 px are more than any image has.
        Self { levels: vec![Image::default(); levels.clamp(1, 32)], used: 0, wide: Vec::new() }
    }

    /// Takes a copy of `image` and builds the levels above. The last level is the last whose shorter side has at least
    /// `min_side` px.
    pub fn build(&mut self, image: GrayView<'_>, min_side: usize) {
        let mut size = (image.width(), image.height());
        self.levels[0].copy_from(image);
        self.used = 1;
        while self.used < self.levels.len() && size != (1, 1) {
            size = (size.0.div_ceil(2), size.1.div_ceil(2));
            if size.0.min(size.1) < min_side {
                break;
            }
            let (below, above) = self.levels.split_at_mut(self.used);
            let Some(view) = below[self.used - 1].view() else { break };
            halve(view, &mut self.wide, &mut above[0]);
            self.used += 1;
        }
    }

    /// Number of levels of the image at hand; zero before the first.
    pub fn len(&self) -> usize {
        self.used
    }

    /// Whether it holds no image yet.
    pub fn is_empty(&self) -> bool {
        self.used == 0
    }

    /// Level `k`, 0 being the image itself; `None` above the last.
    pub fn level(&self, k: usize) -> Option<GrayView<'_>> {
        self.levels[..self.used].get(k)?.view()
    }
}

/// Blurs and keeps every other pixel, those at even places.
fn halve(image: View<'_, u8>, wide: &mut Vec<u16>, out: &mut Image<u8>) {
    let (width, height) = (image.width(), image.height());
    let half_width = width.div_ceil(2);
    out.resize(half_width, height.div_ceil(2));
    // Two pixels of border left and right, and one more so that the pixels come in pairs.
    wide.resize(2 * half_width + 4, 0);
    for v in 0..out.height() {
        let row = |offset: usize| image.row((2 * v + offset).saturating_sub(2).min(height - 1));
        let (a, b, c, d, e) = (row(0), row(1), row(2), row(3), row(4));
        for (((((w, &a), &b), &c), &d), &e) in wide[2..].iter_mut().zip(a).zip(b).zip(c).zip(d).zip(e) {
            let [a, b, c, d, e] = [a, b, c, d, e].map(u16::from);
            *w = a + e + 4 * (b + d) + 6 * c;
        }
        let (first, last) = (wide[2], wide[width + 1]);
        wide[..2].fill(first);
        wide[width + 2..].fill(last);
        let (pairs, _) = wide.as_chunks::<2>();
        for (((half, ab), cd), e) in out.row_mut(v).iter_mut().zip(pairs).zip(&pairs[1..]).zip(&pairs[2..]) {
            // At most 256 * 255 + 128: it fits.
            *half = ((ab[0] + e[0] + 4 * (ab[1] + cd[1]) + 6 * cd[0] + 128) >> 8) as u8;
        }
    }
}
