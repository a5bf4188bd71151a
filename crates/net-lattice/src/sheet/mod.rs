//! The bent and sheared sheet: from rays and pixels to lattice coordinates, its fit to the tiles, and the model that they support.

pub(crate) mod alike;
pub(crate) mod bumps;
pub(crate) mod chart;
pub(crate) mod fit;
pub(crate) mod map;
pub(crate) mod model;
pub(crate) mod relief;
pub(crate) mod surface;
