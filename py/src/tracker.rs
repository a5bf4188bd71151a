//! `Tracker` and `estimate`.

use pyo3::prelude::*;

use crate::arrays::GrayArgument;
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
        py.detach(|| tracker.update(view, timestamp_ns).map(|e| Estimate::from_frame(&e))).map_err(|error| {
            let argument = match error {
                netpose::Error::TimeOrder { .. } => "timestamp_ns",
                _ => "image",
            };
            of_argument(argument, error)
        })
    }
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
