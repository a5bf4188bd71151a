//! Numpy arrays in and out.

use net_geometry::Pose;
use net_geometry::nalgebra::{Matrix3, Rotation3, Vector3};
use net_image::convert::grey_from_colour;
use net_image::{ColourLayout, GrayView, Image};
use numpy::ndarray::ArrayView2;
use numpy::{
    IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::camera::of_argument;

/// Most pixels of a picture that is copied because it is no plain array.
const MOST_PIXELS: usize = 1 << 28;

/// An image argument: grey, borrowed without a copy when the array is C-contiguous; colour is turned to grey.
pub struct GrayArgument<'py> {
    /// The argument's name, for errors.
    name: &'static str,
    pixels: Pixels<'py>,
}

enum Pixels<'py> {
    /// `(H, W)`, C-contiguous: read where it is.
    Borrowed(PyReadonlyArray2<'py, u8>),
    /// Converted from colour, or packed from an array with other strides.
    Converted(Image<u8>),
}

impl<'py> GrayArgument<'py> {
    /// Takes the argument of this name.
    pub fn new(name: &'static str, object: &Bound<'py, PyAny>) -> PyResult<Self> {
        Ok(Self { name, pixels: Pixels::new(name, object)? })
    }

    /// The picture.
    pub fn view(&self) -> PyResult<GrayView<'_>> {
        let view = match &self.pixels {
            Pixels::Borrowed(array) => {
                let [height, width] = [array.shape()[0], array.shape()[1]];
                GrayView::packed(array.as_slice().map_err(|e| of_argument(self.name, e))?, width, height)
            }
            Pixels::Converted(image) => GrayView::packed(image.data(), image.width(), image.height()),
        };
        view.map_err(|e| of_argument(self.name, e))
    }
}

impl<'py> Pixels<'py> {
    fn new(name: &str, object: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(gray) = object.extract::<PyReadonlyArray2<'py, u8>>() {
            // Fortran order is contiguous too, but by columns.
            if gray.is_c_contiguous() {
                return Ok(Self::Borrowed(gray));
            }
            let array = gray.as_array();
            let (height, width) = array.dim();
            // A view may be larger than memory.
            if width.saturating_mul(height) > MOST_PIXELS {
                let why = format!("{name}: expected at most {MOST_PIXELS} pixels, got shape ({height}, {width})");
                return Err(PyValueError::new_err(why));
            }
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
                grey_from_colour(bytes, width, height, 3 * width, ColourLayout::Rgb, &mut gray)
                    .map_err(|e| of_argument(name, e))?;
                return Ok(Self::Converted(gray));
            }
        }
        Err(wrong_type(name, "uint8 of shape (H, W) or (H, W, 3) RGB", object))
    }
}

/// A float64 array of two dimensions; `shape` says which, for the error.
pub fn float_array<'py>(name: &str, shape: &str, object: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArray2<'py, f64>> {
    object.extract().map_err(|_| wrong_type(name, &format!("float64 of shape {shape}"), object))
}

/// Refuses another shape, and names the first number that is not finite.
pub fn check_finite(name: &str, m: &ArrayView2<'_, f64>, shape: (usize, usize)) -> PyResult<()> {
    if m.dim() != shape {
        return Err(PyValueError::new_err(format!("{name}: expected shape {shape:?}, got {:?}", m.dim())));
    }
    let Some(((row, column), value)) = m.indexed_iter().find(|(_, x)| !x.is_finite()) else { return Ok(()) };
    let value = if value.is_nan() { "nan".to_owned() } else { value.to_string() };
    Err(PyValueError::new_err(format!("{name}: row {row}, column {column} is {value}: expected a finite number")))
}

/// A (4, 4) pose as argument `name`.
pub fn pose_argument(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Pose> {
    let array = float_array(name, "(4, 4)", object)?;
    let m = array.as_array();
    check_finite(name, &m, (4, 4))?;
    let rotation = Matrix3::from_fn(|r, c| m[(r, c)]);
    if (rotation * rotation.transpose() - Matrix3::identity()).amax() > 1e-6 || rotation.determinant() < 0.0 {
        return Err(PyValueError::new_err(format!("{name}: its upper left 3 x 3 is not a rotation")));
    }
    let translation = Vector3::new(m[(0, 3)], m[(1, 3)], m[(2, 3)]);
    Ok(Pose { rotation: Rotation3::from_matrix_unchecked(rotation), translation })
}

fn wrong_type(name: &str, expected: &str, object: &Bound<'_, PyAny>) -> PyErr {
    let described = object.cast::<PyUntypedArray>().map_err(PyErr::from).and_then(|array| {
        let shape: Vec<String> = array.shape().iter().map(usize::to_string).collect();
        let comma = if shape.len() == 1 { "," } else { "" };
        Ok(format!("{} of shape ({}{comma})", array.dtype().str()?, shape.join(", ")))
    });
    let got = described.unwrap_or_else(|_| object.get_type().to_string());
    PyTypeError::new_err(format!("{name}: expected a numpy array, {expected}, got {got}"))
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
