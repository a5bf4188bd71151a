//! What is said of the net: the estimate and its covariance, the average cell, evidence and probability, names and nodes.

pub(crate) mod covariance;
pub(crate) mod decision;
pub(crate) mod estimate;
pub(crate) mod fold;
pub(crate) mod naming;
pub(crate) mod nodes;
pub(crate) mod stages;
