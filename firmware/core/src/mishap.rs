//! Mishaps: the vehicle falls, hits something, tumbles, is disarmed in the air, or sinks without being told to.
//!
//! A detector of its own, because the checks' gates (in flight, armed, steady) drop them in the very second that matters. It
//! watches each inertial sample while the vehicle is armed, and for 10 s afterwards.
//!
//! | kind | what is seen | where |
//! |---|---|---|
//! | free fall | specific force below 0.3 g for `MIS_FALL_TIME`, and the throttle asks for thrust | on rotors |
//! | impact | a shock above `MIS_IMPACT`, and the speed breaks off or the vehicle lies on its side; then it is still | everywhere |
//! | tumbling | body rates above `MIS_TUMBLE` for half a second, on wings for 1.5 s; not in modes made for it | everywhere |
//! | disarmed in the air | disarmed above `MIS_DISARM_H` or while it sinks; then it falls, sinks or goes on moving | everywhere |
//! | sinking | faster than `MIS_SINK` for half a second; where the pilot has the throttle, at nearly full throttle only | on rotors |
//!
//! ```text
//!        seen in a flight            it lies still, or 10 s after disarming
//! Quiet ------------------> Going ------------------------------------------> Down
//!   ^                         |  still armed and flying, nothing seen for 5 s  |
//!   |<------------------------+------------------------------------------------+
//!                                            armed again
//! ```
//! While it goes on the flight is held open, so that a vehicle that recovers has one flight and not two; `Down` ends it.
//! What is seen while armed but not in a flight (on the bench) is told as [`Change::OnBench`], once for each arming.

mod evidence;
mod told;

pub use told::{Change, Kind, Place, Report};

use crate::derived::GRAVITY;
use crate::flight::{Flight, climb_mps, ground_speed_mps, height_m};
use crate::latest::Reading;
use crate::observation::{Autopilot, LandedState, Observation, VehicleKind};
use crate::params::{Param, Params};
use crate::time::{Instant, Span};
use crate::units::{MetresPerSecond2, RadiansPerSecond};
use crate::vehicle::{LANDED_STATE_AGE, Vehicle};
use evidence::{
    Doubt, Lasting, Recent, Shock, has_pilots_throttle, is_known, is_made_to_turn, is_tilted, on_rotors,
};

/// How long after disarming it is watched.
const WATCHED: Span = Span::from_secs(10);
/// A vehicle that still flies so long after the last thing seen goes on with its flight.
const RECOVERED: Span = Span::from_secs(5);
/// Below this load factor nothing carries the vehicle. A fall with the drag of a quad at its end speed is above it.
const FALL_G: f32 = 0.3;
/// A vehicle that was disarmed and is carried by less than this falls.
const UNCARRIED_G: f32 = 0.5;
/// Tumbling and sinking last so long at least.
const TUMBLES: Span = Span::from_millis(500);
const TUMBLES_ON_WINGS: Span = Span::from_millis(1_500);
const SINKS: Span = Span::from_millis(500);
/// A shock stops something that was this fast.
const IMPACT_MPS: f32 = 4.0;
/// It has broken off when it is below this part of it within [`BREAKS_OFF`].
const BROKEN_OFF: f32 = 0.4;
const BREAKS_OFF: Span = Span::from_secs(1);
/// It is still for [`STILL`] within this time after a shock.
const AFTER_SHOCK: Span = Span::from_secs(4);
const STILL: Span = Span::from_secs(1);
const STILL_MPS: f32 = 1.0;
const STILL_RATE: f32 = 0.3;
/// How long it is seen whether what was disarmed falls.
const FALL_SHOWS: Span = Span::from_secs(3);
const FALLEN_M: f32 = 2.0;
/// What was disarmed and moves so fast is in the air: sinking, and on wings over ground.
const FALLING_MPS: f32 = 2.5;
const GLIDING_MPS: f32 = 8.0;
/// Below this part of the throttle that it hovers with, a fall is what the throttle asks for.
const THRUST_PART: f32 = 0.5;
/// Below this throttle nothing flies; above [`FULL_THROTTLE`] nobody asks to sink, and what is still does not fly.
const IDLE_THROTTLE: f32 = 0.1;
const FULL_THROTTLE: f32 = 0.9;
/// Time constant of the throttle that it hovers with.
const HOVER_S: f32 = 10.0;
/// Older values decide nothing.
const FRESH: Span = Span::from_secs(2);

