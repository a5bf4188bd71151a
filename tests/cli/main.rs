//! The program as a process: what only a process shows.

#![allow(clippy::unwrap_used)]

mod bad_input;
mod calibrate;
mod folder;
mod map;
mod mcap;
mod run;
mod sim;
mod support;
mod usage;
