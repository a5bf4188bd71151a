//! A fish net unrolled: what was seen of each mesh, how sharply, from how far; which twines are missing; what grows on it.
//!
//! Lattice coordinates name every mesh of a net, so that pictures add up: the map has a record for each mesh and each twine, whatever way the camera went. It lies in
//! tiles of 32 x 32 cells; those not in use are the caller's to keep ([`TileStore`]), so that memory does not grow with the way.
//!
//! # Steps
//! 1. [`Mapper::add`] takes a [`Frame`] whose pose can be vouched for: picture, lattice, and what was found of each twine.
//! 2. Twines (`evidence.rs`): log likelihood ratios, present to missing, add up over looks, worth the root of their number. Frames of one look (the camera has moved by less than a cell) are averaged, and no look
//!    says more than [`Config::look_max`]. Twines behind fish or under growth say nothing.
//! 3. Meshes (`patch.rs`): 16 x 16 samples each, water at 128 and twine at a fixed swing from it. Water (`water.rs`) is a robust quadric through the openings of 9 x 9 cells,
//!    twine's contrast a median over them with noise taken off. The nearest unhidden view is kept. The samples' distance from the water, in parts of twine's contrast and
//!    at most one, adds up to the blocked share; nothing is said where twine hardly stands out from noise, or unevenly.
//! 4. [`Mapper::holes`] joins the meshes beside missing twines; a group is a [`Hole`] if one twine is certain, or several together.
//!
//! Cell `(i, j)` lies between the nodes `(i, j)` and `(i + 1, j + 1)`; other conventions are those of [`net_geometry`].
//!
//! # What is not safe
//! - The map lays pictures out as the caller's [`NetView`] says. A fitted sheet that misfits blurs the mosaic; measured knots do not.
//! - The map believes the count of cells. A count that slipped in silence draws the same mesh twice, and a hole seen on both sides of the slip is two holes.
//! - The blocked share is what the picture shows: where blur is wider than twine, a clean net has a share above that of its twine, growth fainter than twine counts for less, a fish that the junction stage did not see counts as growth, and
//!   so does a second net close behind. Compare meshes with each other rather than with a ruler.
//! - The end of a net is no hole only because nothing stands out there; a rope along it may make one.

mod config;
mod error;
mod evidence;
mod frame;
mod holes;
mod mapper;
mod patch;
mod store;
mod tile;
mod water;

pub use config::Config;
pub use error::{Error, Result};
pub use frame::{Frame, NetView, Seen, TwineLook};
pub use holes::Hole;
pub use mapper::Mapper;
pub use store::TileStore;
pub use tile::{Cell, PATCH, SAMPLES, TILE, Tile, TileKey, Twine};
