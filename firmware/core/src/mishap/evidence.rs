//! What a mishap is seen by: how long something lasts, what was greatest of late, what the vehicle hangs on and who flies it.

use crate::observation::{Autopilot, VehicleKind};
use crate::time::{Instant, Span};
use crate::vehicle::Vehicle;

/// Samples, one after the other, before anything is believed.
const SAMPLES: u8 = 3;
/// 45 degrees: what rests at a greater tilt than that does not fly.
const TILTED_RAD: f32 = 0.785;

/// How long something has been so, and in how many samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lasting {
    pub(super) since: Instant,
    pub(super) samples: u8,
}

impl Lasting {
    pub(super) const NOT: Self = Self { since: Instant::ZERO, samples: 0 };

    /// For how long it has been so, once there were enough samples.
    pub(super) fn take(&mut self, at: Instant, so: bool) -> Option<Span> {
        if !so {
            self.samples = 0;
            return None;
        }
        if self.samples == 0 {
            self.since = at;
        }
        self.samples = self.samples.saturating_add(1);
        (self.samples >= SAMPLES).then(|| at.since(self.since))
    }
}

/// The greatest of the last half to whole second.
#[derive(Clone, Copy, Debug)]
pub(super) struct Recent {
    pub(super) now: f32,
    pub(super) before: f32,
    pub(super) window: Instant,
}

impl Recent {
    pub(super) const WINDOW: Span = Span::from_millis(600);
    pub(super) const NOTHING: Self = Self { now: 0.0, before: 0.0, window: Instant::ZERO };

    pub(super) fn take(&mut self, at: Instant, value: f32) {
        if at.since(self.window) >= Self::WINDOW {
            (self.before, self.now, self.window) = (self.now, 0.0, at);
        }
        self.now = self.now.max(value);
    }

    pub(super) const fn greatest(&self) -> f32 {
        self.now.max(self.before)
    }
}

/// A shock, and what came of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shock {
    pub(super) at: Instant,
    pub(super) load_g: f32,
    /// The speed just before it.
    pub(super) speed_mps: f32,
    /// The sink just before it.
    pub(super) sink_mps: f32,
    /// The speed broke off.
    pub(super) stopped: bool,
}

/// Disarmed out of a flight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Doubt {
    pub(super) since: Instant,
    /// Above home.
    pub(super) height_m: f32,
    /// Above mean sea level.
    pub(super) altitude_m: Option<f32>,
}

pub(super) fn is_known(vector: [f32; 3]) -> bool {
    vector.into_iter().all(f32::is_finite)
}

/// Whether it hangs on rotors now.
pub(super) fn on_rotors(now: Instant, vehicle: &Vehicle) -> bool {
    vehicle.hovers(now) == Some(true)
}

pub(super) fn is_tilted(vehicle: &Vehicle) -> bool {
    vehicle
        .attitude
        .get()
        .is_some_and(|attitude| attitude.roll.0.abs() > TILTED_RAD || attitude.pitch.0.abs() > TILTED_RAD)
}

/// Modes in which the pilot himself has the throttle: `ArduCopter`'s STABILIZE, ACRO, DRIFT, FLIP; PX4's MANUAL, ACRO, STABILIZED.
/// Of other autopilots nothing is known.
pub(super) fn has_pilots_throttle(vehicle: &Vehicle) -> bool {
    let Some(heartbeat) = vehicle.heartbeat.get() else { return true };
    match heartbeat.autopilot {
        Autopilot::ArduPilot => matches!(heartbeat.mode, 0 | 1 | 11 | 14),
        Autopilot::Px4 => matches!(heartbeat.mode >> 16 & 0xFF, 1 | 5 | 7),
        Autopilot::Other => true,
    }
}

/// Modes that are made for turning over: `ArduCopter`'s ACRO and FLIP, `ArduPlane`'s MANUAL, TRAINING and ACRO, PX4's MANUAL and ACRO.
pub(super) fn is_made_to_turn(vehicle: &Vehicle) -> bool {
    let Some(heartbeat) = vehicle.heartbeat.get() else { return true };
    let on_wings = matches!(heartbeat.kind, VehicleKind::Plane | VehicleKind::Vtol);
    match heartbeat.autopilot {
        Autopilot::ArduPilot if on_wings => matches!(heartbeat.mode, 0 | 3 | 4),
        Autopilot::ArduPilot => matches!(heartbeat.mode, 1 | 14),
        Autopilot::Px4 => {
            matches!(heartbeat.mode >> 16 & 0xFF, 5) || (on_wings && heartbeat.mode >> 16 & 0xFF == 1)
        }
        Autopilot::Other => false,
    }
}
