//! The net's pose from the peaks of its spectrum.
//!
//! A net is a lattice, and a lattice has few and strong peaks in its spectrum: its wave vectors. They tell how far and how turned it is, without finding a single twine
//! (Schellewald 2021, Strandenes 2023).
//!
//! ```
//! use net_fft::{ThesisConfig, ThesisEstimator};
//! use net_geometry::{Camera, Lens, Mesh};
//! use net_image::View;
//!
//! let camera = Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None)?;
//! let mut estimator = ThesisEstimator::new(&camera, &Mesh::square(0.05)?, &ThesisConfig::default())?;
//! let picture = vec![90; 848 * 480];
//! let found = estimator.estimate(View::packed(&picture, 848, 480)?)?;
//! assert!(found.is_none_or(|found| found.probability < 0.5), "open water is no net");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Stages
//! In the order in which data flows, one file each; each can be called alone. [`ThesisEstimator`] keeps what they leave behind ([`ThesisEstimator::sections`],
//! [`ThesisEstimator::hypotheses`], [`ThesisEstimator::section_poses`]) until the next picture; grey pictures of spectra are only drawn when asked for ([`SpectrumImage`]).
//!
//! | stage | |
//! |---|---|
//! | sections of the picture, seen through the lens | [`GridConfig`], [`SectionView`] |
//! | mean, window, transform | [`SpectrumPlan`], [`RealFft2`], [`HalfSpectrum`] |
//! | grey picture of the spectrum; the background taken off | [`SpectrumImage`], [`Flattener`] |
//! | peaks (Algorithm 2) and which of them pass | [`PeakFinder`], [`RunningExtrema`], [`filter_peaks`] |
//! | values (Algorithm 3) | [`score_peaks`] |
//! | all of these for one section | [`SectionAnalyser`] |
//! | a section's own choice, and how sure it is | [`choose`] |
//! | one cell's pose | [`cell_poses`] |
//! | the plane through sections, the rotation in it | [`most_confident_three`], [`plane_from_waves`], [`pose_in_plane`] |
//! | the wave vectors that a plane foretells everywhere | [`LatticeField`] |
//! | all of it | [`ThesisEstimator`] |
//!
//! # Conventions
//! Frames, pixels and units are those of [`net_geometry`].
//!
//! **Bins.** One bin is a cycle per width (along u) or per height (along v) of the transformed picture. A wave vector and its negative are the same wave.
//!
//! **Normalization.** Transforms are unscaled: the bin of a wave of amplitude `a` holds `a / 2` times the sum of the window's weights.
//!
//! **Output order.** A real picture's spectrum is its own mirror image, so [`HalfSpectrum`] keeps the bins of `kx = 0 ..= width / 2` cycles per width, column
//! by column (what the column transforms leave behind, which saves a transposition): within a column `ky = 0, 1, .. height - 1`, those past `height / 2`
//! standing for `ky - height`. [`HalfSpectrum::bin`] takes any signed `(kx, ky)`. A [`SpectrumImage`] is shifted: zero in its middle, `kx` to the right, `ky` down.
//!
//! **Levels.** A flattened spectrum has its background at [`Flattener::ZERO`] and [`Flattener::LEVELS_PER_NAT`] levels to a factor of e.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod bins;
mod cell;
mod choose;
mod config;
mod crossings;
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
mod line_fft;
mod measure;
mod naming;
mod peaks;
mod plane;
mod polish;
mod poses;
mod reduce;
mod score;
mod search;
mod section;
mod sections;
mod spectrum;
mod spectrum_image;

pub use bins::Bins;
pub use cell::cell_poses;
pub use choose::{Choice, Confidence, choose};
pub use config::{PlaneSource, Selection, ThesisConfig};
pub use error::{Error, Result};
pub use estimate::{SectionPose, Side, Support, ThesisEstimate};
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
pub use reduce::{mean_of_four, sum_of_four};
pub use score::{Candidate, ScoreConfig, score_peaks};
pub use search::{Hypothesis, SearchConfig};
pub use section::{SectionAnalyser, SectionConfig, SectionSpectrum};
pub use sections::{GRID, GridConfig, SectionView};
pub use spectrum::{SpectrumPlan, Window};
pub use spectrum_image::{SpectrumImage, SpectrumImageConfig};
