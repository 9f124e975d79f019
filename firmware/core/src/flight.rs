//! On the ground or in the air, and since when; and which flights that makes.
//!
//! # In the air
//! Only what is armed flies, and only what can: a rover, a boat or a submarine never does, whatever its landed state says
//! (PX4 calls an armed rover "in air"). The autopilot's own word ([`LandedState`], `EXTENDED_SYS_STATE`) counts where it is
//! given, but for what idles: on rotors, with less throttle than flies or no more vibration than at rest, and neither height, climb
//! nor speed that would show flight; on wings, with little throttle, no speed and no height. Otherwise, for half a second:
//!
//! | what is known | in the air | on the ground again, for two seconds |
//! |---|---|---|
//! | a height above home or above the local origin | more than one metre above the place of arming | less than half a metre, and still; 2 m below the place of arming with less throttle than flies |
//! | the speed of a plane or VTOL | faster than 8 m/s | as above |
//! | the airspeed of a plane or VTOL, and its throttle | faster than 8 m/s with more than a fifth: wind alone is no flight | slower |
//! | only the throttle (no position at all) | more than a fifth, and the displayed altitude rose by a metre | less than a tenth |
//!
//! One lost message, or a land detector that fails, hides no flight: the word that it stands counts no more once it was contradicted
//! for five seconds, by 2 m and more above the place of arming together with throttle that flies (on rotors) or more than
//! 8 m/s (on wings). It counts again with the end of the flight, or once the autopilot has said that it flies.
//!
//! The place of arming counts only where arming was seen. Whoever hears an armed vehicle first (a restart in the air) takes
//! the height above home as it is, and goes on in the air at once: [`FlightEvent::Resumed`].
//!
//! # Flights
//! A flight begins with leaving the ground. It ends when the vehicle is disarmed, or when it has been on the ground for
//! eight seconds; so a bounce and a touch-and-go are parts of one flight.

use crate::motion::{airspeed_mps, altitude_m, climb_mps, ground_speed_mps, height_m, throttle};
use crate::observation::{LandedState, VehicleKind};
use crate::time::{Instant, Span};
use crate::vehicle::{LANDED_STATE_AGE, Vehicle};

/// In the air for so long it has left the ground.
const SETTLED: Span = Span::from_secs(3);
/// Steady flight is not tilted further.
const STEADY_TILT_RAD: f32 = 0.26;

const TAKEOFF_HEIGHT_M: f32 = 1.0;
const LANDED_HEIGHT_M: f32 = 0.5;
const PLANE_FLYING_MPS: f32 = 8.0;
/// A multicopter hovers at a quarter to three quarters of its throttle, where nothing better is known.
pub(crate) const FLYING_THROTTLE: f32 = 0.2;
/// Full throttle: autopilots end within 5 % of it.
pub(crate) const FULL_THROTTLE: f32 = 0.95;
/// Near the ground.
const HPA_PER_METRE: f32 = 0.12;
const STILL_MPS: f32 = 0.5;
/// What climbs, sinks or goes faster than this moves, whatever wind and noise make of what stands.
const MOVES_MPS: f32 = 1.5;
/// With idle throttle the height of what stands may drift so far: pressure and estimators do.
const DRIFT_M: f32 = 8.0;
/// Above this it hovers though it does not shake: simulators do not.
const STANDS_M: f32 = 2.0;
const TAKEOFF_DEBOUNCE: Span = Span::from_millis(500);
const LANDING_DEBOUNCE: Span = Span::from_secs(2);
/// The autopilot's word has its own debounce; one message of nonsense at 2 Hz has none.
const WORD_DEBOUNCE: Span = Span::from_millis(600);
/// What is seen of the vehicle contradicts the autopilot's word for so long: the word is as one that is not told any more.
const CONTRADICTED: Span = LANDED_STATE_AGE;
/// On the ground, still armed, for so long: the flight is over. A plane rolls on from a touch-and-go within this.
const GROUND_LASTS: Span = Span::from_secs(8);

