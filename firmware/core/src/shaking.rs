//! Vibration against its own usual level in this flight.

use crate::departure::Departure;
use crate::flight::Flight;
use crate::latest::Reading;
use crate::observation::{VehicleKind, VibrationScale};
use crate::steady::is_clear;
use crate::time::{Instant, Span, Stamp};
use crate::vehicle::Vehicle;

/// It comes at 1 Hz or faster; what comes after a longer pause is not of the same hover.
const PAUSE: Span = Span::from_secs(3);
/// Of the lower of two messages: a shock is in one.
const SMOOTHING_S: f32 = 0.25;
/// What rises by less did not rise: per axis, and PX4's metric, m/s2.
const GRAIN_PER_AXIS: f32 = 2.5;
const GRAIN_PX4: f32 = 1.0;

/// The memory of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shaking {
    usual: Departure,
    at: Stamp,
    /// The last message's, m/s2.
    before: f32,
    grain: f32,
}

impl Shaking {
    /// Nothing seen.
    pub(crate) const NEW: Self = Self { usual: Departure::NEW, at: Stamp::NONE, before: 0.0, grain: 0.0 };

    /// Vibration came, on the scale that the vehicle knows.
    pub(crate) fn take(&mut self, at: Instant, vehicle: &Vehicle, flight: &Flight) {
        let Some(vibration) = vehicle.vibration.get() else { return };
        let (level, grain) = match vibration.scale {
            VibrationScale::PerAxis => {
                (vibration.levels.into_iter().flatten().reduce(f32::max), GRAIN_PER_AXIS)
            }
            VibrationScale::Px4Metrics => (vibration.levels[2], GRAIN_PX4),
        };
        let judged =
            vehicle.kind() == VehicleKind::Rotorcraft && flight.is_settled(at) && is_clear(at, vehicle);
        let (Some(level), true) = (level, judged) else { return };
        self.grain = grain;
        let step = self.at.age(at).filter(|step| *step > Span::ZERO && *step < PAUSE);
        self.at = Stamp::at(at);
        // A shock is in one message: what is in two counts.
        let lasting = level.min(core::mem::replace(&mut self.before, level));
        if let Some(step) = step {
            self.usual.take(lasting, step.as_secs_f32(), SMOOTHING_S, grain);
        }
    }

    /// From which figure on it is more than so many times what is usual in this flight.
    pub(crate) fn limit(&self, times: f32) -> Option<f32> {
        self.usual.limit(times, self.grain)
    }

    /// As a multiple of what is usual in this flight.
    pub(crate) fn rise(&self, now: Instant) -> Option<Reading> {
        Reading::new(self.at.instant(now), self.usual.multiple(self.grain))
    }
}
