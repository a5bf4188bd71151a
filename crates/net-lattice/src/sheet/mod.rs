//! The bent and sheared sheet: from rays to lattice coordinates, its fit to the tiles, the model that they support and its covariance.

pub(crate) mod alike;
pub(crate) mod chart;
pub(crate) mod covariance;
pub(crate) mod fit;
pub(crate) mod model;
pub(crate) mod surface;
