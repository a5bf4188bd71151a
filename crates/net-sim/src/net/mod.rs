//! The net as a thing in space: which knots are in view, and where they are.

pub(crate) mod lattice;
pub(crate) mod region;
