//! Pictures taken apart and put together another way: undistortion, rectification.

use crate::error::{Error, Result};
use crate::image::Image;
use crate::view::GrayView;

/// Fractions of a pixel are kept in 1/128ths: a bilinear value is then off by at most one grey value.
const ONE: f64 = 128.0;

/// Where each pixel of a picture comes from, worked out once.
#[derive(Debug, Clone)]
pub struct Remap {
    /// Size of the picture made, px.
    width: usize,
    height: usize,
    /// Size of the picture read, px.
    source_width: usize,
    source_height: usize,
    entries: Vec<Entry>,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    /// Pixel at or before the place to read, `OUTSIDE` if there is none.
    u: u16,
    v: u16,
    /// The rest, in 1/128ths.
    x: u8,
    y: u8,
}

/// No source is that wide.
const OUTSIDE: u16 = u16::MAX;

impl Remap {
    /// A picture of `width` x `height` px whose pixel `(u, v)` is read at `source_from_pixel(u, v)` of a picture of
    /// `source_width` x `source_height` px; `None` and places outside give black.
    ///
    /// # Errors
    /// [`Error::Size`] for sizes of zero or above 65535 px.
    pub fn new(
        (width, height): (usize, usize),
        (source_width, source_height): (usize, usize),
        source_from_pixel: impl Fn(f64, f64) -> Option<(f64, f64)>,
    ) -> Result<Self> {
        for (width, height) in [(width, height), (source_width, source_height)] {
            if !(1..=usize::from(OUTSIDE)).contains(&width) || !(1..=usize::from(OUTSIDE)).contains(&height) {
                return Err(Error::Size { width, height, stride: width });
            }
        }
        let entry = |k: usize| {
            let outside = Entry { u: OUTSIDE, v: OUTSIDE, x: 0, y: 0 };
            let Some((u, v)) = source_from_pixel((k % width) as f64, (k / width) as f64) else { return outside };
            // Rounded first, so that the pixel and the rest belong together. NaN is in no range.
            let (u, v) = ((u * ONE).round() / ONE, (v * ONE).round() / ONE);
            if !(0.0..=(source_width - 1) as f64).contains(&u) || !(0.0..=(source_height - 1) as f64).contains(&v) {
                return outside;
            }
            Entry { u: u as u16, v: v as u16, x: (u.fract() * ONE) as u8, y: (v.fract() * ONE) as u8 }
        };
        let entries = (0..width * height).map(entry).collect();
        Ok(Self { width, height, source_width, source_height, entries })
    }

    /// Makes the picture. Allocates nothing once `out` has been of its size.
    ///
    /// # Errors
    /// [`Error::SourceSize`] for an image of another size than the map was made for.
    pub fn apply(&self, image: GrayView<'_>, out: &mut Image<u8>) -> Result<()> {
        if (image.width(), image.height()) != (self.source_width, self.source_height) {
            return Err(Error::SourceSize {
                width: image.width(),
                height: image.height(),
                expected_width: self.source_width,
                expected_height: self.source_height,
            });
        }
        out.resize(self.width, self.height);
        let (last_u, last_v) = (self.source_width - 1, self.source_height - 1);
        for (pixel, entry) in out.data_mut().iter_mut().zip(&self.entries) {
            if entry.u == OUTSIDE {
                *pixel = 0;
                continue;
            }
            let (u, v) = (usize::from(entry.u), usize::from(entry.v));
            let (top, bottom) = (image.row(v), image.row((v + 1).min(last_v)));
            let right = (u + 1).min(last_u);
            let (x, y) = (u32::from(entry.x), u32::from(entry.y));
            let along = |row: &[u8]| u32::from(row[u]) * (128 - x) + u32::from(row[right]) * x;
            *pixel = ((along(top) * (128 - y) + along(bottom) * y + (1 << 13)) >> 14) as u8;
        }
        Ok(())
    }

    /// Whether pixel `(u, v)` of the picture made comes from inside the picture read.
    pub fn is_inside(&self, u: usize, v: usize) -> bool {
        u < self.width && v < self.height && self.entries[v * self.width + u].u != OUTSIDE
    }
}
