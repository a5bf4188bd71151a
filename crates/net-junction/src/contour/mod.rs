//! Junctions from the outlines of the net's meshes (thesis, 4.4).

mod block_mean;
mod cluster;
mod config;
mod covering;
mod detector;
mod expectation;
mod level;
mod naming;
mod outline;
mod quadrilateral;
mod rectangle;
mod shape;
mod size;
mod threshold;
mod trace;

pub use config::{Config, LocalMean, Polarity, Shape};
pub use covering::Covering;
pub use detector::JunctionDetector;
pub use expectation::{CellArea, Expectation, ExpectedNet};
pub use rectangle::{Rectangle, convex_hull, min_area_parallelogram, min_area_rectangle};
pub use shape::{CellBox, Verdict};
