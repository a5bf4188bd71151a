//! `netpose_rs.fft`

use net_fft::{
    Bins, Ellipse, HalfSpectrum, PeakConfig, PeakFinder, ScoreConfig, SpectrumImage, SpectrumImageConfig, SpectrumPlan,
    ThesisConfig, ThesisEstimator, Window, filter_peaks, score_peaks,
};
use net_geometry::nalgebra::Vector2;
use numpy::{PyArray1, PyArray2, PyArray3, PyArray4, PyArrayMethods, ToPyArray};
use pyo3::prelude::*;

use crate::arrays::{GrayArgument, array2};
use crate::camera::{Camera, Mesh, of_argument, value_error};

/// Centred log magnitude of the Hann-windowed picture, 0..255, constant bin at `(width / 2, height / 2)`.
#[pyfunction]
#[pyo3(signature = (image, *, window=true, logarithm=true, blur=true))]
pub fn spectrum<'py>(
    py: Python<'py>,
    image: &Bound<'_, PyAny>,
    window: bool,
    logarithm: bool,
    blur: bool,
) -> PyResult<Bound<'py, PyArray2<u8>>> {
    let image = GrayArgument::new("image", image)?;
    let view = image.view()?;
    let drawn = py
        .detach(|| {
            let window = if window { Window::Hann } else { Window::None };
            let mut plan = SpectrumPlan::new(view.width(), view.height(), window)?;
            let mut half = HalfSpectrum::default();
            plan.transform(view, &mut half)?;
            let mut drawn = SpectrumImage::default();
            drawn.draw(&half, Bins::All, SpectrumImageConfig { logarithm, blur });
            Ok(drawn)
        })
        .map_err(|error: net_fft::Error| value_error(error))?;
    let picture = drawn.image();
    array2(py, picture.data().to_vec(), picture.height(), picture.width())
}

/// Peaks of a spectrum drawn by `spectrum`: rows `kx, ky` (cycles per width and height) and level (Algorithm 2).
#[pyfunction]
#[pyo3(signature = (spectrum, *, neighbourhood=16, threshold=20, cluster=10.0))]
pub fn peaks<'py>(
    py: Python<'py>,
    spectrum: &Bound<'_, PyAny>,
    neighbourhood: usize,
    threshold: u8,
    cluster: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let spectrum = GrayArgument::new("spectrum", spectrum)?;
    let view = spectrum.view()?;
    let config = PeakConfig {
        neighbourhood_bins: neighbourhood,
        threshold_levels: threshold,
        lowest_level: 0,
        cluster_bins: cluster,
    };
    config.validate().map_err(value_error)?;
    let rows: Vec<f64> = py.detach(|| {
        let middle = (view.width() / 2, view.height() / 2);
        PeakFinder::default().find(view, middle, &config).iter().flat_map(|p| [p.bin.x, p.bin.y, p.level]).collect()
    });
    let n = rows.len() / 3;
    array2(py, rows, n, 3)
}

/// Peak values of a spectrum (Algorithm 3), best first: rows `kx, ky, peak, beam, pattern, absent, value`.
#[pyfunction]
#[pyo3(signature = (spectrum, *, ellipse=0.25, constant_radius=4.0, neighbourhood=16, threshold=20, cluster=10.0))]
pub fn scores<'py>(
    py: Python<'py>,
    spectrum: &Bound<'_, PyAny>,
    ellipse: f64,
    constant_radius: f64,
    neighbourhood: usize,
    threshold: u8,
    cluster: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let spectrum = GrayArgument::new("spectrum", spectrum)?;
    let view = spectrum.view()?;
    let config = PeakConfig {
        neighbourhood_bins: neighbourhood,
        threshold_levels: threshold,
        lowest_level: 0,
        cluster_bins: cluster,
    };
    config.validate().map_err(value_error)?;
    if !(ellipse > 0.0 && ellipse.is_finite()) {
        return Err(of_argument("ellipse", format!("{ellipse} is not a share of the spectrum above 0")));
    }
    if !(constant_radius >= 0.0 && constant_radius.is_finite()) {
        return Err(of_argument("constant_radius", format!("{constant_radius} is not a number of bins, 0 or more")));
    }
    let rows: Vec<f64> = py.detach(|| {
        let (width, height) = (view.width(), view.height());
        let middle = (width / 2, height / 2);
        let ellipse = Ellipse { horizontal_bins: ellipse * width as f64, vertical_bins: ellipse * height as f64 };
        let mut finder = PeakFinder::default();
        let mut kept = Vec::new();
        filter_peaks(finder.find(view, middle, &config), &ellipse, constant_radius, None, &mut kept);
        let total: f64 = view.rows().flat_map(|row| row.iter().map(|&level| f64::from(level))).sum();
        let mean = total / (width * height) as f64;
        let (mut order, mut candidates) = (Vec::new(), Vec::new());
        score_peaks(view, middle, &kept, &ellipse, mean, &ScoreConfig::default(), &mut order, &mut candidates);
        candidates.iter().flat_map(|c| [c.bin.x, c.bin.y, c.peak, c.beam, c.pattern, c.absent, c.value()]).collect()
    });
    let n = rows.len() / 7;
    array2(py, rows, n, 7)
}

