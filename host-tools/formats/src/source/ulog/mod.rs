//! PX4's onboard logs (`ULog`): `.ulg`.
//!
//! Source: PX4's guide, "`ULog` File Format".
//!
//! | file | does |
//! |---|---|
//! | `message` | tells messages from damage, and finds the next one |
//! | `format` | definitions, and the places of fields that follow from them |
//! | `topics` | the topic of each number |
//! | `fields` | places of the fields for the mapping |
//! | `times` | the times of messages, and of those after them |
//! | `rows` | every field, by its own name |
//! | `px4` | observations from PX4's topics, the same as from PX4's MAVLink messages |
//! | `session` | one pass over all of it |
//!
//! Memory: a buffer of 1 MiB, 1,024 definitions with 32,768 fields, 4,096 subscriptions. Appended data (a
//! crash dump) come last.

mod fields;
mod format;
mod message;
mod px4;
mod rows;
mod session;
#[cfg(test)]
mod tests;
mod times;
mod topics;

use std::io::Read;

use anyhow::Result;

pub use self::px4::{mode_name, nav_state};
use super::buffer::Buffer;
use super::input::Input;
use super::item::{ItemSink, Needs, Reader, RecordingSummary};

/// Whether these first bytes are of a ULog.
pub fn detect(start: &[u8]) -> bool {
    start.starts_with(&message::MAGIC)
}

/// The reader of such a log.
pub fn open(input: Input) -> Result<Box<dyn Reader>> {
    Ok(Box::new(Ulog::new(input)))
}

/// A log's reader.
pub struct Ulog<R> {
    buffer: Buffer<R>,
}

impl<R: Read> Ulog<R> {
    /// Reads from `input`.
    pub fn new(input: R) -> Self {
        Self { buffer: Buffer::new(input) }
    }
}

impl<R: Read + Send> Reader for Ulog<R> {
    fn read(&mut self, want: Needs<'_>, take: &mut ItemSink<'_>) -> Result<RecordingSummary> {
        session::read(&mut self.buffer, want, take)
    }
}
