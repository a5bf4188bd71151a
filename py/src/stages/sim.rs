//! `netpose_rs.sim`

use net_sim::{Image, Scenario, Simulator, Visibility};
use numpy::{PyArray1, PyArray2, ToPyArray};
use pyo3::prelude::*;

use crate::arrays::array2;
use crate::camera::{Camera, Mesh, of_argument, value_error};
use crate::estimate::matrix;
use crate::stages::pixels;

/// A simulated frame with its truth.
#[pyclass(frozen, module = "netpose_rs.sim")]
pub struct SimFrame {
    image: Py<PyArray2<u8>>,
    truth: net_sim::Truth,
    camera: net_geometry::Camera,
    mesh: net_geometry::Mesh,
    /// Nanoseconds since the Unix epoch.
    #[pyo3(get)]
    timestamp_ns: i64,
}

#[pymethods]
impl SimFrame {
    #[getter]
    fn image<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<u8>> {
        self.image.bind(py).clone()
    }
    #[getter]
    fn camera(&self) -> Camera {
        Camera { inner: self.camera }
    }
    #[getter]
    fn mesh(&self) -> Mesh {
        Mesh { inner: self.mesh }
    }
    #[getter]
    fn range_m(&self) -> Option<f64> {
        self.truth.layers.first()?.axis.as_ref().map(|a| a.range_m)
    }
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.truth.layers.first()?.axis.as_ref().map(|a| a.normal.as_slice().to_pyarray(py))
    }
    #[getter]
    fn crossing_angle(&self) -> Option<f64> {
        self.truth.layers.first()?.axis.as_ref().map(|a| a.crossing_angle)
    }
    #[getter]
    fn curvatures_per_m(&self) -> Option<(f64, f64)> {
        self.truth.layers.first()?.axis.as_ref().map(|a| a.curvatures_per_m.into())
    }
    #[getter]
    fn pose<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let Some(layer) = self.truth.layers.first() else { return Ok(None) };
        let pose = layer.pose.matrix();
        matrix(py, 4, |r, c| pose[(r, c)]).map(Some)
    }
    #[getter]
    fn nodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        pixels(py, self.truth.layers.first().into_iter().flat_map(|l| l.nodes.iter().map(|n| n.pixel)))
    }
    #[getter]
    fn lattice<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let nodes = self.truth.layers.first().map_or(&[][..], |l| &l.nodes);
        let names = nodes.iter().flat_map(|n| [i64::from(n.index.0), i64::from(n.index.1)]).collect();
        array2(py, names, nodes.len(), 2)
    }
    #[getter]
    fn visible<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        let nodes = self.truth.layers.first().map_or(&[][..], |l| &l.nodes);
        nodes.iter().map(|n| n.visibility == Visibility::Visible).collect::<Vec<_>>().to_pyarray(py)
    }
}

/// Names and descriptions of the scenarios.
#[pyfunction]
pub fn scenarios() -> Vec<(String, String)> {
    Scenario::all().into_iter().map(|s| (s.name, s.description)).collect()
}

/// Draws frame `frame` of a named scenario.
#[pyfunction]
#[pyo3(signature = (scenario, frame=0, seed=None))]
pub fn render(py: Python<'_>, scenario: &str, frame: u32, seed: Option<u64>) -> PyResult<SimFrame> {
    let mut scenario = Scenario::by_name(scenario).map_err(|e| of_argument("scenario", e))?;
    scenario.seed = seed.unwrap_or(scenario.seed);
    let drawn = py.detach(|| {
        let (camera, mesh) = (scenario.camera()?, scenario.mesh()?);
        let frame = scenario.frame(frame)?;
        let mut image = Image::default();
        let truth = Simulator::new(camera).render(&frame.scene, frame.seed, &mut image)?.clone();
        Ok((camera, mesh, frame.timestamp_ns, truth, image))
    });
    let (camera, mesh, timestamp_ns, truth, image) = drawn.map_err(|error: net_sim::Error| value_error(error))?;
    let image = array2(py, image.data().to_vec(), image.height(), image.width())?.unbind();
    Ok(SimFrame { image, truth, camera, mesh, timestamp_ns })
}
