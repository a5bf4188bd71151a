//! `Camera` and `Mesh`.

use std::path::PathBuf;

use net_geometry::Lens;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};

/// Errors of a value keep their words.
pub fn value_error(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Errors of an argument say its name first.
pub fn of_argument(name: &str, error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(format!("{name}: {error}"))
}

/// A calibrated camera.
#[pyclass(frozen, eq, module = "netpose_rs")]
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// The camera itself.
    pub inner: net_geometry::Camera,
}

#[pymethods]
impl Camera {
    #[new]
    #[pyo3(signature = (fx, fy, cx, cy, width, height, distortion=None, model=None))]
    fn new(
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        width: u32,
        height: u32,
        distortion: Option<Vec<f64>>,
        model: Option<&str>,
    ) -> PyResult<Self> {
        let lens = lens(model, distortion.as_deref().unwrap_or(&[]))?;
        let inner = net_geometry::Camera::new(fx, fy, cx, cy, width, height, lens).map_err(value_error)?;
        Ok(Self { inner })
    }

    #[staticmethod]
    fn from_yaml(path: PathBuf) -> PyResult<Self> {
        Ok(Self { inner: net_log::read_camera(&path).map_err(value_error)? })
    }

    /// Coefficients of the lens in OpenCV's order; none for a pinhole.
    #[getter]
    fn distortion(&self) -> Vec<f64> {
        self.inner.lens().coefficients().to_vec()
    }
    /// Name of the lens model, as in ROS.
    #[getter]
    fn model(&self) -> &'static str {
        self.inner.lens().model()
    }

    #[getter]
    fn fx(&self) -> f64 {
        self.inner.fx()
    }
    #[getter]
    fn fy(&self) -> f64 {
        self.inner.fy()
    }
    #[getter]
    fn cx(&self) -> f64 {
        self.inner.cx()
    }
    #[getter]
    fn cy(&self) -> f64 {
        self.inner.cy()
    }
    #[getter]
    fn width(&self) -> u32 {
        self.inner.width()
    }
    #[getter]
    fn height(&self) -> u32 {
        self.inner.height()
    }

    /// What makes the same camera of its class: for `pickle` and `copy`.
    fn __reduce__<'py>(&self, py: Python<'py>) -> (Bound<'py, PyType>, CameraNumbers) {
        (py.get_type::<Self>(), self.numbers())
    }

    fn __hash__(&self, py: Python<'_>) -> PyResult<isize> {
        let (fx, fy, cx, cy, width, height, distortion, model) = self.numbers();
        let distortion = PyTuple::new(py, distortion)?;
        (fx, fy, cx, cy, width, height, distortion, model).into_pyobject(py)?.hash()
    }

    /// As it would be made again.
    fn __repr__(&self) -> String {
        let (fx, fy, cx, cy, width, height, distortion, model) = self.numbers();
        let pinhole = format!("Camera(fx={fx:?}, fy={fy:?}, cx={cx:?}, cy={cy:?}, width={width}, height={height}");
        match self.inner.lens() {
            Lens::None => pinhole + ")",
            _ => format!("{pinhole}, distortion={distortion:?}, model={model:?})"),
        }
    }
}

/// The arguments of the constructor.
type CameraNumbers = (f64, f64, f64, f64, u32, u32, Vec<f64>, &'static str);

impl Camera {
    fn numbers(&self) -> CameraNumbers {
        let c = &self.inner;
        (c.fx(), c.fy(), c.cx(), c.cy(), c.width(), c.height(), self.distortion(), self.model())
    }
}

fn lens(model: Option<&str>, k: &[f64]) -> PyResult<Lens> {
    let padded = |n: usize| k.iter().copied().chain(std::iter::repeat(0.0)).take(n).collect::<Vec<_>>();
    let plumb_bob = || {
        let k = padded(5);
        Lens::PlumbBob([k[0], k[1], k[2], k[3], k[4]])
    };
    let rational = || {
        let k = padded(8);
        Lens::Rational([k[0], k[1], k[2], k[3], k[4], k[5], k[6], k[7]])
    };
    match (model, k.len()) {
        (None | Some("plumb_bob" | "rational_polynomial" | "equidistant"), 0) => Ok(Lens::None),
        (None | Some("plumb_bob"), 4 | 5) => Ok(plumb_bob()),
        (None | Some("rational_polynomial"), 8) => Ok(rational()),
        (Some("equidistant"), 4) => Ok(Lens::KannalaBrandt([k[0], k[1], k[2], k[3]])),
        _ => Err(PyValueError::new_err(format!(
            "distortion has {} coefficients for model {}: plumb_bob takes 4 or 5, rational_polynomial 8, equidistant 4",
            k.len(),
            model.unwrap_or("(not given)"),
        ))),
    }
}

/// The mesh of a net.
#[pyclass(frozen, eq, module = "netpose_rs")]
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    /// The mesh itself.
    pub inner: net_geometry::Mesh,
}

#[pymethods]
impl Mesh {
    #[staticmethod]
    fn square(cell: f64) -> PyResult<Self> {
        Ok(Self { inner: net_geometry::Mesh::square(cell).map_err(value_error)? })
    }
    #[staticmethod]
    fn rectangular(a: f64, b: f64) -> PyResult<Self> {
        Ok(Self { inner: net_geometry::Mesh::rectangular(a, b).map_err(value_error)? })
    }
    #[staticmethod]
    fn oblique(a: f64, b: f64, angle: f64) -> PyResult<Self> {
        Ok(Self { inner: net_geometry::Mesh::oblique(a, b, angle).map_err(value_error)? })
    }
    #[staticmethod]
    fn parse(text: &str) -> PyResult<Self> {
        Ok(Self { inner: text.parse().map_err(value_error)? })
    }
    #[getter]
    fn sides(&self) -> (f64, f64) {
        (self.inner.side1(), self.inner.side2())
    }
    #[getter]
    fn angle(&self) -> f64 {
        self.inner.angle()
    }
    /// What makes the same mesh: for `pickle` and `copy`.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (f64, f64, f64))> {
        Ok((py.get_type::<Self>().getattr("oblique")?, self.numbers()))
    }

    fn __hash__(&self, py: Python<'_>) -> PyResult<isize> {
        self.numbers().into_pyobject(py)?.hash()
    }

    /// As it would be made again.
    fn __repr__(&self) -> String {
        let (a, b, angle) = self.numbers();
        format!("Mesh.oblique({a:?}, {b:?}, {angle:?})")
    }
}

impl Mesh {
    /// Sides, m, and angle, rad.
    fn numbers(&self) -> (f64, f64, f64) {
        (self.inner.side1(), self.inner.side2(), self.inner.angle())
    }
}
