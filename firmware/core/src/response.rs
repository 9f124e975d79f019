//! What the vehicle does against what it is told to do: how fast it turns, and whether it climbs with full throttle.
//!
//! Control makes the body's rates those that it wants, within a fraction of a second. Where a motor, a propeller, a servo or a surface
//! does not do as it is told, they stay apart. The difference is smoothed with its sign, so that delay and noise cancel, and less a
//! part of the rates that were wanted: who is told to turn fast may be late by much. Rates that are told about the axes of the wanted
//! attitude are turned to the body's first: what is yawed fast lags that attitude by a quarter of a turn.

use crate::flight::Flight;
use crate::latest::{Latest, Reading};
use crate::modes::has_pilots_throttle;
use crate::motion::climb_mps;
use crate::observation::{Attitude, Hud, VehicleKind, WantedRates};
use crate::rotation;
use crate::time::{Instant, Span};
use crate::units::RadiansPerSecond;
use crate::vehicle::Vehicle;

/// Time constant of rates, s.
const SMOOTHING_S: f32 = 1.0;
/// What is wanted is as old as this at most: an agile vehicle turns otherwise after it. Between comparisons, [`PAUSE`] at most counts.
const FRESH: Span = Span::from_millis(150);
const PAUSE: Span = Span::from_millis(500);
/// What was not heard for longer begins anew.
const HOLE: Span = Span::from_millis(1_500);
/// This part of the rates that are wanted may be missing.
const LATE_PART: f32 = 0.3;
/// No vehicle turns faster, rad/s: garbage.
const RATE_MAX: f32 = 60.0;
/// Throttle at its end.
const FULL: f32 = 0.95;
/// With it multicopters climb faster than this, m/s, while they are not tilted further, rad; what flies on wings does not sink faster.
const CLIMBS_MPS: f32 = 0.3;
const TILT_RAD: f32 = 0.52;
const SINKS_MPS: f32 = -0.5;
/// So long in vain is what `THRUST_WARN` tells of.
const IN_VAIN: Span = Span::from_secs(2);

/// Roll and pitch.
const AXES: usize = 2;

/// The memory of both.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Response {
    wanted: Latest<[RadiansPerSecond; AXES]>,
    /// What is missing, and what is wanted either way, rad/s, smoothed.
    missing: [f32; AXES],
    asked: [f32; AXES],
    compared_at: Option<Instant>,
    full_since: Option<Instant>,
    full_at: Option<Instant>,
}

impl Response {
    /// Nothing seen.
    pub(crate) const fn new() -> Self {
        Self {
            wanted: Latest::nothing(),
            missing: [0.0; AXES],
            asked: [0.0; AXES],
            compared_at: None,
            full_since: None,
            full_at: None,
        }
    }

    pub(crate) fn take_wanted(&mut self, at: Instant, rates: Option<WantedRates>, vehicle: &Vehicle) {
        let Some(WantedRates { about, of }) = rates else { return };
        let [roll, pitch, _] = match of.filter(|_| vehicle.is_ardupilot()) {
            Some(of) => {
                let Some(attitude) = vehicle.attitude.within(at, FRESH) else { return };
                rotation::from_axes_of(of, about.map(|rate| rate.0), attitude).map(RadiansPerSecond)
            }
            None => about,
        };
        self.wanted.set(at, [roll, pitch]);
    }

    pub(crate) fn take_attitude(
        &mut self,
        at: Instant,
        attitude: &Attitude,
        vehicle: &Vehicle,
        flight: &Flight,
    ) {
        // A VTOL's two sets of actuators share the work in a transition, and a tail-sitter on its wings has other axes than it says.
        let judged = vehicle.kind() != VehicleKind::Vtol || vehicle.hovers(at) == Some(true);
        let (Some(wanted), Some([roll, pitch, _])) = (self.wanted.within(at, FRESH), attitude.rates) else {
            return;
        };
        let sane = |rate: &RadiansPerSecond| rate.0.abs() <= RATE_MAX;
        if !judged || !flight.is_settled(at) || !wanted.iter().chain(&[roll, pitch]).all(sane) {
            return;
        }
        if self.compared_at.is_none_or(|before| at.since(before) > HOLE) {
            (self.missing, self.asked, self.compared_at) = ([0.0; AXES], [0.0; AXES], None);
        }
        let step_s = self.compared_at.map_or(0.0, |before| at.since(before).min(PAUSE).as_secs_f32());
        let weight = step_s / (SMOOTHING_S + step_s);
        for (axis, (wanted, flown)) in wanted.iter().zip([roll, pitch]).enumerate() {
            self.missing[axis] += weight * (wanted.0 - flown.0 - self.missing[axis]);
            self.asked[axis] += weight * (wanted.0.abs() - self.asked[axis]);
        }
        self.compared_at = Some(at);
    }

    /// A pilot's display: throttle.
    pub(crate) fn take_hud(&mut self, at: Instant, hud: &Hud, vehicle: &Vehicle, flight: &Flight) {
        let (Some(throttle), Some(climb_mps)) = (hud.throttle, climb_mps(at, vehicle)) else { return };
        let level = vehicle
            .attitude
            .get()
            .is_none_or(|attitude| attitude.roll.0.abs() < TILT_RAD && attitude.pitch.0.abs() < TILT_RAD);
        if self.full_at.is_none_or(|before| at.since(before) > HOLE) {
            self.full_since = None;
        }
        // Once it was so for long, it is until it climbs.
        let was_long = self.full_since.is_some_and(|since| at.since(since) >= IN_VAIN);
        let in_vain = match vehicle.hovers(at) {
            Some(_) if was_long => climb_mps < CLIMBS_MPS,
            Some(true) => level && climb_mps < CLIMBS_MPS,
            // A pilot may dive with all his throttle.
            Some(false) => climb_mps < SINKS_MPS && !has_pilots_throttle(vehicle),
            None => false,
        };
        self.full_at = Some(at);
        self.full_since =
            (flight.is_settled(at) && throttle.0 >= FULL && in_vain).then(|| self.full_since.unwrap_or(at));
    }

    /// A flight begins.
    pub(crate) const fn begin(&mut self) {
        *self = Self::new();
    }

    /// How much of the rate that is wanted about an axis (0 roll, 1 pitch) is missing, degrees a second.
    pub(crate) fn rate_missing(&self, axis: usize) -> Option<Reading> {
        let (missing, asked) = (self.missing.get(axis)?, self.asked.get(axis)?);
        let value = (missing.abs() - LATE_PART * asked).max(0.0).to_degrees();
        Reading::new(self.compared_at, Some(value))
    }

    /// For how long full throttle has not made it climb, s.
    pub(crate) fn full_in_vain(&self) -> Option<Reading> {
        let at = self.full_at?;
        Some(Reading { at, value: self.full_since.map_or(0.0, |since| at.since(since).as_secs_f32()) })
    }
}
