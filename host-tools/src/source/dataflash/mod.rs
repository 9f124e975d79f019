//! ArduPilot's onboard logs (DataFlash): binary `.bin` and text `.log`.

use anyhow::{Result, bail};

use super::input::Input;
use super::item::Reader;

/// How such a log is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Messages with a header of two bytes.
    Binary,
    /// A line for each message.
    Text,
}

/// Whether these first bytes of a file (64 KiB of a longer one) are those of such a log.
pub fn detect(start: &[u8]) -> Option<Form> {
    /// The header of a message that defines one: `FMT` is type 128 and 89 bytes long.
    const FMT: &[u8] = &[0xa3, 0x95, 0x80];
    let text =
        |start: &[u8]| start.starts_with(b"FMT,") || start.windows(5).any(|window| window == b"\nFMT,");
    if start.windows(FMT.len()).any(|window| window == FMT) {
        Some(Form::Binary)
    } else {
        text(start).then_some(Form::Text)
    }
}

/// The reader of such a log.
pub fn open(_input: Input, _form: Form) -> Result<Box<dyn Reader>> {
    bail!("is a DataFlash log, which this version cannot read yet")
}
