//! From PX4's topics to observations, equal to `hums_link::observe` of PX4's MAVLink. Source of each formula:
//! `src/modules/mavlink/streams` in PX4.
//!
//! A topic's row lists the field names of v1.8 to v1.17. Fast topics (attitude 250 times a second) are taken
//! 20 or 10 times a second, so that usage counters agree with the board's.
//!
//! Messages that MAVLink repeats by the clock (`HEARTBEAT`, `EXTENDED_SYS_STATE`, `SYSTEM_TIME`,
//! `GPS_RAW_INT` of a silent receiver) come once a second.

mod motion;
mod power;
mod receivers;
mod state;
mod system;
#[cfg(test)]
mod tests;

use hums_core::clock::Instant;

pub use self::system::{mode_name, nav_state};

pub(super) use state::{Px4, Report, Sample, Topic};

const REPEAT_US: u64 = 1_000_000;
/// Useful topics.
const LISTS: [&[Topic]; 4] = [system::TOPICS, motion::TOPICS, power::TOPICS, receivers::TOPICS];

pub(super) fn topic(name: &str) -> Option<&'static Topic> {
    LISTS.into_iter().flatten().find(|topic| topic.name == name)
}

impl Px4 {
    /// A parameter, at the beginning or changed.
    pub(super) fn parameter(&mut self, name: &str, value: f64) {
        self.system.parameter(name, value);
    }

    /// The version of the firmware, once it is known.
    pub(super) fn identity(&mut self, release: u32) {
        self.system.release = release;
    }

    /// Silence means nothing for a while.
    pub(super) fn dropout(&mut self) {
        receivers::dropout(&mut self.receivers);
    }

    pub(super) fn take(&mut self, topic: &Topic, sample: &Sample<'_>) {
        (topic.take)(self, sample);
    }

    /// Time goes on.
    pub(super) fn step(&mut self, now: Instant, recorded_us: u64) {
        let due = self.repeated_us.is_none_or(|last| recorded_us < last || recorded_us - last >= REPEAT_US);
        if due && self.system.status.is_some() {
            self.repeated_us = Some(recorded_us);
            self.repeat(recorded_us);
            let Self { receivers, reports, .. } = self;
            receivers::silence(receivers, now, &mut |observation| {
                reports.push(Report::Observation(observation));
            });
        }
    }
}
