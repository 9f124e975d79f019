//! How the vehicle moves, from the best source that is fresh: height, climb, speeds, and the throttle that it does so with.

use crate::time::{Instant, Span};
use crate::vehicle::Vehicle;

/// Positions and speeds older than this decide nothing.
const MOTION_AGE: Span = Span::from_secs(3);
/// Nothing that is watched here is faster: garbage, which must not get into sums and maxima.
pub(crate) const SPEED_MAX_MPS: f32 = 1_000.0;

/// With less throttle no rotors carry anything: hover takes a quarter to three quarters.
pub(crate) const IDLE_THROTTLE: f32 = 0.1;

/// Height above home; above the local origin where there is no global position.
pub fn height_m(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    let global = vehicle.global.within(now, MOTION_AGE).map(|global| global.relative_altitude.0);
    let local = || vehicle.local.within(now, MOTION_AGE).map(|local| -local.position[2].0);
    global.or_else(local).filter(|height_m| height_m.is_finite())
}

/// The part of the throttle that the autopilot gives.
pub(crate) fn throttle(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    let hud = vehicle.hud.within(now, MOTION_AGE);
    hud.and_then(|hud| hud.throttle).map(|throttle| throttle.0).filter(|part| part.is_finite())
}

/// The speed through the air, in m/s.
pub(crate) fn airspeed_mps(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    let hud = vehicle.hud.within(now, MOTION_AGE);
    hud.and_then(|hud| hud.airspeed)
        .map(|speed| speed.0)
        .filter(|speed| (0.0..=SPEED_MAX_MPS).contains(speed))
}

/// The altitude of the pilot's display, of the barometer where there is no position.
pub(crate) fn altitude_m(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    let hud = vehicle.hud.within(now, MOTION_AGE);
    hud.and_then(|hud| hud.altitude).map(|altitude| altitude.0).filter(|height_m| height_m.is_finite())
}

/// Speed upwards from the best source that is fresh, in m/s.
pub fn climb_mps(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    climb_within(now, vehicle, MOTION_AGE)
}

/// The same, of what is no older.
pub(crate) fn climb_within(now: Instant, vehicle: &Vehicle, age: Span) -> Option<f32> {
    let global = vehicle.global.within(now, age).map(|global| -global.velocity[2].0);
    let local = || vehicle.local.within(now, age).map(|local| -local.velocity[2].0);
    let hud = || vehicle.hud.within(now, age).and_then(|hud| hud.climb).map(|climb| climb.0);
    global.or_else(local).or_else(hud).filter(|climb| climb.abs() <= SPEED_MAX_MPS)
}

/// Speed over ground from the best source that is fresh, in m/s.
pub fn ground_speed_mps(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    let norm = |north: f32, east: f32| libm::sqrtf(north * north + east * east);
    let global =
        vehicle.global.within(now, MOTION_AGE).map(|global| norm(global.velocity[0].0, global.velocity[1].0));
    let local =
        || vehicle.local.within(now, MOTION_AGE).map(|local| norm(local.velocity[0].0, local.velocity[1].0));
    let hud = || vehicle.hud.within(now, MOTION_AGE).and_then(|hud| hud.groundspeed).map(|speed| speed.0);
    global.or_else(local).or_else(hud).filter(|speed| (0.0..=SPEED_MAX_MPS).contains(speed))
}
