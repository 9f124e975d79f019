//! Crashes in a radio gap, and vehicles that fall when first received: no pilot can act, so the box does not
//! judge them.
//!
//! In the air, silent for [`SILENT`], received again: within [`SHOWS`] one of these signs for [`SIGN_LASTS`]
//! shows a crash. Fixed-wing vehicles are not judged.
//!
//! | sign | found as |
//! |---|---|
//! | on its side, without the time to land and be laid down | `overturned` |
//! | more than [`CAME_DOWN_M`] lower and slow, with full throttle near the ground or on its side | `impact` |
//! | as low and slow, landed or disarmed earlier than any landing takes | `impact` |
//!
//! Disarmed when first received, and sinking faster than `MIS_SINK` by speed and air pressure: disarmed in
//! the air.

use std::collections::VecDeque;

use hums_core::Monitor;
use hums_core::clock;
use hums_core::health::{Level, checks};
use hums_core::modes::has_pilots_throttle;
use hums_core::motion::{climb_mps, ground_speed_mps, height_m, throttle};
use hums_core::observation::{Air, Attitude, Imu, LandedState, Observation, VehicleKind};
use hums_core::parameters::{Param, Params};
use hums_core::time::{BootMs, Millis};
use hums_core::vehicle::Vehicle;

use super::problem::IMPACT;
use crate::source::told::Finding;

/// May hide a fall.
const SILENT: Millis = Millis::from_secs(5);
/// Attitude after reception; a disarmed, restarted vehicle reports forces later.
const SHOWS: Millis = Millis::from_millis(2_400);
const STARTS: Millis = Millis::from_secs(20);
/// Old values are replaced.
const SETTLED: Millis = Millis::from_secs(1);
const SIGN_LASTS: Millis = Millis::from_millis(500);
/// Lost height, m.
const CAME_DOWN_M: f32 = 3.0;
/// m above home.
const NEAR_GROUND_M: f32 = 2.0;
/// Slow: m/s, rad/s.
const STILL_MPS: f32 = 1.0;
const STILL_RADPS: f32 = 0.3;
/// m/s: faster, it leans in flight.
const LEANS_MPS: f32 = 12.0;
const TILTED_RAD: f32 = 0.785;
/// g on the underside: on its back.
const ON_BACK_G: f32 = 0.5;
const IDLE_THROTTLE: f32 = 0.1;
const FULL_THROTTLE: f32 = 0.9;
/// Older values are not used.
const FRESH: Millis = Millis::from_secs(2);
/// m: a receiver's height at rest.
const STANDS_M: f32 = 3.0;
/// Sink, m/s.
const FALLING_MPS: f32 = 2.5;
/// A metre at sea level; at 4,000 m 35 % too much, so a fall must be deeper.
const HPA_PER_METRE: f32 = 0.12;
const FIRST: Millis = Millis::from_secs(10);
/// Sinks are kept for this long.
const WINDOW: Millis = Millis::from_millis(900);

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Verdict {
    /// Finding check.
    pub check: &'static str,
    /// `None` if not measured.
    value: Option<f32>,
    /// Time of the finding; for an impact, the next reception.
    pub at: BootMs,
    /// Last reception before.
    pub from: Option<BootMs>,
}

impl Verdict {
    /// `None` if its check is off.
    pub(super) fn finding(&self, at: clock::Instant, level: Level, params: &Params) -> Option<Finding> {
        let check = checks().find(|check| check.name == self.check)?;
        let limit = check.limits.critical.map(|limit| params.get(limit)).filter(|limit| limit.is_finite())?;
        let previous = if level == Level::Critical { Level::Ok } else { Level::Critical };
        Some(Finding::of(check, at, (previous, level), self.value.unwrap_or(f32::NAN), limit))
    }
}

#[derive(Clone, Copy, Debug)]
struct Silence {
    /// Last reception, less lost spans, over which time stops.
    from: BootMs,
    last_heard_at: BootMs,
    again_at: Option<BootMs>,
    /// Forces and position again.
    state_at: Option<BootMs>,
    /// Last act of no wreck.
    no_sign_at: BootMs,
    altitude_m: Option<f32>,
    sink_mps: f32,
}

