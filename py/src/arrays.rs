//! Numpy arrays in and out.

use net_image::{GrayView, Image};
use numpy::{PyArrayDescrMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// An image argument: grey, borrowed without a copy when its rows are contiguous; colour is turned to grey.
pub enum GrayArgument<'py> {
    /// `(H, W)`, rows contiguous and without gaps: read where it is.
    Borrowed(PyReadonlyArray2<'py, u8>),
    /// Converted from colour, or packed from an array with other strides.
    Converted(Image<u8>),
}

impl GrayArgument<'_> {
    /// The picture.
    pub fn view(&self) -> PyResult<GrayView<'_>> {
        let view = match self {
            Self::Borrowed(array) => {
                let [height, width] = [array.shape()[0], array.shape()[1]];
                GrayView::packed(array.as_slice().map_err(|e| PyValueError::new_err(e.to_string()))?, width, height)
            }
            Self::Converted(image) => GrayView::packed(image.data(), image.width(), image.height()),
        };
        view.map_err(|e| PyValueError::new_err(e.to_string()))
    }
}

impl<'py> FromPyObject<'_, 'py> for GrayArgument<'py> {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(gray) = object.extract::<PyReadonlyArray2<'py, u8>>() {
            if gray.as_slice().is_ok() {
                return Ok(Self::Borrowed(gray));
            }
            let array = gray.as_array();
            let (height, width) = array.dim();
            return Ok(Self::Converted(image_from(array.iter().copied(), width, height)?));
        }
        if let Ok(colour) = object.extract::<PyReadonlyArray3<'py, u8>>() {
            let array = colour.as_array();
            let (height, width, channels) = array.dim();
            if channels == 3 {
                let gray = array.rows().into_iter().map(|p| net_image::gray_from_rgb([p[0], p[1], p[2]]));
                return Ok(Self::Converted(image_from(gray, width, height)?));
            }
        }
        let got = match object.cast::<PyUntypedArray>() {
            Ok(array) => format!("{} of shape {:?}", array.dtype().str_()?, array.shape()),
            Err(_) => object.get_type().to_string(),
        };
        Err(PyTypeError::new_err(format!("expected a numpy array, uint8 of shape (H, W) or (H, W, 3) RGB, got {got}")))
    }
}

fn image_from(pixels: impl Iterator<Item = u8>, width: usize, height: usize) -> PyResult<Image<u8>> {
    Image::from_vec(pixels.collect(), width, height)
        .filter(|image| image.width() > 0 && image.height() > 0)
        .ok_or_else(|| PyValueError::new_err(format!("an image of shape ({height}, {width}) has no pixels")))
}
