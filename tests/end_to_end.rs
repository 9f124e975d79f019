//! The `hums` command and the image, from outside; each module is one step of `cargo xtask test`. One program: five took longer
//! to link than to run.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod answer;
mod browser;
mod chip;
mod live;
mod sim;
