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
//! | | what comes down slowly without throttle lands and skids | on wings |
//! | tumbling | body rates above `MIS_TUMBLE` for half a second, on wings for 1.5 s; not in modes made for it | everywhere |
//! | disarmed in the air | disarmed or terminated above `MIS_DISARM_H` or while it sinks; then it falls, sinks or goes on moving | everywhere |
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
//!        seen in a flight            it lies still, or 10 s after disarming
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

mod evidence;
mod sight;
mod told;

pub use told::{Change, Kind, Place, Report};

use crate::flight::Flight;
use crate::latest::Reading;
use crate::modes::has_pilots_throttle;
use crate::motion::{climb_mps, ground_speed_mps, height_m};
use crate::observation::VehicleKind;
use crate::params::{Param, Params};
use crate::time::{Instant, Span, Stamp};
use crate::vehicle::Vehicle;
use evidence::{
    BREAKS_OFF, Doubt, FRESH, FULL_THROTTLE, IDLE_THROTTLE, Lasting, Pressure, Recent, Shock, THRUST_PART,
    UNCARRIED, Unheard, calls_itself_landed, is_known, is_near_ground, is_tilted, on_rotors, throttle,
};

/// How long after disarming it is watched.
const WATCHED: Span = Span::from_secs(10);
/// A vehicle that still flies so long after the last thing seen goes on with its flight.
const RECOVERED: Span = Span::from_secs(5);
/// What was down and moves so long as what flies has taken off again.
const TAKEN_OFF: Span = Span::from_secs(4);
/// A shock stops something that was this fast.
const IMPACT_MPS: f32 = 3.5;
/// Legs take this from what comes down upright, at the fastest landing speeds that are set (2.5 m/s): harder is no landing.
const LEGS_G: f32 = 4.0;
const LEGS_MPS: f32 = 3.0;
/// What comes down on wings without throttle, and sinks slower than this, lands and skids.
const FLARED_MPS: f32 = 2.0;
/// It is still for [`STILL`] within this time after a shock.
const AFTER_SHOCK: Span = Span::from_secs(4);
const STILL: Span = Span::from_secs(1);
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
/// How long it is seen whether what was disarmed falls.
const FALL_SHOWS: Span = Span::from_secs(3);
const FALLEN_M: f32 = 2.0;
/// What was disarmed and moves so fast is in the air: sinking, and on wings over ground.
const FALLING_MPS: f32 = 2.5;
const GLIDING_MPS: f32 = 8.0;
/// What was terminated falls so fast some seconds later, by the air pressure alone.
const DROPS_MPS: f32 = 10.0;

