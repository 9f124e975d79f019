//! Whether the vehicle was disarmed, or terminated, in the air. It is watched for 3 s.
//!
//! The motors are off: that is one witness. The other is that it is unloaded, loses height, sinks, or glides on. A vehicle that stands within
//! this time, or shows neither, has landed; a terminated one has not, unless it stands.

use super::signs::BREAKS_OFF;
use super::witness::on_rotors;
use super::{BEATS, Flight, WATCHED};
use crate::mishap::Kind;
use crate::motion::{FRESH, STILL_MPS, WINGS_MPS, WindowMax, climb_mps, ground_speed_mps};
use crate::params::{Param, Params};
use crate::time::{Instant, Span};
use crate::vehicle::Vehicle;

/// How long it is watched.
const WATCH: Span = Span::from_secs(3);
/// A vehicle that stands level and slow for so long stands.
const STANDS: Span = Span::from_secs(1);
/// A termination that nobody received is known to be a crash after so long without standing.
const LIES_FOR: Span = Span::from_millis(1_500);
/// A disarmed vehicle that sinks so fast sinks through the air, m/s.
pub(super) const FALLING_MPS: f32 = 2.5;
/// One that is lower by so much fell, m.
const FALLEN_M: f32 = 2.0;
/// A terminated one falls so fast some seconds later, by the air pressure alone, m/s.
const DROPS_MPS: f32 = 10.0;

/// It was disarmed or terminated out of a flight, or was terminated when it was heard first.
#[derive(Clone, Copy, Debug)]
pub(super) struct DisarmWatch {
    since: Instant,
    /// Height above home, m, if that is known.
    pub(super) height_m: Option<f32>,
    /// Height above mean sea level, m.
    altitude_m: Option<f32>,
    /// Nothing has carried it since.
    pub(super) is_unloaded: bool,
    /// It was terminated while nobody listened: the fall may be over.
    is_late: bool,
    /// It stood still and level since, or nobody saw it fly.
    stood: bool,
}

impl Flight {
    /// Its motors went off, by a heartbeat before which others may have been missed; its height was this.
    pub(super) fn note_disarming(
        &mut self,
        now: Instant,
        vehicle: &Vehicle,
        params: &Params,
        height_m: Option<f32>,
        beats_missed: bool,
    ) {
        // Below home there is air too, over a valley. An unknown height may be any, if forces tell of a fall; but on wings a landing rolls on.
        let limit_m = params.get(Param::MisDisarm);
        let is_felt = self.felt_at != Instant::ZERO && on_rotors(now, vehicle);
        let high = height_m.map_or(is_felt, |height_m| height_m.abs() > limit_m);
        // After a landing it idles for a while before an autopilot disarms it.
        let had_thrust = self.thrust.was_driven(now, BEATS).unwrap_or(true);
        if (high && (had_thrust || beats_missed || self.is_unloaded()))
            || self.motion.sink.greatest(now) > FALLING_MPS
        {
            self.watch = Some(DisarmWatch {
                since: now,
                height_m,
                altitude_m: altitude_m(now, vehicle),
                is_unloaded: self.is_unloaded(),
                is_late: beats_missed && vehicle.terminated_since.is_some(),
                stood: false,
            });
        }
    }

    /// It is heard first.
    pub(super) fn note_first(&mut self, now: Instant, vehicle: &Vehicle, powered: bool) {
        self.off_at = (!powered).then_some(now);
        self.first_at = Some(now);
        if vehicle.armed() && !powered {
            self.watch = Some(DisarmWatch {
                since: now,
                height_m: None,
                altitude_m: None,
                is_unloaded: false,
                is_late: false,
                stood: true,
            });
        }
    }

    /// One step of the watch.
    pub(super) fn judge_disarming(&mut self, now: Instant, vehicle: &Vehicle, params: &Params) {
        if self.first_at.is_some_and(|since| self.airborne() || now.since(since) > WATCHED) {
            self.first_at = None;
        }
        let Some(mut watch) = self.watch else { return };
        // A terminated vehicle stays armed.
        let says_so = vehicle.armed() && self.calls_itself_landed(now, vehicle);
        let stands = says_so || self.stands_off(now, vehicle);
        if stands {
            watch.is_late = false;
            // A hover just before the word is level and slow too.
            watch.stood |= self.felt_at.since(watch.since) >= STANDS;
        }
        self.watch = Some(watch);
        if self.was_in_air(now, vehicle, &watch) || (!stands && self.is_lost_off(now, vehicle, &watch)) {
            self.see(now, Kind::Disarmed, watch.height_m.unwrap_or(0.0), params);
        } else if now.since(watch.since) > WATCH || (watch.stood && !vehicle.armed()) {
            self.watch = None;
        }
    }

    fn was_in_air(&self, now: Instant, vehicle: &Vehicle, watch: &DisarmWatch) -> bool {
        let passed = now.since(watch.since);
        // An estimator is shaken by the touch, and may fall on while the vehicle stands.
        let air = |sink_mps: f32| self.pressure.follows(now, -sink_mps) != Some(false);
        let fallen = watch
            .altitude_m
            .zip(altitude_m(now, vehicle))
            .is_some_and(|(before_m, now_m)| now_m < before_m - FALLEN_M && air(FALLING_MPS));
        let sink_mps = self.motion.sink.now(now);
        let sinks = passed > WindowMax::SPAN && sink_mps > FALLING_MPS && air(sink_mps);
        let glides = passed > BREAKS_OFF
            && !on_rotors(now, vehicle)
            && ground_speed_mps(now, vehicle).is_some_and(|speed_mps| speed_mps > WINGS_MPS);
        // An autopilot that lost its estimate terminates the flight, and tells no more of heights and speeds.
        let drops = passed > FRESH && vehicle.armed() && self.pressure.follows(now, -DROPS_MPS) == Some(true);
        watch.is_unloaded || fallen || sinks || glides || drops
    }

    /// Whether it was terminated and did not stand after that. Sensors and speeds that are told no more do not say that it stands.
    fn is_lost_off(&self, now: Instant, vehicle: &Vehicle, watch: &DisarmWatch) -> bool {
        let passed = now.since(watch.since);
        !watch.stood
            && self.felt_at != Instant::ZERO
            && on_rotors(now, vehicle)
            && ((watch.is_late && passed >= LIES_FOR) || (vehicle.armed() && passed > WATCH))
    }

    /// Whether its sensors say that it stands upright and still, and they are alive.
    fn stands_off(&self, now: Instant, vehicle: &Vehicle) -> bool {
        let slow = |speed_mps: Option<f32>| speed_mps.is_some_and(|speed_mps| speed_mps.abs() < STILL_MPS);
        now.since(self.felt_at) <= STANDS
            && vehicle.inertial.is_level_for(now, STANDS)
            && (self.receiver_rests(now)
                || (slow(climb_mps(now, vehicle)) && slow(ground_speed_mps(now, vehicle))))
    }

    /// Whether the receiver has stood for a while, and the pressure does not rise as in a fall.
    pub(super) fn receiver_rests(&self, now: Instant) -> bool {
        self.motion.stands_for(now, STANDS) && self.pressure.follows(now, -FALLING_MPS) == Some(false)
    }
}

/// Height above mean sea level, m: home is another one once it is disarmed.
pub(super) fn altitude_m(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    vehicle.global.within(now, FRESH).map(|global| global.altitude.0)
}
