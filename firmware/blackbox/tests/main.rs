//! The codec and the container, against golden files, any bytes and damage.
#![expect(clippy::panic, reason = "that is how a test fails")]

#[path = "common/card.rs"]
mod card;
mod codec;
mod common;
mod container;
#[path = "common/frames.rs"]
mod frames;
mod golden;
mod golden_sums;
mod hostile;
#[path = "common/kinds.rs"]
mod kinds;
#[path = "common/log.rs"]
mod log;