/// What becomes of the flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fate {
    /// What the vehicle says decides.
    Own,
    /// It stays as it is.
    Held,
    /// It is over.
    Over,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Quiet,
    /// When something was seen last.
    Going(Instant),
    Down,
}

/// The detector.
#[derive(Clone, Copy, Debug)]
pub struct Mishap {
    state: State,
    /// The worst of each kind, in its own unit; 0 for nothing.
    worst: [f32; Kind::COUNT],
    seen: Option<Kind>,
    armed: bool,
    disarmed_at: Option<Instant>,
    /// Disarmed out of a flight: whether it falls is to be seen.
    doubt: Option<Doubt>,
    uncarried: Lasting,
    on_bench: bool,
    falls: Lasting,
    tumbles: Lasting,
    sinks: Lasting,
    still_since: Option<Instant>,
    flies_since: Option<Instant>,
    shock: Option<Shock>,
    speed: Recent,
    sink: Recent,
    /// The fastest sink that broke off in this mishap.
    touch_mps: f32,
    load_g: f32,
    rate: f32,
    /// The last height above home while it was armed.
    height_m: f32,
    hover_throttle: f32,
    /// Where it began, or ended.
    place: Place,
}

impl Default for Mishap {
    fn default() -> Self {
        Self::new()
    }
}

impl Mishap {
    /// Nothing seen.
    pub const fn new() -> Self {
        Self {
            state: State::Quiet,
            worst: [0.0; Kind::COUNT],
            seen: None,
            armed: false,
            disarmed_at: None,
            doubt: None,
            uncarried: Lasting::NOT,
            on_bench: false,
            falls: Lasting::NOT,
            tumbles: Lasting::NOT,
            sinks: Lasting::NOT,
            still_since: None,
            flies_since: None,
            shock: None,
            speed: Recent::NOTHING,
            sink: Recent::NOTHING,
            touch_mps: 0.0,
            load_g: 1.0,
            rate: 0.0,
            height_m: 0.0,
            hover_throttle: 0.0,
            place: Place { position: None, height_m: 0 },
        }
    }

    /// What becomes of the flight while this is so.
    pub(crate) const fn fate(&self) -> Fate {
        match self.state {
            State::Down => Fate::Over,
            State::Going(_) => Fate::Held,
            State::Quiet if self.doubt.is_some() => Fate::Held,
            State::Quiet => Fate::Own,
        }
    }

    /// Whether other checks would only echo it.
    pub(crate) fn is_going(&self) -> bool {
        self.fate() != Fate::Own
    }

    /// What a check reads: the worst of this mishap, 0 while there is none; `None` where the vehicle does not tell enough to see
    /// it.
    pub(crate) fn reading(&self, kind: Kind, now: Instant, vehicle: &Vehicle) -> Option<Reading> {
        let value = self.worst[kind as usize];
        if value > 0.0 {
            return Some(Reading { at: now, value });
        }
        let rotors = !matches!(vehicle.kind(), VehicleKind::Plane | VehicleKind::Surface);
        let Vehicle { imu, attitude, heartbeat, .. } = vehicle;
        let forces = || {
            let known = imu
                .get()
                .and_then(|imu| imu.acceleration)
                .is_some_and(|force| is_known(force.map(|axis| axis.0)));
            imu.at().filter(|_| known)
        };
        let at = match kind {
            Kind::FreeFall => forces().filter(|_| rotors),
            Kind::Impact => forces(),
            Kind::Tumbling => {
                let rates = attitude.get().and_then(|attitude| attitude.rates);
                attitude.at().filter(|_| rates.is_some_and(|rates| is_known(rates.map(|rate| rate.0))))
            }
            Kind::Disarmed => heartbeat.at(),
            Kind::Sinking => climb_mps(now, vehicle).filter(|_| rotors).map(|_| now),
        };
        Reading::new(at.filter(|_| vehicle.kind() != VehicleKind::Surface), Some(0.0))
    }