/// What the vehicle is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// On the ground.
    Ground,
    /// The first metres up.
    TakeOff,
    /// Standing in the air.
    Hover,
    /// Going up.
    Climb,
    /// Going somewhere.
    Cruise,
    /// Going down.
    Descent,
    /// The last metres down.
    Landing,
}

impl Phase {
    /// The name that records and reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ground => "ground",
            Self::TakeOff => "take_off",
            Self::Hover => "hover",
            Self::Climb => "climb",
            Self::Cruise => "cruise",
            Self::Descent => "descent",
            Self::Landing => "landing",
        }
    }
}

/// Vertical speed from which it is a climb or a descent; half of it near the ground.
const VERTICAL_MPS: f32 = 0.7;
/// Speed over ground from which it is a cruise.
const CRUISE_MPS: f32 = 1.5;
/// Below this height above the place of arming it takes off or lands.
const NEAR_GROUND_M: f32 = 3.0;

/// A flight begins or ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlightEvent {
    /// The vehicle left the ground.
    TakeOff,
    /// The vehicle was armed and in the air when it was heard first: the flight that it is on began before.
    Resumed,
    /// The flight is over: the vehicle is back on the ground, or disarmed.
    Landing,
}

/// What others than the autopilot's estimator know of the ground.
#[derive(Clone, Copy, Debug)]
pub struct Support {
    /// Something carries it that is not its rotors.
    pub is_supported: bool,
    /// The throttle from which on rotors may carry it. It idles below half of that.
    pub flying_throttle: f32,
    /// The barometer works: its pressure changed just now.
    pub has_pressure: bool,
}

impl Support {
    /// Nothing known.
    pub const UNKNOWN: Self =
        Self { is_supported: false, flying_throttle: FLYING_THROTTLE, has_pressure: true };

    const fn idle_throttle(&self) -> f32 {
        self.flying_throttle / 2.0
    }
}

/// Whether the vehicle flies.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "facts that have nothing to do with each other")]
pub struct Flight {
    airborne_since: Option<Instant>,
    /// A flight is going on, and when the vehicle was in the air last.
    flew_at: Option<Instant>,
    /// The vehicle was heard disarmed: where it is armed next is the place of arming.
    seen_disarmed: bool,
    /// The vehicle was seen on the ground: what follows is a take-off.
    seen_on_ground: bool,
    armed: bool,
    /// Height where it was armed.
    armed_height_m: Option<f32>,
    /// The pressure where it was armed, hPa; whether it changed since by more than a take-off does.
    armed_hpa: Option<f32>,
    rose: bool,
    support: Support,
    /// The pilot's display of the altitude while it stood without thrust.
    idle_altitude_m: Option<f32>,
    /// It had throttle to fly with since its arming: what is told of the throttle means something.
    driven: bool,
    changing_since: Option<Instant>,
    /// Since when what is seen contradicts the autopilot's word that it stands.
    contradicted_since: Option<Instant>,
    /// That word counts for nothing in this flight.
    overruled: bool,
}

impl Flight {
    /// On the ground.
    pub const fn grounded() -> Self {
        Self {
            airborne_since: None,
            flew_at: None,
            seen_disarmed: false,
            seen_on_ground: false,
            armed: false,
            armed_height_m: None,
            armed_hpa: None,
            rose: false,
            support: Support::UNKNOWN,
            idle_altitude_m: None,
            driven: false,
            changing_since: None,
            contradicted_since: None,
            overruled: false,
        }
    }

    /// Whether it is in the air.
    pub const fn airborne(&self) -> bool {
        self.airborne_since.is_some()
    }

    /// In the air for a moment: it flies, and does not just leave the ground.
    pub(crate) fn is_settled(&self, now: Instant) -> bool {
        self.airborne_since.is_some_and(|since| now.since(since) > SETTLED)
    }

