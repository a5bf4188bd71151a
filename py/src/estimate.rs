//! What one frame says, owned by Python.

use numpy::{PyArray1, PyArray2, ToPyArray};
use pyo3::prelude::*;

use crate::arrays::array2;
use crate::pickle::{
    JunctionNumbers, LayerNumbers, TwineNumbers, from_junction, from_layer, from_net, from_twine, to_connection,
    to_junction, to_layer, to_net, to_status, to_twine,
};

/// What one frame says.
#[pyclass(frozen, module = "netpose_rs")]
pub struct Estimate {
    #[pyo3(get)]
    status: &'static str,
    #[pyo3(get)]
    probability: f64,
    #[pyo3(get)]
    track: u32,
    #[pyo3(get)]
    connection: &'static str,
    /// Likeliest shifts and what they stand out by, and the logarithm of the odds of the first to the second.
    shifts: Vec<Shift>,
    #[pyo3(get)]
    log_odds: Option<f64>,
    net: Option<netpose::NetPose>,
    junctions: Vec<netpose::Junction>,
    twines: Vec<netpose::Twine>,
    layers: Vec<netpose::Layer>,
}

/// Cells along both directions, and deviations.
type Shift = (i32, i32, f64);

/// One of several nets in a picture.
#[pyclass(frozen, module = "netpose_rs")]
pub struct Layer {
    inner: netpose::Layer,
}

#[pymethods]
impl Layer {
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (LayerNumbers,))> {
        Ok((py.get_type::<Self>().getattr("_from_state")?, (from_layer(&self.inner),)))
    }
    #[staticmethod]
    fn _from_state(state: LayerNumbers) -> PyResult<Self> {
        Ok(Self { inner: to_layer(&state)? })
    }
    #[getter]
    fn probability(&self) -> f64 {
        self.inner.probability
    }
    #[getter]
    fn followed(&self) -> bool {
        self.inner.followed
    }
    #[getter]
    fn range_m(&self) -> f64 {
        self.inner.net.range_m
    }
    #[getter]
    fn distance_m(&self) -> f64 {
        self.inner.net.distance_m
    }
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.inner.net.normal.as_slice().to_pyarray(py)
    }
    #[getter]
    fn pose<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, 4, |r, c| self.inner.net.pose.matrix()[(r, c)])
    }
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, 6, |r, c| self.inner.net.covariance[(r, c)])
    }
    #[getter]
    fn sigma_range_m(&self) -> f64 {
        self.inner.net.sigma_range_m
    }
    #[getter]
    fn sigma_tilt(&self) -> f64 {
        self.inner.net.sigma_tilt
    }
    #[getter]
    fn sigma_xy_m(&self) -> f64 {
        self.inner.net.sigma_xy_m
    }
    #[getter]
    fn crossing_angle(&self) -> Option<f64> {
        self.inner.net.sheet.map(|s| s.crossing_angle)
    }
    #[getter]
    fn sigma_crossing_angle(&self) -> Option<f64> {
        self.inner.net.sheet.and_then(|s| s.sigma_crossing_angle)
    }
    #[getter]
    fn curvatures_per_m(&self) -> Option<(f64, f64)> {
        self.inner.net.sheet.map(|s| s.curvatures_per_m.into())
    }
    #[getter]
    fn sigma_curvatures_per_m(&self) -> Option<(f64, f64)> {
        self.inner.net.sheet.and_then(|s| s.sigma_curvatures_per_m).map(Into::into)
    }
    #[getter]
    fn mean_normal<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.inner.net.sheet.map(|s| s.mean_plane.normal.as_slice().to_pyarray(py))
    }
    #[getter]
    fn mean_distance_m(&self) -> Option<f64> {
        self.inner.net.sheet.map(|s| s.mean_plane.distance)
    }
    #[getter]
    fn cell_margin(&self) -> Option<f64> {
        self.inner.net.sheet.map(|s| s.cell_margin)
    }
    fn __repr__(&self) -> String {
        let Layer { inner } = self;
        let followed = if inner.followed { "True" } else { "False" };
        format!("Layer(range_m={:.4}, probability={:.3}, followed={followed})", inner.net.range_m, inner.probability)
    }
}

/// What [`Estimate`] holds, in the order of its fields.
type EstimateState = (
    String,
    f64,
    u32,
    String,
    Vec<Shift>,
    Option<f64>,
    Option<Vec<f64>>,
    (Vec<JunctionNumbers>, Vec<TwineNumbers>),
    Vec<LayerNumbers>,
);

impl Estimate {
    /// Copies what must outlive the frame.
    pub fn from_frame(estimate: &netpose::Estimate<'_>) -> Self {
        Self {
            status: estimate.status.as_str(),
            probability: estimate.probability,
            track: estimate.track,
            connection: estimate.connection.as_str(),
            shifts: estimate.vote.map_or_else(Vec::new, |vote| {
                vote.shifts.iter().map(|shift| (shift.cells.0, shift.cells.1, shift.z)).collect()
            }),
            log_odds: estimate.vote.map(|vote| vote.log_odds),
            net: estimate.net,
            junctions: estimate.junctions.to_vec(),
            twines: estimate.twines.to_vec(),
            layers: estimate.layers.to_vec(),
        }
    }

    fn sheet(&self) -> Option<netpose::Sheet> {
        self.net?.sheet
    }
}

