//! PX4's onboard logs (`ULog`): `.ulg`.
//!
//! A log begins with a header and definitions: formats of messages, parameters, information. Then come messages of data,
//! each of a topic that a subscription gave a number. The format is described in PX4's guide, "`ULog` File Format".
//!
//! | file | does |
//! |---|---|
//! | `window` | a part of the input in one piece |
//! | `message` | tells messages from damage, and finds the next one |
//! | `format` | definitions, and the places of fields that they make |
//! | `topics` | which number is which topic |
//! | `fields` | where the fields are that the mapping needs |
//! | `times` | the times of messages, and of those after them |
//! | `rows` | every field, by its own name |
//! | `px4` | what PX4's topics say, as observations: the same that the MAVLink edge makes of what PX4 sends |
//! | `session` | one pass over all of it |
//!
//! Memory is bounded whatever the file says: a window of 768 KiB, 1,024 definitions with 32,768 fields, 4,096
//! subscriptions. Appended data (a crash dump) is read after what comes before it. Nothing here panics for any input.

mod fields;
mod format;
mod message;
mod px4;
mod rows;
mod session;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod times;
mod topics;
mod window;

use std::io::Read;

use anyhow::Result;

pub use self::px4::mode_name;
use super::input::Input;
use super::item::{Reader, Summary, Take, Want};
use window::Window;

/// Whether these first bytes of a file are those of such a log.
pub fn detect(start: &[u8]) -> bool {
    start.starts_with(&message::MAGIC)
}

/// The reader of such a log.
pub fn open(input: Input) -> Result<Box<dyn Reader>> {
    Ok(Box::new(Ulog::new(input)))
}

/// A log, to be read once.
pub struct Ulog<R> {
    window: Window<R>,
}

impl<R: Read> Ulog<R> {
    /// Reads from `input`.
    pub fn new(input: R) -> Self {
        Self { window: Window::new(input) }
    }
}

impl<R: Read + Send> Reader for Ulog<R> {
    fn read(&mut self, want: Want<'_>, take: &mut Take<'_>) -> Result<Summary> {
        session::read(&mut self.window, want, take)
    }
}
