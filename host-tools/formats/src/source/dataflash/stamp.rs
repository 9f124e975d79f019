//! The time in a message.

use super::format::Formats;
use super::message::Message;
use crate::source::clock::Stamp;

const WEEK_US: u64 = 7 * 86_400 * 1_000_000;

#[derive(Clone, Copy, Debug)]
pub(super) struct Week {
    first_us: Option<u64>,
    before_us: u64,
}

impl Week {
    pub(super) const fn new(first_us: Option<u64>, before_us: u64) -> Self {
        Self { first_us, before_us }
    }

    /// Goes on over the week's end.
    fn since_first(self, week_us: u64) -> Option<u64> {
        let first = self.first_us?;
        let since = (week_us % WEEK_US + WEEK_US - first % WEEK_US) % WEEK_US;
        let same = (self.before_us / WEEK_US).saturating_mul(WEEK_US).saturating_add(since);
        let next = same.saturating_add(WEEK_US / 2) < self.before_us;
        Some(if next { same.saturating_add(WEEK_US) } else { same })
    }
}

/// Microseconds since power-on.
pub(super) fn stamp(
    message: &Message<'_>,
    boot_us: Option<u64>,
    formats: &Formats,
    week: Week,
) -> Option<Stamp> {
    let us = boot_us.or_else(|| week.since_first(week_us(message, formats)?))?;
    Some(Stamp { us, series: usize::from(message.format().kind) })
}

pub(super) fn week_us(message: &Message<'_>, formats: &Formats) -> Option<u64> {
    let format = message.format();
    if formats.has_boot_clock || format.name != "GPS" {
        return None;
    }
    let ms = message.unsigned(format.field("TimeMS").or_else(|| format.field("Time"))?)?;
    Some(ms.saturating_mul(1_000))
}

/// Microseconds.
pub(super) fn receiver_us(message: &Message<'_>) -> Option<u64> {
    let format = message.format();
    if format.name != "GPS" {
        return None;
    }
    let ms = message.unsigned(format.field("GMS").or_else(|| format.field("TimeMS"))?)?;
    (ms > 0).then(|| ms.saturating_mul(1_000))
}
