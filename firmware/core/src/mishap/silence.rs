//! What flew, was not heard for a while, and is heard again: whether it came down meanwhile as nothing lands.

use super::evidence::{FRESH, FULL_THROTTLE, Unheard, calls_itself_landed, is_near_ground, on_rotors};
use super::{Kind, Mishap, STILL, STILL_MPS, STILL_RATE, State, is_fast};
use crate::flight::Flight;
use crate::modes::has_pilots_throttle;
use crate::motion::{climb_mps, throttle};
use crate::params::{Param, Params};
use crate::time::{Instant, Span};
use crate::vehicle::Vehicle;

/// Nothing heard for so long hides a fall.
const UNHEARD: Span = Span::from_secs(5);
/// So long after that it is seen whether it lies; and so long it does what only what lies does.
const LYING_SHOWS: Span = Span::from_millis(2_400);
const SIGN_LASTS: Span = Span::from_millis(500);
/// A restarted autopilot tells its forces and its place no later than this.
const STARTS: Span = Span::from_secs(20);
/// What came down so far is not where it flew.
const CAME_DOWN_M: f32 = 3.0;

impl Mishap {
    /// Whether it is heard again after a silence, and not yet seen how it is.
    pub(super) fn is_heard_again(&self) -> bool {
        self.unheard.is_some_and(|unheard| unheard.again_at.is_some())
    }

    /// One step: whether it is heard, and what it does once it is heard again.
    pub(super) fn note_silence(&mut self, now: Instant, vehicle: &Vehicle, flight: &Flight, params: &Params) {
        let Some(mut unheard) = self.unheard else {
            if now.since(self.heard_at) >= UNHEARD {
                self.begin_silence(self.heard_at, vehicle, flight);
            }
            return;
        };
        if self.heard_at == unheard.last_heard_at {
            return;
        }
        let again_at = *unheard.again_at.get_or_insert(now);
        let tells = |at: Option<Instant>| at.is_none_or(|at| at.is_after(unheard.last_heard_at));
        if unheard.state_known_at.is_none() && tells(vehicle.imu.at()) && tells(vehicle.global.at()) {
            unheard.state_known_at = Some(now);
        }
        let (since, shows) = match unheard.state_known_at {
            Some(known_at) => (known_at, LYING_SHOWS),
            None => (again_at, if self.armed { LYING_SHOWS } else { STARTS }),
        };
        unheard.calls_itself_down = !self.armed || calls_itself_landed(now, vehicle);
        // Its states of before it was silent say nothing.
        let mut sign = None;
        if now.since(again_at) >= STILL {
            // Of what hangs on wings nothing is known.
            if self.state != State::Quiet || now.since(since) > shows || vehicle.hovers(now) == Some(false) {
                self.unheard = None;
                return;
            }
            sign = self.came_down(now, vehicle, params, &unheard);
        }
        match sign {
            None => unheard.no_sign_at = now,
            Some((kind, value)) if now.since(unheard.no_sign_at) >= SIGN_LASTS => {
                (self.hit_at, self.unheard_from) = (again_at, Some(unheard.from));
                self.see(now, kind, value, params);
            }
            Some(_) => {}
        }
        self.unheard = Some(unheard);
    }

    /// What flies is not heard, since then.
    fn begin_silence(&mut self, from: Instant, vehicle: &Vehicle, flight: &Flight) {
        if self.armed && flight.airborne() && self.state == State::Quiet && self.doubt.is_none() {
            let silence = Unheard {
                from,
                last_heard_at: self.heard_at,
                again_at: None,
                state_known_at: None,
                calls_itself_down: false,
                no_sign_at: self.heard_at,
                altitude_m: vehicle.global.get().map(|global| global.altitude.0),
                sink_mps: self.sink.greatest(self.heard_at),
            };
            self.unheard = Some(silence);
        }
    }

    /// Its recording lost what it said for so long, and no time passed here meanwhile.
    pub(crate) fn lose(&mut self, span: Span, vehicle: &Vehicle, flight: &Flight) {
        if span >= UNHEARD && self.unheard.is_none() {
            self.begin_silence(self.heard_at - span, vehicle, flight);
        }
    }

    /// What it does, after a silence, that only what came down as nothing lands does: as what that is told, and with which value, if one is
    /// known.
    fn came_down(
        &self,
        now: Instant,
        vehicle: &Vehicle,
        params: &Params,
        unheard: &Unheard,
    ) -> Option<(Kind, f32)> {
        if !on_rotors(now, vehicle) {
            return None;
        }
        // Above the sea: home is another one once it is disarmed.
        let altitude_m = vehicle.global.within(now, FRESH).map(|global| global.altitude.0);
        let lost_m = unheard.altitude_m.zip(altitude_m).map_or(0.0, |(before_m, now_m)| before_m - now_m);
        let least_s = unheard.least_s(lost_m.max(0.0), params.get(Param::MisSink), self.armed);
        let had_time = unheard.lasted(now).as_secs_f32() >= least_s;
        // What never stood hangs so in its hover (tail-sitters), and what is fast leans. What had the time to land and is off may have been
        // laid down by somebody.
        let is_off = unheard.calls_itself_down
            || throttle(now, vehicle).is_some_and(|part| part < self.support.idle_throttle());
        let limit_deg = params.get(Param::MisOverturn);
        let over_deg = vehicle.inertial.lies_over(now).map(f32::to_degrees);
        let lies = self.stood && !is_fast(now, vehicle) && self.rate < STILL_RATE && !(is_off && had_time);
        if let Some(over_deg) = over_deg.filter(|over_deg| lies && *over_deg > limit_deg) {
            return Some((Kind::Overturned, over_deg));
        }
        let slow =
            climb_mps(now, vehicle).is_none_or(|climb_mps| climb_mps.abs() < STILL_MPS) || self.rests(now);
        // With all its thrust it may hover, but not near the ground.
        let in_vain = self.armed
            && (self.lies(now, vehicle) || is_near_ground(now, vehicle))
            && throttle(now, vehicle).is_some_and(|part| part >= FULL_THROTTLE);
        let fell = !has_pilots_throttle(vehicle) && is_off && !had_time;
        let is_down = slow && lost_m > CAME_DOWN_M && (in_vain || fell);
        // Nobody felt the shock.
        is_down.then_some((Kind::Impact, 0.0))
    }
}
