//! The times of messages, and those that follow them in the file: what tells a wrong one.

use std::io::Read;

use super::message::{DataAfter, data_after};
use super::topics::Subscriptions;
use super::window::Window;
use crate::source::clock::{Ahead, BEGINNING_ASKED, Rules, Stamp};
use crate::source::doubt::{ASKED, Ends};

/// Microseconds since the autopilot's boot. A log begins with old values; the logger does not pause, but drops out for a second
/// or two.
pub(super) const RULES: Rules =
    Rules { from_first: false, old_values: true, ends: Ends { steady_us: 1_000_000, seldom_us: 10_000_000 } };
/// How much of a log is looked at for the first messages of data: definitions come before them, 100 to 200 KiB.
const FIRST_BYTES: usize = 512 * 1024;
/// Messages after one that are looked at for their times.
const MESSAGES_MAX: usize = 256;
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

/// The next times that are asked for. A topic with the time zero tells none.
pub(super) fn ahead(subscriptions: &Subscriptions, after: &[u8], asks: &dyn Fn(Stamp) -> bool) -> Ahead {
    let (mut stamps, mut messages) = (Vec::with_capacity(ASKED), data_after(after, MESSAGES_MAX));
    while stamps.len() < ASKED {
        let Some((id, data)) = messages.next() else { break };
        let told = subscriptions.time(id, data).filter(|us| *us > 0).map(|us| stamp(id, us));
        stamps.extend(told.filter(|stamp| asks(*stamp)));
    }
    Ahead { is_end: stamps.len() < ASKED && messages.is_end(), stamps }
}

/// The times of the first messages of data in these bytes, as many as tell when a log began. (The time stands first in each
/// topic of PX4.)
pub(super) fn first(bytes: &[u8]) -> Vec<u64> {
    let time = |(_, data): (u16, &[u8])| data.first_chunk().map(|time| u64::from_le_bytes(*time));
    let messages: DataAfter<'_> = data_after(bytes, usize::MAX);
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
