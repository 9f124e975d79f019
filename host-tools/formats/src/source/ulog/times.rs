//! The times of messages, and of those after them in the file, which show a wrong time.

use std::io::Read;

use super::message::{DataAfter, Found, MESSAGE_BYTES_MAX, Message, Parser, data_after};
use super::topics::Subscriptions;
use super::window::Window;
use crate::source::clock::{Ahead, BEGINNING_ASKED, Rules, Stamp};
use crate::source::doubt::{ASKED, Ends};

/// Microseconds since the autopilot's boot. A log begins with old values; the logger does not pause, but drops out for a second
/// or two.
pub(super) const RULES: Rules =
    Rules { from_first: false, old_values: true, ends: Ends { steady_us: 1_000_000, seldom_us: 10_000_000 } };
/// Number of bytes searched for the first messages of data: definitions come before them, 100 to 200 KiB.
const FIRST_BYTES: usize = 512 * 1024;
/// Number of bytes after a jump of the time that are looked at, damage too.
pub(super) const AHEAD_BYTES: usize = 256 * 1024;
/// After this many bytes without a message, the rest is erased memory, not part of the log. Longer than any
/// message.
const NOTHING_BYTES: usize = 2 * MESSAGE_BYTES_MAX;
/// Bytes that are looked at for all jumps of a file together: each of a hostile one could ask for all that there may be.
pub(super) const ASKED_BYTES: usize = 64 * 1024 * 1024;
/// Messages after one that are looked at for their times.
const MESSAGES_MAX: usize = 1_024;
/// The series of texts; a topic's is its number and one.
const TEXTS: usize = 0;

/// The time of a message of data.
pub(super) fn stamp(id: u16, us: u64) -> Stamp {
    Stamp { us, series: usize::from(id) + 1 }
}

/// The time of a text.
pub(super) const fn of_text(us: u64) -> Stamp {
    Stamp { us, series: TEXTS }
}

/// The next times as witnesses; damage between them is passed over. A topic with the time zero has none.
/// `after` has [`AHEAD_BYTES`] and the longest message, or the rest of the file. At most `left` bytes are
/// looked at.
pub(super) fn ahead(
    subscriptions: &Subscriptions,
    after: &[u8],
    left: &mut usize,
    asks: &dyn Fn(Stamp) -> bool,
) -> Ahead {
    if *left == 0 {
        return Ahead::default();
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
            Found::Message(Message::Beginning { .. }, _) => return Ahead { stamps, is_end: true },
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
    Ahead { is_end: stamps.len() < ASKED && messages < MESSAGES_MAX && (is_all || nothing), stamps }
}

/// The times of the first messages of data in these bytes, as many as needed for the log's start. (The time
/// is first in each topic of PX4.)
pub(super) fn first(bytes: &[u8]) -> Vec<u64> {
    let time = |(_, data): (u16, &[u8])| data.first_chunk().map(|time| u64::from_le_bytes(*time));
    let messages: DataAfter<'_> = data_after(bytes);
    messages.filter_map(time).take(4 * BEGINNING_ASKED).collect()
}

/// The same of a log whose header has been read.
pub(super) fn first_in<R: Read>(window: &mut Window<R>) -> Vec<u64> {
    let times = first(window.rest());
    if times.len() >= BEGINNING_ASKED || window.ended() {
        return times;
    }
    window.fill(FIRST_BYTES);
    first(window.rest())
}
