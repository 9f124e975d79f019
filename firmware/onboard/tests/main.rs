//! The pipeline of the box on recorded and scripted flights, and the documents of it.
#![expect(clippy::unwrap_used, clippy::panic, reason = "that is how a test fails")]

mod docs;
mod golden;
mod scripted_flights;
