//! `sensor_msgs/Image`.

use crate::frame::FrameError;
use crate::message::fields::{Fields, header};
use crate::message::raw::RawImage;
use crate::message::{ImageMessage, Pixels};

/// Reads the fields; the pixels stay where they are.
pub(super) fn read<'a>(mut fields: impl Fields<'a>) -> Result<ImageMessage<'a>, FrameError> {
    let stamp_ns = header(&mut fields)?;
    let (height, width) = (fields.u32()?, fields.u32()?);
    let encoding = fields.str()?.into();
    let big_endian = fields.u8()? != 0;
    let step = fields.u32()?;
    let data = fields.bytes()?.into();
    Ok(ImageMessage { stamp_ns, pixels: Pixels::Raw(RawImage { width, height, encoding, big_endian, step, data }) })
}
