//! Mishaps: the vehicle falls, hits something, tumbles, is disarmed in the air, or sinks without being told to.
//!
//! A detector of its own, because the checks' gates (in flight, armed, steady) drop them in the very second that matters. It
//! watches each inertial sample while the vehicle is armed, and for 10 s afterwards.
//!
//! | kind | what is seen | where |
//! |---|---|---|
//! | free fall | specific force below 0.3 g for `MIS_FALL_TIME`, and the throttle asks for thrust | on rotors |
//! | impact | a shock above `MIS_IMPACT`, and the speed breaks off harder than legs take it or the vehicle lies on its side; then it is still | everywhere |
//! | | a shock above 4 g of what little had carried for 0.3 s (it fell) | on rotors |
//! | | a shock, and within 4 s it is overturned | on rotors |
//! | | what comes down slowly without throttle, slower than 15 m/s, lands and skids | on wings |
//! | tumbling | body rates above `MIS_TUMBLE` for half a second, on wings for 1.5 s; not in modes made for it | everywhere |
//! | disarmed in the air | disarmed or terminated further than `MIS_DISARM_H` from home or while it sinks; then it falls, sinks or goes on moving | everywhere |
//! | | terminated, in a silence too, and does not stand after it | on rotors |
//! | | disarmed or terminated when it is heard first, and falls | everywhere |
//! | overturned | its top looks down, by more than 100 degrees of tilt, for 0.7 s; not in modes made for it | on rotors |
//! | | it lies over by more than `MIS_OVERTURN`, by the force that carries it, within 5 s of throttle, and is slower than 12 m/s | on rotors |
//! | sinking | faster than `MIS_SINK` for half a second; where the pilot has the throttle, at nearly full throttle only | on rotors |
//! | | 7 m lost, faster than 1 m/s, at full throttle, where the autopilot has it and wants no steep bank | everywhere |
//!
//! What came down while it was not heard for 5 s or more is told within 2.4 s after that: it lies over (overturned); it does not rise with
//! all its throttle, far below where it was heard last, or it came down faster than anything lands (impact, of which no shock is known).
//!
//! ```text
//!        seen in a flight         it lies still, or is disarmed and sinks no more
//! Quiet ------------------> Going ------------------------------------------> Down
//!   ^                         |  still armed and flying, nothing seen for 5 s  |
//!   |<------------------------+------------------------------------------------+
//!                                            armed again
//! ```
//! While it goes on the flight is held open, so that a vehicle that recovers has one flight and not two; `Down` ends it.
//! What is seen while armed but not in a flight (on the bench) is told as [`Change::OnBench`], once for each arming; but what its own
//! rotors turned over is a mishap, though it never flew.
//!
//! An estimator may be wrong. No attitude counts which the accelerometer and the gyros contradict ([`crate::inertial`]), and no
//! vertical speed which the air pressure contradicts.

mod disarming;
mod evidence;
mod sight;
mod silence;
mod support;
mod told;

pub use told::{Change, Kind, Place, Report};

use crate::flight::Flight;
use crate::latest::Reading;
use crate::motion::{climb_mps, ground_speed_mps, height_m, throttle};
use crate::observation::VehicleKind;
use crate::params::Params;
use crate::time::{Instant, Span, Stamp};
use crate::vehicle::Vehicle;
use evidence::{
    Doubt, FALL_SHOWS, FALLING_MPS, FRESH, FULL_THROTTLE, Lasting, Pressure, Recent, Shock, Support,
    UNCARRIED, Unheard, calls_itself_landed, is_known, is_near_ground, is_off_ground, is_tilted, on_rotors,
};

