//! Signs of a mishap in each observation: no weight, shocks, rates, tilt and sink.

use super::disarming::FALLING_MPS;
use super::witness::{INERTIAL, Votes, is_fast, on_rotors};
use super::{DRIVEN, Flight, RECOVERED, Stage, WATCHED};
use crate::derived::load_factor_g;
use crate::gates::LEANS_RAD;
use crate::inertial::LIES;
use crate::mishap::MishapKind;
use crate::modes::{has_pilots_throttle, is_made_to_turn, is_thrown};
use crate::motion::{STILL_MPS, TILTED_RAD, climb_mps, ground_speed_mps, height_m, throttle};
use crate::observation::{Attitude, EstimatorScale, Imu, Observation, VehicleKind};
use crate::parameters::{Param, Params};
use crate::thrust::{FULL, Power};
use crate::time::{BootMs, FRESH, Millis, PAUSE, Stamp};
use crate::units::{GRAVITY, MetresPerSecond2, RadiansPerSecond, norm};
use crate::vehicle::Vehicle;

/// Below this load factor, g, nothing carries the vehicle. A fall with the drag of a quad at its end speed is above it.
const FALL_G: f32 = 0.3;
/// Below this load factor, g, it falls: no multicopter sinks so hard on purpose. A bounce is shorter than the first of these; a fall from
/// half a metre lasts as long as the second.
const UNLOADED_G: f32 = 0.65;
const UNLOADED: Millis = Millis::from_millis(200);
const DROPS: Millis = Millis::from_millis(300);
const BROKEN_OFF: f32 = 0.4;
pub(super) const BREAKS_OFF: Millis = Millis::from_secs(1);
/// A vehicle whose speed broke off thrashes about for so long at most.
const THRASHES: Millis = Millis::from_secs(8);
/// A shock counts if the vehicle lies still within this time.
const AFTER_SHOCK: Millis = Millis::from_secs(4);
/// A shock stops a vehicle that was this fast, m/s.
const IMPACT_MPS: f32 = 3.5;
/// Shock, g, and sink, m/s, of a landing on legs. The fastest landing speed that can be set is 2.5 m/s.
const LEGS_G: f32 = 4.0;
const LEGS_MPS: f32 = 3.0;
/// A plane without throttle that sinks slower than this, m/s, lands and skids. Skids slow down by 8 m/s2 at most: a plane that is faster than
/// the second does not stop within [`BREAKS_OFF`].
const FLARED_MPS: f32 = 2.0;
const SKIDS_MPS: f32 = 15.0;
/// Wings pull out of a dive with so much at most, g: the limit of CS-23 for the aerobatic category.
const PULL_OUT_G: f32 = 6.0;
/// Tumbling and sinking last so long at least.
const LASTS: Millis = Millis::from_millis(500);
/// A roll on wings takes a second.
const TUMBLES_ON_WINGS: Millis = Millis::from_millis(1_500);
/// Rotors that pull downwards for a moment more than level, by the estimator's attitude alone.
const OVERTURNED_DEG: f32 = 100.0;
/// A vehicle may sink so much faster than its setpoint, m/s.
const FOLLOWS_MPS: f32 = 2.0;
/// A vehicle that stalls or has lost a propeller loses so much height with all its thrust, m; gusts take less.
const LOST_M: f32 = 7.0;
/// A vehicle that sinks slower with all its thrust follows a glide path against the wind, m/s.
const GLIDES_MPS: f32 = 1.0;
/// A vehicle that turns by 90 degrees a second is not carried by its thrust, rad/s.
const TURNS_RADPS: f32 = 1.5;
/// All the throttle of a plane, which may need most of it on a steep path against the wind.
const FULL_ON_WINGS: f32 = 0.97;
/// Samples, one after the other, before anything is believed.
const SAMPLES: u8 = 3;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Lasting {
    since: BootMs,
    samples: u8,
    last: BootMs,
}

