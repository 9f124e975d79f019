//! The report and the live page in a browser: what they show is what the flight was.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

#[cfg(feature = "browser")]
mod live;
#[cfg(feature = "browser")]
mod report;
