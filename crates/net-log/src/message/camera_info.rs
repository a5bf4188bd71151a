//! `sensor_msgs/CameraInfo`.

use net_geometry::Camera;

use crate::calibration::{Calibration, intrinsics_of, wrong};
use crate::error::Result;
use crate::frame::FrameError;
use crate::message::fields::{Fields, header};

/// Most coefficients of a lens model that are read: OpenCV's longest has 14.
const MAX_COEFFICIENTS: u32 = 64;

/// A camera as a message has it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct CameraInfo {
    /// Size of the full sensor image, px.
    pub width: u32,
    pub height: u32,
    pub distortion_model: String,
    pub d: Vec<f64>,
    /// Row-major 3 x 3, of the image as it is.
    pub k: Vec<f64>,
    /// Row-major 3 x 4, of the rectified image.
    pub p: Vec<f64>,
    /// Sensor pixels that make one image pixel, across and down. 0 means 1.
    pub binning: [u32; 2],
    /// Window of the sensor that the image shows: left, top, width, height in sensor pixels. All zero means all of it.
    pub roi: [u32; 4],
}

/// Reads the fields.
pub(super) fn read<'a>(mut fields: impl Fields<'a>) -> std::result::Result<CameraInfo, FrameError> {
    header(&mut fields)?;
    let (height, width) = (fields.u32()?, fields.u32()?);
    let distortion_model = fields.str()?.to_owned();
    let d = fields.f64s(MAX_COEFFICIENTS)?;
    let mut numbers = |count: usize| (0..count).map(|_| fields.f64()).collect::<std::result::Result<Vec<_>, _>>();
    let (k, _rectification, p) = (numbers(9)?, numbers(9)?, numbers(12)?);
    let binning = [fields.u32()?, fields.u32()?];
    let (left, top, roi_height, roi_width) = (fields.u32()?, fields.u32()?, fields.u32()?, fields.u32()?);
    Ok(CameraInfo { width, height, distortion_model, d, k, p, binning, roi: [left, top, roi_width, roi_height] })
}

impl CameraInfo {
    /// The camera that took the images, or that a rectified image looks as if taken with.
    pub(crate) fn camera(&self, place: &str, rectified: bool) -> Result<Camera> {
        let (field, matrix) = if rectified { ("P", &self.p) } else { ("K", &self.k) };
        if matrix.iter().all(|&x| x == 0.0) {
            return Err(wrong(place, field, "all zero", "a camera that has been calibrated"));
        }
        let [fx, fy, cx, cy] = intrinsics_of(place, field, matrix)?;
        let [left, top, width, height] = match self.roi {
            [_, _, 0, _] | [_, _, _, 0] => [0, 0, self.width, self.height],
            roi => roi,
        };
        let [bx, by] = self.binning.map(|b| f64::from(b.max(1)));
        // The centre of an image pixel is the mean of the centres of the sensor pixels in it.
        let principal = |c: f64, start: u32, bin: f64| (c - f64::from(start) - (bin - 1.0) / 2.0) / bin;
        Calibration {
            place,
            width: width / self.binning[0].max(1),
            height: height / self.binning[1].max(1),
            intrinsics: [fx / bx, fy / by, principal(cx, left, bx), principal(cy, top, by)],
            model: &self.distortion_model,
            fields: ["distortion_model", "D"],
            coefficients: if rectified { &[] } else { &self.d },
        }
        .camera()
    }
}
