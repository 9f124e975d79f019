//! Whether a vehicle flies so that what its sensors say, and what its motors are given, can be compared.

use crate::flight::Flight;
use crate::motion::climb_mps;
use crate::observation::{Attitude, LandedState};
use crate::time::{Instant, Span};
use crate::vehicle::{LANDED_STATE_AGE, Vehicle};

/// What turns slower than [`crate::inertial`]'s fast for so long can be compared.
pub(crate) const TURNED: Span = Span::from_secs(1);
/// Older motion says nothing.
const FRESH: Span = Span::from_secs(1);
/// Above this height over home, m; slower up or down, m/s.
const LOW_M: f32 = 1.5;
const LEVEL_MPS: f32 = 2.0;
/// Further it does not lean steadily, rad.
const LEANS_RAD: f32 = 0.6;

/// Whether a multicopter climbs little, and does not touch the ground: there motors do what the legs make them do. It may be fast, and lean
/// against the wind.
pub(crate) fn flies_level(now: Instant, vehicle: &Vehicle, flight: &Flight) -> bool {
    let climbs = climb_mps(now, vehicle).is_some_and(|climb| climb.abs() > LEVEL_MPS);
    let leans = |attitude: &Attitude| attitude.roll.0.abs().max(attitude.pitch.0.abs()) > LEANS_RAD;
    !climbs
        && vehicle.is_multicopter()
        && !vehicle.attitude.get().is_some_and(leans)
        && flight.is_settled(now)
        && is_clear(now, vehicle)
}

/// Whether it is away from the ground, as far as that is known.
pub(crate) fn is_clear(now: Instant, vehicle: &Vehicle) -> bool {
    let landed = vehicle.landed.within(now, LANDED_STATE_AGE);
    !matches!(landed, Some(LandedState::TakingOff | LandedState::Landing | LandedState::OnGround))
        && vehicle
            .global
            .within(now, FRESH)
            .is_none_or(|global| libm::fabsf(global.relative_altitude.0) > LOW_M)
}
