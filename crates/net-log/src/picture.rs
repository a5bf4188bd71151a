//! Encoded pictures to grey: JPEG, PNG, TIFF, BMP, WebP, told by their first bytes.
//!
//! - Colour becomes luma by the weights of JPEG (BT.601), so that a frame looks the same in whatever format it was stored.
//!   Alpha and orientation tags are ignored: a calibration belongs to the pixels as they are stored.
//! - Sixteen bits become eight by the depth that the largest value tells (8, 10, 12, 14 or 16 bits), for cameras of 12 bits
//!   that store them in the low end of 16.

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use net_image::Image;
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

use crate::frame::FrameError;

/// Longest side that is taken for a picture, px.
pub(crate) const MAX_SIDE: u64 = 16_384;
/// Most pixels that are taken for a picture.
pub(crate) const MAX_PIXELS: u64 = 100_000_000;
/// Largest file that is taken for a picture, bytes: 16-bit colour of [`MAX_PIXELS`].
pub(crate) const MAX_BYTES: u64 = 8 * MAX_PIXELS;

/// The format that the first bytes tell.
pub(crate) fn sniff(bytes: &[u8]) -> Option<(&'static str, ImageFormat)> {
    Some(match bytes {
        [0xFF, 0xD8, 0xFF, ..] => ("JPEG", ImageFormat::Jpeg),
        [0x89, b'P', b'N', b'G', ..] => ("PNG", ImageFormat::Png),
        [b'I', b'I', 42, 0, ..] | [b'M', b'M', 0, 42, ..] => ("TIFF", ImageFormat::Tiff),
        [b'B', b'M', ..] => ("BMP", ImageFormat::Bmp),
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => ("WebP", ImageFormat::WebP),
        _ => return None,
    })
}

/// Decodes a whole picture file to grey.
pub(crate) fn decode(bytes: &[u8]) -> Result<Image<u8>, FrameError> {
    match sniff(bytes) {
        Some((_, ImageFormat::Jpeg)) => decode_jpeg(bytes),
        Some((name, format)) => decode_other(bytes, name, format),
        None if bytes.is_empty() => Err(FrameError::Decode { format: "unknown format", why: "it is empty".to_owned() }),
        None => Err(FrameError::Decode {
            format: "unknown format",
            why: format!(
                "it begins with {:02x?}; known are JPEG, PNG, TIFF, BMP and WebP",
                &bytes[..bytes.len().min(8)]
            ),
        }),
    }
}

/// Refuses sizes that no camera has, before memory is asked for.
pub(crate) fn check_size(width: u64, height: u64) -> Result<(), FrameError> {
    if width > MAX_SIDE || height > MAX_SIDE || width.saturating_mul(height) > MAX_PIXELS {
        return Err(FrameError::TooLarge { width, height });
    }
    Ok(())
}

fn decode_jpeg(bytes: &[u8]) -> Result<Image<u8>, FrameError> {
    let wrong = |why: String| FrameError::Decode { format: "JPEG", why: why.trim_end().to_owned() };
    // Strict: otherwise the rest of a cut-off picture comes back as flat grey.
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(MAX_SIDE as usize)
        .set_max_height(MAX_SIDE as usize)
        .jpeg_set_out_colorspace(ColorSpace::Luma);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| wrong(e.to_string()))?;
    let info = decoder.info().ok_or_else(|| wrong("no size in its header".to_owned()))?;
    let (width, height) = (usize::from(info.width), usize::from(info.height));
    check_size(width as u64, height as u64)?;
    // The decoder looks for a premature end once a row of blocks: the last row may be cut off unseen.
    let last = |marker: u8| bytes.windows(2).rposition(|pair| pair == [0xFF, marker]);
    if last(0xD9) <= last(0xDA) {
        return Err(wrong("it is cut off before its end marker".to_owned()));
    }
    let luma = decoder.decode().map_err(|e| wrong(e.to_string()))?;
    let length = luma.len();
    Image::from_vec(luma, width, height)
        .ok_or_else(|| wrong(format!("{length} values came out for {width}x{height} px of grey")))
}

fn decode_other(bytes: &[u8], format: &'static str, kind: ImageFormat) -> Result<Image<u8>, FrameError> {
    let wrong = |e: image::ImageError| FrameError::Decode { format, why: e.to_string() };
    let reader = ImageReader::with_format(std::io::Cursor::new(bytes), kind);
    let mut decoder = reader.into_decoder().map_err(wrong)?;
    let (width, height) = decoder.dimensions();
    check_size(width.into(), height.into())?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE as u32);
    limits.max_image_height = Some(MAX_SIDE as u32);
    // Decoders need room for their output and about as much again to work in.
    limits.max_alloc = Some(16 * u64::from(width) * u64::from(height) + (16 << 20));
    decoder.set_limits(limits).map_err(wrong)?;
    let picture = DynamicImage::from_decoder(decoder).map_err(wrong)?;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let data = match picture {
        DynamicImage::ImageLuma8(p) => p.into_raw(),
        DynamicImage::ImageLumaA8(p) => p.as_raw().chunks_exact(2).map(|c| c[0]).collect(),
        DynamicImage::ImageRgb8(p) => p.as_raw().chunks_exact(3).map(|c| luma(c[0], c[1], c[2])).collect(),
        DynamicImage::ImageRgba8(p) => p.as_raw().chunks_exact(4).map(|c| luma(c[0], c[1], c[2])).collect(),
        DynamicImage::ImageLuma16(p) => eight_bits(p.into_raw()),
        DynamicImage::ImageLumaA16(p) => eight_bits(p.as_raw().chunks_exact(2).map(|c| c[0]).collect()),
        DynamicImage::ImageRgb16(p) => eight_bits(p.as_raw().chunks_exact(3).map(luma16).collect()),
        DynamicImage::ImageRgba16(p) => eight_bits(p.as_raw().chunks_exact(4).map(luma16).collect()),
        other => {
            return Err(FrameError::Decode {
                format,
                why: format!("pixels of type {:?} are not supported", other.color()),
            });
        }
    };
    Image::from_vec(data, width, height)
        .ok_or_else(|| FrameError::Decode { format, why: format!("its data do not make {width}x{height} px") })
}

/// Luma of JPEG (BT.601): `0.299 R + 0.587 G + 0.114 B`, rounded.
#[inline]
pub(crate) fn luma(r: u8, g: u8, b: u8) -> u8 {
    // Weights in 1/65536 that add up to 65536: grey stays what it is.
    ((19_595 * u32::from(r) + 38_470 * u32::from(g) + 7_471 * u32::from(b) + 32_768) >> 16) as u8
}

/// The same for sixteen bits; more channels than three are ignored.
#[inline]
fn luma16(c: &[u16]) -> u16 {
    ((19_595 * u64::from(c[0]) + 38_470 * u64::from(c[1]) + 7_471 * u64::from(c[2]) + 32_768) >> 16) as u16
}

/// Sixteen bits to eight, by the depth (8, 10, 12, 14, 16 bits) that the largest value tells.
pub(crate) fn eight_bits(values: Vec<u16>) -> Vec<u8> {
    let max = values.iter().copied().max().unwrap_or(0);
    let shift = [0, 2, 4, 6].into_iter().find(|&s| max >> s < 256).unwrap_or(8);
    values.into_iter().map(|v| (v >> shift) as u8).collect()
}
