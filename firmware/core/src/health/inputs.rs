//! Inputs of checks.

use super::finding::Subsystem;
use crate::derived::Derived;
use crate::flight::Flight;
use crate::latest::Reading;
use crate::parameters::Params;
use crate::status::{LinkReading, RecorderStatus};
use crate::time::BootMs;
use crate::vehicle::Vehicle;

/// Inputs of checks. They do not change during a step.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// Now.
    pub now: BootMs,
    /// The vehicle as it is known.
    pub vehicle: &'a Vehicle,
    /// On the ground, in the air, or in a mishap.
    pub flight: &'a Flight,
    /// Figures that are derived from messages.
    pub derived: &'a Derived,
    /// The autopilot's port.
    pub link: &'a LinkReading,
    /// Our own recording.
    pub recorder: &'a RecorderStatus,
    /// For each component: its subsystem, and the used part of its life, percent.
    pub wear: &'a [Option<(Subsystem, f32)>],
    /// Limits and settings.
    pub params: &'a Params,
}

impl Inputs<'_> {
    pub(super) fn reading(&self, value: impl Into<Option<f32>>) -> Option<Reading> {
        Reading::new(Some(self.now), value.into())
    }
}
