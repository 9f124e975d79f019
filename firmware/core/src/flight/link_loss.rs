//! The link was lost in flight, and the vehicle is heard again: whether it came down meanwhile faster than anything lands.

use super::disarming::altitude_m;
use super::witness::{is_fast, on_rotors};
use super::{Flight, STILL, STILL_RADPS};
use crate::mishap::Kind;
use crate::modes::has_pilots_throttle;
use crate::motion::{CLEAR_M, STILL_MPS, climb_mps, height_m};
use crate::params::{Param, Params};
use crate::thrust::Power;
use crate::time::{Instant, Span};
use crate::vehicle::Vehicle;

/// A silence of this length hides a fall.
const LOST: Span = Span::from_secs(5);
/// It is judged within so long after it is heard again, by a sign that lasts so long.
const LYING_SHOWS: Span = Span::from_millis(2_400);
const SIGN_LASTS: Span = Span::from_millis(500);
/// A restarted autopilot tells its forces and its place no later than this.
const STARTS: Span = Span::from_secs(20);
/// A vehicle that came down so far is not where it flew, m.
const CAME_DOWN_M: f32 = 3.0;

/// The vehicle is not heard, in the air.
#[derive(Clone, Copy, Debug)]
pub(super) struct LinkLoss {
    /// When it was heard last; earlier by the gap of a recording, in which no time passed here.
    from: Instant,
    /// The same without the gap.
    heard_at: Instant,
    /// When it was heard again.
    again_at: Option<Instant>,
    /// When its forces and its place were heard again.
    known_at: Option<Instant>,
    /// It is disarmed, or calls itself landed, since.
    calls_itself_down: bool,
    /// When there was no sign of a crash last.
    no_sign_at: Instant,
    /// Height above mean sea level, m, and sink, m/s, when it was heard last.
    altitude_m: Option<f32>,
    sink_mps: f32,
}

impl LinkLoss {
    /// The shortest time in which a vehicle comes down so far by itself, stands and is disarmed, s: from its sink to the fastest descent that
    /// can be set, as gently as autopilots do, the last metres no faster than legs take; an autopilot sees for so long that it stands
    /// (`ArduPilot` 1 s, PX4 longer).
    fn least_s(&self, lost_m: f32, limit_mps: f32, powered: bool) -> f32 {
        const SEES_S: f32 = 1.0;
        const LAST_M: f32 = 5.0;
        const LAST_MPS: f32 = 2.5;
        const GENTLY_MPS2: f32 = 2.0;
        let last_m = lost_m.min(LAST_M);
        let fastest_mps = limit_mps.max(self.sink_mps);
        let faster_mps = fastest_mps - self.sink_mps.max(0.0);
        let sees_s = if powered { 0.0 } else { SEES_S };
        last_m / LAST_MPS + (lost_m - last_m) / fastest_mps + faster_mps / (2.0 * GENTLY_MPS2) + sees_s
    }
}

impl Flight {
    /// Whether it is heard again after a silence, and not yet seen how it is.
    pub(super) fn is_heard_again(&self) -> bool {
        self.link.is_some_and(|link| link.again_at.is_some())
    }

    /// Whether it calls itself down since it is heard again.
    pub(super) fn came_back_down(&self) -> bool {
        self.link.is_some_and(|link| link.calls_itself_down)
    }

