//! The framer against recorded flights and any bytes, and the pipeline behind it.
#![expect(clippy::panic, clippy::unwrap_used, reason = "that is how a test fails")]

mod any_bytes;
mod common;
mod flights;
mod framing;
mod hostile;
