//! `netpose_rs.fft`

use net_fft::{
    Bins, Ellipse, HalfSpectrum, PeakConfig, PeakFinder, ScoreConfig, SpectrumImage, SpectrumImageConfig, SpectrumPlan,
    Window, filter_peaks, score_peaks,
};
use net_geometry::nalgebra::Vector2;
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::arrays::{GrayArgument, array2};
use crate::camera::{of_argument, value_error};

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