    /// Takes an observation that the vehicle took.
    pub(crate) fn observe(
        &mut self,
        at: Instant,
        vehicle: &Vehicle,
        observation: &Observation,
        params: &Params,
    ) {
        let watched = self.armed || self.disarmed_at.is_some_and(|since| at.since(since) <= WATCHED);
        if !watched || vehicle.kind() == VehicleKind::Surface {
            return;
        }
        match observation {
            Observation::Imu(imu) | Observation::ImuAndAir(imu, _) if imu.instance == 0 => {
                if let Some(acceleration) = imu.acceleration {
                    self.take_force(at, acceleration, vehicle, params);
                }
                if let Some(rates) = imu.rate {
                    self.take_rates(at, rates, vehicle, params);
                }
            }
            Observation::Attitude(attitude) => {
                if let Some(rates) = attitude.rates {
                    self.take_rates(at, rates, vehicle, params);
                }
            }
            Observation::GlobalPosition(_) | Observation::LocalPosition(_) => {
                self.take_motion(at, vehicle, params);
            }
            Observation::Hud(_) => self.take_throttle(at, vehicle),
            _ => {}
        }
    }

    fn see(&mut self, at: Instant, kind: Kind, value: f32) {
        let worst = &mut self.worst[kind as usize];
        *worst = worst.max(value);
        self.seen.get_or_insert(kind);
        if let State::Going(last) = &mut self.state {
            *last = at;
        }
    }

    fn take_force(&mut self, at: Instant, force: [MetresPerSecond2; 3], vehicle: &Vehicle, params: &Params) {
        let [x, y, z] = force.map(|axis| axis.0);
        let load_g = libm::sqrtf(x * x + y * y + z * z) / GRAVITY;
        // A sensor that says the same again, or nothing but zeros, is no sensor that flies.
        if !load_g.is_finite() || load_g == 0.0 || load_g.to_bits() == self.load_g.to_bits() {
            return;
        }
        self.load_g = load_g;
        let falls = load_g < FALL_G && on_rotors(at, vehicle) && self.asks_for_thrust(at, vehicle);
        let least_s = params.get(Param::MisFallTime);
        if let Some(span) = self.falls.take(at, falls)
            && span.as_secs_f32() >= least_s
        {
            self.see(at, Kind::FreeFall, span.as_secs_f32().max(least_s.next_up()));
        }
        self.uncarried.take(at, load_g < UNCARRIED_G && self.doubt.is_some());
        if load_g > params.get(Param::MisImpact) {
            let before = self.shock.filter(|shock| at.since(shock.at) <= BREAKS_OFF);
            let shock = before.unwrap_or(Shock {
                at,
                load_g,
                speed_mps: self.speed.greatest(),
                sink_mps: self.sink.greatest(),
                stopped: false,
            });
            self.shock = Some(Shock { load_g: shock.load_g.max(load_g), ..shock });
            if matches!(self.state, State::Going(_)) {
                self.see(at, Kind::Impact, load_g);
            }
        }
    }

