//! The picture at several scales, the rays through it, and the tiles that gather evidence.

pub(crate) mod smooth;
pub(crate) mod view;
pub(crate) mod window;
