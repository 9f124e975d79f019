//! The MAVLink edge: framer, decoding to observations, encoding of what we send.
#![cfg_attr(not(test), no_std)]

mod crc;
pub mod encode;
pub mod frame;
pub mod framer;
mod observe;
mod seen;
pub mod sequence;
pub mod summary;
pub mod text;

pub use frame::{Check, Frame};
pub use framer::{Framer, FramerCounts};
pub use observe::observe;
