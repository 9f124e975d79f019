//! The monitor: vehicle, flight, health and usage, kept together in step.

use crate::derived::Derived;
use crate::flight::Flight;
use crate::health::{Finding, Health, Inputs};
use crate::observation::{Observation, Source};
use crate::params::Params;
use crate::status::{LinkReading, RecorderStatus};
use crate::time::{Instant, Span};
use crate::usage::Usage;
use crate::vehicle::Vehicle;

/// How often [`Monitor::tick`] is to be called: a finding comes at most this much after its debounce.
pub const TICK: Span = Span::from_millis(50);

/// Everything that the monitor knows and decides.
#[derive(Clone, Copy, Debug)]
pub struct Monitor {
    params: Params,
    vehicle: Vehicle,
    flight: Flight,
    derived: Derived,
    health: Health,
    usage: Usage,
}

const _: () = assert!(size_of::<Monitor>() <= 9 * 1024);

impl Monitor {
    /// Before the first observation.
    pub const fn new(params: Params) -> Self {
        Self {
            params,
            vehicle: Vehicle::unknown(),
            flight: Flight::grounded(),
            derived: Derived::new(),
            health: Health::new(),
            usage: Usage::new(),
        }
    }

    /// Takes what somebody on the link said; `false` when it is not of the monitored vehicle.
    pub fn observe(&mut self, at: Instant, source: Source, observation: &Observation) -> bool {
        if !self.vehicle.observe(at, source, observation) {
            return false;
        }
        self.derived.observe(at, &self.vehicle, observation);
        self.usage.observe(at, &self.vehicle, &self.flight, &self.derived, observation);
        true
    }

    /// One step, every [`TICK`]: flight, checks, usage. Each change of a check's level is given to `findings`, once.
    pub fn tick(
        &mut self,
        now: Instant,
        link: &LinkReading,
        recorder: &RecorderStatus,
        findings: &mut impl FnMut(&Finding),
    ) {
        let event = self.flight.step(now, &self.vehicle);
        self.derived.step(now, &self.vehicle, event, recorder.frames_lost);
        self.usage.step(now, &self.vehicle, &self.flight, event, &self.params);
        let inputs = Inputs {
            now,
            vehicle: &self.vehicle,
            flight: &self.flight,
            derived: &self.derived,
            link,
            recorder,
            params: &self.params,
        };
        self.health.step(&inputs, findings);
    }

    /// The vehicle as it is known.
    pub const fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    /// On the ground or in the air.
    pub const fn flight(&self) -> &Flight {
        &self.flight
    }

    /// Levels and roll-ups.
    pub const fn health(&self) -> &Health {
        &self.health
    }

    /// Usage since power-on.
    pub const fn usage(&self) -> &Usage {
        &self.usage
    }

    /// Limits and settings.
    pub const fn params(&self) -> &Params {
        &self.params
    }

    /// Limits and settings, to be changed.
    pub const fn params_mut(&mut self) -> &mut Params {
        &mut self.params
    }
}
