//! What each observation shows of a mishap.

use super::evidence::{
    BREAKS_OFF, BROKEN_OFF, FRESH, FULL_THROTTLE, Shock, UNCARRIED, is_believed, on_rotors,
};
use super::{Kind, Mishap, State, WATCHED};
use crate::derived::load_factor_g;
use crate::modes::{has_pilots_throttle, is_made_to_turn, is_thrown};
use crate::motion::{climb_mps, ground_speed_mps, height_m, throttle};
use crate::observation::{Air, Attitude, Imu, Observation, VehicleKind};
use crate::params::{Param, Params};
use crate::time::{Instant, Span, Stamp};
use crate::units::{GRAVITY, MetresPerSecond2, RadiansPerSecond, norm};
use crate::vehicle::Vehicle;

/// Below this load factor nothing carries the vehicle. A fall with the drag of a quad at its end speed is above it.
const FALL_G: f32 = 0.3;
/// A vehicle that was disarmed and is carried by less than this for [`UNCARRIED`] falls.
const UNCARRIED_G: f32 = 0.5;
/// What falls is carried by less than this for so long: nobody asks a multicopter to sink so hard, and so short before a touch.
const DROPS_G: f32 = 0.65;
const DROPS: Span = Span::from_millis(300);
/// What broke off a speed thrashes about for so long at most.
const THRASHES: Span = Span::from_secs(8);
/// Tumbling and sinking last so long at least.
const TUMBLES: Span = Span::from_millis(500);
const TUMBLES_ON_WINGS: Span = Span::from_millis(1_500);
const TURNS_OVER: Span = Span::from_millis(700);
/// What is level and still by its sensors for so long is not turned over.
const LEVEL: Span = Span::from_millis(500);
/// Rotors that pull downwards for a moment more than level, by the estimator's attitude alone.
const OVERTURNED_DEG: f32 = 100.0;
const SINKS: Span = Span::from_millis(500);
/// A sink that is wanted so lately, and is followed within this, m/s, is what the autopilot was told to do.
const WANTED_AGE: Span = Span::from_secs(1);
const FOLLOWS_MPS: f32 = 2.0;
/// So much height is lost with all the thrust by what stalls, or has lost a propeller; gusts take less.
const LOST_M: f32 = 7.0;
/// What sinks slower than this with all its thrust follows a glide path against the wind, m/s: a height is forgotten so fast.
const GLIDES_MPS: f32 = 1.0;
/// A bank in which all the thrust may not carry what hangs on rotors, rad.
const BANKS_RAD: f32 = 0.6;
/// 45 degrees, and about 90 degrees a second: what leans so far, or turns so fast, is not carried by its thrust.
const LEANS_RAD: f32 = 0.785;
const TURNS_RADPS: f32 = 1.5;
/// All the throttle of a plane, which may need most of it on a steep path against the wind.
const FULL_ON_WINGS: f32 = 0.97;
/// Wings pull out of a dive with so much at most: the limit of CS-23 for the aerobatic category.
const PULL_OUT_G: f32 = 6.0;

impl Mishap {
    /// Takes an observation that the vehicle took.
    pub(crate) fn observe(
        &mut self,
        at: Instant,
        vehicle: &Vehicle,
        observation: &Observation,
        params: &Params,
    ) {
        let watched = self.armed
            || self.unheard.is_some()
            || matches!(self.state, State::Going(_))
            || self.disarmed_at.is_some_and(|since| at.since(since) <= WATCHED);
        if !watched || vehicle.kind() == VehicleKind::Surface {
            return;
        }
        // A radio, a battery or an engine may be heard while the autopilot is not.
        let of_others = matches!(
            observation,
            Observation::TelemetryRadio(_)
                | Observation::Battery(_)
                | Observation::Escs(_)
                | Observation::Engine(_)
        );
        if !of_others {
            self.heard_at = at;
        }
        match observation {
            Observation::Imu(imu) if imu.instance == 0 => self.take_imu(at, imu, vehicle, params),
            Observation::ImuAndAir(imu, air) => {
                if air.instance == 0 {
                    self.take_pressure(at, air);
                }
                if imu.instance == 0 {
                    self.take_imu(at, imu, vehicle, params);
                }
            }
            Observation::Shock(force) => self.take_shock(at, force.0 / GRAVITY, vehicle, params),
            Observation::Air(air) if air.instance == 0 => self.take_pressure(at, air),
            Observation::Attitude(attitude) => {
                self.take_attitude(at, attitude, vehicle, params);
                if let Some(rates) = attitude.rates {
                    self.take_rates(at, rates, vehicle, params);
                }
            }
            Observation::GlobalPosition(_) | Observation::LocalPosition(_) => {
                self.take_motion(at, vehicle, params);
            }
            Observation::Hud(_) => self.note_throttle(at, vehicle),
            _ => {}
        }
    }

