//! The program as a process: what only a process shows.

#![allow(clippy::unwrap_used)]

mod bad_input;
mod folder;
mod run;
mod support;
mod usage;