    /// Settled, and not tilted far.
    pub(crate) fn is_steady(&self, now: Instant, vehicle: &Vehicle) -> bool {
        self.is_settled(now)
            && vehicle.attitude.get().is_none_or(|attitude| {
                attitude.roll.0.abs() < STEADY_TILT_RAD && attitude.pitch.0.abs() < STEADY_TILT_RAD
            })
    }

    /// When it left the ground last, while it is in the air.
    pub const fn airborne_since(&self) -> Option<Instant> {
        self.airborne_since
    }

    /// Whether a flight has begun and not ended: in the air, or on the ground for a moment.
    pub const fn is_open(&self) -> bool {
        self.flew_at.is_some()
    }

    /// Whether it was ever seen on the ground: a flight that goes on without that began before the vehicle was heard.
    pub const fn was_on_ground(&self) -> bool {
        self.seen_on_ground
    }

    /// Whether it is known to stand on the ground.
    pub(crate) const fn stands(&self) -> bool {
        self.seen_on_ground && !self.is_open()
    }

    /// A step in which nothing changes: a mishap goes on, and what the vehicle says of itself means little.
    pub(crate) fn stay(&mut self, now: Instant) {
        self.changing_since = None;
        if self.is_open() {
            self.flew_at = Some(now);
        }
    }

    /// A step of a vehicle that is down for good, until it is armed again: the flight is over.
    pub(crate) fn end(&mut self, now: Instant, vehicle: &Vehicle) -> Option<FlightEvent> {
        self.note_arming(now, vehicle);
        let open = self.is_open();
        self.seen_on_ground = true;
        (self.airborne_since, self.flew_at, self.changing_since) = (None, None, None);
        open.then_some(FlightEvent::Landing)
    }

    /// One step, at least every 50 ms.
    pub fn step(&mut self, now: Instant, vehicle: &Vehicle, support: Support) -> Option<FlightEvent> {
        self.support = support;
        self.note_arming(now, vehicle);
        let idles = support.is_supported || self.idles(now, vehicle);
        let word = Self::autopilot_says(now, vehicle);
        self.weigh(now, vehicle, word, idles);
        // That it stands needs a second witness: one wrong landed state ends nothing that is high and has thrust or speed.
        let stands = |this: &Self| !(this.overruled || this.airborne() && this.surely_flies(now, vehicle));
        let says = word.filter(|flies| if *flies { !idles } else { stands(self) });
        // What was terminated before it was heard falls or lies.
        let flies = self.armed
            && can_fly(vehicle)
            && (self.is_open() || vehicle.terminated_since.is_none())
            && says.unwrap_or_else(|| !idles && self.seems_to_fly(now, vehicle));
        let debounce = match (says, self.airborne()) {
            // What is on the ground is judged as such at once: motors that stop are no fault there. One wrong word ends no
            // flight.
            (Some(_), true) => Span::ZERO,
            (_, true) if !self.armed => Span::ZERO,
            (Some(_), false) => WORD_DEBOUNCE,
            (None, false) => TAKEOFF_DEBOUNCE,
            (None, true) => LANDING_DEBOUNCE,
        };
        if flies == self.airborne() {
            self.changing_since = None;
            let knows = says.is_some() || !self.armed || height_m(now, vehicle).is_some();
            self.seen_on_ground |= !flies && knows && vehicle.heartbeat.get().is_some();
        } else {
            let since = *self.changing_since.get_or_insert(now);
            if now.since(since) >= debounce {
                self.changing_since = None;
                self.airborne_since = flies.then_some(since);
            }
        }
        self.begin_or_end(now)
    }

