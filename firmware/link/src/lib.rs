//! The MAVLink edge: framer, decoding to observations, encoding of what we send.
#![cfg_attr(not(test), no_std)]

mod crc;
pub mod frame;
pub mod framer;
mod seen;

pub use frame::{Check, Frame};
pub use framer::{Framer, FramerCounts};
