//! The stages one by one: arrays in, arrays out.

pub mod fft;
pub mod flow;
pub mod junction;
pub mod sim;

use net_geometry::nalgebra::Vector2;
use numpy::PyArray2;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{array2, float_array};

/// `(N, 2)` pixels.
pub fn pixels<'py>(py: Python<'py>, points: impl Iterator<Item = Vector2<f64>>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let values: Vec<f64> = points.flat_map(|p| [p.x, p.y]).collect();
    let rows = values.len() / 2;
    array2(py, values, rows, 2)
}

/// Reads `(N, 2)` pixels; `name` is the argument's, for the error.
pub fn read_pixels(name: &str, points: &Bound<'_, PyAny>) -> PyResult<Vec<Vector2<f64>>> {
    let points = float_array(name, "(N, 2)", points)?;
    let points = points.as_array();
    if points.ncols() != 2 {
        return Err(PyValueError::new_err(format!("{name}: expected shape (N, 2), got {:?}", points.shape())));
    }
    let read: Vec<_> = points.rows().into_iter().map(|p| Vector2::new(p[0], p[1])).collect();
    match read.iter().find(|p| !(p.x.is_finite() && p.y.is_finite())) {
        Some(p) => Err(PyValueError::new_err(format!("{name}: ({}, {}) is not a pixel", p.x, p.y))),
        None => Ok(read),
    }
}
