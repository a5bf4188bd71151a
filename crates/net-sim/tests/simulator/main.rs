//! The simulator against closed forms, naive pictures and its own promises. One binary: it links once.
// Tests may unwrap what they made themselves.
#![allow(clippy::unwrap_used)]

mod bad_input;
mod bent;
mod conditions;
mod planar;
mod scenarios;
mod support;
