//! The disk as hosts use it, and as hostile ones do.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod cases;
mod commands;
mod common;
mod hostile;
mod presence;
