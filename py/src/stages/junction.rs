//! `netpose_rs.junction`

use net_junction::{Config, Expectation, ExpectedNet, JunctionDetector};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{GrayArgument, array2, pose_argument};
use crate::camera::{Camera, Mesh, of_argument};
use crate::estimate::index_or_unnamed;
use crate::stages::pixels;

/// Junctions of one picture by the contours of its meshes.
#[pyclass(frozen, module = "netpose_rs.junction")]
pub struct Junctions {
    junctions: Vec<net_geometry::Junction>,
    boxes: Vec<f64>,
}

#[pymethods]
impl Junctions {
    #[getter]
    fn pixels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        pixels(py, self.junctions.iter().map(|j| j.pixel))
    }
    #[getter]
    fn lattice<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let names = self.junctions.iter().flat_map(index_or_unnamed).collect();
        array2(py, names, self.junctions.len(), 2)
    }
    #[getter]
    fn sigma_px<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.junctions.iter().map(|j| j.sigma_px).collect::<Vec<_>>().to_pyarray(py)
    }
    #[getter]
    fn boxes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        self.boxes.to_pyarray(py).reshape([self.boxes.len() / 8, 4, 2])
    }
}

/// Finds junctions. With `camera`, `mesh` and `pose` (4, 4) given, meshes of the predicted size and shape are looked for.
#[pyfunction]
#[pyo3(signature = (image, camera=None, mesh=None, pose=None))]
pub fn detect(
    py: Python<'_>,
    image: &Bound<'_, PyAny>,
    camera: Option<&Camera>,
    mesh: Option<&Mesh>,
    pose: Option<&Bound<'_, PyAny>>,
) -> PyResult<Junctions> {
    let image = GrayArgument::new("image", image)?;
    let view = image.view()?;
    let expectation = match (camera, mesh, pose) {
        (None, None, None) => None,
        (Some(camera), Some(mesh), Some(pose)) => {
            let pose = pose_argument("pose", pose)?;
            Some(Expectation::Net(ExpectedNet { camera: camera.inner, mesh: mesh.inner, pose, anchored: true }))
        }
        _ => return Err(PyValueError::new_err("camera, mesh and pose go together: give all three or none")),
    };
    py.detach(|| {
        let mut detector = JunctionDetector::new(view.width(), view.height(), &Config::default())?;
        let junctions = detector.detect(view, expectation.as_ref())?.to_vec();
        let boxes = detector.boxes().flat_map(|b| b.corners).flat_map(|p| [p.x, p.y]).collect();
        Ok(Junctions { junctions, boxes })
    })
    .map_err(|error: net_junction::Error| of_argument("image", error))
}
