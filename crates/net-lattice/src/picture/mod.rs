//! The picture at several scales, and what of it is laid along a lattice: phases, sums over tiles, the average cell.

pub(crate) mod demodulate;
pub(crate) mod fold;
pub(crate) mod map;
pub(crate) mod numeric;
pub(crate) mod smooth;
pub(crate) mod view;
