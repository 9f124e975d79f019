//! Which findings a pilot hears of, and how many: one cause is told once, not everything that it brings with it.
//!
//! * A finding that another one explains ([`Finding::because`]) is recorded, and not told.
//! * That something is over is told only of what was told.
//! * In any [`SPAN`] at most [`TEXTS_MAX`] are told, the worst first; what is not critical leaves [`RESERVED`] of these. What waits is
//!   told later, if it is still so.

use hums_core::health::{Finding, Level};
use hums_core::time::{Instant, Span};

/// Texts in any span of this length, and how many of these only critical findings may use.
const TEXTS_MAX: usize = 5;
/// See [`TEXTS_MAX`].
const SPAN: Span = Span::from_secs(30);
const RESERVED: usize = 2;
/// Alarms that were told and are not over, of which more is known.
const OPEN_MAX: usize = 16;

/// What was told.
#[derive(Clone, Debug)]
pub(crate) struct Telling {
    /// When the last texts went.
    times: heapless::Deque<Instant, TEXTS_MAX>,
    /// Check and instance of the alarms that were told and are not over.
    open: heapless::Vec<(&'static str, u8), OPEN_MAX>,
}

impl Telling {
    pub(crate) const fn new() -> Self {
        Self { times: heapless::Deque::new(), open: heapless::Vec::new() }
    }

    /// Whether a pilot is to hear of it.
    pub(crate) fn is_news(&self, finding: &Finding) -> bool {
        match finding.level {
            Level::Ok => self.open.contains(&(finding.check, finding.instance)),
            _ => finding.because.is_empty(),
        }
    }

    /// Whether one more may go now.
    pub(crate) fn has_room(&mut self, now: Instant, level: Level) -> bool {
        while self.times.front().is_some_and(|at| now.since(*at) >= SPAN) {
            self.times.pop_front();
        }
        let most = if level == Level::Critical { TEXTS_MAX } else { TEXTS_MAX - RESERVED };
        self.times.len() < most
    }

    /// It went.
    pub(crate) fn told(&mut self, now: Instant, finding: &Finding) {
        // There was room.
        let _ = self.times.push_back(now);
        self.open.retain(|open| *open != (finding.check, finding.instance));
        if matches!(finding.level, Level::Warning | Level::Critical) {
            if self.open.is_full() {
                self.open.remove(0);
            }
            let _ = self.open.push((finding.check, finding.instance));
        }
    }
}
