//! One lattice on one hung sheet, fitted to the whole picture.

mod config;
mod covariance;
mod decision;
mod error;
mod estimate;
mod estimator;
mod fit;
mod likelihood;
mod lockin;
mod map;
mod model;
mod numeric;
mod search;
mod smooth;
mod spectra;
mod surface;
mod template;
mod view;

pub use config::Config;
pub use decision::Evidence;
pub use error::{Error, Result};
pub use estimate::LatticeEstimate;
pub use estimator::LatticeEstimator;
pub use likelihood::Polarity;
pub use model::Model;
pub use surface::Surface;
