//! Where to begin: which planes put the harmonics of both families on power in the spectra of all tiles.

pub(crate) mod background;
pub(crate) mod coarse;
pub(crate) mod refine;
pub(crate) mod score;
pub(crate) mod spectra;
pub(crate) mod table;