/// How long after disarming it is watched.
const WATCHED: Span = Span::from_secs(10);
/// From 500 m at 4 m/s.
const FALLS_AT_MOST: Span = Span::from_secs(120);
/// A vehicle that still flies so long after the last thing seen goes on with its flight.
const RECOVERED: Span = Span::from_secs(5);
/// What lies over for so long after that, with its motors running, is down.
const GIVEN_UP: Span = Span::from_secs(30);
/// What was down and moves so long as what flies has taken off again.
const TAKEN_OFF: Span = Span::from_secs(4);
/// A shock stops something that was this fast.
const IMPACT_MPS: f32 = 3.5;
/// Legs take this from what comes down upright, at the fastest landing speeds that are set (2.5 m/s): harder is no landing.
const LEGS_G: f32 = 4.0;
const LEGS_MPS: f32 = 3.0;
/// What comes down on wings without throttle, and sinks slower than this, lands and skids.
const FLARED_MPS: f32 = 2.0;
/// What skids slows down by 8 m/s2 at most: faster, it does not stop within [`evidence::BREAKS_OFF`].
const SKIDS_MPS: f32 = 15.0;
/// It is still for [`STILL`] within this time after a shock.
const AFTER_SHOCK: Span = Span::from_secs(4);
const STILL: Span = Span::from_secs(1);
/// A pressure that rose no longer ago rises still.
const RISES: Span = Span::from_millis(300);
const STILL_MPS: f32 = 1.0;
const STILL_RATE: f32 = 0.3;
/// What is so far above the place where it lay flies again, though it hovers.
const ROSE_M: f32 = 3.0;
/// Rotors pull upwards; what is carried so from above lies on its back.
const ON_BACK_G: f32 = 0.5;
/// What lies over so long after its last throttle was turned over by its rotors, and by no hand.
const DRIVEN: Span = Span::from_secs(5);
/// What is faster than this over ground flies, and the air carries it from ahead besides its rotors, m/s.
const DRAGS_MPS: f32 = 12.0;
/// Heartbeats so far apart hide a disarming.
const BEATS: Span = Span::from_millis(2_500);
/// A sign of what lies lasts so long.
const LIES_FOR: Span = Span::from_millis(1_500);

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
    /// The latest heartbeat, the height above home then, and when the autopilot was heard last.
    beat_at: Instant,
    beat_height_m: Option<f32>,
    heard_at: Instant,
    /// It was heard first then, and has not flown since: if it is disarmed, whether it falls is to be seen.
    first_at: Option<Instant>,
    /// It was not heard in the air: whether it lies is to be seen.
    unheard: Option<Unheard>,
    /// It came down in a silence, which began then.
    unheard_from: Option<Instant>,
    /// When the force changed last: a sensor that says the same for ever says nothing.
    felt_at: Instant,
    /// Disarmed or terminated out of a flight: whether it falls is to be seen.
    doubt: Option<Doubt>,
    uncarried: Lasting,
    on_bench: bool,
    falls: Lasting,
    /// When something carried it last.
    carried_at: Instant,
    tumbles: Lasting,
    overturned: Lasting,
    sinks: Lasting,
    still_since: Option<Instant>,
    flies_since: Option<Instant>,
    shock: Option<Shock>,
    /// The first of the shocks that belong together.
    hit_at: Instant,
    speed: Recent,
    sink: Recent,
    /// The fastest sink that broke off in this mishap.
    touch_mps: f32,
    load_g: f32,
    /// What it is carried with from above, which rotors cannot: it lies on its back.
    from_above_g: f32,
    pressure: Pressure,
    /// Its greatest height since it has had all its thrust, m, which fades; and when that was worked out last.
    peak_m: f32,
    peak_at: Instant,
    rate: f32,
    support: Support,
    /// When it was armed with throttle last; zero for never.
    driven_at: Instant,
    /// It was level while it was armed.
    stood: bool,
    /// When it leaned by more than 45 degrees, or turned fast, last, while armed.
    tilted_at: Stamp,
    /// When its estimate moved last while the receiver stood.
    strayed_at: Stamp,
    /// When the receiver did not stand last, as far as it is known, and its altitude then.
    moved_at: Stamp,
    stood_at_m: f32,
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
            beat_at: Instant::ZERO,
            beat_height_m: None,
            heard_at: Instant::ZERO,
            first_at: None,
            unheard: None,
            unheard_from: None,
            felt_at: Instant::ZERO,
            doubt: None,
            uncarried: Lasting::NOT,
            on_bench: false,
            falls: Lasting::NOT,
            carried_at: Instant::ZERO,
            tumbles: Lasting::NOT,
            overturned: Lasting::NOT,
            sinks: Lasting::NOT,
            still_since: None,
            flies_since: None,
            shock: None,
            hit_at: Instant::ZERO,
            speed: Recent::NOTHING,
            sink: Recent::NOTHING,
            touch_mps: 0.0,
            load_g: 1.0,
            from_above_g: 0.0,
            pressure: Pressure::NOTHING,
            peak_m: f32::NEG_INFINITY,
            peak_at: Instant::ZERO,
            rate: 0.0,
            support: Support::NOTHING,
            driven_at: Instant::ZERO,
            stood: false,
            tilted_at: Stamp::NONE,
            strayed_at: Stamp::NONE,
            moved_at: Stamp::NONE,
            stood_at_m: 0.0,
            place: Place::UNKNOWN,
        }
    }

    /// What becomes of the flight while this is so.
    pub(crate) fn fate(&self) -> Fate {
        match self.state {
            State::Down => Fate::Over,
            State::Going(_) => Fate::Held,
            State::Quiet if self.is_judged() => Fate::Held,
            State::Quiet => Fate::Own,
        }
    }

    /// Whether it is to be seen within seconds if something happened: it was disarmed in the air, its speed broke off with a shock, or it
    /// is heard again after a silence.
    fn is_judged(&self) -> bool {
        self.doubt.is_some() || self.shock.is_some_and(|shock| shock.hit) || self.is_heard_again()
    }

    /// Whether other checks would only echo it.
    pub(crate) fn is_going(&self) -> bool {
        let calls_itself_down = self.unheard.is_some_and(|unheard| unheard.calls_itself_down);
        self.state != State::Quiet || self.doubt.is_some() || calls_itself_down
    }

    /// Whether it was disarmed out of a flight, and that it falls is not seen yet.
    pub const fn is_doubted(&self) -> bool {
        self.doubt.is_some()
    }

    /// Whether nothing carries it just now: what flew and is so is in the air, though its autopilot may call it landed.
    pub fn is_uncarried(&self) -> bool {
        self.uncarried.lasts(self.heard_at, UNCARRIED)
    }

    /// Whether it is over: the vehicle lies where it came down.
    pub(crate) const fn is_down(&self) -> bool {
        matches!(self.state, State::Down)
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
            Kind::Overturned => {
                let known = attitude.get().is_some_and(|it| it.roll.0.is_finite() && it.pitch.0.is_finite());
                attitude.at().filter(|_| known && rotors)
            }
            Kind::Tumbling => {
                let rates = attitude.get().and_then(|attitude| attitude.rates);
                attitude.at().filter(|_| rates.is_some_and(|rates| is_known(rates.map(|rate| rate.0))))
            }
            Kind::Disarmed => heartbeat.at(),
            Kind::Sinking => climb_mps(now, vehicle).map(|_| now),
        };
        Reading::new(at.filter(|_| vehicle.kind() != VehicleKind::Surface), Some(0.0))
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
        self.support.flies = flight.airborne() && self.state == State::Quiet;
        self.note_support(now, vehicle, params);
        self.note_rest(now, vehicle);
        self.judge_disarming(now, vehicle, params);
        self.note_silence(now, vehicle, flight, params);
        self.shocked(now, vehicle, params);
        let seen = self.seen.take();
        match (self.state, seen) {
            (State::Quiet, Some(kind))
                if flight.is_open()
                    || kind == Kind::Disarmed
                    || (kind == Kind::Impact && self.first_at.is_some() && !self.armed)
                    || self.is_turned_over(now, vehicle, kind) =>
            {
                self.state = State::Going(now);
                let mut place = Place::of(now, vehicle);
                let before_m = self.doubt.take().and_then(|doubt| doubt.height_m);
                if let Some(height_m) = before_m.filter(|_| kind == Kind::Disarmed) {
                    place.height_m = height_m as i16;
                }
                self.first_at = None;
                self.place = place;
                // What turned over right after a shock hit something first.
                if let Some(shock) = self.shock.filter(|_| kind == Kind::Overturned) {
                    self.touch(now, shock.sink_mps);
                    self.see(now, Kind::Impact, shock.load_g, params);
                }
                Some(Change::Began(kind))
            }
            (State::Quiet, Some(kind)) => {
                (self.worst, self.unheard_from) = ([0.0; Kind::COUNT], None);
                if !self.armed {
                    return None;
                }
                let told = core::mem::replace(&mut self.on_bench, true);
                (!told).then_some(Change::OnBench(kind))
            }
            (State::Going(last), _) => self.goes(now, last, vehicle),
            (State::Down, _) if self.flies_since.is_some_and(|since| now.since(since) >= TAKEN_OFF) => {
                self.calm();
                Some(Change::FliesAgain)
            }
            _ => None,
        }
    }

    /// It flies on, or is armed again: what was seen is over.
    fn calm(&mut self) {
        (self.state, self.worst, self.seen) = (State::Quiet, [0.0; Kind::COUNT], None);
        (self.doubt, self.first_at, self.unheard, self.unheard_from) = (None, None, None, None);
        (self.shock, self.touch_mps, self.still_since, self.flies_since) = (None, 0.0, None, None);
        self.place = Place::UNKNOWN;
    }

    fn note_arming(&mut self, now: Instant, vehicle: &Vehicle, flight: &Flight, params: &Params) {
        // Terminated, its motors are off, though it stays armed.
        let armed = vehicle.armed() && vehicle.terminated_since.is_none();
        if armed && !self.armed {
            // Armed again in the air it flies on; on the ground another flight begins.
            if self.state == State::Down && self.disarmed_at.is_some() {
                self.calm();
            }
            (self.on_bench, self.disarmed_at, self.stood, self.heard_at) = (false, None, false, now);
            self.support.forget();
            (self.doubt, self.first_at, self.unheard) = (None, None, None);
        }
        let beat_at = vehicle.heartbeat.at().unwrap_or(self.beat_at);
        // The height of the beat before: PX4's is 0 from the disarming on, and home may be another one.
        let mut before_m = self.beat_height_m;
        let mut beats_missed = false;
        if beat_at != self.beat_at {
            if self.beat_at == Instant::ZERO {
                self.note_first(now, vehicle, armed);
            }
            beats_missed = beat_at.since(self.beat_at) > BEATS;
            before_m = core::mem::replace(&mut self.beat_height_m, height_m(now, vehicle));
            self.beat_at = beat_at;
        }
        self.stood = self.stood || (armed && vehicle.inertial.is_level(now));
        if self.armed && !armed {
            self.disarmed_at = Some(now);
            // The autopilot may have called it landed because it is disarmed.
            if flight.is_open() && self.state == State::Quiet {
                let height_m = before_m.or_else(|| height_m(now, vehicle));
                self.note_disarming(now, vehicle, params, height_m, beats_missed);
            }
        }
        self.armed = armed;
    }

    /// Since when it has been still, and since when it has moved as what flies.
    fn note_rest(&mut self, now: Instant, vehicle: &Vehicle) {
        let ground_mps = ground_speed_mps(now, vehicle).unwrap_or(0.0);
        let speed_mps = ground_mps.max(climb_mps(now, vehicle).map_or(0.0, f32::abs));
        self.note_receiver(now, vehicle, ground_mps);
        // Of what was disarmed, lies on its back or has hit something, the sensors are believed and not the estimate.
        let slow = speed_mps < STILL_MPS
            || (!self.armed && on_rotors(now, vehicle))
            || self.lies_on_its_back(vehicle)
            || (self.worst[Kind::Impact as usize] > 0.0 && self.rate < STILL_RATE / 3.0)
            || (self.shock.is_some_and(|shock| shock.dropped) && self.rate < STILL_RATE / 3.0);
        // Under a parachute it is carried, and goes down.
        let descends = self.pressure.steady_for(now).is_some_and(|span| span < RISES);
        let still = slow && !descends && self.rate < STILL_RATE && (0.7..1.3).contains(&self.load_g);
        self.still_since = if still { self.still_since.or(Some(now)) } else { None };
        // What is carried home may be armed still, and no motor turns.
        let thrust = !on_rotors(now, vehicle)
            || throttle(now, vehicle).is_none_or(|part| part > self.support.idle_throttle());
        let lay_at_m = f32::from(self.place.height_m);
        let rose = height_m(now, vehicle).is_some_and(|height_m| height_m > lay_at_m + ROSE_M);
        // On rotors what moves and does not climb may be a wreck whose estimate is lost.
        let climbs = climb_mps(now, vehicle).is_none_or(|climb_mps| climb_mps > STILL_MPS);
        let moves = speed_mps > 2.0 * STILL_MPS && (climbs || !on_rotors(now, vehicle));
        let rests = self.lies(now, vehicle) || self.has_strayed(now) || self.is_supported(now);
        let flies = self.armed && (moves || rose || self.hangs(now, vehicle)) && thrust && !rests;
        self.flies_since = if flies { self.flies_since.or(Some(now)) } else { None };
    }

    /// Whether what was seen outside of a flight is the work of its own rotors, and no hand's: it had throttle just now, and the
    /// inertial messages show it.
    fn is_turned_over(&self, now: Instant, vehicle: &Vehicle, kind: Kind) -> bool {
        self.was_driven(now)
            && on_rotors(now, vehicle)
            && (kind == Kind::Tumbling || self.lies_turned(now, vehicle).is_some())
    }

    /// How far it lies over, in radians, what stood level while it was armed and turned since.
    fn lies_turned(&self, now: Instant, vehicle: &Vehicle) -> Option<f32> {
        let over = vehicle.inertial.lies_over(now)?;
        let turned = self.stood && !vehicle.inertial.turns_little(now, DRIVEN);
        (turned && !is_fast(now, vehicle)).then_some(over)
    }

    fn was_driven(&self, now: Instant) -> bool {
        self.driven_at != Instant::ZERO && now.since(self.driven_at) <= DRIVEN
    }

    /// Whether it leaned so far or turned so fast in the last seconds that thrust did not carry it.
    pub(crate) fn has_tilted(&self, now: Instant) -> bool {
        self.tilted_at.age(now).is_some_and(|age| age <= RECOVERED)
    }

    /// A receiver measures its speed by Doppler, to some tenths of a metre a second, and its height to some metres; an estimate that is lost
    /// drifts.
    fn note_receiver(&mut self, now: Instant, vehicle: &Vehicle, ground_mps: f32) {
        let receiver = vehicle.gnss[0].within(now, FRESH).filter(|gnss| gnss.is_exact());
        let slow = receiver.and_then(|gnss| gnss.speed).filter(|speed| speed.0 < STILL_MPS);
        let height_m = receiver.and_then(|gnss| gnss.altitude).map_or(0.0, |altitude| altitude.0);
        let Some(speed) = slow.filter(|_| (height_m - self.stood_at_m).abs() <= ROSE_M) else {
            (self.moved_at, self.stood_at_m, self.strayed_at) = (Stamp::at(now), height_m, Stamp::NONE);
            return;
        };
        let stands = self.moved_at.age(now).is_some_and(|age| age >= FALL_SHOWS);
        if stands && ground_mps > speed.0 + 2.0 * STILL_MPS {
            self.strayed_at = Stamp::at(now);
        }
    }

    /// Whether its estimate moved within the last seconds while the receiver stood: it is lost.
    fn has_strayed(&self, now: Instant) -> bool {
        self.strayed_at.age(now).is_some_and(|age| age <= RECOVERED)
    }

    /// Whether the receiver has stood for a while, and the air pressure does not rise as in a fall.
    fn rests(&self, now: Instant) -> bool {
        self.moved_at.age(now).is_some_and(|age| age >= STILL)
            && self.pressure.agrees(now, FALLING_MPS) == Some(false)
    }

    /// Whether it lies on its side or its back. What hangs on wings banks, and tail-sitters look up.
    fn lies(&self, now: Instant, vehicle: &Vehicle) -> bool {
        let flies = vehicle.hovers(now) == Some(false) && is_fast(now, vehicle);
        (is_tilted(now, vehicle) && !flies) || self.lies_on_its_back(vehicle)
    }

    fn lies_on_its_back(&self, vehicle: &Vehicle) -> bool {
        vehicle.is_multicopter() && self.from_above_g > ON_BACK_G
    }

    fn is_still(&self, now: Instant) -> bool {
        self.still_since.is_some_and(|since| now.since(since) >= STILL)
    }

    /// A shock after which it is still, and does not hang in the air.
    fn shocked(&mut self, now: Instant, vehicle: &Vehicle, params: &Params) {
        let Some(shock) = self.shock else { return };
        if now.since(shock.at) > AFTER_SHOCK {
            self.shock = None;
            return;
        }
        let lands = !on_rotors(now, vehicle)
            && shock.sink_mps < FLARED_MPS
            && shock.speed_mps < SKIDS_MPS
            && throttle(now, vehicle).is_none_or(|part| part < self.support.idle_throttle());
        let hard = shock.load_g > LEGS_G || shock.sink_mps > LEGS_MPS;
        let stopped = shock.stopped && shock.speed_mps >= IMPACT_MPS && hard && !lands;
        // What was not seen to fly may be knocked, and lie on its back for its battery.
        let hit = stopped
            || (self.first_at.is_none()
                && ((shock.dropped && shock.load_g > LEGS_G)
                    || (on_rotors(now, vehicle) && is_tilted(now, vehicle))
                    || self.lies_on_its_back(vehicle)));
        self.shock = Some(Shock { hit, ..shock });
        let rests =
            self.still_since.is_some_and(|since| !shock.at.is_after(since) && now.since(since) >= STILL);
        if hit && rests && self.is_idle(now, vehicle) {
            self.touch_mps = self.touch_mps.max(shock.sink_mps);
            self.see(now, Kind::Impact, shock.load_g, params);
            self.shock = None;
        }
    }

    /// Whether what is still does not hang in the air: disarmed, on the ground, on its side, without throttle or with all of it.
    fn is_idle(&self, now: Instant, vehicle: &Vehicle) -> bool {
        !self.armed
            || (calls_itself_landed(now, vehicle) && !self.hangs(now, vehicle))
            || self.lies(now, vehicle)
            || throttle(now, vehicle).is_some_and(|part| {
                // What is carried by less than half of the throttle that it hovers with stands on the ground.
                let stands = on_rotors(now, vehicle) && self.support.is_little(part);
                !(self.support.idle_throttle()..FULL_THROTTLE).contains(&part) || stands
            })
    }

    /// Whether its rotors carry it away from the ground: by its height, its throttle and its vibration.
    fn hangs(&self, now: Instant, vehicle: &Vehicle) -> bool {
        let carries = |part: f32| {
            (self.support.flying_throttle()..FULL_THROTTLE).contains(&part) && !self.support.is_little(part)
        };
        self.armed
            && on_rotors(now, vehicle)
            && is_off_ground(now, vehicle)
            && throttle(now, vehicle).is_some_and(carries)
            && vehicle.inertial.shakes(now) != Some(false)
            && !(self.lies(now, vehicle) || self.has_strayed(now) || self.is_supported(now))
    }

    fn goes(&mut self, now: Instant, last: Instant, vehicle: &Vehicle) -> Option<Change> {
        let long = now.since(last) >= RECOVERED;
        let silent = vehicle.heartbeat.within(now, RECOVERED).is_none();
        let near_ground = is_near_ground(now, vehicle);
        // With all its thrust it would climb: it dances on the ground.
        let dances = near_ground
            && on_rotors(now, vehicle)
            && throttle(now, vehicle).is_some_and(|part| part >= FULL_THROTTLE);
        let slow = self.speed.greatest(now) < 2.0 * STILL_MPS;
        let struck = self.worst[Kind::Impact as usize] > 0.0;
        let lies = self.lies(now, vehicle);
        let stuck = struck && slow && !self.hangs(now, vehicle);
        // Where it hit the ground on rotors its speed is not asked: an estimate may be lost.
        let stays = lies || (struck && on_rotors(now, vehicle)) || (slow && (dances || struck));
        let strayed = self.has_strayed(now);
        let down = (long && near_ground && stays)
            || (self.rests(now) && on_rotors(now, vehicle) && ((struck && lies) || (long && strayed)))
            || (self.is_still(now) && (self.is_idle(now, vehicle) || (long && near_ground)))
            || (long && (silent || self.is_supported(now)))
            || ((lies || stuck) && on_rotors(now, vehicle) && now.since(last) >= GIVEN_UP)
            || self.disarmed_at.is_some_and(|since| !self.armed && self.has_come_down(now, since, vehicle));
        if down {
            (self.state, self.flies_since) = (State::Down, None);
            if !strayed {
                self.touch(now, self.sink.greatest(now));
            }
            self.place = Place::of(now, vehicle);
            return Some(Change::Down);
        }
        // What lies over does not fly, nor does what has not moved since it hit something.
        let moves = !(dances || lies || strayed || stuck);
        if long && self.armed && moves {
            self.calm();
            return Some(Change::FliesOn);
        }
        None
    }

    /// Whether what was disarmed then has come down, by the air pressure: without thrust nothing stays where it is.
    fn has_come_down(&self, now: Instant, since: Instant, vehicle: &Vehicle) -> bool {
        let passed = now.since(since);
        if passed >= FALLS_AT_MOST {
            return true;
        }
        let steady_for = self.pressure.steady_for(now).map(|span| if span < passed { span } else { passed });
        match steady_for {
            Some(span) => span >= if on_rotors(now, vehicle) { FALL_SHOWS } else { WATCHED },
            None => passed >= WATCHED,
        }
    }

    /// What the ground is told of a change, at the tick of it.
    pub fn report(&self, change: Change) -> Report {
        Report { change, place: self.place, touch: (self.touch_mps * 10.0) as u16 }
    }

    /// When the first shock of the latest impact was.
    pub const fn hit_at(&self) -> Instant {
        self.hit_at
    }

    /// When it was heard last before it came down, where nobody heard it meanwhile.
    pub const fn unheard_from(&self) -> Option<Instant> {
        self.unheard_from
    }

    /// When it first hit something in this mishap; `None` where it did not.
    pub fn struck_at(&self) -> Option<Instant> {
        (self.worst[Kind::Impact as usize] > 0.0).then_some(self.hit_at)
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

/// Whether it is faster than what lies, or is dragged along: the air carries it from ahead besides its rotors.
fn is_fast(now: Instant, vehicle: &Vehicle) -> bool {
    ground_speed_mps(now, vehicle).is_some_and(|speed_mps| speed_mps > DRAGS_MPS)
}
