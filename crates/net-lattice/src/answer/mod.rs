//! What is said of the net: the estimate, its evidence and probability, its names and nodes.

pub(crate) mod decision;
pub(crate) mod estimate;
pub(crate) mod naming;
pub(crate) mod nodes;
pub(crate) mod stages;
