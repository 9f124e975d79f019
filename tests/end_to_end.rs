//! The `hums` command and the image that is flashed, from outside; each module is one step of `cargo xtask test`. One program:
//! compiling and linking five took longer than most of them run.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod answer;
mod browser;
mod chip;
mod live;
mod sim;