/// Lattice vectors, px, rows, of two wave vectors, cycles per pixel: the inverse transpose.
#[pyfunction]
pub fn lattice_vectors<'py>(py: Python<'py>, k1: (f64, f64), k2: (f64, f64)) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let vector = |name: &str, k: (f64, f64)| {
        let finite = k.0.is_finite() && k.1.is_finite();
        finite.then(|| Vector2::new(k.0, k.1)).ok_or_else(|| of_argument(name, format!("{k:?} is not a wave vector")))
    };
    let b = net_geometry::Basis::from_wave_vectors(vector("k1", k1)?, vector("k2", k2)?);
    let b = b.map_err(|e| of_argument("k1, k2", e))?;
    array2(py, vec![b.b1.x, b.b1.y, b.b2.x, b.b2.y], 2, 2)
}

/// The net as the sections of one picture see it, one by one.
#[pyclass(frozen, module = "netpose_rs.fft")]
pub struct SectionPoses {
    /// Of the whole picture; `None` if nothing was found.
    #[pyo3(get)]
    probability: Option<f64>,
    centres: Vec<f64>,
    waves: Vec<f64>,
    basis: Vec<f64>,
    confidence: Vec<f64>,
    poses: Vec<f64>,
    chosen: Vec<i64>,
}

#[pymethods]
impl SectionPoses {
    #[getter]
    fn centres<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array2(py, self.centres.clone(), self.chosen.len(), 2)
    }
    #[getter]
    fn waves<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        self.waves.to_pyarray(py).reshape([self.chosen.len(), 2, 2])
    }
    #[getter]
    fn basis<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        self.basis.to_pyarray(py).reshape([self.chosen.len(), 2, 2])
    }
    #[getter]
    fn confidence<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array2(py, self.confidence.clone(), self.chosen.len(), 2)
    }
    #[getter]
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray4<f64>>> {
        self.poses.to_pyarray(py).reshape([self.chosen.len(), 2, 4, 4])
    }
    #[getter]
    fn chosen<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.chosen.to_pyarray(py)
    }
}

/// Wave vectors, lattice vectors and both one-cell poses of every section that sees the net.
#[pyfunction]
pub fn sections(py: Python<'_>, image: &Bound<'_, PyAny>, camera: &Camera, mesh: &Mesh) -> PyResult<SectionPoses> {
    let image = GrayArgument::new("image", image)?;
    let view = image.view()?;
    py.detach(|| {
        let mut estimator = ThesisEstimator::new(&camera.inner, &mesh.inner, &ThesisConfig::default())?;
        let probability = estimator.estimate(view)?.map(|found| found.probability);
        let mut out = SectionPoses {
            probability,
            centres: Vec::new(),
            waves: Vec::new(),
            basis: Vec::new(),
            confidence: Vec::new(),
            poses: Vec::new(),
            chosen: Vec::new(),
        };
        for pose in estimator.section_poses() {
            let section = &estimator.sections()[pose.section];
            let reduction = section.reduction as f64;
            let size = Vector2::new(section.size.0 as f64, section.size.1 as f64) * reduction;
            let corner = Vector2::new(section.corner.0 as f64, section.corner.1 as f64) * reduction;
            out.centres.extend((corner + 0.5 * size).add_scalar(-0.5).iter());
            out.waves.extend(pose.bins.iter().flat_map(|bin| [bin.x / size.x, bin.y / size.y]));
            out.basis.extend([pose.basis.b1.x, pose.basis.b1.y, pose.basis.b2.x, pose.basis.b2.y]);
            out.confidence.extend(pose.confidence.map(|c| c.ratio));
            for both in &pose.poses {
                out.poses.extend(both.pose.matrix().transpose().iter());
            }
            out.chosen.push(pose.chosen as i64);
        }
        Ok(out)
    })
    .map_err(|error: net_fft::Error| of_argument("image", error))
}
