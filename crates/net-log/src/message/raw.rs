//! Pixels as the sensor gave them, to grey.

use std::borrow::Cow;

use net_image::Image;

use crate::frame::FrameError;
use crate::picture::{check_size, eight_bits, luma};

/// All encodings that are known, for telling the user.
const KNOWN: &str = "mono8, mono16, 8UC1, 16UC1, 8UC3, 8UC4, rgb8, bgr8, rgba8, bgra8, bayer_*8, bayer_*16, yuv422 (uyvy), \
                     yuv422_yuy2 (yuyv), nv12, nv21, nv24";

/// An image of a message.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RawImage<'a> {
    pub width: u32,
    pub height: u32,
    pub encoding: Cow<'a, str>,
    /// Byte order of values of more than one byte.
    pub big_endian: bool,
    /// Bytes from one row to the next.
    pub step: u32,
    pub data: Cow<'a, [u8]>,
}

/// How the grey value of a pixel comes from its bytes.
enum Layout {
    /// Every `stride`-th byte, from `first` on.
    Bytes { stride: usize, first: usize },
    /// Colour: bytes per pixel, and where in them red, green and blue are.
    Colour { stride: usize, rgb: [usize; 3] },
    /// Two bytes.
    Words,
    /// One or two bytes, of alternating colour.
    Bayer { words: bool },
}

impl RawImage<'_> {
    /// Grey, 0 black to 255 white. Colour as JPEG weights it; sixteen bits by the depth that the largest value tells.
    ///
    /// A Bayer mosaic becomes grey by the binomial filter (1, 2, 1) in both directions: it weights red, green and blue by 1/4, 1/2,
    /// 1/4 around *every* pixel, so that nothing of the mosaic's pattern is left, whichever of the four orders it has.
    pub(crate) fn decode(&self) -> Result<Image<u8>, FrameError> {
        check_size(self.width.into(), self.height.into())?;
        let (width, height, step) = (self.width as usize, self.height as usize, self.step as usize);
        let layout = self.layout()?;
        let bytes = match layout {
            Layout::Bytes { stride, .. } | Layout::Colour { stride, .. } => stride,
            Layout::Bayer { words } => 1 + usize::from(words),
            Layout::Words => 2,
        };
        // At most 16,384 px of 4 bytes a row: no overflow.
        let row = width * bytes;
        let needed = height.saturating_sub(1).checked_mul(step).and_then(|n| n.checked_add(row));
        if width == 0 || height == 0 || step < row || needed.is_none_or(|n| n > self.data.len()) {
            let (w, h, e, n) = (width, height, &self.encoding, self.data.len());
            return Err(FrameError::Layout {
                why: format!("{w}x{h} px of {e} in rows of {step} bytes do not fit {n} bytes"),
            });
        }
        let rows = || self.data.chunks(step).take(height).map(|r| &r[..row]);
        let words = || -> Vec<u16> { rows().flat_map(|r| r.chunks_exact(2)).map(|b| self.word(b)).collect() };
        let packed = || -> Vec<u8> { rows().flatten().copied().collect() };
        let grey: Vec<u8> = match layout {
            Layout::Bytes { stride: 1, .. } => packed(),
            Layout::Bytes { stride, first } => rows().flat_map(|r| r.chunks_exact(stride)).map(|p| p[first]).collect(),
            Layout::Colour { stride, rgb: [r, g, b] } => {
                rows().flat_map(|row| row.chunks_exact(stride)).map(|p| luma(p[r], p[g], p[b])).collect()
            }
            Layout::Words => eight_bits(words()),
            Layout::Bayer { words: true } => without_mosaic(&eight_bits(words()), width, height),
            Layout::Bayer { words: false } => without_mosaic(&packed(), width, height),
        };
        let count = grey.len();
        Image::from_vec(grey, width, height)
            .ok_or_else(|| FrameError::Layout { why: format!("{count} values came out for {width}x{height} px") })
    }

    fn layout(&self) -> Result<Layout, FrameError> {
        let colour = |stride, rgb| Ok(Layout::Colour { stride, rgb });
        match &*self.encoding {
            "mono8" | "8UC1" | "nv12" | "nv21" | "nv24" => Ok(Layout::Bytes { stride: 1, first: 0 }),
            "mono16" | "16UC1" => Ok(Layout::Words),
            "rgb8" => colour(3, [0, 1, 2]),
            "bgr8" | "8UC3" => colour(3, [2, 1, 0]),
            "rgba8" => colour(4, [0, 1, 2]),
            "bgra8" | "8UC4" => colour(4, [2, 1, 0]),
            "yuv422" | "uyvy" | "UYVY" => Ok(Layout::Bytes { stride: 2, first: 1 }),
            "yuv422_yuy2" | "yuyv" | "YUYV" => Ok(Layout::Bytes { stride: 2, first: 0 }),
            e if e.starts_with("bayer_") && e.ends_with("16") => Ok(Layout::Bayer { words: true }),
            e if e.starts_with("bayer_") && e.ends_with('8') => Ok(Layout::Bayer { words: false }),
            other => Err(FrameError::Encoding { encoding: other.to_owned(), known: KNOWN }),
        }
    }

    fn word(&self, bytes: &[u8]) -> u16 {
        let pair = [bytes[0], bytes[1]];
        if self.big_endian { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) }
    }
}

/// The filter (1, 2, 1)/4 across and down; a border is mirrored, which keeps the colours' order.
fn without_mosaic(mosaic: &[u8], width: usize, height: usize) -> Vec<u8> {
    // Neighbours of `i` in a line of `n`: at the ends the same one twice.
    let around = |i: usize, n: usize| {
        let before = i.checked_sub(1).unwrap_or(1.min(n - 1));
        let after = if i + 1 < n { i + 1 } else { n.saturating_sub(2) };
        (before, after)
    };
    let mut grey = Vec::with_capacity(mosaic.len());
    let row = |v: usize| &mosaic[v * width..][..width];
    for v in 0..height {
        let (above, below) = around(v, height);
        let (top, middle, bottom) = (row(above), row(v), row(below));
        let down = |u: usize| u16::from(top[u]) + 2 * u16::from(middle[u]) + u16::from(bottom[u]);
        grey.extend((0..width).map(|u| {
            let (left, right) = around(u, width);
            ((down(left) + 2 * down(u) + down(right) + 8) >> 4) as u8
        }));
    }
    grey
}