    fn take_rates(&mut self, at: Instant, rates: [RadiansPerSecond; 3], vehicle: &Vehicle, params: &Params) {
        let [x, y, z] = rates.map(|rate| rate.0);
        let rate = libm::sqrtf(x * x + y * y + z * z);
        if !rate.is_finite() {
            return;
        }
        self.rate = rate;
        let rate_dps = rate.to_degrees();
        let tumbles = rate_dps > params.get(Param::MisTumble) && !is_made_to_turn(vehicle);
        let least = if on_rotors(at, vehicle) { TUMBLES } else { TUMBLES_ON_WINGS };
        if self.tumbles.take(at, tumbles).is_some_and(|span| span >= least) {
            self.see(at, Kind::Tumbling, rate_dps);
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
        if vehicle.armed() {
            self.height_m = height_m(at, vehicle).unwrap_or(0.0);
        }
        // What breaks off in a mishap is the touch.
        if -climb_mps < BROKEN_OFF * self.sink.greatest() && matches!(self.state, State::Going(_)) {
            self.touch_mps = self.touch_mps.max(self.sink.greatest());
        }
        self.sink.take(at, -climb_mps);
        let limit_mps = params.get(Param::MisSink);
        let throttle = vehicle.hud.within(at, FRESH).and_then(|hud| hud.throttle).map(|throttle| throttle.0);
        let told_to =
            has_pilots_throttle(vehicle) && throttle.is_none_or(|throttle| throttle < FULL_THROTTLE);
        let sinks = -climb_mps > limit_mps && on_rotors(at, vehicle) && !told_to && self.armed;
        if self.sinks.take(at, sinks).is_some_and(|span| span >= SINKS) {
            self.see(at, Kind::Sinking, -climb_mps);
        }
    }

    /// The throttle that it hovers with, smoothed.
    fn take_throttle(&mut self, at: Instant, vehicle: &Vehicle) {
        let throttle = vehicle.hud.get().and_then(|hud| hud.throttle).map_or(0.0, |throttle| throttle.0);
        let hovers = climb_mps(at, vehicle).is_some_and(|climb_mps| climb_mps.abs() < 1.0);
        if hovers && throttle > IDLE_THROTTLE && self.state == State::Quiet {
            let weight = if self.hover_throttle > 0.0 { 0.25 / HOVER_S } else { 1.0 };
            self.hover_throttle += weight * (throttle - self.hover_throttle);
        }
    }

    /// Whether the throttle asks for thrust; not known is yes. Thrown into the air to start (`ArduCopter`'s THROW), it falls.
    fn asks_for_thrust(&self, at: Instant, vehicle: &Vehicle) -> bool {
        const THROW: u32 = 18;
        let throttle = vehicle.hud.within(at, FRESH).and_then(|hud| hud.throttle);
        let least = (THRUST_PART * self.hover_throttle).max(IDLE_THROTTLE);
        let thrown = vehicle
            .heartbeat
            .get()
            .is_some_and(|heartbeat| heartbeat.autopilot == Autopilot::ArduPilot && heartbeat.mode == THROW);
        !thrown && throttle.is_none_or(|throttle| throttle.0 > least)
    }

    /// One step, at least every 50 ms, before the flight's own.
    pub(crate) fn step(
        &mut self,
        now: Instant,
        vehicle: &Vehicle,
        flight: &Flight,
        params: &Params,
    ) -> Option<Change> {
        self.note_arming(now, vehicle, flight, params);
        self.note_rest(now, vehicle);
        self.doubted(now, vehicle, params);
        self.shocked(now, vehicle);
        let seen = self.seen.take();
        match (self.state, seen) {
            (State::Quiet, Some(kind)) if flight.is_open() => {
                self.state = State::Going(now);
                let mut place = Place::of(now, vehicle);
                if let (Kind::Disarmed, Some(doubt)) = (kind, self.doubt.take()) {
                    place.height_m = doubt.height_m as i16;
                }
                self.doubt = None;
                self.place = place;
                Some(Change::Began(kind))
            }
            (State::Quiet, Some(kind)) => {
                self.worst = [0.0; Kind::COUNT];
                let told = core::mem::replace(&mut self.on_bench, true);
                (!told).then_some(Change::OnBench(kind))
            }
            (State::Going(last), _) => self.goes(now, last, vehicle),
            (State::Down, _) if self.flies_since.is_some_and(|since| now.since(since) >= RECOVERED) => {
                self.calm();
                Some(Change::FliesOn)
            }
            _ => None,
        }
    }

    fn calm(&mut self) {
        *self = Self {
            armed: self.armed,
            disarmed_at: self.disarmed_at,
            on_bench: self.on_bench,
            hover_throttle: self.hover_throttle,
            ..Self::new()
        };
    }

    fn note_arming(&mut self, now: Instant, vehicle: &Vehicle, flight: &Flight, params: &Params) {
        let armed = vehicle.armed();
        if armed && !self.armed && self.state != State::Quiet && self.disarmed_at.is_some() {
            // Armed again in the air it flies on; on the ground another flight begins.
            if self.state == State::Down {
                self.calm();
            }
        }
        if armed && !self.armed {
            (self.on_bench, self.disarmed_at, self.doubt) = (false, None, None);
        }
        if self.armed && !armed {
            self.disarmed_at = Some(now);
            // The height of before: PX4's is 0 from the disarming on.
            let high = self.height_m > params.get(Param::MisDisarm) || self.sink.greatest() > FALLING_MPS;
            // The autopilot may have called it landed because it is disarmed.
            if high && flight.is_open() && self.state == State::Quiet {
                let altitude_m = vehicle.global.within(now, FRESH).map(|global| global.altitude.0);
                self.doubt = Some(Doubt { since: now, height_m: self.height_m, altitude_m });
            }
        }
        self.armed = armed;
    }

    /// Since when it has been still, and since when it has moved as what flies.
    fn note_rest(&mut self, now: Instant, vehicle: &Vehicle) {
        let speed_mps =
            ground_speed_mps(now, vehicle).unwrap_or(0.0).max(climb_mps(now, vehicle).map_or(0.0, f32::abs));
        // Of what was disarmed, or has hit something, the sensors are believed and not the estimate.
        let slow = speed_mps < STILL_MPS
            || (!self.armed && on_rotors(now, vehicle))
            || (self.worst[Kind::Impact as usize] > 0.0 && self.rate < STILL_RATE / 3.0);
        let still = slow && self.rate < STILL_RATE && (0.7..1.3).contains(&self.load_g);
        self.still_since = if still { self.still_since.or(Some(now)) } else { None };
        let flies = self.armed && speed_mps > 2.0 * STILL_MPS && !is_tilted(vehicle);
        self.flies_since = if flies { self.flies_since.or(Some(now)) } else { None };
    }

    fn is_still(&self, now: Instant) -> bool {
        self.still_since.is_some_and(|since| now.since(since) >= STILL)
    }

    /// Disarmed out of a flight: what falls, sinks or glides on was disarmed in the air.
    fn doubted(&mut self, now: Instant, vehicle: &Vehicle, params: &Params) {
        let Some(Doubt { since, height_m, altitude_m }) = self.doubt else { return };
        let fallen =
            |before: f32| vehicle.global.get().is_some_and(|global| global.altitude.0 < before - FALLEN_M);
        let sinks = self.sink.now > FALLING_MPS && now.since(since) > Recent::WINDOW;
        let glides = !on_rotors(now, vehicle)
            && now.since(since) > BREAKS_OFF
            && ground_speed_mps(now, vehicle).is_some_and(|speed_mps| speed_mps > GLIDING_MPS);
        if self.uncarried.samples >= 2 || sinks || glides || altitude_m.is_some_and(fallen) {
            self.see(now, Kind::Disarmed, height_m.max(params.get(Param::MisDisarm).next_up()));
        } else if now.since(since) > FALL_SHOWS {
            self.doubt = None;
        }
    }

    /// A shock after which it is still, and does not hang in the air.
    fn shocked(&mut self, now: Instant, vehicle: &Vehicle) {
        let Some(shock) = self.shock else { return };
        if now.since(shock.at) > AFTER_SHOCK {
            self.shock = None;
            return;
        }
        let hit = (shock.speed_mps >= IMPACT_MPS && shock.stopped)
            || (on_rotors(now, vehicle) && is_tilted(vehicle));
        let rests = self.still_since.is_some_and(|since| since >= shock.at && now.since(since) >= STILL);
        if hit && rests && self.is_idle(now, vehicle) {
            self.touch_mps = self.touch_mps.max(shock.sink_mps);
            self.see(now, Kind::Impact, shock.load_g);
            self.shock = None;
        }
    }

    /// Whether what is still does not hang in the air: disarmed, on the ground, on its side, without throttle or with all of it.
    fn is_idle(&self, now: Instant, vehicle: &Vehicle) -> bool {
        let throttle = vehicle.hud.within(now, FRESH).and_then(|hud| hud.throttle);
        !self.armed
            || vehicle.landed.within(now, LANDED_STATE_AGE) == Some(&LandedState::OnGround)
            || is_tilted(vehicle)
            || throttle.is_some_and(|throttle| !(IDLE_THROTTLE..FULL_THROTTLE).contains(&throttle.0))
    }

    fn goes(&mut self, now: Instant, last: Instant, vehicle: &Vehicle) -> Option<Change> {
        let long = now.since(last) >= RECOVERED;
        let silent = vehicle.heartbeat.within(now, RECOVERED).is_none();
        let near_ground = height_m(now, vehicle).is_some_and(|height_m| height_m < 2.0);
        let down = (self.is_still(now) && (self.is_idle(now, vehicle) || (long && near_ground)))
            || (long && silent)
            || self.disarmed_at.is_some_and(|since| !self.armed && now.since(since) >= WATCHED);
        if down {
            self.state = State::Down;
            self.touch_mps = self.touch_mps.max(self.sink.greatest());
            self.place = Place::of(now, vehicle);
            return Some(Change::Down);
        }
        if long && self.armed {
            self.calm();
            return Some(Change::FliesOn);
        }
        None
    }

    /// What the ground is told of a change, at the tick of it.
    pub fn report(&self, change: Change) -> Report {
        Report { change, place: self.place, touch: (self.touch_mps * 10.0) as u16 }
    }

    /// The height above home of the last place that was told, metres.
    pub const fn height_m(&self) -> i16 {
        self.place.height_m
    }

    /// How fast it touched, m/s.
    pub(crate) const fn touch_mps(&self) -> f32 {
        self.touch_mps
    }
}
