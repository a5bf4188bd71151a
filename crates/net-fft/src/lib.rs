//! The net's pose from the peaks of its spectrum.
//!
//! # Conventions
//! Frames, pixels and units are those of [`net_geometry`].
//!
//! **Normalization.** Transforms are unscaled: the bin of a wave of amplitude `a` holds `a / 2` times the sum of the window's weights.
//!
//! **Output order.** A real picture's spectrum is its own mirror image, so [`HalfSpectrum`] keeps the bins of `kx = 0 ..= width / 2` cycles per width, column
//! by column (what the column transforms leave behind, which saves a transposition): within a column `ky = 0, 1, .., height - 1`, those past `height / 2`
//! standing for `ky - height`. [`HalfSpectrum::bin`] takes any signed `(kx, ky)`. A [`SpectrumImage`] is shifted: zero in its middle, `kx` to the right, `ky` down.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod cell;
mod choose;
mod config;
mod decide;
mod envelope;
mod error;
mod estimate;
mod estimator;
mod evidence;
mod extrema;
mod fft2;
mod field;
mod filter;
mod fit;
mod flatten;
mod measure;
mod peaks;
mod plane;
mod poses;
mod reduce;
mod score;
mod search;
mod section;
mod sections;
mod spectrum;

pub use cell::cell_poses;
pub use choose::{Choice, Confidence, choose};
pub use config::{ThesisConfig, PlaneSource, Selection};
pub use error::{Error, Result};
pub use estimate::{SectionPose, Side, ThesisEstimate, Support};
pub use estimator::ThesisEstimator;
pub use evidence::{Evidence, Section};
pub use extrema::RunningExtrema;
pub use fft2::{HalfSpectrum, RealFft2};
pub use field::LatticeField;
pub use filter::{Ellipse, FallingThreshold, FilterConfig, filter_peaks};
pub use fit::ShapeConfig;
pub use flatten::Flattener;
pub use peaks::{Peak, PeakConfig, PeakFinder};
pub use plane::{SideInSection, most_confident_three, plane_from_waves, pose_in_plane};
pub use reduce::sum_of_four;
pub use score::{Candidate, ScoreConfig, score_peaks};
pub use search::{Hypothesis, SearchConfig};
pub use section::{SectionAnalyser, SectionConfig, SectionSpectrum};
pub use sections::{GRID, GridConfig, SectionView};
pub use spectrum::{Bins, SpectrumImage, SpectrumImageConfig, SpectrumPlan, Window};
