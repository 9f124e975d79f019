//! The arming state: from the log's messages, or else from the vehicle's motion.
//!
//! Logs of today report arming by ARM, EV and MSG; planes and rovers before 2015 do not. Evidence is a throttle above
//! idle, or a flying plane's speed. The first message about arming ends it.

use hums_core::clock::{Instant, Span};

/// Throttle is touched for a test.
const ARMED_AFTER: Span = Span::from_secs(2);
/// The slowest such message is logged at 1 Hz.
const PAUSE_MAX: Span = Span::from_millis(2_500);
/// A plane glides, and a copter descends, with less than idle.
const DISARMED_AFTER: Span = Span::from_secs(10);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Word {
    /// Nobody knows.
    Unknown,
    /// From throttle and speed.
    Evidence,
    Told,
}

impl Word {
    /// Empty if the log reports it.
    pub(super) const fn words(self) -> &'static str {
        match self {
            Self::Unknown => "the log does not tell whether it was armed",
            Self::Evidence => "the log does not tell arming: taken from throttle and speed",
            Self::Told => "",
        }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Arming {
    armed: Option<bool>,
    first_told: Option<bool>,
    /// Since when and until when the evidence has lasted.
    evidence: Option<(Instant, Instant)>,
}

impl Arming {
    /// `None` if unknown.
    pub(super) const fn armed(&self) -> Option<bool> {
        self.armed
    }

    pub(super) const fn first_told(&self) -> Option<bool> {
        self.first_told
    }

    pub(super) const fn word(&self) -> Word {
        match (self.first_told, self.armed) {
            (Some(_), _) => Word::Told,
            (None, Some(_)) => Word::Evidence,
            (None, None) => Word::Unknown,
        }
    }

    /// Begins with a vehicle that was armed before the first message.
    pub(super) const fn begin_armed(&mut self) {
        (self.armed, self.first_told) = (Some(true), Some(true));
    }

    pub(super) fn tell(&mut self, armed: bool) {
        self.first_told.get_or_insert(armed);
        self.armed = Some(armed);
    }

    /// Takes motion as a sign of arming, until a message reports it.
    pub(super) fn evidence(&mut self, at: Instant, runs: bool) {
        if self.first_told.is_some() {
            return;
        }
        let known = self.evidence;
        if runs {
            let since = known.filter(|(_, last)| at.since(*last) <= PAUSE_MAX).map_or(at, |(since, _)| since);
            self.evidence = Some((since, at));
            if at.since(since) >= ARMED_AFTER {
                self.armed = Some(true);
            }
        } else if self.armed == Some(true) && known.is_some_and(|(_, last)| at.since(last) >= DISARMED_AFTER)
        {
            self.armed = Some(false);
        }
    }
}
