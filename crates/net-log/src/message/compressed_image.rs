//! `sensor_msgs/CompressedImage`.

use crate::frame::FrameError;
use crate::message::fields::{Fields, header};
use crate::message::{ImageMessage, Pixels};

/// Reads the fields. `format` says such things as `jpeg` or `bgr8; jpeg compressed bgr8`, and at times what is not so.
pub(super) fn read<'a>(mut fields: impl Fields<'a>) -> Result<ImageMessage<'a>, FrameError> {
    let stamp_ns = header(&mut fields)?;
    let format = fields.str()?;
    let data = fields.bytes()?;
    if format.contains("compressedDepth") {
        let why = format!("format {format:?} holds distances, not brightness");
        return Err(FrameError::Message { schema: "sensor_msgs/CompressedImage".to_owned(), why });
    }
    Ok(ImageMessage { stamp_ns, pixels: Pixels::File(data.into()) })
}
