//! Whether what was disarmed, or terminated, was so in the air.

use super::evidence::{
    BREAKS_OFF, Doubt, FALL_SHOWS, FALLING_MPS, FRESH, Recent, calls_itself_landed, on_rotors,
};
use super::{BEATS, Kind, LIES_FOR, Mishap, STILL, STILL_MPS, WATCHED};
use crate::motion::{climb_mps, ground_speed_mps};
use crate::params::{Param, Params};
use crate::time::Instant;
use crate::vehicle::Vehicle;

/// What is lower by so much fell.
const FALLEN_M: f32 = 2.0;
/// On wings, over ground.
const GLIDING_MPS: f32 = 8.0;
/// What was terminated falls so fast some seconds later, by the air pressure alone.
const DROPS_MPS: f32 = 10.0;

impl Mishap {
    /// Its motors went off, by a heartbeat before which others may have been missed; its height was this.
    pub(super) fn note_disarming(
        &mut self,
        now: Instant,
        vehicle: &Vehicle,
        params: &Params,
        height_m: Option<f32>,
        beats_missed: bool,
    ) {
        // Below home there is air too, over a valley. A height that nobody knows may be any, where
        // forces say what becomes of it; but on wings a landing rolls on.
        let limit_m = params.get(Param::MisDisarm);
        let is_felt = self.felt_at != Instant::ZERO && on_rotors(now, vehicle);
        let high = height_m.map_or(is_felt, |height_m| height_m.abs() > limit_m);
        // What has landed idles for a while before an autopilot disarms it.
        let had_thrust = self.driven_at == Instant::ZERO || now.since(self.driven_at) <= BEATS;
        if (high && (had_thrust || beats_missed || self.is_uncarried()))
            || self.sink.greatest(now) > FALLING_MPS
        {
            self.doubt = Some(Doubt {
                since: now,
                height_m,
                altitude_m: vehicle.global.within(now, FRESH).map(|global| global.altitude.0),
                uncarried: self.is_uncarried(),
                unseen: beats_missed && vehicle.terminated_since.is_some(),
                stood: false,
            });
        }
    }

    /// It is heard first.
    pub(super) fn note_first(&mut self, now: Instant, vehicle: &Vehicle, armed: bool) {
        self.disarmed_at = (!armed).then_some(now);
        self.first_at = Some(now);
        // Terminated.
        if vehicle.armed() && !armed {
            let doubt = Doubt {
                since: now,
                height_m: None,
                altitude_m: None,
                uncarried: false,
                unseen: false,
                stood: true,
            };
            self.doubt = Some(doubt);
        }
    }

    /// What falls, sinks or glides on was disarmed in the air, and what was terminated there, if it does not stand.
    pub(super) fn judge_disarming(&mut self, now: Instant, vehicle: &Vehicle, params: &Params) {
        self.judge_first(now, params);
        // What was terminated stays armed, and its autopilot's word that it stands is not of that.
        let says_so = |since| {
            vehicle.armed()
                && vehicle.landed.at().is_some_and(|at| at.is_after(since))
                && calls_itself_landed(now, vehicle)
        };
        let Some(Doubt { since, .. }) = self.doubt else { return };
        let stands = says_so(since) || self.stands(now, vehicle);
        let Some(doubt) = &mut self.doubt else { return };
        if stands {
            doubt.unseen = false;
            // A hover just before the word is level and slow too.
            doubt.stood |= self.felt_at.since(since) >= STILL;
        }
        let doubt = *doubt;
        let over = now.since(since) > FALL_SHOWS;
        if self.was_in_air(now, vehicle, &doubt) || self.is_lost(now, vehicle, &doubt, stands) {
            self.see(now, Kind::Disarmed, doubt.height_m.unwrap_or(0.0), params);
        } else if over || (doubt.stood && !vehicle.armed()) {
            self.doubt = None;
        }
    }

    /// What is disarmed and was not seen to fly must fall faster than anything is carried down.
    fn judge_first(&mut self, now: Instant, params: &Params) {
        let Some(since) = self.first_at else { return };
        let sink_mps = self.sink.now(now);
        let falls = !self.armed
            && sink_mps > params.get(Param::MisSink)
            && self.pressure.agrees(now, sink_mps) == Some(true);
        if falls && now.since(since) > Recent::WINDOW {
            self.see(now, Kind::Disarmed, 0.0, params);
        } else if self.support.flies || now.since(since) > WATCHED {
            self.first_at = None;
        }
    }

    fn was_in_air(&self, now: Instant, vehicle: &Vehicle, doubt: &Doubt) -> bool {
        let passed = now.since(doubt.since);
        // An estimator is shaken by the touch, and may fall on while the vehicle stands.
        let air = |sink_mps: f32| self.pressure.agrees(now, sink_mps) != Some(false);
        let altitude_m = vehicle.global.within(now, FRESH).map(|global| global.altitude.0);
        let fallen = doubt
            .altitude_m
            .zip(altitude_m)
            .is_some_and(|(before_m, now_m)| now_m < before_m - FALLEN_M && air(FALLING_MPS));
        let sink_mps = self.sink.now(now);
        let sinks = passed > Recent::WINDOW && sink_mps > FALLING_MPS && air(sink_mps);
        let glides = passed > BREAKS_OFF
            && !on_rotors(now, vehicle)
            && ground_speed_mps(now, vehicle).is_some_and(|speed_mps| speed_mps > GLIDING_MPS);
        // An autopilot that lost its estimate terminates the flight, and tells no more of heights and speeds.
        let drops = passed > FRESH && vehicle.armed() && self.pressure.agrees(now, DROPS_MPS) == Some(true);
        doubt.uncarried || fallen || sinks || glides || drops
    }

    /// Whether it was terminated and does not stand after that. Sensors and speeds that were told and are no more are no word that it
    /// stands.
    fn is_lost(&self, now: Instant, vehicle: &Vehicle, doubt: &Doubt, stands: bool) -> bool {
        let watched = !doubt.stood && self.felt_at != Instant::ZERO && on_rotors(now, vehicle);
        let passed = now.since(doubt.since);
        let shows = (doubt.unseen && passed >= LIES_FOR) || (vehicle.armed() && passed > FALL_SHOWS);
        watched && !stands && shows
    }

    /// Whether its sensors say that it stands upright and still, and they are alive.
    fn stands(&self, now: Instant, vehicle: &Vehicle) -> bool {
        let slow = |speed_mps: Option<f32>| speed_mps.is_some_and(|speed_mps| speed_mps.abs() < STILL_MPS);
        now.since(self.felt_at) <= STILL
            && vehicle.inertial.is_level_for(now, STILL)
            && (self.rests(now) || (slow(climb_mps(now, vehicle)) && slow(ground_speed_mps(now, vehicle))))
    }
}
