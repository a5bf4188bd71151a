//! The net as a thing in space: where its knots are, which of them are in view, what is broken.

pub(crate) mod damage;
mod drape;
pub(crate) mod fabric;
pub(crate) mod lattice;
pub(crate) mod region;
pub(crate) mod sheet;
