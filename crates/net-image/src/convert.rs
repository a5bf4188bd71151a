//! From one kind of pixel to another.

use crate::error::{Error, Result};
use crate::image::Image;
use crate::pixel::Pixel;
use crate::view::View;

/// The values of `image`, unchanged, as `f32`.
pub fn to_f32<T: Pixel>(image: View<'_, T>, out: &mut Image<f32>) {
    map(image, out, Pixel::to_f32);
}

/// The values of `image` rounded to the nearest of 0 to 255; NaN becomes 0.
pub fn to_u8(image: View<'_, f32>, out: &mut Image<u8>) {
    map(image, out, |x| (x + 0.5) as u8);
}

/// 16-bit grey to 8-bit grey: `255 x / white`, rounded; what is brighter than `white` becomes 255.
///
/// `white` is what the sensor gives for white: 65535 where 16 bits are used, 4095 for 12 bits in the lower part of 16.
/// It is never taken from the picture, so brightness does not jump from frame to frame.
///
/// # Errors
/// [`Error::Value`] for a `white` of zero.
pub fn grey8_from_grey16(image: View<'_, u16>, white: u16, out: &mut Image<u8>) -> Result<()> {
    if white == 0 {
        return Err(Error::Value { field: "white level", value: 0.0, expected: "1 to 65535" });
    }
    let scale = 255.0 / f32::from(white);
    map(image, out, |x| (f32::from(x) * scale + 0.5) as u8);
    Ok(())
}

/// How the bytes of a colour pixel follow each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColourLayout {
    /// Red, green, blue.
    Rgb,
    /// Blue, green, red.
    Bgr,
    /// Red, green, blue, and one byte that does not count.
    Rgba,
    /// Blue, green, red, and one byte that does not count.
    Bgra,
}

impl ColourLayout {
    /// Bytes from one pixel to the next.
    pub fn bytes(self) -> usize {
        match self {
            Self::Rgb | Self::Bgr => 3,
            Self::Rgba | Self::Bgra => 4,
        }
    }
}

/// 8-bit colour to grey: `0.299 R + 0.587 G + 0.114 B` (ITU-R BT.601), in integers as OpenCV does it.
///
/// `data`: `height` rows of `width` pixels, `stride` bytes from one row to the next.
///
/// # Errors
/// As [`View::new`], counted in bytes.
pub fn grey_from_colour(
    data: &[u8],
    width: usize,
    height: usize,
    stride: usize,
    layout: ColourLayout,
    out: &mut Image<u8>,
) -> Result<()> {
    let row_bytes = width.checked_mul(layout.bytes()).ok_or(Error::Size { width, height, stride })?;
    let rows = View::new(data, row_bytes, height, stride)?;
    out.resize(width, height);
    for (v, row) in rows.rows().enumerate() {
        let grey = out.row_mut(v).iter_mut();
        match layout {
            ColourLayout::Rgb => grey.zip(row.as_chunks().0).for_each(|(y, &[r, g, b])| *y = luma(r, g, b)),
            ColourLayout::Bgr => grey.zip(row.as_chunks().0).for_each(|(y, &[b, g, r])| *y = luma(r, g, b)),
            ColourLayout::Rgba => grey.zip(row.as_chunks().0).for_each(|(y, &[r, g, b, _])| *y = luma(r, g, b)),
            ColourLayout::Bgra => grey.zip(row.as_chunks().0).for_each(|(y, &[b, g, r, _])| *y = luma(r, g, b)),
        }
    }
    Ok(())
}

/// Weights in parts of 2^14; they sum to it.
#[inline]
fn luma(r: u8, g: u8, b: u8) -> u8 {
    let [r, g, b] = [r, g, b].map(u32::from);
    ((4899 * r + 9617 * g + 1868 * b + (1 << 13)) >> 14) as u8
}

fn map<A: Copy, B: Copy + Default>(image: View<'_, A>, out: &mut Image<B>, f: impl Fn(A) -> B) {
    out.resize(image.width(), image.height());
    for (v, row) in image.rows().enumerate() {
        for (y, &x) in out.row_mut(v).iter_mut().zip(row) {
            *y = f(x);
        }
    }
}