    /// Whether the autopilot's word that it stands counts.
    fn weigh(&mut self, now: Instant, vehicle: &Vehicle, word: Option<bool>, idles: bool) {
        if word == Some(true) || !self.armed {
            (self.contradicted_since, self.overruled) = (None, false);
            return;
        }
        self.overruled &= self.is_open();
        if word.is_none() || self.overruled || idles || !self.surely_flies(now, vehicle) {
            self.contradicted_since = None;
            return;
        }
        let since = *self.contradicted_since.get_or_insert(now);
        if now.since(since) >= CONTRADICTED {
            self.overruled = true;
            self.changing_since = Some(since);
        }
    }

    /// Whether it flies by all that is seen: above or below the ground where it was armed, and with the thrust or the speed of flight.
    /// Once in the air, moving without idling is flight too.
    fn surely_flies(&self, now: Instant, vehicle: &Vehicle) -> bool {
        let height_m = self.height_above_start_m(now, vehicle).or_else(|| self.rise_m(now, vehicle));
        let is_driven = if vehicle.hovers(now) == Some(true) {
            let Support { flying_throttle, .. } = self.support;
            let moves = || self.airborne() && moves(now, vehicle);
            throttle(now, vehicle).is_some_and(|throttle| {
                throttle >= flying_throttle || (throttle >= self.support.idle_throttle() && moves())
            })
        } else {
            is_fast(ground_speed_mps(now, vehicle)) || is_fast(airspeed_mps(now, vehicle))
        };
        can_fly(vehicle) && is_driven && height_m.is_some_and(|height_m| height_m.abs() > STANDS_M)
    }

    fn note_arming(&mut self, now: Instant, vehicle: &Vehicle) {
        let Some(heartbeat) = vehicle.heartbeat.get() else { return };
        if !heartbeat.armed {
            (self.seen_disarmed, self.armed_height_m) = (true, None);
        } else if self.seen_disarmed && !self.armed {
            self.armed_height_m = height_m(now, vehicle);
        }
        self.armed = heartbeat.armed;
        let pressure =
            vehicle.air.get().and_then(|air| air.pressure).filter(|pressure| pressure.0.is_finite());
        if !self.armed {
            (self.armed_hpa, self.rose) = (None, false);
        } else if let Some(pressure) = pressure {
            let off_hpa = libm::fabsf(pressure.0 - *self.armed_hpa.get_or_insert(pressure.0));
            self.rose |= off_hpa >= TAKEOFF_HEIGHT_M * HPA_PER_METRE;
        }
        let flying = |throttle| throttle >= self.support.flying_throttle;
        self.driven = self.armed && (self.driven || throttle(now, vehicle).is_some_and(flying));
        let idle = self.support.idle_throttle();
        let idles = !self.armed || throttle(now, vehicle).is_some_and(|throttle| throttle < idle);
        if idles && !self.airborne() {
            self.idle_altitude_m = altitude_m(now, vehicle).or(self.idle_altitude_m);
        }
    }

    fn begin_or_end(&mut self, now: Instant) -> Option<FlightEvent> {
        match (self.airborne(), self.flew_at) {
            (true, None) => {
                self.flew_at = Some(now);
                Some(if self.seen_on_ground { FlightEvent::TakeOff } else { FlightEvent::Resumed })
            }
            (true, Some(_)) => {
                self.flew_at = Some(now);
                None
            }
            (false, Some(last)) if !self.armed || now.since(last) >= GROUND_LASTS => {
                self.flew_at = None;
                Some(FlightEvent::Landing)
            }
            (false, _) => None,
        }
    }

    /// Height above the place of arming where that was seen, above home otherwise.
    fn height_above_start_m(&self, now: Instant, vehicle: &Vehicle) -> Option<f32> {
        height_m(now, vehicle).map(|height_m| height_m - self.armed_height_m.unwrap_or(0.0))
    }