    fn take_imu(&mut self, at: Instant, imu: &Imu, vehicle: &Vehicle, params: &Params) {
        if let Some(acceleration) = imu.acceleration {
            self.take_force(at, acceleration, vehicle, params);
        }
        if let Some(rates) = imu.rate {
            self.take_rates(at, rates, vehicle, params);
        }
    }

    fn take_pressure(&mut self, at: Instant, air: &Air) {
        if let Some(pressure) = air.pressure.filter(|pressure| pressure.0.is_finite()) {
            self.pressure.take(at, pressure.0);
        }
    }

    /// It was seen, with such a value, which is above the limit.
    pub(super) fn see(&mut self, at: Instant, kind: Kind, value: f32, params: &Params) {
        let value = value.max(params.get(kind.limit()).next_up());
        let worst = &mut self.worst[kind as usize];
        *worst = worst.max(value);
        // What was disarmed in the air may tumble.
        if self.seen.is_none() || kind == Kind::Disarmed {
            self.seen = Some(kind);
        }
        if let State::Going(last) = &mut self.state {
            *last = at;
        }
    }

    fn take_force(&mut self, at: Instant, force: [MetresPerSecond2; 3], vehicle: &Vehicle, params: &Params) {
        let Some(load_g) = load_factor_g(force) else {
            // What is no force is no rest either.
            self.load_g = f32::INFINITY;
            return;
        };
        // A sensor that says the same again, or nothing but zeros, is no sensor that flies.
        if load_g == 0.0 || load_g.to_bits() == self.load_g.to_bits() {
            return;
        }
        self.take_shock(at, load_g, vehicle, params);
        self.felt_at = at;
        (self.load_g, self.from_above_g) = (load_g, force[2].0 / GRAVITY);
        if load_g >= DROPS_G {
            self.carried_at = at;
        }
        let falls = load_g < FALL_G && on_rotors(at, vehicle) && self.asks_for_thrust(at, vehicle);
        let least_s = params.get(Param::MisFallTime);
        if let Some(span) = self.falls.take(at, falls)
            && span.as_secs_f32() >= least_s
        {
            self.see(at, Kind::FreeFall, span.as_secs_f32(), params);
        }
        self.uncarried.take(at, load_g < UNCARRIED_G);
        if self.uncarried.lasts(at, UNCARRIED)
            && let Some(doubt) = &mut self.doubt
        {
            doubt.uncarried = true;
        }
        let limit_deg = params.get(Param::MisOverturn);
        if let Some(tilt_deg) = self.lies_turned(at, vehicle).map(f32::to_degrees)
            && tilt_deg > limit_deg
            && self.was_driven(at)
            && on_rotors(at, vehicle)
        {
            self.see(at, Kind::Overturned, tilt_deg, params);
        }
    }

