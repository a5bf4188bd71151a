//! One lattice on one hung sheet, fitted to the whole picture: from one camera, where the net is, how it is turned and bent, how its meshes
//! have sheared, and how far to trust the answer.
//!
//! # Folders, in the order data flows
//! 1. `picture`: averaged down to a pyramid, the rays through its grid and the tiles that gather evidence (`view`).
//! 2. `search`: whitened power spectra of overlapping tiles (`spectra`, `coarse`), and which planes, turns, depths and crossing angles put both families' harmonics
//!    on power in *all* tiles (`table`, `score`, `refine`). A single spectrum cannot tell the sign of a tilt; the change of the wave vectors from tile to tile does.
//!    `background`: what hypotheses score that are not there.
//! 3. `sheet`: the hung net (`surface`), rays that meet it (`chart`: any lens), lattice coordinates of every pixel (`map`), its fit to what tiles say (`fit`, `alike`),
//!    and how much of it they support (`model`: flat square, rhomb, quadratic to quartic, by the Bayesian information criterion).
//! 4. `lock`: the picture summed over tiles along the predicted waves (`demodulate`), phases left over, all harmonics read together (`comb`, `lockin`), where to begin
//!    (`seed`), outwards from there (`spread`), fitted in a window that grows (`passes`).
//! 5. `drawing`: the twine as it should look (`template`, `bar`, `polarity`), how much better that explains the picture and how each tile would move it
//!    (`likelihood`, `compare`): for the true cell, for bright or dark, and for the last digits. `paint`: a net taken out of the picture.
//! 6. `answer`: the estimate, errors that grow when the model does not fit (`covariance`), all cells on top of each other (`fold`), a probability from statistics
//!    that the fit cannot raise (`decision`), names and nodes.
//! 7. `start` puts it all together: a first picture (`cold`, its true cell in `periods`), a next one (`follow`), the end of both (`conclude`), and a net behind the net
//!    (`layers`).
//!
//! `estimator` is the door; `workspace` is what the stages share, `numeric` small sums and quick functions.
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

mod answer;
mod config;
mod drawing;
mod error;
mod estimator;
mod lock;
mod numeric;
mod picture;
mod search;
mod sheet;
mod start;
mod workspace;

pub use answer::decision::Evidence;
pub use answer::estimate::LatticeEstimate;
pub use answer::nodes::Node;
pub use answer::stages::Stages;
pub use config::Config;
pub use drawing::polarity::Polarity;
pub use error::{Error, Result};
pub use estimator::LatticeEstimator;
pub use sheet::model::Model;
pub use sheet::surface::Surface;