    /// What the vehicle is doing now.
    pub fn phase(&self, now: Instant, vehicle: &Vehicle) -> Phase {
        if !self.airborne() {
            return Phase::Ground;
        }
        let climb_mps = climb_mps(now, vehicle).unwrap_or(0.0);
        let near_ground =
            self.height_above_start_m(now, vehicle).is_some_and(|height_m| height_m.abs() < NEAR_GROUND_M);
        if near_ground && climb_mps > VERTICAL_MPS / 2.0 {
            Phase::TakeOff
        } else if near_ground && climb_mps < -VERTICAL_MPS / 2.0 {
            Phase::Landing
        } else if climb_mps > VERTICAL_MPS {
            Phase::Climb
        } else if climb_mps < -VERTICAL_MPS {
            Phase::Descent
        } else if ground_speed_mps(now, vehicle).is_some_and(|speed_mps| speed_mps > CRUISE_MPS) {
            Phase::Cruise
        } else {
            Phase::Hover
        }
    }

    fn autopilot_says(now: Instant, vehicle: &Vehicle) -> Option<bool> {
        match vehicle.landed.within(now, LANDED_STATE_AGE)? {
            LandedState::OnGround => Some(false),
            // Sent from the spooling up of the motors on the ground until the height that was asked for is reached:
            // the height decides.
            LandedState::TakingOff | LandedState::Unknown => None,
            LandedState::InAir | LandedState::Landing => Some(true),
        }
    }

    /// Nothing that moves, and less throttle than flies, or no more vibration than at rest: `ArduPilot`'s and PX4's land detectors
    /// call a vehicle that is armed on the bench, spools up, or came down under a pilot's sticks, not landed. What glides moves;
    /// what is thrown, falls or autorotates does too.
    fn idles(&self, now: Instant, vehicle: &Vehicle) -> bool {
        if vehicle.hovers(now) == Some(true) && self.never_rose() && vehicle.inertial.is_calm(now) {
            return true;
        }
        let throttle = throttle(now, vehicle);
        let (idle, flying) = (self.support.idle_throttle(), self.support.flying_throttle);
        let enough = if self.airborne() { idle } else { flying };
        let little = throttle.is_some_and(|throttle| throttle < enough);
        let low =
            self.height_above_start_m(now, vehicle).is_some_and(|height_m| height_m.abs() < TAKEOFF_HEIGHT_M);
        // Of what stands, an estimator may drift away while its sensors rest.
        let off = throttle.is_some_and(|throttle| throttle < idle);
        let rests = !self.airborne() && off && vehicle.inertial.is_level(now);
        if ((little && low) || rests) && vehicle.hovers(now) == Some(true) {
            return true;
        }
        if moves(now, vehicle) {
            return false;
        }
        let height_m = self.height_above_start_m(now, vehicle).or_else(|| self.rise_m(now, vehicle));
        let within = |limit_m: f32| height_m.is_none_or(|height_m| height_m.abs() < limit_m);
        match vehicle.hovers(now).or_else(|| has_wings(vehicle).then_some(false)) {
            Some(true) => {
                let shakes = vehicle.inertial.shakes(now);
                // Some logs tell a throttle that says nothing.
                let told = throttle.filter(|_| self.driven || shakes != Some(true));
                let off = told.is_some_and(|throttle| throttle < idle);
                if self.airborne() {
                    // Little throttle alone is no landing: the height or the vibration must be that of the ground.
                    let idles = throttle.is_some_and(|throttle| throttle < flying);
                    let near = within(if shakes == Some(true) { STANDS_M } else { DRIFT_M });
                    let rests = shakes == Some(false);
                    return (off && (near || (rests && self.driven))) || (idles && rests && within(STANDS_M));
                }
                // With all its thrust it would climb.
                let low = height_m.is_some() && within(TAKEOFF_HEIGHT_M);
                let full = throttle.is_some_and(|throttle| throttle >= FULL_THROTTLE);
                (off && within(DRIFT_M))
                    || (full && low)
                    || ((shakes == Some(false) || vehicle.inertial.contradicts(now)) && within(STANDS_M))
            }
            Some(false) => {
                let air_mps = airspeed_mps(now, vehicle).unwrap_or(0.0);
                let slow = air_mps < PLANE_FLYING_MPS / 2.0 && ground_speed_mps(now, vehicle).is_some();
                let off = throttle.is_some_and(|throttle| throttle < flying);
                off && slow && height_m.is_some_and(|height_m| height_m < TAKEOFF_HEIGHT_M)
            }
            None => false,
        }
    }