impl Silence {
    /// Of a regular landing, s: the fastest settable descent, slower in the last metres, and a second before
    /// disarming.
    fn least_s(&self, lost_m: f32, limit_mps: f32, armed: bool) -> f32 {
        const SEES_S: f32 = 1.0;
        const LAST_M: f32 = 5.0;
        const LAST_MPS: f32 = 2.5;
        const GENTLY_MPS2: f32 = 2.0;
        let last_m = lost_m.min(LAST_M);
        let fastest_mps = limit_mps.max(self.sink_mps);
        let faster_mps = fastest_mps - self.sink_mps.max(0.0);
        let sees_s = if armed { 0.0 } else { SEES_S };
        last_m / LAST_MPS + (lost_m - last_m) / fastest_mps + faster_mps / (2.0 * GENTLY_MPS2) + sees_s
    }
}

#[derive(Debug, Default)]
pub(super) struct LinkLoss {
    heard_at: BootMs,
    armed: bool,
    /// Level while armed: no tail-sitter.
    stood: bool,
    first_at: Option<BootMs>,
    /// Has flown, or received for [`FIRST`].
    is_known: bool,
    found: Option<Verdict>,
    silence: Option<Silence>,
    /// Sinks, and pressures in hPa, of the last seconds.
    sinks: VecDeque<(BootMs, f32)>,
    pressures: VecDeque<(BootMs, f32)>,
    /// Last other pressure.
    changed_at: Option<BootMs>,
    rate: f32,
    from_above_g: f32,
    /// Start of the receiver's rest, and its altitude.
    stands_since: Option<BootMs>,
    stands_at_m: f32,
}

impl LinkLoss {
    pub(super) fn observe(&mut self, at: BootMs, observation: &Observation, vehicle: &Vehicle) {
        match observation {
            // Received without the autopilot.
            Observation::TelemetryRadio(_)
            | Observation::Battery(_)
            | Observation::Escs(_)
            | Observation::Engine(_) => return,
            Observation::Imu(imu) => self.take_imu(imu),
            Observation::Air(air) => self.take_air(at, air),
            Observation::ImuAndAir(imu, air) => {
                self.take_imu(imu);
                self.take_air(at, air);
            }
            Observation::Attitude(Attitude { rates: Some(rates), .. }) => {
                self.rate = norm(rates.map(|rate| rate.0));
            }
            Observation::GlobalPosition(_) | Observation::LocalPosition(_) => {
                if let Some(climb_mps) = climb_mps(at, vehicle) {
                    push(&mut self.sinks, WINDOW, at, -climb_mps);
                }
            }
            _ => {}
        }
        self.heard_at = at;
    }

    fn take_imu(&mut self, imu: &Imu) {
        if imu.instance > 0 {
            return;
        }
        if let Some(rates) = imu.rate {
            self.rate = norm(rates.map(|rate| rate.0));
        }
        if let Some(force) = imu.acceleration {
            self.from_above_g = force[2].0 / hums_core::units::GRAVITY;
        }
    }

    fn take_air(&mut self, at: BootMs, air: &Air) {
        let Some(hpa) = air.pressure.map(|it| it.0).filter(|hpa| air.instance == 0 && hpa.is_finite()) else {
            return;
        };
        if self.pressures.back().is_none_or(|(_, before)| before.to_bits() != hpa.to_bits()) {
            self.changed_at = Some(at);
        }
        push(&mut self.pressures, FRESH, at, hpa);
    }

    /// Lost span: the monitor's time stopped.
    pub(super) fn lose(&mut self, span: Millis, monitor: &Monitor, in_mishap: bool) {
        if span >= SILENT && self.silence.is_none() {
            self.begin(self.heard_at - span, monitor, in_mishap);
        }
    }

    fn begin(&mut self, from: BootMs, monitor: &Monitor, in_mishap: bool) {
        if self.armed && monitor.flight().airborne() && !in_mishap {
            self.silence = Some(Silence {
                from,
                last_heard_at: self.heard_at,
                again_at: None,
                state_at: None,
                no_sign_at: self.heard_at,
                altitude_m: monitor.vehicle().global.get().map(|global| global.altitude.0),
                sink_mps: self.sink_mps(self.heard_at),
            });
        }
    }

