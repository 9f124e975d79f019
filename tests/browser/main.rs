//! The report in a browser: what it shows is what the flight was.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

#[cfg(feature = "browser")]
mod report;
