//! When a message was written, from what it says of it.
//!
//! Logs of today tell microseconds since power-on in every message, those of before 2015 milliseconds in most, and the
//! oldest (`ArduCopter` 2.9 and 3.0) only in GPS messages, as the receiver's time of the week. A message without a time
//! counts as written with the one before it, and one with a wrong time too.

use hums_core::clock::{Instant, Span};

use super::ahead::Ahead;
use super::format::Formats;
use super::message::Message;
use super::stamp::{Week, stamp, week_us};
use crate::source::clock::{self, Reading, Rules};
use crate::source::doubt::Ends;

/// A log that is only written while armed does have pauses of any length. What is written after them again and again is a
/// state or a saved parameter, every 30 s.
const RULES: Rules = Rules {
    from_first: false,
    old_values: false,
    ends: Ends { steady_us: 1_000_000, seldom_us: 3_600_000_000 },
};
/// Nothing is written for this long only where the logger pauses or fails: something of every log comes at 5 Hz.
const SILENCE: Span = Span::from_secs(1);

/// Follows the clock of a log.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    times: clock::Clock,
    /// The first time of the week, where that is the log's only clock.
    week_first_us: Option<u64>,
    /// When nothing had been written for a while before the message at hand: since when.
    silence: Option<Instant>,
}

/// When a message was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct When {
    /// In the recording's time.
    pub(super) at: Instant,
    /// Another power-on begins with it.
    pub(super) restarted: bool,
    /// Microseconds since power-on as the message says; `None` where it says nothing.
    pub(super) boot_us: Option<u64>,
    /// What its own time is worth.
    pub(super) own: Own,
    /// The clock stands still, as messages of this type tell it.
    pub(super) stands: bool,
}

/// What a message's own time is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Own {
    /// It has none.
    None,
    /// It counts.
    Sound,
    /// The times around it say that it is wrong: the message is likely damaged.
    Wrong,
}

impl Default for Clock {
    fn default() -> Self {
        Self { times: clock::Clock::new(RULES), week_first_us: None, silence: None }
    }
}

impl Clock {
    /// The first time of the log is this one.
    pub(super) fn begin(&mut self, first_us: u64) {
        self.times.begin(first_us);
    }

    /// Another log begins, at this time if that is known: time goes on from where it was.
    pub(super) fn begin_another(&mut self, first_us: Option<u64>) {
        (self.week_first_us, self.silence) = (None, None);
        if let Some(first_us) = first_us {
            self.times.begin_log(first_us);
        }
    }

    /// Whether a message has told a time.
    pub(super) const fn has_begun(&self) -> bool {
        self.times.has_begun()
    }

    /// Since when nothing had been written before the message at hand, where that was for long; asked for once.
    pub(super) fn silence(&mut self) -> Option<Instant> {
        self.silence.take()
    }

    /// The latest time.
    pub(super) fn now(&self) -> Instant {
        self.times.now()
    }

    /// When a message was written; `ahead` is what follows it in the file.
    pub(super) fn at(&mut self, message: &Message<'_>, ahead: Ahead<'_>, formats: &Formats) -> When {
        let boot_us = message.time_us();
        if boot_us.is_none()
            && let Some(week_us) = week_us(message, formats)
        {
            self.week_first_us.get_or_insert(week_us);
        }
        let Some(stamp) = stamp(message, boot_us, formats, self.week()) else {
            return self.as_before(boot_us, Own::None);
        };
        let before = self.now();
        let week = self.week();
        let reading = self.times.take(stamp, |asks| ahead.stamps(formats, week, asks));
        let Reading::Sound(moment) = reading else { return self.as_before(boot_us, Own::Wrong) };
        self.silence = Some(before).filter(|before| !moment.restarted && moment.at.since(*before) > SILENCE);
        let stands = self.times.stands(stamp.series);
        When { at: moment.at, restarted: moment.restarted, boot_us, own: Own::Sound, stands }
    }

    /// Written with the message before it.
    fn as_before(&self, boot_us: Option<u64>, own: Own) -> When {
        When { at: self.now(), restarted: false, boot_us, own, stands: false }
    }

    /// How times of the week are told.
    fn week(&self) -> Week {
        Week::new(self.week_first_us, self.times.recorded_us().unwrap_or(0))
    }
}
