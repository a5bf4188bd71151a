//! What tiles say of a lattice that is nearly right: the picture summed along its waves, residual phases of all harmonics, where to begin and how to go outwards.

pub(crate) mod comb;
pub(crate) mod demodulate;
pub(crate) mod lockin;
pub(crate) mod passes;
pub(crate) mod seed;
pub(crate) mod spread;