    /// Whether the air pressure has stayed that of the place of arming, by a barometer that works. A vehicle that is heard first in the
    /// air was not seen there.
    const fn never_rose(&self) -> bool {
        self.seen_on_ground && self.support.has_pressure && self.armed_hpa.is_some() && !self.rose
    }

    /// Whether it stands without thrust.
    pub(crate) fn is_at_rest(&self, now: Instant, vehicle: &Vehicle) -> bool {
        let off =
            throttle(now, vehicle).map_or(!vehicle.armed(), |throttle| throttle < FLYING_THROTTLE / 4.0);
        !self.is_open() && off && vehicle.heartbeat.get().is_some()
    }

    /// How far the displayed altitude rose since it stood without thrust.
    fn rise_m(&self, now: Instant, vehicle: &Vehicle) -> Option<f32> {
        self.idle_altitude_m.zip(altitude_m(now, vehicle)).map(|(stood_m, is_m)| is_m - stood_m)
    }

    fn seems_to_fly(&self, now: Instant, vehicle: &Vehicle) -> bool {
        let speed_mps = ground_speed_mps(now, vehicle);
        let throttle = throttle(now, vehicle);
        let has_thrust = |least: f32| throttle.is_some_and(|throttle| throttle > least);
        let (idle, flying) = (self.support.idle_throttle(), self.support.flying_throttle);
        // Wind alone shows an airspeed on the ground.
        let by_air = is_fast(airspeed_mps(now, vehicle)) && (self.airborne() || has_thrust(flying));
        let fast = has_wings(vehicle) && (is_fast(speed_mps) || by_air);
        let Some(height_m) = self.height_above_start_m(now, vehicle) else {
            // Without any word about height, speed or thrust it goes on with what it does.
            if self.airborne() {
                return fast || throttle.is_none_or(|throttle| throttle > idle);
            }
            // Motors are tried on the bench: the barometer says so.
            let rose = self.rise_m(now, vehicle).is_none_or(|rise_m| rise_m > TAKEOFF_HEIGHT_M);
            return fast || (has_thrust(flying) && rose && !has_wings(vehicle));
        };
        if self.airborne() {
            // It hovers over a valley, unless it idles there.
            let thrust = throttle.is_none_or(|throttle| throttle > flying);
            let hangs = height_m < -STANDS_M && vehicle.hovers(now) == Some(true) && thrust;
            return height_m > LANDED_HEIGHT_M || speed_mps.unwrap_or(0.0) > STILL_MPS || by_air || hangs;
        }
        height_m > TAKEOFF_HEIGHT_M || fast
    }
}

/// Whether it climbs, sinks or goes faster than what stands.
fn moves(now: Instant, vehicle: &Vehicle) -> bool {
    let moves = |speed_mps: Option<f32>| speed_mps.is_some_and(|speed_mps| speed_mps.abs() > MOVES_MPS);
    moves(climb_mps(now, vehicle)) || moves(ground_speed_mps(now, vehicle))
}

/// A speed at which wings carry.
fn is_fast(speed_mps: Option<f32>) -> bool {
    speed_mps.is_some_and(|speed_mps| speed_mps > PLANE_FLYING_MPS)
}

fn can_fly(vehicle: &Vehicle) -> bool {
    vehicle.kind() != VehicleKind::Surface
}

fn has_wings(vehicle: &Vehicle) -> bool {
    matches!(vehicle.kind(), VehicleKind::Plane | VehicleKind::Vtol)
}

#[cfg(test)]
mod tests;
