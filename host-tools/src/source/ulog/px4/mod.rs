//! What PX4's topics say, as observations: the same that `hums_link::observe` makes of the MAVLink messages that PX4
//! computes from these topics (`src/modules/mavlink/streams` in PX4 is the source of each formula).
//!
//! Names of fields changed between versions; a topic's row lists those of v1.8 to v1.17, and takes what is there.
//! Topics that are logged faster than the monitor steps (attitude 250 times a second) are taken 20 or 10 times a second,
//! so that counters of usage mean the same for a log as on the board.
//!
//! What MAVLink repeats by the clock although nothing is published (`HEARTBEAT`, `EXTENDED_SYS_STATE`, `SYSTEM_TIME`,
//! `GPS_RAW_INT` of a receiver that fell silent) is repeated here once a second.

mod motion;
mod power;
mod receivers;
mod system;

use hums_core::observation::{Observation, Source};
use hums_core::time::Instant;

use super::fields::Fields;
use motion::Motion;
use power::Power;
use receivers::Receivers;
use system::System;

/// A topic that becomes observations.
#[derive(Debug)]
pub(super) struct Topic {
    pub(super) name: &'static str,
    /// How many instances of it serve.
    pub(super) instances: u8,
    /// The least time between two messages that serve, microseconds.
    pub(super) every_us: u64,
    /// The fields that are needed, of all versions.
    pub(super) fields: &'static [&'static str],
    take: fn(&mut Px4, &Said<'_>),
}

/// A message of a topic.
#[derive(Clone, Copy, Debug)]
pub(super) struct Said<'a> {
    pub(super) at: Instant,
    /// Microseconds since the autopilot's boot.
    pub(super) recorded_us: u64,
    pub(super) instance: u8,
    pub(super) fields: Fields<'a>,
}

/// What comes of messages.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Told {
    Observation(Observation),
    Text { severity: u8, words: String },
    Event { number: u32, severity: u8 },
    Mode { number: u32, name: Option<&'static str> },
    Utc { utc_us: u64, recorded_us: u64 },
}

/// How often what MAVLink repeats is repeated.
const REPEAT_US: u64 = 1_000_000;
/// The least time between two messages of a fast topic: the monitor's own step (`hums_core::monitor::TICK`), and the rate
/// at which the board asks for `HIGHRES_IMU`.
const FAST_US: u64 = 50_000;
/// The same for what changes slowly; the board asks for it at 1 to 5 a second.
const MEDIUM_US: u64 = 100_000;

/// The vehicle, as far as one message needs what others said.
#[derive(Debug, Default)]
pub(super) struct Px4 {
    /// What came of the last messages, to be handed on.
    pub(super) told: Vec<Told>,
    system: System,
    motion: Motion,
    power: Power,
    receivers: Receivers,
    repeated_us: Option<u64>,
}

/// The row of a topic, if it is needed.
pub(super) fn topic(name: &str) -> Option<&'static Topic> {
    [system::TOPICS, motion::TOPICS, power::TOPICS, receivers::TOPICS]
        .into_iter()
        .flatten()
        .find(|topic| topic.name == name)
}

impl Px4 {
    /// The vehicle's number, and the autopilot's of its components.
    pub(super) fn source(&self) -> Source {
        Source { system: self.system.number(), component: 1 }
    }

    /// A parameter, at the beginning or changed.
    pub(super) fn parameter(&mut self, name: &str, value: f64) {
        self.system.parameter(name, value);
    }

    /// The version of the firmware, once it is known.
    pub(super) fn identity(&mut self, release: u32) {
        self.system.release = release;
    }

    /// The logger missed something: silence means nothing for a while.
    pub(super) fn dropout(&mut self) {
        self.receivers.dropout();
    }

    pub(super) fn take(&mut self, topic: &Topic, said: &Said<'_>) {
        (topic.take)(self, said);
    }

    /// Time goes on.
    pub(super) fn step(&mut self, now: Instant, recorded_us: u64) {
        let due = self.repeated_us.is_none_or(|last| recorded_us < last || recorded_us - last >= REPEAT_US);
        if due && self.system.known() {
            self.repeated_us = Some(recorded_us);
            self.repeat(recorded_us);
            let Self { receivers, told, .. } = self;
            receivers.silence(now, &mut |observation| told.push(Told::Observation(observation)));
        }
    }

    fn observe(&mut self, observation: Observation) {
        self.told.push(Told::Observation(observation));
    }
}
