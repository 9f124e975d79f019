//! The next messages' times: they tell a jump of the clock from a damaged time.

use std::collections::BTreeMap;

use super::definition::definition;
use super::format::{BEGINNING, Format, Formats, HEADER_BYTES};
use super::message::{Body, Message};
use super::stamp::{Week, stamp};
use super::text;
use crate::source::clock::{self, Stamp};
use crate::source::doubt::ASKED;

/// More than [`ASKED`] of the longest messages, all definitions of today, some damage, and a second of the
/// oldest logs, in which only GPS messages have times.
pub(super) const AHEAD_BYTES: usize = 256 * 1_024;
/// Bytes without a message: then the rest is erased memory.
const ERASED_BYTES: usize = 4 * 1_024;
/// Fields of a line that are looked at.
const VALUES_MAX: usize = 32;
/// Searched for arming after a pause: a logger's beginning ...
const MESSAGES_MAX: usize = 2_048;
/// ... within this of the first.
const ARMS_US: u64 = 1_000_000;
/// Searched definitions.
const DEFINED_MAX: usize = 256;

#[derive(Clone, Copy, Debug)]
pub(super) struct Ahead<'a> {
    /// [`AHEAD_BYTES`] or more, unless the file ends.
    pub(super) bytes: &'a [u8],
    pub(super) is_text: bool,
    /// Nothing follows.
    pub(super) is_end: bool,
}

impl Ahead<'_> {
    /// Arming comes next, before any disarming: the vehicle was disarmed until now. (Copters of before 2016
    /// log no disarming if they log only while armed.)
    pub(super) fn arms(self, message: &Message<'_>, formats: &Formats) -> bool {
        if let Some(arms) = arming(message) {
            return arms;
        }
        let bytes = self.bytes.get(..AHEAD_BYTES).unwrap_or(self.bytes);
        let until = message.time_us().map_or(u64::MAX, |us| us.saturating_add(ARMS_US));
        let (mut found, mut looked) = (None, 0);
        let mut take = |message: &Message<'_>| {
            found = arming(message);
            looked += 1;
            found.is_none() && looked < MESSAGES_MAX && message.time_us().is_none_or(|us| us <= until)
        };
        if self.is_text {
            of_lines(bytes, self.is_end, formats, &mut take);
        } else {
            of_bytes(bytes, formats, &mut take);
        }
        found == Some(true)
    }

    /// The first few accepted times.
    pub(super) fn stamps(
        self,
        formats: &Formats,
        week: Week,
        asks: &dyn Fn(Stamp) -> bool,
    ) -> clock::LaterTimes {
        let bytes = self.bytes.get(..AHEAD_BYTES).unwrap_or(self.bytes);
        let mut is_end = self.is_end && bytes.len() == self.bytes.len();
        let mut stamps = Vec::with_capacity(ASKED);
        let mut take = |message: &Message<'_>| {
            stamps.extend(stamp(message, message.time_us(), formats, week).filter(|stamp| asks(*stamp)));
            stamps.len() < ASKED
        };
        if self.is_text {
            is_end |= of_lines(bytes, is_end, formats, &mut take);
        } else {
            let (read, begins) = of_bytes(bytes, formats, &mut take);
            is_end |= begins || bytes.len() - read >= ERASED_BYTES;
        }
        clock::LaterTimes { is_end: is_end && stamps.len() < ASKED, stamps }
    }
}

/// `EV` 10 and 11, and `ARM`.
fn arming(message: &Message<'_>) -> Option<bool> {
    let format = message.format();
    let told = |field: &str| message.unsigned(format.field(field)?);
    match (format.name.as_str(), told("Id"), told("ArmState")) {
        ("EV", Some(10), _) | ("ARM", _, Some(1)) => Some(true),
        ("EV", Some(11), _) | ("ARM", _, Some(0)) => Some(false),
        _ => None,
    }
}

/// Until `take` has enough or another log begins. Returns the end of the last message, and whether another
/// log begins there.
fn of_bytes(bytes: &[u8], formats: &Formats, take: &mut dyn FnMut(&Message<'_>) -> bool) -> (usize, bool) {
    let (mut at, mut last) = (0, 0);
    let mut defined: BTreeMap<u8, Format> = BTreeMap::new();
    while let Some(rest) = bytes.get(at..).filter(|rest| !rest.is_empty()) {
        let &[0xA3, 0x95, kind, ..] = rest else {
            at += 1;
            continue;
        };
        if rest.starts_with(BEGINNING) {
            return (last, true);
        }
        let format = defined.get(&kind).or_else(|| formats.get(kind));
        let told = formats.lengths.told[usize::from(kind)];
        let length = usize::from(defined.get(&kind).map_or(told, |format| format.length));
        if let (Some(format), Some(payload)) = (format, rest.get(HEADER_BYTES..length)) {
            let message = Message::new(format, Body::Bytes(payload));
            if !take(&message) {
                return (bytes.len(), false);
            }
            if let Some(new) = definition(&message).filter(|new| formats.get(new.kind).is_none()) {
                defined.insert(new.kind, new);
            }
        }
        at += length.max(1);
        last = at.min(bytes.len());
    }
    (last, false)
}

fn of_lines(
    bytes: &[u8],
    is_end: bool,
    formats: &Formats,
    take: &mut dyn FnMut(&Message<'_>) -> bool,
) -> bool {
    let is_newline = |byte: &u8| matches!(byte, b'\n' | b'\r');
    // The last one may not be whole.
    let whole = if is_end { bytes.len() } else { bytes.iter().rposition(is_newline).unwrap_or(0) };
    let mut defined: BTreeMap<String, Format> = BTreeMap::new();
    for line in bytes.get(..whole).unwrap_or_default().split(is_newline) {
        let Ok(line) = std::str::from_utf8(line) else { continue };
        if text::beginning(line).is_some() {
            return true;
        }
        let name = text::name(line);
        let known = || (0..=u8::MAX).filter_map(|kind| formats.get(kind)).find(|format| format.name == name);
        let Some(format) = known().or_else(|| defined.get(name)) else { continue };
        let values = text::values(line, format.fields.len().min(VALUES_MAX));
        let message = Message::new(format, Body::Words(&values));
        if !take(&message) {
            return false;
        }
        if let Some(new) = definition(&message).filter(|_| defined.len() < DEFINED_MAX) {
            defined.insert(new.name.clone(), new);
        }
    }
    false
}