    /// A step after the monitor's: an alarm that begins or ends.
    pub(super) fn step(
        &mut self,
        now: BootMs,
        monitor: &Monitor,
        in_mishap: bool,
    ) -> Option<(Level, Verdict)> {
        let (vehicle, params) = (monitor.vehicle(), monitor.params());
        if vehicle.kind() == VehicleKind::Surface || vehicle.heartbeat.get().is_none() {
            return None;
        }
        let armed = vehicle.armed() && vehicle.terminated_since.is_none();
        let is_armed_again = armed && !self.armed;
        if is_armed_again {
            (self.stood, self.silence) = (false, None);
        }
        self.armed = armed;
        self.stood |= armed && vehicle.inertial.is_level(now);
        self.note_receiver(now, vehicle);
        if let Some(found) = self.found.take_if(|_| is_armed_again) {
            return Some((Level::Ok, Verdict { at: now, ..found }));
        }
        let found =
            self.judge_first(now, monitor).or_else(|| self.judge_silence(now, monitor, params, in_mishap))?;
        self.found = Some(found);
        Some((Level::Critical, found))
    }

    fn judge_first(&mut self, now: BootMs, monitor: &Monitor) -> Option<Verdict> {
        let since = *self.first_at.get_or_insert(now);
        let passed = now.since(since);
        self.is_known |= passed > FIRST || monitor.flight().airborne();
        let sink_mps = self.sink_mps(now);
        let falls = !self.armed
            && !self.is_known
            && passed > WINDOW
            && sink_mps > monitor.params().get(Param::MisSink)
            && self.is_sinking(now, sink_mps) == Some(true);
        falls.then(|| {
            self.is_known = true;
            Verdict { check: "disarmed_in_air", value: Some(0.0), at: now, from: None }
        })
    }

    fn judge_silence(
        &mut self,
        now: BootMs,
        monitor: &Monitor,
        params: &Params,
        in_mishap: bool,
    ) -> Option<Verdict> {
        let vehicle = monitor.vehicle();
        let Some(mut silence) = self.silence else {
            if now.since(self.heard_at) >= SILENT {
                self.begin(self.heard_at, monitor, in_mishap);
            }
            return None;
        };
        if self.heard_at == silence.last_heard_at {
            return None;
        }
        let again_at = *silence.again_at.get_or_insert(now);
        let tells = |at: Option<BootMs>| at.is_none_or(|at| at.is_after(silence.last_heard_at));
        if tells(vehicle.imu.at()) && tells(vehicle.global.at()) {
            silence.state_at.get_or_insert(now);
        }
        let since = silence.state_at.unwrap_or(again_at);
        let shows = if silence.state_at.is_some() || self.armed { SHOWS } else { STARTS };
        if now.since(again_at) < SETTLED {
            silence.no_sign_at = now;
            self.silence = Some(silence);
            return None;
        }
        self.silence = None;
        if in_mishap || now.since(since) > shows || vehicle.hovers(now) == Some(false) {
            return None;
        }
        match self.sign(now, vehicle, params, &silence) {
            Some((check, value)) if now.since(silence.no_sign_at) >= SIGN_LASTS => {
                let at = if check == IMPACT { again_at } else { now };
                return Some(Verdict { check, value, at, from: Some(silence.from) });
            }
            Some(_) => {}
            None => silence.no_sign_at = now,
        }
        self.silence = Some(silence);
        None
    }

