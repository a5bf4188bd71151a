//! The net drawn: how much better it explains the picture, and a net taken out of it.

pub(crate) mod bar;
pub(crate) mod blocks;
pub(crate) mod compare;
pub(crate) mod likelihood;
pub(crate) mod paint;
pub(crate) mod polarity;
pub(crate) mod template;
