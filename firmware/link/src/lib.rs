//! MAVLink interface: framer, decoder of observations, encoder of our messages.
#![cfg_attr(not(test), no_std)]

pub mod alert;
pub mod asking;
pub mod encode;
pub mod events;
pub mod frame;
pub mod framer;
pub mod ftp;
pub mod long_text;
pub mod mav_cmd;
pub mod messages;
mod observe;
pub mod outlet;
pub mod packet;
pub mod param_line;
pub mod request;
mod seen;
pub mod sequence;
pub mod signing;
pub mod statustext;
pub mod summary;
mod telling;
pub mod vocabulary;

pub use frame::{Check, Frame};
pub use framer::{Framer, FramerCounts};
pub use hums_dialect::ids;
pub use long_text::LongTexts;
pub use observe::observe;
