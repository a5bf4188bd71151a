//! `netpose_rs._core`: the compiled half of the Python package `netpose_rs`. Documentation for users is in the Python stubs.

mod arrays;
mod camera;
mod estimate;
mod pickle;
mod stages;
mod tracker;

/// The private extension module.
#[pyo3::pymodule]
mod _core {
    #[pymodule_export]
    use crate::camera::{Camera, Mesh};
    #[pymodule_export]
    use crate::estimate::{Estimate, Layer};
    #[pymodule_export]
    use crate::stages::fft::{SectionPoses, lattice_vectors, peaks, scores, sections, spectrum};
    #[pymodule_export]
    use crate::stages::flow::{FlowResult, FlowTracker, Matches, match_points};
    #[pymodule_export]
    use crate::stages::junction::{Junctions, detect};
    #[pymodule_export]
    use crate::stages::sim::{SimFrame, render, scenarios};
    #[pymodule_export]
    use crate::tracker::{Tracker, estimate};
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