    /// A sign of a crash, and its value.
    fn sign(
        &self,
        now: BootMs,
        vehicle: &Vehicle,
        params: &Params,
        silence: &Silence,
    ) -> Option<(&'static str, Option<f32>)> {
        if vehicle.hovers(now) != Some(true) {
            return None;
        }
        // A disarmed vehicle may set a new home.
        let altitude_m = vehicle.global.within(now, FRESH).map(|global| global.altitude.0);
        let lost_m = silence.altitude_m.zip(altitude_m).map_or(0.0, |(before_m, now_m)| before_m - now_m);
        let least_s = silence.least_s(lost_m.max(0.0), params.get(Param::MisSink), self.armed);
        let lasted = silence.again_at.unwrap_or(now).since(silence.from);
        let had_time = lasted.as_secs_f32() >= least_s;
        let landed = vehicle.landed.within(now, SILENT) == Some(&LandedState::OnGround);
        let part = throttle(now, vehicle);
        let is_off = !self.armed || landed || part.is_some_and(|part| part < IDLE_THROTTLE);
        let is_fast = ground_speed_mps(now, vehicle).is_some_and(|speed_mps| speed_mps > LEANS_MPS);
        let over_deg = vehicle.inertial.lies_over(now).map(f32::to_degrees);
        let may_lie = self.stood && !is_fast && self.rate < STILL_RADPS && !(is_off && had_time);
        if let Some(over_deg) = over_deg.filter(|deg| may_lie && *deg > params.get(Param::MisOverturn)) {
            return Some(("overturned", Some(over_deg)));
        }
        let slow =
            climb_mps(now, vehicle).is_none_or(|climb_mps| climb_mps.abs() < STILL_MPS) || self.rests(now);
        let near_ground = height_m(now, vehicle).is_some_and(|height_m| height_m < NEAR_GROUND_M);
        let in_vain = self.armed
            && (self.lies(now, vehicle) || near_ground)
            && part.is_some_and(|part| part >= FULL_THROTTLE);
        let fell = !has_pilots_throttle(vehicle) && is_off && !had_time;
        (slow && lost_m > CAME_DOWN_M && (in_vain || fell)).then_some((IMPACT, None))
    }

    fn lies(&self, now: BootMs, vehicle: &Vehicle) -> bool {
        let tilts = |attitude: &Attitude| attitude.roll.0.abs().max(attitude.pitch.0.abs()) > TILTED_RAD;
        let is_tilted =
            !vehicle.inertial.contradicts(now) && vehicle.attitude.within(now, FRESH).is_some_and(tilts);
        is_tilted || (vehicle.is_multicopter() && self.from_above_g > ON_BACK_G)
    }

    fn note_receiver(&mut self, now: BootMs, vehicle: &Vehicle) {
        let receiver = vehicle.gnss[0].within(now, FRESH).filter(|gnss| gnss.is_exact());
        let slow = receiver.filter(|gnss| gnss.speed.is_some_and(|speed| speed.0 < STILL_MPS));
        let altitude_m = receiver.and_then(|gnss| gnss.altitude).map_or(0.0, |altitude| altitude.0);
        if slow.is_none() || (altitude_m - self.stands_at_m).abs() > STANDS_M {
            (self.stands_since, self.stands_at_m) = (slow.map(|_| now), altitude_m);
        }
        self.stands_since = self.stands_since.or(slow.map(|_| now));
    }

    fn rests(&self, now: BootMs) -> bool {
        self.stands_since.is_some_and(|since| now.since(since) >= SETTLED)
            && self.is_sinking(now, FALLING_MPS) == Some(false)
    }

    fn sink_mps(&self, now: BootMs) -> f32 {
        let recent = self.sinks.iter().filter(|(at, _)| now.since(*at) <= FRESH);
        recent.fold(0.0, |greatest: f32, (_, sink_mps)| greatest.max(*sink_mps))
    }

    /// `None` if unknown, or constant.
    fn is_sinking(&self, now: BootMs, sink_mps: f32) -> Option<bool> {
        /// The sink may be young; wind and propellers do as much.
        const PART_S: f32 = 0.3;
        const NOISE_M: f32 = 0.8;
        let (at, now_hpa) = *self.pressures.back()?;
        let is_live = now.since(at) <= FRESH && self.changed_at.is_some_and(|at| now.since(at) <= FRESH);
        let (_, before_hpa) =
            self.pressures.iter().find(|(then, _)| at.since(*then) >= Millis::from_secs(1))?;
        is_live.then(|| now_hpa - before_hpa > HPA_PER_METRE * (PART_S * sink_mps).max(NOISE_M))
    }
}

fn push(values: &mut VecDeque<(BootMs, f32)>, span: Millis, at: BootMs, value: f32) {
    values.push_back((at, value));
    while values.front().is_some_and(|(then, _)| at.since(*then) > span) {
        values.pop_front();
    }
}

fn norm(vector: [f32; 3]) -> f32 {
    vector.iter().map(|axis| axis * axis).sum::<f32>().sqrt()
}

#[cfg(test)]
mod tests;
