//! Junctions by adjusting a predicted lattice to the picture: a small bundle adjustment in the image plane.

mod adjuster;
mod appearance;
mod between;
mod blocks;
mod config;
mod covered;
mod foreign;
mod graph;
mod grow;
mod lanes;
mod lines;
mod locate;
mod map;
mod outside;
mod presence;
mod profile;
mod seen;
mod solve;
mod source;
mod spread;
mod statistic;
mod template;
mod warp;
mod width;

pub use adjuster::NetAdjuster;
pub use config::AdjustConfig;
pub use map::LatticeMap;
pub use presence::{Twine, TwineState};
