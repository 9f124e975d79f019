//! The check, the report and the live page in a browser: they show the flight as it was.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

#[cfg(feature = "browser")]
mod check;
#[cfg(feature = "browser")]
mod live;
#[cfg(feature = "browser")]
mod report;