#[pymethods]
impl Estimate {
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (EstimateState,))> {
        let state = (
            self.status.to_owned(),
            self.probability,
            self.track,
            self.connection.to_owned(),
            self.shifts.clone(),
            self.log_odds,
            self.net.as_ref().map(from_net),
            (self.junctions.iter().map(from_junction).collect(), self.twines.iter().map(from_twine).collect()),
            self.layers.iter().map(from_layer).collect(),
        );
        Ok((py.get_type::<Self>().getattr("_from_state")?, (state,)))
    }
    #[staticmethod]
    fn _from_state(state: EstimateState) -> PyResult<Self> {
        let (status, probability, track, connection, shifts, log_odds, net, (junctions, twines), layers) = state;
        Ok(Self {
            status: to_status(&status)?,
            probability,
            track,
            connection: to_connection(&connection)?,
            shifts,
            log_odds,
            net: net.as_deref().map(to_net).transpose()?,
            junctions: junctions.into_iter().map(to_junction).collect::<PyResult<_>>()?,
            twines: twines.into_iter().map(to_twine).collect::<PyResult<_>>()?,
            layers: layers.iter().map(to_layer).collect::<PyResult<_>>()?,
        })
    }
    #[getter]
    fn range_m(&self) -> Option<f64> {
        self.net.map(|n| n.range_m)
    }
    #[getter]
    fn distance_m(&self) -> Option<f64> {
        self.net.map(|n| n.distance_m)
    }
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.net.map(|n| n.normal.as_slice().to_pyarray(py))
    }
    #[getter]
    fn pose<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.net.map(|n| matrix(py, 4, |r, c| n.pose.matrix()[(r, c)])).transpose()
    }
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.net.map(|n| matrix(py, 6, |r, c| n.covariance[(r, c)])).transpose()
    }
    #[getter]
    fn junctions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows: Vec<f64> = self.junctions.iter().flat_map(|j| [j.pixel.x, j.pixel.y]).collect();
        array2(py, rows, self.junctions.len(), 2)
    }
    #[getter]
    fn lattice<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let rows: Vec<i64> = self.junctions.iter().flat_map(index_or_unnamed).collect();
        array2(py, rows, self.junctions.len(), 2)
    }
    #[getter]
    fn sigma_px<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.junctions.iter().map(|j| j.sigma_px).collect::<Vec<_>>().to_pyarray(py)
    }
    #[getter]
    fn states(&self) -> Vec<&'static str> {
        self.junctions.iter().map(|j| j.state.as_str()).collect()
    }
    #[getter]
    fn twines<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let row = |t: &netpose::Twine| [i64::from(t.index.0), i64::from(t.index.1), t.direction as i64];
        array2(py, self.twines.iter().flat_map(row).collect(), self.twines.len(), 3)
    }
    #[getter]
    fn twine_states(&self) -> Vec<&'static str> {
        self.twines.iter().map(|t| t.state.as_str()).collect()
    }
    #[getter]
    fn twine_llr<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.twines.iter().map(|t| f64::from(t.llr)).collect::<Vec<_>>().to_pyarray(py)
    }
    #[getter]
    fn twine_contrast<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.twines.iter().map(|t| f64::from(t.contrast)).collect::<Vec<_>>().to_pyarray(py)
    }
    #[getter]
    fn twine_width_px<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.twines.iter().map(|t| t.width_px.map_or(f64::NAN, f64::from)).collect::<Vec<_>>().to_pyarray(py)
    }
    #[getter]
    fn shifts(&self) -> Vec<Shift> {
        self.shifts.clone()
    }
    #[getter]
    fn layers(&self) -> Vec<Layer> {
        self.layers.iter().map(|&inner| Layer { inner }).collect()
    }
    #[getter]
    fn sigma_range_m(&self) -> Option<f64> {
        self.net.map(|n| n.sigma_range_m)
    }
    #[getter]
    fn sigma_tilt(&self) -> Option<f64> {
        self.net.map(|n| n.sigma_tilt)
    }
    #[getter]
    fn sigma_xy_m(&self) -> Option<f64> {
        self.net.map(|n| n.sigma_xy_m)
    }
    #[getter]
    fn crossing_angle(&self) -> Option<f64> {
        self.sheet().map(|s| s.crossing_angle)
    }
    #[getter]
    fn sigma_crossing_angle(&self) -> Option<f64> {
        self.sheet().and_then(|s| s.sigma_crossing_angle)
    }
    #[getter]
    fn curvatures_per_m(&self) -> Option<(f64, f64)> {
        self.sheet().map(|s| s.curvatures_per_m.into())
    }
    #[getter]
    fn sigma_curvatures_per_m(&self) -> Option<(f64, f64)> {
        self.sheet().and_then(|s| s.sigma_curvatures_per_m).map(Into::into)
    }
    #[getter]
    fn mean_normal<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.sheet().map(|s| s.mean_plane.normal.as_slice().to_pyarray(py))
    }
    #[getter]
    fn mean_distance_m(&self) -> Option<f64> {
        self.sheet().map(|s| s.mean_plane.distance)
    }
    #[getter]
    fn cell_margin(&self) -> Option<f64> {
        self.sheet().map(|s| s.cell_margin)
    }
    fn __repr__(&self) -> String {
        match self.net {
            Some(n) => format!(
                "Estimate(status='ok', probability={:.3}, range_m={:.4}, junctions={})",
                self.probability,
                n.range_m,
                self.junctions.len()
            ),
            None => format!("Estimate(status='{}', probability={:.3})", self.status, self.probability),
        }
    }
}

/// Lattice indices; the lowest 32-bit number where a junction has no name.
pub fn index_or_unnamed(junction: &netpose::Junction) -> [i64; 2] {
    let (i, j) = junction.index.unwrap_or((i32::MIN, i32::MIN));
    [i64::from(i), i64::from(j)]
}

/// `n * n` values as a matrix.
pub fn matrix<'py>(py: Python<'py>, n: usize, at: impl Fn(usize, usize) -> f64) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let values = (0..n * n).map(|k| at(k / n, k % n)).collect();
    array2(py, values, n, n)
}
