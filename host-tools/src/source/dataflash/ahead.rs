//! The times of the next messages: what tells whether a jump of the clock is one, or one damaged time.

use super::format::{Format, Formats, HEADER_BYTES};
use super::message::{Body, Message};
use super::text;
use crate::source::timeline::ASKED;

/// Room for more than [`ASKED`] of the longest binary messages.
pub(super) const AHEAD_BYTES: usize = 2_048;
/// Fields of a line that are looked at.
const VALUES_MAX: usize = 32;

/// What follows a message in the file.
#[derive(Clone, Copy, Debug)]
pub(super) enum Ahead<'a> {
    /// Of a binary log.
    Bytes(&'a [u8]),
    /// Of a text log.
    Lines(&'a [u8]),
}

impl Ahead<'_> {
    /// The first few times that messages tell there, in microseconds since power-on.
    pub(super) fn times(self, formats: &Formats) -> Vec<u64> {
        match self {
            Self::Bytes(bytes) => of_bytes(bytes.get(..AHEAD_BYTES).unwrap_or(bytes), formats),
            Self::Lines(bytes) => of_lines(bytes.get(..AHEAD_BYTES).unwrap_or(bytes), formats),
        }
    }
}

fn of_bytes(bytes: &[u8], formats: &Formats) -> Vec<u64> {
    let (mut times, mut at) = (Vec::new(), 0);
    while let Some(rest) = bytes.get(at..).filter(|rest| !rest.is_empty() && times.len() < ASKED) {
        let &[0xA3, 0x95, kind, ..] = rest else {
            at += 1;
            continue;
        };
        let length = usize::from(formats.lengths.told[usize::from(kind)]);
        let format = formats.get(kind).filter(|format| format.time.is_some());
        if let (Some(format), Some(payload)) = (format, rest.get(HEADER_BYTES..length)) {
            times.extend(Message::new(format, Body::Bytes(payload)).time_us());
        }
        at += length.max(1);
    }
    times
}

fn of_lines(bytes: &[u8], formats: &Formats) -> Vec<u64> {
    // The last one may not be whole.
    let whole = bytes.iter().rposition(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(0);
    let lines = bytes.get(..whole).unwrap_or_default().split(|byte| matches!(byte, b'\n' | b'\r'));
    lines.filter_map(|line| time_of_line(std::str::from_utf8(line).ok()?, formats)).take(ASKED).collect()
}

fn time_of_line(line: &str, formats: &Formats) -> Option<u64> {
    let name = text::name(line);
    let named = |format: &&Format| format.name == name && format.time.is_some();
    let format = (0..=u8::MAX).filter_map(|kind| formats.get(kind)).find(named)?;
    let values = text::values(line, format.fields.len().min(VALUES_MAX));
    Message::new(format, Body::Words(&values)).time_us()
}
