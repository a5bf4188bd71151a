//! `Tracker` and `estimate`.

use net_geometry::nalgebra::Matrix6;
use netpose::MotionPrior;
use pyo3::prelude::*;

use crate::arrays::{GrayArgument, check_finite, float_array, pose_argument};
use crate::camera::{Camera, Mesh, of_argument, value_error};
use crate::estimate::Estimate;

/// Follows one net through the frames of one camera.
#[pyclass(module = "netpose_rs")]
pub struct Tracker {
    inner: netpose::Tracker,
}

#[pymethods]
impl Tracker {
    #[new]
    #[pyo3(signature = (camera, mesh, *, method=None, layers=false))]
    fn new(camera: &Camera, mesh: &Mesh, method: Option<&str>, layers: bool) -> PyResult<Self> {
        let config = netpose::Config { layers, ..config(method)? };
        Ok(Self { inner: netpose::Tracker::new(camera.inner, mesh.inner, &config).map_err(value_error)? })
    }

    fn update(&mut self, py: Python<'_>, image: &Bound<'_, PyAny>, timestamp_ns: i64) -> PyResult<Estimate> {
        let image = GrayArgument::new("image", image)?;
        let view = image.view()?;
        let tracker = &mut self.inner;
        py.detach(|| tracker.update(view, timestamp_ns).map(|e| Estimate::from_frame(&e))).map_err(named)
    }

    fn update_with_prior(
        &mut self,
        py: Python<'_>,
        image: &Bound<'_, PyAny>,
        timestamp_ns: i64,
        motion: &Bound<'_, PyAny>,
        covariance: &Bound<'_, PyAny>,
    ) -> PyResult<Estimate> {
        let image = GrayArgument::new("image", image)?;
        let view = image.view()?;
        let array = float_array("covariance", "(6, 6)", covariance)?;
        let c = array.as_array();
        check_finite("covariance", &c, (6, 6))?;
        let prior = MotionPrior {
            now_from_before: pose_argument("motion", motion)?,
            covariance: Matrix6::from_fn(|r, k| c[(r, k)]),
        };
        let tracker = &mut self.inner;
        py.detach(|| tracker.update_with_prior(view, timestamp_ns, &prior).map(|e| Estimate::from_frame(&e)))
            .map_err(named)
    }
}

/// An error with the argument that it is about.
fn named(error: netpose::Error) -> PyErr {
    let argument = match error {
        netpose::Error::TimeOrder { .. } => "timestamp_ns",
        netpose::Error::Prior { .. } => "covariance",
        _ => "image",
    };
    of_argument(argument, error)
}

/// One image, no state.
#[pyfunction]
#[pyo3(signature = (image, camera, mesh, *, method=None, layers=false))]
pub fn estimate(
    py: Python<'_>,
    image: &Bound<'_, PyAny>,
    camera: &Camera,
    mesh: &Mesh,
    method: Option<&str>,
    layers: bool,
) -> PyResult<Estimate> {
    Tracker::new(camera, mesh, method, layers)?.update(py, image, 0)
}

fn config(method: Option<&str>) -> PyResult<netpose::Config> {
    let mut config = netpose::Config::default();
    if let Some(method) = method {
        config.method = method.parse().map_err(|e: netpose::Error| value_error(e))?;
    }
    Ok(config)
}
