//! The ways from a picture to an answer: cold, with its periods tested, followed, and a net behind a net.

pub(crate) mod bumps;
pub(crate) mod cold;
pub(crate) mod conclude;
pub(crate) mod follow;
pub(crate) mod layers;
pub(crate) mod outwards;
pub(crate) mod periods;