    /// A shock, which may come between two samples.
    fn take_shock(&mut self, at: Instant, load_g: f32, vehicle: &Vehicle, params: &Params) {
        if load_g.is_finite() && load_g > params.get(Param::MisImpact) {
            // What broke off a speed goes on while it bounces, or thrashes about.
            let before = self.shock.and_then(|shock| {
                let goes_on = at.since(shock.at) <= BREAKS_OFF;
                let thrashes = shock.stopped && at.since(self.hit_at) <= THRASHES;
                if goes_on { Some(shock) } else { thrashes.then_some(Shock { at, ..shock }) }
            });
            let shock = before.unwrap_or(Shock {
                at,
                load_g,
                speed_mps: if is_believed(vehicle, params) { self.speed.greatest(at) } else { 0.0 },
                sink_mps: self.sink.greatest(at),
                stopped: false,
                hit: false,
                dropped: self.shock.is_some_and(|shock| shock.dropped)
                    || (self.load_g < DROPS_G
                        && at.since(self.carried_at) >= DROPS
                        && on_rotors(at, vehicle)),
            });
            if self.shock.is_none() && self.worst[Kind::Impact as usize] == 0.0 {
                (self.hit_at, self.unheard_from) = (at, None);
            }
            // The greatest of several: what hits something bounces.
            let greatest_g = self.shock.map_or(load_g, |before| before.load_g.max(load_g));
            self.shock = Some(Shock { load_g: greatest_g, ..shock });
            let pulled_out = !on_rotors(at, vehicle) && load_g <= PULL_OUT_G;
            if matches!(self.state, State::Going(_)) && !pulled_out {
                self.see(at, Kind::Impact, load_g, params);
            }
        }
    }

    fn take_rates(&mut self, at: Instant, rates: [RadiansPerSecond; 3], vehicle: &Vehicle, params: &Params) {
        let rate = norm(rates.map(|rate| rate.0));
        if !rate.is_finite() {
            return;
        }
        self.rate = rate;
        let rate_dps = rate.to_degrees();
        let tumbles = rate_dps > params.get(Param::MisTumble) && !is_made_to_turn(vehicle);
        let least = if on_rotors(at, vehicle) { TUMBLES } else { TUMBLES_ON_WINGS };
        if self.tumbles.take(at, tumbles).is_some_and(|span| span >= least) {
            self.see(at, Kind::Tumbling, rate_dps, params);
        }
    }

    /// Rotors that pull downwards carry nothing: in no mode but those made for it does an autopilot or a pilot ask for that.
    fn take_attitude(&mut self, at: Instant, attitude: &Attitude, vehicle: &Vehicle, params: &Params) {
        let Attitude { roll, pitch, .. } = attitude;
        let most = libm::fabsf(roll.0).max(libm::fabsf(pitch.0));
        if (most > LEANS_RAD || self.rate > TURNS_RADPS) && self.armed {
            self.tilted_at = Stamp::at(at);
        }
        // Below 86 degrees of each, no cosine is asked for: this is done with each attitude.
        let tilts = most > 1.5;
        let tilt_deg =
            if tilts { libm::acosf(libm::cosf(roll.0) * libm::cosf(pitch.0)).to_degrees() } else { 0.0 };
        let over = tilt_deg > OVERTURNED_DEG.max(params.get(Param::MisOverturn))
            && self.armed
            && on_rotors(at, vehicle)
            && !is_made_to_turn(vehicle)
            && !vehicle.inertial.contradicts(at)
            && !vehicle.inertial.is_level_for(at, LEVEL);
        if self.overturned.take(at, over).is_some_and(|span| span >= TURNS_OVER) {
            self.see(at, Kind::Overturned, tilt_deg, params);
        }
    }

    fn take_motion(&mut self, at: Instant, vehicle: &Vehicle, params: &Params) {
        let (Some(climb_mps), Some(ground_mps)) = (climb_mps(at, vehicle), ground_speed_mps(at, vehicle))
        else {
            return;
        };
        let speed_mps = libm::sqrtf(climb_mps * climb_mps + ground_mps * ground_mps);
        if let Some(shock) = &mut self.shock
            && at.since(shock.at) <= BREAKS_OFF
        {
            shock.stopped |= speed_mps < BROKEN_OFF * shock.speed_mps;
        }
        self.speed.take(at, speed_mps);
        // What breaks off in a mishap is the touch, where the estimate is not lost.
        let goes = matches!(self.state, State::Going(_));
        let lost = goes && self.has_strayed(at);
        if goes && !lost && -climb_mps < BROKEN_OFF * self.sink.greatest(at) {
            self.touch(at, self.sink.greatest(at));
        }
        self.sink.take(at, -climb_mps);
        if !lost {
            self.take_sink(at, -climb_mps, vehicle, params);
        }
    }

    /// It touched with this sink, where the air pressure does not contradict it: an estimate that is lost has any speed.
    pub(super) fn touch(&mut self, at: Instant, sink_mps: f32) {
        if self.pressure.agrees(at, sink_mps) != Some(false) {
            self.touch_mps = self.touch_mps.max(sink_mps);
        }
    }

