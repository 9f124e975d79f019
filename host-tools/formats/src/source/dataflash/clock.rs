//! The time of a message.
//!
//! Since 2015 every message has microseconds since power-on; before, most have milliseconds. The oldest
//! (`ArduCopter` 2.9 and 3.0) have only the receiver's time of week, in GPS messages. Without a valid time,
//! that of the message before counts.

use hums_core::clock::{Instant, Span};

use super::ahead::Ahead;
use super::format::Formats;
use super::message::Message;
use super::stamp::{Week, stamp, week_us};
use crate::source::clock::{self, Reading, Rules};
use crate::source::doubt::Ends;

/// Logs written only while armed have pauses of any length. After a pause, states and saved parameters repeat
/// every 30 s.
const RULES: Rules = Rules {
    from_first: false,
    old_values: false,
    ends: Ends { steady_us: 1_000_000, seldom_us: 3_600_000_000 },
};
/// The logger pauses or fails: every log has a message at 5 Hz.
const SILENCE: Span = Span::from_secs(1);

#[derive(Clone, Debug)]
pub(super) struct Clock {
    times: clock::Clock,
    /// The log's only clock.
    week_first_us: Option<u64>,
    silence: Option<Instant>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct When {
    /// Recording's time.
    pub(super) at: Instant,
    pub(super) restarted: bool,
    /// Microseconds since power-on, if known.
    pub(super) boot_us: Option<u64>,
    pub(super) own: Own,
    pub(super) stands: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Own {
    /// No time.
    None,
    /// It counts.
    Sound,
    /// Contradicted: the message is likely damaged.
    Wrong,
}

impl Default for Clock {
    fn default() -> Self {
        Self { times: clock::Clock::new(RULES), week_first_us: None, silence: None }
    }
}

impl Clock {
    pub(super) fn begin(&mut self, first_us: u64) {
        self.times.begin(first_us);
    }

    /// Time goes on from its last value.
    pub(super) fn begin_another(&mut self, first_us: Option<u64>) {
        (self.week_first_us, self.silence) = (None, None);
        if let Some(first_us) = first_us {
            self.times.begin_log(first_us);
        }
    }

    pub(super) const fn has_begun(&self) -> bool {
        self.times.has_begun()
    }

    /// Taken once.
    pub(super) fn silence(&mut self) -> Option<Instant> {
        self.silence.take()
    }

    /// The latest time.
    pub(super) fn now(&self) -> Instant {
        self.times.now()
    }

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

    fn as_before(&self, boot_us: Option<u64>, own: Own) -> When {
        When { at: self.now(), restarted: false, boot_us, own, stands: false }
    }

    fn week(&self) -> Week {
        Week::new(self.week_first_us, self.times.recorded_us().unwrap_or(0))
    }
}
