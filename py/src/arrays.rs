//! Numpy arrays in and out.

use net_image::convert::grey_from_colour;
use net_image::{ColourLayout, GrayView, Image};
use numpy::{
    IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::camera::value_error;

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
                GrayView::packed(array.as_slice().map_err(value_error)?, width, height)
            }
            Self::Converted(image) => GrayView::packed(image.data(), image.width(), image.height()),
        };
        view.map_err(value_error)
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
            let image = Image::from_vec(array.iter().copied().collect(), width, height);
            return Ok(Self::Converted(image.unwrap_or_default()));
        }
        if let Ok(colour) = object.extract::<PyReadonlyArray3<'py, u8>>() {
            let array = colour.as_array();
            let (height, width, channels) = array.dim();
            if channels == 3 {
                let packed;
                let bytes = match array.to_slice() {
                    Some(bytes) => bytes,
                    None => {
                        packed = array.iter().copied().collect::<Vec<u8>>();
                        &packed
                    }
                };
                let mut gray = Image::default();
                grey_from_colour(bytes, width, height, 3 * width, ColourLayout::Rgb, &mut gray).map_err(value_error)?;
                return Ok(Self::Converted(gray));
            }
        }
        let got = match object.cast::<PyUntypedArray>() {
            Ok(array) => format!("{} of shape {:?}", array.dtype().str()?, array.shape()),
            Err(_) => object.get_type().to_string(),
        };
        Err(PyTypeError::new_err(format!("expected a numpy array, uint8 of shape (H, W) or (H, W, 3) RGB, got {got}")))
    }
}

/// `rows * columns` values as an array of that shape.
pub fn array2<'py, T: numpy::Element>(
    py: Python<'py>,
    values: Vec<T>,
    rows: usize,
    columns: usize,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    values.into_pyarray(py).reshape([rows, columns])
}
