//! Outputs of handlers, and their receiver.

use hums_core::cause::Alert;
use hums_core::observation::Observation;

/// An output of a handler.
pub(in crate::source::dataflash) enum Say<'a> {
    /// An observation.
    Observation(&'a Observation),
    /// A parameter and its value.
    Parameter(&'a str, f64),
    /// A text with its severity and alert.
    Text(u8, &'a str, Option<Alert>),
    /// The mode's number.
    Mode(u32),
    /// An event's number, severity, text and alert.
    Event(u32, u8, &'a str, Option<Alert>),
    /// The firmware's name and version.
    Firmware(&'a str),
    /// The airframe.
    Frame(&'a str),
    /// Names of the active failsafes from here on; empty without any.
    Failsafes(&'a str),
    /// An emergency in which the motors stop at once, by its name.
    Emergency(&'a str),
    /// The processor restarted after a fault, as a sentence.
    ProcessorFault(&'a str),
    /// How arming is known.
    Arming(&'a str),
    /// UTC at this message, microseconds since 1970.
    Utc(u64),
    /// The autopilot's logger lost this many messages.
    Lost(u64),
}

/// The receiver of handlers' outputs.
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