impl Lasting {
    fn take(&mut self, at: BootMs, so: bool) -> Option<Millis> {
        if !so {
            self.samples = 0;
            return None;
        }
        if self.samples == 0 || at.since(self.last) > PAUSE {
            (self.since, self.samples) = (at, 0);
        }
        self.last = at;
        self.samples = self.samples.saturating_add(1);
        (self.samples >= SAMPLES).then(|| at.since(self.since))
    }

    fn lasts(&self, now: BootMs, span: Millis) -> bool {
        self.samples >= 2 && now.since(self.last) <= PAUSE && now.since(self.since) >= span
    }
}

state! {
    pub(super) struct Signs {
        /// The worst of each sign, in its own unit; 0 for none.
        pub(super) worst: [f32; MishapKind::COUNT],
        pub(super) seen: Option<MishapKind>,
        pub(super) seen_at: BootMs,
        /// Since when an inertial sensor has fallen or turned while the others say that it flies.
        doubted_since: Stamp,
        falls: Lasting,
        unloaded: Lasting,
        tumbles: Lasting,
        overturned: Lasting,
        sinks: Lasting,
    }

    pub(super) struct Peak {
        height_m: Option<f32>,
        at: BootMs,
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shock {
    at: BootMs,
    pub(super) load_g: f32,
    /// Speed just before it, m/s; 0 if the estimator is not to be believed.
    speed_mps: f32,
    pub(super) sink_mps: f32,
    stopped: bool,
    /// Little carried the vehicle just before.
    pub(super) dropped: bool,
    /// It hit something, if it lies still soon.
    pub(super) has_hit: bool,
}

/// Tilt of the estimator's attitude beyond which rotors are overturned, degrees.
pub(crate) fn overturned_deg(params: &Params) -> f32 {
    OVERTURNED_DEG.max(params.get(Param::MisOverturn))
}

impl Flight {
    /// An observation that the vehicle took.
    pub fn observe(&mut self, at: BootMs, vehicle: &Vehicle, observation: &Observation, params: &Params) {
        self.estimate(at, vehicle, observation);
        let watched = self.arming.is_on
            || matches!(self.stage, Stage::Falling | Stage::Impacted)
            || self.arming.off_at.is_some_and(|since| at.since(since) <= WATCHED);
        if !watched || vehicle.kind() == VehicleKind::Surface {
            return;
        }
        if !observation.may_be_of_another_component() {
            self.heard_at = at;
        }
        match observation {
            Observation::Imu(imu) | Observation::ImuAndAir(imu, _) if imu.instance == 0 => {
                self.take_imu(at, imu, vehicle, params);
            }
            Observation::Shock(force) => self.take_shock(at, force.0 / GRAVITY, vehicle, params),
            Observation::Attitude(attitude) => {
                self.take_attitude(at, attitude, vehicle, params);
                if let Some(rates) = attitude.rates {
                    self.take_rates(at, rates, vehicle, params);
                }
            }
            Observation::GlobalPosition(_) | Observation::LocalPosition(_) => {
                self.take_motion(at, vehicle, params);
            }
            _ => {}
        }
    }

    fn take_imu(&mut self, at: BootMs, imu: &Imu, vehicle: &Vehicle, params: &Params) {
        if let Some(acceleration) = imu.acceleration {
            self.take_force(at, acceleration, vehicle, params);
        }
        if let Some(rates) = imu.rate {
            self.take_rates(at, rates, vehicle, params);
        }
    }

    fn estimate(&mut self, at: BootMs, vehicle: &Vehicle, observation: &Observation) {
        match observation {
            Observation::Air(air) | Observation::ImuAndAir(_, air) if air.instance == 0 => {
                if let Some(pressure) = air.pressure {
                    self.pressure.take(at, pressure.0);
                }
            }
            Observation::Hud(_) if self.arming.is_on => {
                let hovers = vehicle.is_multicopter()
                    && self.airborne()
                    && !self.stage.is_mishap()
                    && climb_mps(at, vehicle).is_some_and(|climb_mps| climb_mps.abs() < STILL_MPS)
                    && self.is_clear;
                if let Some(part) = throttle(at, vehicle) {
                    // Many autopilots and logs tell none, which is 0.
                    self.thrust.take(at, part, hovers && part > 0.0);
                }
            }
            _ => {}
        }
    }

    /// Two report flight, none reports standing, and the vehicle does not sink: the inertial sensor is bad.
    pub(super) fn doubt(&mut self, now: BootMs, vehicle: &Vehicle, votes: Votes) {
        let holds = climb_mps(now, vehicle).is_some_and(|climb_mps| climb_mps > -FALLING_MPS)
            && self.pressure.follows(now, -FALLING_MPS) != Some(true);
        let others_fly = (votes.flies & !INERTIAL).count_ones() >= 2 && votes.stands == 0;
        let goes_on = now.since(self.signs.falls.last.later(self.signs.tumbles.last)) <= PAUSE;
        self.signs.doubted_since.run(goes_on && others_fly && holds, now, RECOVERED);
    }

    pub(super) fn see(&mut self, at: BootMs, kind: MishapKind, value: f32, params: &Params) {
        let is_felt = matches!(kind, MishapKind::FreeFall | MishapKind::Tumbling);
        if is_felt && self.signs.doubted_since.older_than(at, RECOVERED) {
            return;
        }
        let value = value.max(params.get(kind.limit()).next_up());
        let worst = &mut self.signs.worst[kind as usize];
        *worst = worst.max(value);
        // A vehicle that was disarmed in the air may tumble first.
        if self.signs.seen.is_none() || kind == MishapKind::Disarmed {
            self.signs.seen = Some(kind);
        }
        self.signs.seen_at = at;
        if kind == MishapKind::Impact && self.stage == Stage::Falling {
            self.stage = Stage::Impacted;
        }
    }

    fn take_force(&mut self, at: BootMs, force: [MetresPerSecond2; 3], vehicle: &Vehicle, params: &Params) {
        let Some(load_g) = load_factor_g(force) else {
            // Without a valid force the vehicle is not at rest.
            self.felt.load_g = Some(f32::INFINITY);
            return;
        };
        // Repeated values and zeros are not measurements.
        if load_g == 0.0 || self.felt.load_g.is_some_and(|before| load_g.to_bits() == before.to_bits()) {
            return;
        }
        self.take_shock(at, load_g, vehicle, params);
        self.felt.at = at;
        (self.felt.load_g, self.felt.from_above_g) = (Some(load_g), force[2].0 / GRAVITY);
        let falls = load_g < FALL_G && on_rotors(at, vehicle) && self.asks_for_thrust(at, vehicle);
        let least_s = params.get(Param::MisFallTime);
        if let Some(span) = self.signs.falls.take(at, falls)
            && span.as_secs_f32() >= least_s
        {
            self.see(at, MishapKind::FreeFall, span.as_secs_f32(), params);
        }
        self.signs.unloaded.take(at, load_g < UNLOADED_G);
        if self.signs.unloaded.lasts(at, UNLOADED)
            && let Some(watch) = &mut self.watch
        {
            watch.is_unloaded = true;
        }
        let limit_deg = params.get(Param::MisOverturn);
        if let Some(tilt_deg) = self.lies_turned(at, vehicle).map(f32::to_degrees)
            && tilt_deg > limit_deg
            && self.thrust.was_driven(at, DRIVEN)
            && on_rotors(at, vehicle)
        {
            self.see(at, MishapKind::Overturned, tilt_deg, params);
        }
    }

    fn take_shock(&mut self, at: BootMs, load_g: f32, vehicle: &Vehicle, params: &Params) {
        if load_g.is_finite() && load_g > params.get(Param::MisImpact) {
            // An impact goes on while the vehicle bounces, or thrashes about.
            let before = self.shock.and_then(|shock| {
                let ends = shock.stopped || shock.dropped || shock.has_hit;
                let thrashes = ends && at.since(self.hit_at) <= THRASHES;
                let at = if at.since(shock.at) <= BREAKS_OFF { shock.at } else { at };
                (at == shock.at || thrashes).then_some(Shock { at, ..shock })
            });
            let shock = before.unwrap_or(Shock {
                at,
                load_g,
                speed_mps: if is_believed(vehicle, params) { self.motion.speed.greatest(at) } else { 0.0 },
                sink_mps: self.motion.sink.greatest(at),
                stopped: false,
                has_hit: false,
                dropped: self.signs.unloaded.lasts(at, DROPS) && on_rotors(at, vehicle),
            });
            if before.is_none() && self.signs.worst[MishapKind::Impact as usize] == 0.0 {
                self.hit_at = at;
            }
            let greatest_g = self.shock.map_or(load_g, |before| before.load_g.max(load_g));
            self.shock = Some(Shock { load_g: greatest_g, ..shock });
            let pulled_out = !on_rotors(at, vehicle) && load_g <= PULL_OUT_G;
            if matches!(self.stage, Stage::Falling | Stage::Impacted) && !pulled_out {
                self.see(at, MishapKind::Impact, load_g, params);
            }
        }
    }

    fn take_rates(&mut self, at: BootMs, rates: [RadiansPerSecond; 3], vehicle: &Vehicle, params: &Params) {
        let rate = norm(rates.map(|rate| rate.0));
        if !rate.is_finite() {
            return;
        }
        self.felt.rate_radps = rate;
        let rate_dps = rate.to_degrees();
        let tumbles = rate_dps > params.get(Param::MisTumble) && !is_made_to_turn(vehicle);
        let least = if on_rotors(at, vehicle) { LASTS } else { TUMBLES_ON_WINGS };
        if self.signs.tumbles.take(at, tumbles).is_some_and(|span| span >= least) {
            self.see(at, MishapKind::Tumbling, rate_dps, params);
        }
    }

    /// No autopilot or pilot asks for rotors that pull downwards, except in modes for it.
    fn take_attitude(&mut self, at: BootMs, attitude: &Attitude, vehicle: &Vehicle, params: &Params) {
        let Attitude { roll, pitch, .. } = attitude;
        let most = attitude.lean_rad();
        if (most > TILTED_RAD || self.felt.rate_radps > TURNS_RADPS) && self.arming.is_on {
            self.tilted_at = Some(at);
        }
        // Below 86 degrees of each, no cosine is asked for: this is done with each attitude.
        let tilts = most > 1.5;
        let tilt_deg =
            if tilts { libm::acosf(libm::cosf(roll.0) * libm::cosf(pitch.0)).to_degrees() } else { 0.0 };
        let over = tilt_deg > overturned_deg(params)
            && self.arming.is_on
            && on_rotors(at, vehicle)
            && !is_made_to_turn(vehicle)
            && self.believes_attitude(at, vehicle);
        if self.signs.overturned.take(at, over).is_some_and(|span| span >= LIES) {
            self.see(at, MishapKind::Overturned, tilt_deg, params);
        }
    }

    fn take_motion(&mut self, at: BootMs, vehicle: &Vehicle, params: &Params) {
        let (Some(climb_mps), Some(ground_mps)) = (climb_mps(at, vehicle), ground_speed_mps(at, vehicle))
        else {
            return;
        };
        let speed_mps = norm([climb_mps, ground_mps]);
        if let Some(shock) = &mut self.shock
            && at.since(shock.at) <= BREAKS_OFF
        {
            shock.stopped |= shock.speed_mps >= IMPACT_MPS && speed_mps < BROKEN_OFF * shock.speed_mps;
        }
        self.motion.speed.take(at, speed_mps);
        // If the sink breaks off in a mishap, the vehicle touched the ground.
        let goes = matches!(self.stage, Stage::Falling | Stage::Impacted);
        let lost = goes && self.motion.has_strayed(at);
        if goes && !lost && -climb_mps < BROKEN_OFF * self.motion.sink.greatest(at) {
            self.touch(at, self.motion.sink.greatest(at));
        }
        self.motion.sink.take(at, -climb_mps);
        if !lost {
            self.take_sink(at, -climb_mps, vehicle, params);
        }
    }

    pub(super) fn touch(&mut self, at: BootMs, sink_mps: f32) {
        if self.pressure.follows(at, -sink_mps) != Some(false) {
            self.touch_mps = self.touch_mps.max(sink_mps);
        }
    }

    fn take_sink(&mut self, at: BootMs, sink_mps: f32, vehicle: &Vehicle, params: &Params) {
        let limit_mps = params.get(Param::MisSink);
        let on_wings = vehicle.hovers(at) == Some(false);
        let least = if on_wings { FULL_ON_WINGS } else { FULL };
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
        let by_display = || is_displayed(at, sink_mps, vehicle);
        let believed = || self.pressure.follows(at, -sink_mps).unwrap_or_else(by_display);
        let sinks = sinks && self.arming.is_on && believed();
        if self.signs.sinks.take(at, sinks).is_some_and(|span| span >= LASTS) {
            self.see(at, MishapKind::Sinking, sink_mps, params);
        }
    }

    fn lose_height(&mut self, at: BootMs, thrust: bool, vehicle: &Vehicle) -> f32 {
        let since_s = at.since(core::mem::replace(&mut self.peak.at, at)).as_secs_f32();
        let height_m = height_m(at, vehicle).filter(|_| thrust && self.arming.is_on);
        let faded_m = self.peak.height_m.map(|peak_m| peak_m - GLIDES_MPS * since_s);
        self.peak.height_m =
            height_m.map(|height_m| faded_m.map_or(height_m, |faded_m| faded_m.max(height_m)));
        self.peak.height_m.zip(height_m).map_or(0.0, |(peak_m, height_m)| peak_m - height_m)
    }

    /// Whether the throttle asks for thrust; not known is yes. Thrown into the air to start (`ArduCopter`'s THROW), it falls.
    fn asks_for_thrust(&self, at: BootMs, vehicle: &Vehicle) -> bool {
        let asks = |part: f32| self.thrust.power(part) != Power::Idle;
        !is_thrown(vehicle) && throttle(at, vehicle).is_none_or(asks)
    }

    /// A shock after which it is still, and nothing carries it in the air.
    pub(super) fn judge_shock(&mut self, now: BootMs, vehicle: &Vehicle, params: &Params) {
        let Some(shock) = self.shock else { return };
        if now.since(shock.at) > AFTER_SHOCK {
            self.shock = None;
            return;
        }
        let power = self.power(now, vehicle);
        let lands = !on_rotors(now, vehicle)
            && shock.sink_mps < FLARED_MPS
            && shock.speed_mps < SKIDS_MPS
            && power.is_none_or(|power| power == Power::Idle);
        let hard = shock.load_g > LEGS_G || shock.sink_mps > LEGS_MPS;
        let has_hit = (shock.stopped && hard && !lands)
            || (shock.dropped && shock.load_g > LEGS_G)
            || (on_rotors(now, vehicle) && self.lies(now, vehicle))
            || self.was_thrown_down(now, vehicle);
        self.shock = Some(Shock { has_hit, ..shock });
        let rests =
            self.is_still(now) && self.still_since.age(now).is_some_and(|age| age <= now.since(shock.at));
        if has_hit && rests && self.hangs_not(now, vehicle, power) {
            self.touch_mps =
                if self.stage.is_mishap() { self.touch_mps.max(shock.sink_mps) } else { shock.sink_mps };
            self.see(now, MishapKind::Impact, shock.load_g, params);
            self.shock = None;
        }
    }

    /// Whether it rests after a shock in an attitude that no landing has.
    pub(super) fn was_thrown_down(&self, now: BootMs, vehicle: &Vehicle) -> bool {
        let is_hard = self.shock.is_some_and(|shock| shock.load_g > LEGS_G);
        is_hard && on_rotors(now, vehicle) && vehicle.inertial.lies_askew(now)
    }

    /// Whether a still vehicle cannot hang in the air: it is off, landed by its own report, on its side, without
    /// thrust or at full thrust.
    fn hangs_not(&self, now: BootMs, vehicle: &Vehicle, power: Option<Power>) -> bool {
        !self.arming.is_on
            || self.calls_itself_landed(now, vehicle)
            || self.lies(now, vehicle)
            || matches!(power, Some(Power::Idle | Power::Full))
    }

    pub(super) fn is_turned_over(&self, now: BootMs, vehicle: &Vehicle, kind: MishapKind) -> bool {
        self.thrust.was_driven(now, DRIVEN)
            && on_rotors(now, vehicle)
            && (kind == MishapKind::Tumbling || self.lies_turned(now, vehicle).is_some())
    }

    /// How far it lies over, rad, if it stood level while it was armed and turned since.
    fn lies_turned(&self, now: BootMs, vehicle: &Vehicle) -> Option<f32> {
        let over = vehicle.inertial.lies_over(now)?;
        let turned = self.arming.stood && !vehicle.inertial.turns_little(now, DRIVEN);
        (turned && !is_fast(now, vehicle)).then_some(over)
    }

    /// Whether nothing carries it just now: a vehicle that flew is in the air, though its autopilot may call it landed.
    pub fn is_unloaded(&self) -> bool {
        self.signs.unloaded.lasts(self.heard_at, UNLOADED)
    }
}

fn is_told_to_sink(at: BootMs, sink_mps: f32, limit_mps: f32, vehicle: &Vehicle) -> bool {
    let wanted_mps = vehicle.climb_wanted.within(at, FRESH).map(|climb| -climb.0);
    wanted_mps.is_some_and(|wanted_mps| wanted_mps > limit_mps && sink_mps < wanted_mps + FOLLOWS_MPS)
}

/// In such a bank all the thrust of a multicopter may not carry it.
fn is_told_to_bank(at: BootMs, vehicle: &Vehicle) -> bool {
    vehicle
        .wanted
        .within(at, FRESH)
        .is_some_and(|[roll, pitch]| vehicle.is_multicopter() && roll.0.abs().max(pitch.0.abs()) > LEANS_RAD)
}

/// True also without a displayed climb, or with zeros only. A receiver that loses its satellites reports a
/// fall that neither barometer nor inertial sensors see.
fn is_displayed(at: BootMs, sink_mps: f32, vehicle: &Vehicle) -> bool {
    const PART: f32 = 0.3;
    let climb_mps = vehicle.hud.within(at, PAUSE).and_then(|hud| hud.climb).map(|climb| climb.0);
    climb_mps
        .filter(|climb_mps| libm::fabsf(*climb_mps) > 0.0)
        .is_none_or(|climb_mps| -climb_mps > PART * sink_mps)
}

/// Whether the estimator's speeds are to be believed, by its own word: shaking sensors mislead it.
fn is_believed(vehicle: &Vehicle, params: &Params) -> bool {
    vehicle.estimator.get().is_none_or(|estimator| {
        let limit = match estimator.scale {
            EstimatorScale::Variance => Param::EkfVarWarn,
            EstimatorScale::TestRatio => Param::EkfRatioCrit,
        };
        let of_motion = [estimator.velocity, estimator.position_vertical].into_iter().flatten();
        of_motion.reduce(f32::max).is_none_or(|worst| worst <= params.get(limit))
    })
}
