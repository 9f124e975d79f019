//! Outputs of handlers, and their receiver.

use hums_core::cause::Alert;
use hums_core::observation::Observation;

pub(in crate::source::dataflash) enum Say<'a> {
    /// An observation.
    Observation(&'a Observation),
    Parameter(&'a str, f64),
    Text(u8, &'a str, Option<Alert>),
    /// The mode's number.
    Mode(u32),
    Event(u32, u8, &'a str, Option<Alert>),
    /// Name and version.
    Firmware(&'a str),
    /// The airframe.
    Frame(&'a str),
    /// Active from here on; empty without any.
    Failsafes(&'a str),
    /// The motors stop at once.
    Emergency(&'a str),
    /// A restart after a fault, as a sentence.
    ProcessorFault(&'a str),
    Arming(&'a str),
    /// UTC at this message, microseconds since 1970.
    Utc(u64),
    /// Messages.
    Lost(u64),
}

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