    /// One step: whether it is heard, and its signs once it is heard again.
    pub(super) fn note_link(&mut self, now: Instant, vehicle: &Vehicle, params: &Params) {
        let Some(mut link) = self.link else {
            if now.since(self.heard_at) >= LOST {
                self.lose_link(self.heard_at, vehicle);
            }
            return;
        };
        if self.heard_at == link.heard_at {
            return;
        }
        let again_at = *link.again_at.get_or_insert(now);
        let tells = |at: Option<Instant>| at.is_none_or(|at| at.is_after(link.heard_at));
        if link.known_at.is_none() && tells(vehicle.imu.at()) && tells(vehicle.global.at()) {
            link.known_at = Some(now);
        }
        let (since, shows) = match link.known_at {
            Some(known_at) => (known_at, LYING_SHOWS),
            None => (again_at, if self.powered { LYING_SHOWS } else { STARTS }),
        };
        link.calls_itself_down = !self.powered || self.calls_itself_landed(now, vehicle);
        // States of before the silence say nothing.
        let mut sign = None;
        if now.since(again_at) >= STILL {
            if self.stage.is_mishap() || now.since(since) > shows || vehicle.hovers(now) == Some(false) {
                self.link = None;
                return;
            }
            sign = self.came_down(now, vehicle, params, &link);
        }
        match sign {
            None => link.no_sign_at = now,
            Some((kind, value)) if now.since(link.no_sign_at) >= SIGN_LASTS => {
                (self.hit_at, self.unheard_from) = (again_at, Some(link.from));
                self.see(now, kind, value, params);
            }
            Some(_) => {}
        }
        self.link = Some(link);
    }

    fn lose_link(&mut self, from: Instant, vehicle: &Vehicle) {
        if self.powered && self.airborne() && !self.stage.is_mishap() && self.watch.is_none() {
            self.link = Some(LinkLoss {
                from,
                heard_at: self.heard_at,
                again_at: None,
                known_at: None,
                calls_itself_down: false,
                no_sign_at: self.heard_at,
                altitude_m: vehicle.global.get().map(|global| global.altitude.0),
                sink_mps: self.motion.sink.greatest(self.heard_at),
            });
        }
    }

    /// Its recording lost so much, and no time passed here meanwhile.
    pub(crate) fn lose(&mut self, span: Span, vehicle: &Vehicle) {
        if span >= LOST && self.link.is_none() {
            self.lose_link(self.heard_at - span, vehicle);
        }
    }

    /// A sign, after a silence, of a vehicle that came down faster than anything lands: its kind and value.
    fn came_down(
        &self,
        now: Instant,
        vehicle: &Vehicle,
        params: &Params,
        link: &LinkLoss,
    ) -> Option<(Kind, f32)> {
        if !on_rotors(now, vehicle) {
            return None;
        }
        let lost_m =
            link.altitude_m.zip(altitude_m(now, vehicle)).map_or(0.0, |(before_m, now_m)| before_m - now_m);
        let least_s = link.least_s(lost_m.max(0.0), params.get(Param::MisSink), self.powered);
        let lasted = link.again_at.unwrap_or(now).since(link.from);
        let had_time = lasted.as_secs_f32() >= least_s;
        let power = self.power(now, vehicle);
        // A tail-sitter hovers nose up, and a fast vehicle leans. One that had the time to land and is off may have been laid down by somebody.
        let is_off = link.calls_itself_down || power == Some(Power::Idle);
        let over_deg = vehicle.inertial.lies_over(now).map(f32::to_degrees);
        let lies =
            self.stood && !is_fast(now, vehicle) && self.rate_radps < STILL_RADPS && !(is_off && had_time);
        if let Some(over_deg) = over_deg.filter(|over_deg| lies && *over_deg > params.get(Param::MisOverturn))
        {
            return Some((Kind::Overturned, over_deg));
        }
        let slow = climb_mps(now, vehicle).is_none_or(|climb_mps| climb_mps.abs() < STILL_MPS)
            || self.receiver_rests(now);
        // With all its thrust it may hover, but not near the ground.
        let is_low = height_m(now, vehicle).is_some_and(|height_m| height_m < CLEAR_M);
        let in_vain = self.powered && (self.lies(now, vehicle) || is_low) && power == Some(Power::Full);
        let fell = !has_pilots_throttle(vehicle) && is_off && !had_time;
        let is_down = slow && lost_m > CAME_DOWN_M && (in_vain || fell);
        // Nobody felt the shock.
        is_down.then_some((Kind::Impact, 0.0))
    }
}
