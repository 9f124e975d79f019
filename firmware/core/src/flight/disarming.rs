//! Whether the vehicle was disarmed, or terminated, in the air. It is watched for 3 s.
//!
//! The motors are off: that is one witness. The other is that it is unloaded, loses height, sinks, or glides on. A vehicle that stands within
//! this time, or shows neither, has landed; a terminated one has not, unless it stands.

use super::witness::on_rotors;
use super::{Flight, STILL};
use crate::mishap::MishapKind;
use crate::motion::{STILL_MPS, WINGS_MPS, WindowMax, climb_mps, ground_speed_mps};
use crate::parameters::{Param, Params};
use crate::time::{BootMs, Millis, PAUSE};
use crate::vehicle::Vehicle;

const WATCH: Millis = Millis::from_secs(3);
/// A disarmed vehicle that sinks so fast sinks through the air, m/s.
pub(super) const FALLING_MPS: f32 = 2.5;
/// A disarmed vehicle that is lower by this height fell, m.
const FALLEN_M: f32 = 2.0;
/// The sink of a terminated vehicle some seconds later, by the air pressure alone, m/s.
const DROPS_MPS: f32 = 10.0;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DisarmWatch {
    since: BootMs,
    pub(super) height_m: Option<f32>,
    /// Height above mean sea level, m.
    altitude_m: Option<f32>,
    pub(super) is_unloaded: bool,
    stood: bool,
}

impl Flight {
    pub(super) fn note_disarming(
        &mut self,
        now: BootMs,
        vehicle: &Vehicle,
        params: &Params,
        height_m: Option<f32>,
    ) {
        // A valley below home has air too. At an unknown height rotorcraft are watched if their forces are measured; a plane rolls on after a
        // landing.
        let is_felt = self.felt.at != BootMs::ZERO && on_rotors(now, vehicle);
        let is_high = height_m.map_or(is_felt, |height_m| height_m.abs() > params.get(Param::MisDisarm));
        if is_high || self.motion.sink.greatest(now) > FALLING_MPS {
            self.watch = Some(DisarmWatch {
                since: now,
                height_m,
                altitude_m: altitude_m(now, vehicle),
                is_unloaded: self.is_unloaded(),
                stood: false,
            });
        }
    }

    pub(super) fn judge_disarming(&mut self, now: BootMs, vehicle: &Vehicle, params: &Params) {
        let Some(mut watch) = self.watch else { return };
        // A terminated vehicle stays armed.
        let says_so = vehicle.armed() && self.calls_itself_landed(now, vehicle);
        let stands = says_so || self.stands_off(now, vehicle);
        // A hover just before the word is level and slow too.
        watch.stood |= stands && self.felt.at.since(watch.since) >= STILL;
        self.watch = Some(watch);
        if self.was_in_air(now, vehicle, &watch) || (!stands && self.is_lost_off(now, vehicle, &watch)) {
            self.see(now, MishapKind::Disarmed, watch.height_m.unwrap_or(0.0), params);
        } else if now.since(watch.since) > WATCH || (watch.stood && !vehicle.armed()) {
            self.watch = None;
        }
    }

    fn was_in_air(&self, now: BootMs, vehicle: &Vehicle, watch: &DisarmWatch) -> bool {
        let passed = now.since(watch.since);
        let is_lower = watch
            .altitude_m
            .zip(altitude_m(now, vehicle))
            .is_some_and(|(before_m, now_m)| now_m < before_m - FALLEN_M);
        let sinks = passed > WindowMax::SPAN && self.motion.sink.now(now) > FALLING_MPS;
        // An estimator is shaken by the touch, and may fall on while the vehicle stands.
        let falls = (is_lower || sinks) && self.pressure.follows(now, -FALLING_MPS) != Some(false);
        // A plane that rolls on after its landing keeps its height.
        let glides = is_lower
            && !on_rotors(now, vehicle)
            && ground_speed_mps(now, vehicle).is_some_and(|speed_mps| speed_mps > WINGS_MPS);
        // An autopilot that lost its estimate terminates the flight, and tells no more of heights and speeds.
        let drops = passed > PAUSE && vehicle.armed() && self.pressure.follows(now, -DROPS_MPS) == Some(true);
        watch.is_unloaded || falls || glides || drops
    }

    /// Whether it was terminated and did not stand after that. Sensors and speeds that are told no more do not say that it stands.
    fn is_lost_off(&self, now: BootMs, vehicle: &Vehicle, watch: &DisarmWatch) -> bool {
        !watch.stood
            && self.felt.at != BootMs::ZERO
            && on_rotors(now, vehicle)
            && vehicle.armed()
            && now.since(watch.since) > WATCH
    }

    /// Whether it has been level and still for a second, and slow.
    pub(crate) fn stands_off(&self, now: BootMs, vehicle: &Vehicle) -> bool {
        let slow = |speed_mps: Option<f32>| speed_mps.is_some_and(|speed_mps| speed_mps.abs() < STILL_MPS);
        now.since(self.felt.at) <= STILL
            && vehicle.inertial.is_level_for(now, STILL)
            && slow(climb_mps(now, vehicle))
            && slow(ground_speed_mps(now, vehicle))
    }
}

/// Height above mean sea level, m: home is another one once it is disarmed.
pub(super) fn altitude_m(now: BootMs, vehicle: &Vehicle) -> Option<f32> {
    vehicle.global.within(now, PAUSE).map(|global| global.altitude.0)
}
