//! What handlers say, and where to.

use hums_core::cause::Alert;
use hums_core::observation::Observation;

/// What handlers say.
pub(in crate::source::dataflash) enum Say<'a> {
    /// An observation.
    Observation(&'a Observation),
    /// A parameter and its value.
    Parameter(&'a str, f64),
    /// Words with their severity, and what they say is wrong.
    Text(u8, &'a str, Option<Alert>),
    /// The mode's number.
    Mode(u32),
    /// An event's number, severity and words, and what it says is wrong.
    Event(u32, u8, &'a str, Option<Alert>),
    /// The firmware's name and version.
    Firmware(&'a str),
    /// The airframe.
    Frame(&'a str),
    /// The failsafes in force from here on, by their names; empty where there is none.
    Failsafes(&'a str),
    /// An emergency in which the motors stop at once, by its name.
    Emergency(&'a str),
    /// How arming is known.
    Arming(&'a str),
    /// UTC at this message, microseconds since 1970.
    Utc(u64),
    /// The autopilot's logger lost so many messages.
    Lost(u64),
}

/// Where handlers say it.
pub(in crate::source::dataflash) struct Out<'a> {
    say: &'a mut dyn FnMut(&Say<'_>),
}

impl<'a> Out<'a> {
    /// To this function.
    pub(in crate::source::dataflash) fn new(say: &'a mut dyn FnMut(&Say<'_>)) -> Self {
        Self { say }
    }

    pub(super) fn say(&mut self, what: &Say<'_>) {
        (self.say)(what);
    }

    pub(super) fn observe(&mut self, observation: &Observation) {
        self.say(&Say::Observation(observation));
    }
}
