//! `netpose_rs.flow`

use net_flow::{Config, FlowTracker as Inner, Guess, Hints, MatchConfig, MatchState, Status};
use numpy::{PyArray1, PyArray2, ToPyArray};
use pyo3::prelude::*;

use crate::arrays::GrayArgument;
use crate::camera::{of_argument, value_error};
use crate::estimate::matrix;
use crate::stages::{pixels, read_pixels};

/// Where points of one picture are in the next.
#[pyclass(frozen, module = "netpose_rs.flow")]
pub struct Matches {
    matches: Vec<net_flow::Match>,
}

#[pymethods]
impl Matches {
    #[getter]
    fn pixels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        pixels(py, self.matches.iter().map(|m| m.pixel))
    }
    #[getter]
    fn scores<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        self.matches.iter().map(|m| m.score).collect::<Vec<_>>().to_pyarray(py)
    }
    #[getter]
    fn found<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.matches.iter().map(|m| m.state == MatchState::Found).collect::<Vec<_>>().to_pyarray(py)
    }
}

/// Finds each of `points` (N, 2) of `previous` in `next`.
#[pyfunction]
pub fn match_points(
    py: Python<'_>,
    previous: &Bound<'_, PyAny>,
    next: &Bound<'_, PyAny>,
    points: &Bound<'_, PyAny>,
) -> PyResult<Matches> {
    let (previous, next) = (GrayArgument::new("previous", previous)?, GrayArgument::new("next", next)?);
    let (previous, next) = (previous.view()?, next.view()?);
    let points = read_pixels("points", points)?;
    py.detach(|| net_flow::match_points(previous, next, &points, Guess::Still, &MatchConfig::default()))
        .map(|matches| Matches { matches })
        .map_err(|e| of_argument("next", e))
}

/// What an update of the tracker tells.
#[pyclass(frozen, module = "netpose_rs.flow")]
pub struct FlowResult {
    #[pyo3(get)]
    status: &'static str,
    #[pyo3(get)]
    agreed: usize,
    #[pyo3(get)]
    spread_px: f64,
    step: Option<net_flow::Motion>,
    from_key: Option<net_flow::Motion>,
}

#[pymethods]
impl FlowResult {
    #[getter]
    fn step<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.step.map(|m| matrix(py, 3, |r, c| m.matrix()[(r, c)])).transpose()
    }
    #[getter(from_key)]
    fn motion_from_key<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.from_key.map(|m| matrix(py, 3, |r, c| m.matrix()[(r, c)])).transpose()
    }
}

/// Follows points through frames of one size by pyramidal block matching.
#[pyclass(module = "netpose_rs.flow")]
pub struct FlowTracker {
    inner: Inner,
}

#[pymethods]
impl FlowTracker {
    #[new]
    fn new(width: usize, height: usize) -> PyResult<Self> {
        Ok(Self { inner: Inner::new(width, height, &Config::default()).map_err(value_error)? })
    }

    fn update(&mut self, py: Python<'_>, image: &Bound<'_, PyAny>) -> PyResult<FlowResult> {
        let image = GrayArgument::new("image", image)?;
        let view = image.view()?;
        let tracker = &mut self.inner;
        py.detach(|| {
            let result = tracker.update(view, &Hints::default())?;
            Ok(FlowResult {
                status: match result.status {
                    Status::Started => "started",
                    Status::Tracked => "tracked",
                    Status::Ambiguous => "ambiguous",
                    Status::Lost => "lost",
                },
                agreed: result.step.agreed,
                spread_px: result.step.spread_px,
                step: result.step.motion,
                from_key: result.from_key,
            })
        })
        .map_err(|error: net_flow::Error| of_argument("image", error))
    }
}