    fn take_sink(&mut self, at: Instant, sink_mps: f32, vehicle: &Vehicle, params: &Params) {
        let limit_mps = params.get(Param::MisSink);
        let on_wings = vehicle.hovers(at) == Some(false);
        let least = if on_wings { FULL_ON_WINGS } else { FULL_THROTTLE };
        let full = throttle(at, vehicle).is_some_and(|part| part >= least);
        let by_hand = has_pilots_throttle(vehicle);
        let told_to = || by_hand || is_told_to_sink(at, sink_mps, limit_mps, vehicle);
        let lost_m = self.lose_height(at, full && !by_hand && !is_told_to_bank(at, vehicle), vehicle);
        let sinks = match vehicle.hovers(at) {
            // It descends as it is told to, but not with all its thrust.
            Some(true) => (sink_mps > limit_mps && (full || !told_to())) || lost_m > LOST_M,
            Some(false) => lost_m > LOST_M,
            None => false,
        };
        let by_display = || is_believed(vehicle, params) && is_displayed(at, sink_mps, vehicle);
        let believed = || self.pressure.agrees(at, sink_mps).unwrap_or_else(by_display);
        let sinks = sinks && self.armed && believed();
        if self.sinks.take(at, sinks).is_some_and(|span| span >= SINKS) {
            self.see(at, Kind::Sinking, sink_mps, params);
        }
    }

    /// How far it is below the highest that it was since it has had all its thrust, but for what a glide path takes.
    fn lose_height(&mut self, at: Instant, thrust: bool, vehicle: &Vehicle) -> f32 {
        let since_s = at.since(core::mem::replace(&mut self.peak_at, at)).as_secs_f32();
        let height_m = height_m(at, vehicle).filter(|_| thrust && self.armed);
        let faded_m = self.peak_m - GLIDES_MPS * since_s;
        self.peak_m = height_m.map_or(f32::NEG_INFINITY, |height_m| faded_m.max(height_m));
        height_m.map_or(0.0, |height_m| self.peak_m - height_m)
    }

    /// Whether the throttle asks for thrust; not known is yes. Thrown into the air to start (`ArduCopter`'s THROW), it falls.
    fn asks_for_thrust(&self, at: Instant, vehicle: &Vehicle) -> bool {
        let asks = |part: f32| part > self.support.idle_throttle() && !self.support.is_little(part);
        !is_thrown(vehicle) && throttle(at, vehicle).is_none_or(asks)
    }
}

/// Whether the autopilot wants it to sink faster than the limit, and it does not sink much faster than that: a mission, a script or an
/// offboard computer asks for it.
fn is_told_to_sink(at: Instant, sink_mps: f32, limit_mps: f32, vehicle: &Vehicle) -> bool {
    let wanted_mps = vehicle.climb_wanted.within(at, WANTED_AGE).map(|climb| -climb.0);
    wanted_mps.is_some_and(|wanted_mps| wanted_mps > limit_mps && sink_mps < wanted_mps + FOLLOWS_MPS)
}

/// Whether the autopilot wants a bank in which all the thrust of a multicopter may not carry it.
fn is_told_to_bank(at: Instant, vehicle: &Vehicle) -> bool {
    vehicle
        .wanted
        .within(at, WANTED_AGE)
        .is_some_and(|[roll, pitch]| vehicle.is_multicopter() && roll.0.abs().max(pitch.0.abs()) > BANKS_RAD)
}

/// Whether the display sinks too; so it is where no climb is displayed, or nothing but zeros. A receiver that loses its satellites tells
/// of a fall that neither the barometer nor the inertial sensors know of.
fn is_displayed(at: Instant, sink_mps: f32, vehicle: &Vehicle) -> bool {
    const PART: f32 = 0.3;
    let climb_mps = vehicle.hud.within(at, FRESH).and_then(|hud| hud.climb).map(|climb| climb.0);
    climb_mps
        .filter(|climb_mps| libm::fabsf(*climb_mps) > 0.0)
        .is_none_or(|climb_mps| -climb_mps > PART * sink_mps)
}