/// Nothing heard for so long hides a fall, and heartbeats so far apart a disarming.
const UNHEARD: Span = Span::from_secs(5);
const BEATS: Span = Span::from_millis(2_500);
/// So long after that it is seen whether it lies; and so long it does what only what lies does.
const LYING_SHOWS: Span = Span::from_millis(2_400);
const LIES_FOR: Span = Span::from_millis(1_500);
const SIGN_LASTS: Span = Span::from_millis(500);
/// A restarted autopilot tells its forces and its place no later than this.
const STARTS: Span = Span::from_secs(20);
/// What came down so far is not where it flew.
const CAME_DOWN_M: f32 = 3.0;

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
    beat_height_m: f32,
    heard_at: Instant,
    /// Disarmed or terminated when it was heard first, which was then: whether it falls is to be seen.
    first_at: Option<Instant>,
    /// It was not heard in the air: whether it lies is to be seen.
    unheard: Option<Unheard>,
    /// It came down in a silence, which began then.
    unheard_from: Option<Instant>,
    /// When the force changed last: a sensor that says the same for ever says nothing.
    felt_at: Instant,
    /// Disarmed out of a flight: whether it falls is to be seen.
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
    /// The last height above home while it was armed.
    height_m: f32,
    hover_throttle: f32,
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
            beat_height_m: 0.0,
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
            height_m: 0.0,
            hover_throttle: 0.0,
            driven_at: Instant::ZERO,
            stood: false,
            tilted_at: Stamp::NONE,
            strayed_at: Stamp::NONE,
            moved_at: Stamp::NONE,
            stood_at_m: 0.0,
            place: Place { position: None, height_m: 0 },
        }
    }

    /// What becomes of the flight while this is so.
    pub(crate) const fn fate(&self) -> Fate {
        match self.state {
            State::Down => Fate::Over,
            State::Going(_) => Fate::Held,
            State::Quiet if self.doubt.is_some() => Fate::Held,
            State::Quiet if matches!(self.unheard, Some(Unheard { to: Some(_), .. })) => Fate::Held,
            State::Quiet => Fate::Own,
        }
    }

    /// Whether other checks would only echo it.
    pub(crate) fn is_going(&self) -> bool {
        let lies = matches!(self.unheard, Some(Unheard { to: Some(_), calls_itself_down: true, .. }));
        self.state != State::Quiet || self.doubt.is_some() || lies
    }

    /// Whether it was disarmed out of a flight, and that it falls is not seen yet.
    pub const fn is_doubted(&self) -> bool {
        self.doubt.is_some()
    }

    /// Whether nothing carries it just now: what flew and is so is in the air, though its autopilot may call it landed.
    pub const fn is_uncarried(&self) -> bool {
        self.uncarried.samples >= 2
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
        self.note_rest(now, vehicle);
        self.doubted(now, vehicle, params);
        self.note_silence(now, vehicle, flight, params);
        self.shocked(now, vehicle);
        let seen = self.seen.take();
        match (self.state, seen) {
            (State::Quiet, Some(kind))
                if flight.is_open()
                    || (kind == Kind::Disarmed && self.first_at.is_some())
                    || self.is_turned_over(now, vehicle, kind) =>
            {
                self.state = State::Going(now);
                let mut place = Place::of(now, vehicle);
                if let (Kind::Disarmed, Some(doubt)) = (kind, self.doubt.take()) {
                    place.height_m = doubt.height_m as i16;
                }
                (self.doubt, self.first_at) = (None, None);
                self.place = place;
                // What turned over right after a shock hit something first.
                if let Some(shock) = self.shock.filter(|_| kind == Kind::Overturned) {
                    self.touch(now, shock.sink_mps);
                    self.see(now, Kind::Impact, shock.load_g);
                }
                Some(Change::Began(kind))
            }
            (State::Quiet, Some(kind)) => {
                (self.worst, self.unheard_from) = ([0.0; Kind::COUNT], None);
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

    fn calm(&mut self) {
        *self = Self {
            armed: self.armed,
            disarmed_at: self.disarmed_at,
            on_bench: self.on_bench,
            hover_throttle: self.hover_throttle,
            driven_at: self.driven_at,
            stood: self.stood,
            strayed_at: self.strayed_at,
            moved_at: self.moved_at,
            stood_at_m: self.stood_at_m,
            beat_at: self.beat_at,
            beat_height_m: self.beat_height_m,
            heard_at: self.heard_at,
            felt_at: self.felt_at,
            ..Self::new()
        };
    }

    fn note_arming(&mut self, now: Instant, vehicle: &Vehicle, flight: &Flight, params: &Params) {
        // Terminated, its motors are off, though it stays armed.
        let armed = vehicle.armed() && vehicle.terminated_since.is_none();
        if armed && !self.armed && self.state != State::Quiet && self.disarmed_at.is_some() {
            // Armed again in the air it flies on; on the ground another flight begins.
            if self.state == State::Down {
                self.calm();
            }
        }
        if armed && !self.armed {
            (self.on_bench, self.disarmed_at, self.stood, self.heard_at) = (false, None, false, now);
            (self.doubt, self.first_at, self.unheard) = (None, None, None);
        }
        let beat_at = vehicle.heartbeat.at().unwrap_or(self.beat_at);
        let mut before_m = self.beat_height_m;
        let mut beats_missed = false;
        if beat_at != self.beat_at {
            if self.beat_at == Instant::ZERO && !armed {
                self.first_at = Some(now);
            }
            beats_missed = beat_at.since(self.beat_at) > BEATS;
            before_m = core::mem::replace(&mut self.beat_height_m, self.height_m);
            self.beat_at = beat_at;
        }
        self.stood |= armed && vehicle.inertial.is_level(now);
        if self.armed && !armed {
            self.disarmed_at = Some(now);
            // The height of before: PX4's is 0 from the disarming on, and home may be another one.
            let height_m = if beats_missed { before_m } else { self.height_m };
            let high = height_m > params.get(Param::MisDisarm) || self.sink.greatest() > FALLING_MPS;
            // The autopilot may have called it landed because it is disarmed.
            if high && flight.is_open() && self.state == State::Quiet {
                let altitude_m = vehicle.global.within(now, FRESH).map(|global| global.altitude.0);
                let doubt = Doubt::new(now, height_m);
                let uncarried = self.is_uncarried()
                    && now.since(self.felt_at) <= STILL
                    && now.since(self.uncarried.since) >= UNCARRIED;
                let unseen = beats_missed && vehicle.terminated_since.is_some();
                self.doubt = Some(Doubt { altitude_m, uncarried, unseen, ..doubt });
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
        let still = slow && self.rate < STILL_RATE && (0.7..1.3).contains(&self.load_g);
        self.still_since = if still { self.still_since.or(Some(now)) } else { None };
        // What is carried home may be armed still, and no motor turns.
        let thrust =
            !on_rotors(now, vehicle) || throttle(now, vehicle).is_none_or(|part| part > IDLE_THROTTLE);
        let lay_at_m = f32::from(self.place.height_m);
        let rose = height_m(now, vehicle).is_some_and(|height_m| height_m > lay_at_m + ROSE_M);
        // On rotors what moves and does not climb may be a wreck whose estimate is lost.
        let climbs = climb_mps(now, vehicle).is_none_or(|climb_mps| climb_mps > STILL_MPS);
        let moves = speed_mps > 2.0 * STILL_MPS && (climbs || !on_rotors(now, vehicle));
        let flies =
            self.armed && (moves || rose) && !self.lies(now, vehicle) && thrust && !self.has_strayed(now);
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
        let flies = || ground_speed_mps(now, vehicle).is_some_and(|speed_mps| speed_mps > DRAGS_MPS);
        let turned = self.stood && !vehicle.inertial.turns_little(now, DRIVEN);
        vehicle.inertial.lies_over(now).filter(|_| turned && !flies())
    }

    fn was_driven(&self, now: Instant) -> bool {
        self.driven_at > Instant::ZERO && now.since(self.driven_at) <= DRIVEN
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

    /// Whether it lies on its side or its back.
    fn lies(&self, now: Instant, vehicle: &Vehicle) -> bool {
        is_tilted(now, vehicle) || self.lies_on_its_back(vehicle)
    }

    fn lies_on_its_back(&self, vehicle: &Vehicle) -> bool {
        vehicle.is_multicopter() && self.from_above_g > ON_BACK_G
    }

    fn is_still(&self, now: Instant) -> bool {
        self.still_since.is_some_and(|since| now.since(since) >= STILL)
    }

    /// Disarmed out of a flight: what falls, sinks or glides on was disarmed in the air, and what was terminated there, if it does not
    /// stand. What is disarmed when it is heard first must fall faster than anything is carried down.
    fn doubted(&mut self, now: Instant, vehicle: &Vehicle, params: &Params) {
        let first = || self.first_at.map(|at| Doubt::new(at, height_m(now, vehicle).unwrap_or(0.0)));
        let Some(doubt) = self.doubt.or_else(first) else { return };
        let Doubt { since, height_m, altitude_m, uncarried, unseen, stood } = doubt;
        let is_first = self.doubt.is_none();
        let is_carried = is_first && !vehicle.armed();
        // An estimator is shaken by the touch, and may fall on while the vehicle stands.
        let air = |sink_mps: f32| self.pressure.agrees(now, sink_mps) != Some(false);
        let fallen = |before: f32| {
            vehicle.global.get().is_some_and(|global| global.altitude.0 < before - FALLEN_M)
                && air(FALLING_MPS)
        };
        let falls = self.pressure.agrees(now, self.sink.now) == Some(true)
            && self.sink.now > params.get(Param::MisSink);
        let sinks = if is_carried { falls } else { self.sink.now > FALLING_MPS && air(self.sink.now) }
            && now.since(since) > Recent::WINDOW;
        let glides = !on_rotors(now, vehicle)
            && !is_carried
            && now.since(since) > BREAKS_OFF
            && ground_speed_mps(now, vehicle).is_some_and(|speed_mps| speed_mps > GLIDING_MPS);
        // An autopilot that lost its estimate terminates the flight, and tells no more of heights and speeds.
        let drops =
            vehicle.armed() && now.since(since) > FRESH && self.pressure.agrees(now, DROPS_MPS) == Some(true);
        // What was terminated stays armed, and its autopilot's word that it stands is not of that.
        let says_so =
            vehicle.armed() && vehicle.landed.at() > Some(since) && calls_itself_landed(now, vehicle);
        let stands = says_so || self.stands(now, vehicle);
        if stands && let Some(doubt) = &mut self.doubt {
            doubt.unseen = false;
            // A hover just before the word is level and slow too.
            doubt.stood |= now.since(since) >= STILL;
        }
        // Sensors and speeds that were told and are no more are no word that it stands.
        let over = now.since(since) > FALL_SHOWS;
        let watched = !is_first && !stood && self.felt_at > Instant::ZERO && on_rotors(now, vehicle);
        let lost =
            watched && !stands && ((unseen && now.since(since) >= LIES_FOR) || (vehicle.armed() && over));
        if uncarried || sinks || glides || drops || lost || altitude_m.is_some_and(fallen) {
            self.disarmed_at.get_or_insert(now);
            self.see(now, Kind::Disarmed, height_m.max(params.get(Param::MisDisarm).next_up()));
        } else if over {
            (self.doubt, self.first_at) = (None, None);
        }
    }

    /// Whether its sensors say that it stands upright and still, and they are alive.
    fn stands(&self, now: Instant, vehicle: &Vehicle) -> bool {
        let slow = |speed_mps: Option<f32>| speed_mps.is_some_and(|speed_mps| speed_mps.abs() < STILL_MPS);
        now.since(self.felt_at) <= STILL
            && vehicle.inertial.is_level_for(now, STILL)
            && (self.rests(now) || (slow(climb_mps(now, vehicle)) && slow(ground_speed_mps(now, vehicle))))
    }

    /// What flew, was not heard, and is heard again: whether it came down meanwhile as nothing lands.
    fn note_silence(&mut self, now: Instant, vehicle: &Vehicle, flight: &Flight, params: &Params) {
        let Some(mut unheard) = self.unheard else {
            if now.since(self.heard_at) >= UNHEARD {
                self.begin_silence(self.heard_at, vehicle, flight);
            }
            return;
        };
        if self.heard_at == unheard.last_at {
            return;
        }
        let to = *unheard.to.get_or_insert(now);
        let tells = |at: Option<Instant>| at.is_none_or(|at| at > unheard.last_at);
        if unheard.seen_at.is_none() && tells(vehicle.imu.at()) && tells(vehicle.global.at()) {
            unheard.seen_at = Some(now);
        }
        let (since, shows) = match unheard.seen_at {
            Some(seen_at) => (seen_at, LYING_SHOWS),
            None => (to, if self.armed { LYING_SHOWS } else { STARTS }),
        };
        unheard.calls_itself_down = !self.armed || calls_itself_landed(now, vehicle);
        let mut sign = None;
        // Its states of before it was silent say nothing.
        if now.since(to) >= STILL {
            if self.state != State::Quiet || now.since(since) > shows {
                self.unheard = None;
                return;
            }
            if !on_rotors(now, vehicle) {
                self.unheard = Some(unheard);
                return;
            }
            sign = self.came_down(now, vehicle, params, &unheard);
        }
        match sign {
            None => unheard.well_at = now,
            Some((kind, value)) if now.since(unheard.well_at) >= SIGN_LASTS => {
                (self.hit_at, self.unheard_from) = (to, Some(unheard.from));
                self.see(now, kind, value);
            }
            Some(_) => {}
        }
        self.unheard = Some(unheard);
    }

    /// What flies is not heard, since then.
    fn begin_silence(&mut self, from: Instant, vehicle: &Vehicle, flight: &Flight) {
        if self.armed && flight.airborne() && self.state == State::Quiet && self.doubt.is_none() {
            let altitude_m = vehicle.global.get().map(|global| global.altitude.0);
            let sink_mps = self.sink.greatest();
            let silence = Unheard {
                from,
                last_at: self.heard_at,
                to: None,
                seen_at: None,
                calls_itself_down: false,
                well_at: self.heard_at,
                altitude_m,
                sink_mps,
            };
            self.unheard = Some(silence);
        }
    }

    /// Its recording lost what it said for so long, and no time passed here meanwhile.
    pub(crate) fn lose(&mut self, span: Span, vehicle: &Vehicle, flight: &Flight) {
        if span >= UNHEARD && self.unheard.is_none() {
            let from_us = self.heard_at.as_micros().saturating_sub(span.as_micros());
            self.begin_silence(Instant::from_micros(from_us), vehicle, flight);
        }
    }

    /// What it does, after a silence, that only what came down as nothing lands does: as what that is told, and with which value.
    fn came_down(
        &self,
        now: Instant,
        vehicle: &Vehicle,
        params: &Params,
        unheard: &Unheard,
    ) -> Option<(Kind, f32)> {
        // Above the sea: home is another one once it is disarmed.
        let altitude_m = vehicle.global.within(now, FRESH).map(|global| global.altitude.0);
        let lost_m = unheard.altitude_m.zip(altitude_m).map_or(0.0, |(before_m, now_m)| before_m - now_m);
        let least_s = unheard.least_s(lost_m.max(0.0), params.get(Param::MisSink), self.armed);
        let had_time = unheard.lasted(now).as_secs_f32() >= least_s;
        // What never stood hangs so in its hover (tail-sitters), and what is fast leans. What had the time to land and is off may have been
        // laid down by somebody.
        let flies = ground_speed_mps(now, vehicle).is_some_and(|speed_mps| speed_mps > DRAGS_MPS);
        let is_off =
            unheard.calls_itself_down || throttle(now, vehicle).is_some_and(|part| part < IDLE_THROTTLE);
        let limit_deg = params.get(Param::MisOverturn);
        let over_deg = vehicle.inertial.lies_over(now).map(f32::to_degrees);
        let lies = self.stood && !flies && self.rate < STILL_RATE && !(is_off && had_time);
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
        is_down.then(|| (Kind::Impact, params.get(Param::MisImpact).next_up()))
    }

    /// A shock after which it is still, and does not hang in the air.
    fn shocked(&mut self, now: Instant, vehicle: &Vehicle) {
        let Some(shock) = self.shock else { return };
        if now.since(shock.at) > AFTER_SHOCK {
            self.shock = None;
            return;
        }
        let lands = !on_rotors(now, vehicle)
            && shock.sink_mps < FLARED_MPS
            && throttle(now, vehicle).is_none_or(|part| part < IDLE_THROTTLE);
        let hard = shock.load_g > LEGS_G || shock.sink_mps > LEGS_MPS;
        let hit = (shock.speed_mps >= IMPACT_MPS && shock.stopped && hard && !lands)
            || (shock.dropped && shock.load_g > LEGS_G)
            || (on_rotors(now, vehicle) && is_tilted(now, vehicle))
            || self.lies_on_its_back(vehicle);
        let rests = self.still_since.is_some_and(|since| since >= shock.at && now.since(since) >= STILL);
        if hit && rests && self.is_idle(now, vehicle) {
            self.touch_mps = self.touch_mps.max(shock.sink_mps);
            self.see(now, Kind::Impact, shock.load_g);
            self.shock = None;
        }
    }

    /// Whether what is still does not hang in the air: disarmed, on the ground, on its side, without throttle or with all of it.
    fn is_idle(&self, now: Instant, vehicle: &Vehicle) -> bool {
        !self.armed
            || calls_itself_landed(now, vehicle)
            || is_tilted(now, vehicle)
            || self.lies_on_its_back(vehicle)
            || throttle(now, vehicle).is_some_and(|part| {
                // What is carried by less than half of the throttle that it hovers with stands on the ground.
                let stands = on_rotors(now, vehicle) && part < THRUST_PART * self.hover_throttle;
                !(IDLE_THROTTLE..FULL_THROTTLE).contains(&part) || stands
            })
    }

    fn goes(&mut self, now: Instant, last: Instant, vehicle: &Vehicle) -> Option<Change> {
        let long = now.since(last) >= RECOVERED;
        let silent = vehicle.heartbeat.within(now, RECOVERED).is_none();
        let near_ground = is_near_ground(now, vehicle);
        // With all its thrust it would climb: it dances on the ground.
        let dances = near_ground
            && on_rotors(now, vehicle)
            && throttle(now, vehicle).is_some_and(|part| part >= FULL_THROTTLE);
        let slow = self.speed.greatest() < 2.0 * STILL_MPS;
        let struck = self.worst[Kind::Impact as usize] > 0.0;
        let lies = self.lies(now, vehicle);
        // Where it hit the ground on rotors its speed is not asked: an estimate may be lost.
        let stays = lies || (struck && on_rotors(now, vehicle)) || (slow && (dances || struck));
        let strayed = self.has_strayed(now);
        let down = (long && near_ground && stays)
            || (self.rests(now) && on_rotors(now, vehicle) && ((struck && lies) || (long && strayed)))
            || (self.is_still(now) && (self.is_idle(now, vehicle) || (long && near_ground)))
            || (long && silent)
            || self.disarmed_at.is_some_and(|since| !self.armed && now.since(since) >= WATCHED);
        if down {
            (self.state, self.flies_since) = (State::Down, None);
            if !strayed {
                self.touch(now, self.sink.greatest());
            }
            self.place = Place::of(now, vehicle);
            return Some(Change::Down);
        }
        // What lies over does not fly, nor does what has not moved since it hit something.
        let moves = !(dances || lies || strayed || struck && slow);
        if long && self.armed && moves {
            self.calm();
            return Some(Change::FliesOn);
        }
        None
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
