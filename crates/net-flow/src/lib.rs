//! Motion between pictures of a net by pyramidal block matching.

mod block_match;
mod config;
mod error;
mod motion;
mod pyramid;
mod refine;
mod zncc;

pub use block_match::{Guess, Match, MatchState, Matcher, match_points};
pub use config::MatchConfig;
pub use error::{Error, Result};
pub use motion::Motion;
pub use pyramid::Pyramid;
