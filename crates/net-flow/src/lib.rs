//! Motion between pictures of a net: points followed by block matching, one motion that they agree on, and an honest word on which cell it led to.
//!
//! A net is the same after a step of one cell. Trackers that follow texture therefore slip by whole cells and report success. Here every step is
//! compared with its rivals, the same motion and one cell more, and is called [`Status::Ambiguous`] unless the pictures themselves, a prior or a bound on the
//! speed rule them out.
//!
//! # Conventions
//! - **Pixels** `(u, v)` as in [`net_image`]: u right, v down, the centre of the top-left pixel is `(0, 0)`.
//! - **Motions** are homographies from pixel to pixel, named `later_from_earlier`: see [`Motion`].
//! - Nothing is random: the same pictures give the same result, to the byte. After the first frames nothing is allocated.
//!
//! # Stages
//! In the order in which a frame passes through them:
//! 1. *Flatten and halve*: the light's slow changes are taken away, and a [`Pyramid`] is built.
//! 2. *Common shift*: the correlation surfaces of many points, summed, say where the whole picture went.
//! 3. *Block matching* ([`Matcher`], or [`match_points`] alone): each point's neighbourhood, by zero-mean normalised correlation from coarse to fine,
//!    with a quadratic's and then the gradient's sub-pixel part, there and back.
//! 4. *Consensus* ([`Consensus`]): the one motion that most points agree on; fish go elsewhere.
//! 5. *Rivals* ([`Rival`]): could it have been the next cell?
//! 6. *Tracks* ([`Track`]): points under their own numbers, carried by the others where hidden, seeded anew where lost. Optionally [`snap`]ped to detected
//!    junctions.
//! 7. *Direct match* with the key frame, started from the sum ([`Mode::KeyFrame`]): no drift while the key frame serves.
//!
//! ```
//! use net_flow::{Config, FlowTracker, Hints, Status};
//! use net_image::GrayView;
//!
//! // Two pictures of something that does not repeat, the second moved by (2, 1) px.
//! let picture = |du: i32, dv: i32| -> Vec<u8> {
//!     let value = |u: f64, v: f64| 128.0 + 50.0 * (0.3 * u + (0.07 * v).sin()).sin() + 40.0 * (0.2 * v + (0.05 * u).cos()).cos();
//!     (0..200 * 160).map(|i| value(f64::from(i % 200 - du), f64::from(i / 200 - dv)) as u8).collect()
//! };
//! let (first, second) = (picture(0, 0), picture(2, 1));
//!
//! let mut tracker = FlowTracker::new(200, 160, &Config::default())?;
//! tracker.update(GrayView::packed(&first, 200, 160)?, &Hints::default())?;
//! let result = tracker.update(GrayView::packed(&second, 200, 160)?, &Hints::default())?;
//! let motion = result.step.motion.expect("the pictures show the same");
//! let moved = motion.apply(nalgebra::Vector2::new(100.0, 80.0));
//! assert!((moved.x - 102.0).abs() < 0.1 && (moved.y - 81.0).abs() < 0.1);
//! println!("{:?}: {} of {} points agree", result.step.status, result.step.agreed, result.step.points);
//! # Ok::<(), net_flow::Error>(())
//! ```

mod block_match;
mod config;
mod consensus;
mod error;
mod flatten;
mod lanes;
mod loop_test;
mod motion;
mod motion_fit;
mod patch;
mod refine;
mod result;
mod rivals;
mod snap;
mod surface;
mod tracker;
mod tracks;
pub mod vote;
mod zncc;

pub use block_match::{Guess, Match, MatchState, Matcher, match_points};
pub use config::{Config, ConsensusConfig, MatchConfig, Mode, Model};
pub use consensus::{Consensus, Fit};
pub use error::{Error, Result};
pub use loop_test::{LoopError, loop_error};
pub use motion::Motion;
pub use net_image::Pyramid;
pub use result::{Estimate, FlowResult, Status};
pub use rivals::{Lattice, Rival};
pub use snap::snap;
pub use tracker::{FlowTracker, Hints, Prior};
pub use tracks::{Track, TrackState};
