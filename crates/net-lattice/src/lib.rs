//! One lattice on one hung sheet, fitted to the whole picture: from one camera, where the net is, how it is turned and bent, how its meshes
//! have sheared, and how far to trust the answer.
//!
//! # Stages, one file each, in the order data flows
//! 1. `view`: the picture averaged down to a pyramid, the rays through its grid, the tiles that gather evidence.
//! 2. `spectra`, `coarse`: whitened power spectra of overlapping tiles.
//! 3. `search`, `score`, `refine`: which planes, turns, depths and crossing angles put both families' harmonics on power in *all* tiles. A single spectrum cannot
//!    tell the sign of a tilt; the change of the wave vectors from tile to tile does. `background`: what hypotheses score that are not there.
//! 4. `surface`, `chart`, `map`: the sheet, and the lattice coordinates it gives every pixel (rays, so any lens).
//! 5. `seed`, `demodulate`, `comb`, `lockin`, `fit`: the picture demodulated along the predicted waves; Gauss-Newton on the phases left over, in a window that grows.
//! 6. `template`, `likelihood`: the twine drawn as it should look; how much better that explains the picture, and how each tile would move it.
//!    Used to tell bright twine from dark, the true cell from rival periods, and for the last digits.
//! 7. `model`: flat square, rhomb, quadratic to quartic sheet, by the Bayesian information criterion.
//! 8. `fold`: all cells on top of each other; the average cell must look like two crossing twines.
//! 9. `decision`, `covariance`: a probability from statistics that the fit cannot raise, and errors that grow when the model does not fit.
//!
//! `estimator` is the door; `cold` and `follow` put the stages together for a first and for a next picture, `conclude` ends both; `workspace`
//! is what they share.
//! 10. `layers`, `paint`: the net found painted over, and all of the above once more for one behind it.
//!
//! # Conventions
//! Frames, pixels and units are those of [`net_geometry`]. Lattice coordinates are in cells. Of a bent net the pose is that of the tangent
//! plane at the optical axis.
//!
//! # Example
//! ```
//! use net_geometry::{Camera, Lens, Mesh};
//! use net_image::GrayView;
//! use net_lattice::{Config, LatticeEstimator};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let camera = Camera::new(150.0, 150.0, 99.5, 74.5, 200, 150, Lens::None)?;
//! let config = Config::default();
//! let mut estimator = LatticeEstimator::new(&camera, &Mesh::square(0.05)?, &config)?;
//! let open_water = vec![80u8; 200 * 150];
//! let found = estimator.estimate(GrayView::packed(&open_water, 200, 150)?)?;
//! assert!(found.is_none_or(|net| net.probability < config.probability_threshold));
//! # Ok(())
//! # }
//! ```

// Dense matrix code reads best with its indices.
#![allow(clippy::needless_range_loop)]

mod alike;
mod background;
mod bar;
mod blocks;
mod chart;
mod coarse;
mod cold;
mod comb;
mod compare;
mod conclude;
mod config;
mod covariance;
mod decision;
mod demodulate;
mod error;
mod estimate;
mod estimator;
mod fit;
mod fold;
mod follow;
mod layers;
mod likelihood;
mod lockin;
mod map;
mod model;
mod naming;
mod nodes;
mod numeric;
mod paint;
mod passes;
mod periods;
mod polarity;
mod refine;
mod score;
mod search;
mod seed;
mod smooth;
mod spectra;
mod spread;
mod stages;
mod surface;
mod template;
mod view;
mod workspace;

pub use config::Config;
pub use decision::Evidence;
pub use error::{Error, Result};
pub use estimate::LatticeEstimate;
pub use estimator::LatticeEstimator;
pub use model::Model;
pub use nodes::Node;
pub use polarity::Polarity;
pub use stages::Stages;
pub use surface::Surface;
