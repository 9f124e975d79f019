//! The time of day, by the autopilot's reports.

use hums_core::clock::Instant;
use hums_core::observation::{Observation, SystemTime};
use hums_link::{Frame, observe};

use super::item::AUTOPILOT;
use crate::mavlink::ids::SYSTEM_TIME;

/// Difference within one clock: messages are late by tenths of a second.
const SAME_US: u64 = 1_000_000;

/// UTC at time zero, from `SYSTEM_TIME`. A clock set while running, as by a first fix, counts after two messages in a
/// row.
#[derive(Debug, Default)]
pub(super) struct Daytime {
    told_us: Option<u64>,
    heard_us: Option<u64>,
}

impl Daytime {
    /// New UTC at time zero, microseconds since 1970.
    pub(super) fn of(&mut self, at: Instant, frame: &Frame<'_>) -> Option<u64> {
        let told = observe(frame).filter(|_| frame.id() == SYSTEM_TIME && frame.component() == AUTOPILOT);
        let Some((_, Observation::SystemTime(SystemTime { utc_micros: Some(utc_us), .. }))) = told else {
            return None;
        };
        let epoch_us = utc_us.checked_sub(at.as_micros())?;
        let agrees = |other: u64| other.abs_diff(epoch_us) <= SAME_US;
        let before = self.heard_us.replace(epoch_us);
        let is_new = self.told_us.is_none_or(|told| !agrees(told) && before.is_some_and(agrees));
        is_new.then(|| *self.told_us.insert(epoch_us))
    }
}
