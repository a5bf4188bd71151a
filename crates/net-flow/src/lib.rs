//! Motion between pictures of a net by pyramidal block matching.

mod block_match;
mod config;
mod consensus;
mod error;
mod flatten;
mod loop_test;
mod motion;
mod refine;
mod result;
mod rivals;
mod surface;
mod tracker;
mod tracks;
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
pub use tracker::{FlowTracker, Hints, Prior};
pub use tracks::{Track, TrackState};
