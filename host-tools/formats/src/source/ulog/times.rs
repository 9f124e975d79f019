//! Times of messages, and of those after them.

use std::io::Read;

use super::message::{DataAfter, Found, MESSAGE_BYTES_MAX, Message, Parser, data_after};
use super::topics::Subscriptions;
use crate::source::buffer::Buffer;
use crate::source::clock::{BEGINNING_ASKED, LaterTimes, Rules, Stamp};
use crate::source::doubt::{ASKED, Ends};

/// Since the autopilot's boot. A log begins with old values, and drops out for a second or two.
pub(super) const RULES: Rules =
    Rules { from_first: false, old_values: true, ends: Ends { steady_us: 1_000_000, seldom_us: 10_000_000 } };
/// Definitions come before data, 100 to 200 KiB.
const FIRST_BYTES: usize = 512 * 1024;
pub(super) const AHEAD_BYTES: usize = 256 * 1024;
/// Longer than any message: the rest is erased memory.
const NOTHING_BYTES: usize = 2 * MESSAGE_BYTES_MAX;
/// Bytes for all jumps together: a hostile file could ask for all of it each time.
pub(super) const ASKED_BYTES: usize = 64 * 1024 * 1024;
/// Looked at after one.
const MESSAGES_MAX: usize = 1_024;
/// A topic's series is its number and one.
const TEXTS: usize = 0;

pub(super) fn stamp(id: u16, us: u64) -> Stamp {
    Stamp { us, series: usize::from(id) + 1 }
}

pub(super) const fn of_text(us: u64) -> Stamp {
    Stamp { us, series: TEXTS }
}

/// Witnesses; damage between them is passed over. A topic with time zero has none. `after`: [`AHEAD_BYTES`] and the longest
/// message, or the rest of the file. Looks at `left` bytes at most.
pub(super) fn ahead(
    subscriptions: &Subscriptions,
    after: &[u8],
    left: &mut usize,
    asks: &dyn Fn(Stamp) -> bool,
) -> LaterTimes {
    if *left == 0 {
        return LaterTimes::default();
    }
    let fits = |id: u16, bytes: usize| subscriptions.fits(id, bytes);
    let parser = Parser { fits: &fits };
    let is_all = after.len() < AHEAD_BYTES;
    let (mut stamps, mut messages, mut at, mut last) = (Vec::with_capacity(ASKED), 0, 0, 0);
    while stamps.len() < ASKED
        && messages < MESSAGES_MAX
        && let Some(rest) = after.get(at..).filter(|rest| !rest.is_empty())
    {
        match parser.look(rest) {
            Found::Message(Message::Beginning { .. }, _) => return LaterTimes { stamps, is_end: true },
            Found::Message(message, bytes) => {
                if let Message::Data { id, data } = message {
                    let told = subscriptions.time(id, data).filter(|us| *us > 0).map(|us| stamp(id, us));
                    stamps.extend(told.filter(|stamp| asks(*stamp)));
                }
                at += bytes;
                (messages, last) = (messages + 1, at);
            }
            _ => match parser.find(rest, 1, is_all) {
                Ok(skipped) => at += skipped,
                Err(none) => {
                    *left = left.saturating_sub(none);
                    break;
                }
            },
        }
    }
    *left = left.saturating_sub(at);
    let nothing = after.len() - last >= NOTHING_BYTES;
    LaterTimes { is_end: stamps.len() < ASKED && messages < MESSAGES_MAX && (is_all || nothing), stamps }
}

/// Enough for the log's start. Each topic of PX4 begins with its time.
pub(super) fn first(bytes: &[u8]) -> Vec<u64> {
    let time = |(_, data): (u16, &[u8])| data.first_chunk().map(|time| u64::from_le_bytes(*time));
    let messages: DataAfter<'_> = data_after(bytes);
    messages.filter_map(time).take(4 * BEGINNING_ASKED).collect()
}

pub(super) fn first_in<R: Read>(buffer: &mut Buffer<R>) -> Vec<u64> {
    let times = first(buffer.rest());
    if times.len() >= BEGINNING_ASKED || buffer.ended() {
        return times;
    }
    buffer.fill(FIRST_BYTES);
    first(buffer.rest())
}
