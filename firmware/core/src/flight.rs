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
//! The place of arming counts only where arming was seen. Whoever hears an armed vehicle first (a restart in the air) takes
//! the height above home as it is, and goes on in the air at once: [`FlightEvent::Resumed`].
//!
//! # Flights
//! A flight begins with leaving the ground. It ends when the vehicle is disarmed, or when it has been on the ground for
//! eight seconds; so a bounce and a touch-and-go are parts of one flight.

use crate::observation::{LandedState, VehicleKind};
use crate::time::{Instant, Span};
use crate::vehicle::{LANDED_STATE_AGE, Vehicle};

/// Steady flight: in the air for this long, and not tilted further.
const STEADY_AFTER: Span = Span::from_secs(3);
const STEADY_TILT_RAD: f32 = 0.26;

const TAKEOFF_HEIGHT_M: f32 = 1.0;
const LANDED_HEIGHT_M: f32 = 0.5;
const PLANE_FLYING_MPS: f32 = 8.0;
/// A multicopter hovers at a quarter to three quarters of its throttle and idles on the ground below a tenth.
const FLYING_THROTTLE: f32 = 0.2;
const IDLE_THROTTLE: f32 = 0.1;
const FULL_THROTTLE: f32 = 0.95;
/// Nothing that is watched here is faster: garbage, which must not get into sums and maxima.
const SPEED_MAX_MPS: f32 = 1_000.0;
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
/// On the ground, still armed, for so long: the flight is over. A plane rolls on from a touch-and-go within this.
const GROUND_LASTS: Span = Span::from_secs(8);
/// Positions and speeds older than this decide nothing.
const MOTION_AGE: Span = Span::from_secs(3);

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

/// Whether the vehicle flies.
#[derive(Clone, Copy, Debug, Default)]
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
    /// The pilot's display of the altitude while it stood without thrust.
    idle_altitude_m: Option<f32>,
    /// It had throttle to fly with since its arming: what is told of the throttle means something.
    driven: bool,
    changing_since: Option<Instant>,
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
            idle_altitude_m: None,
            driven: false,
            changing_since: None,
        }
    }

    /// Whether it is in the air.
    pub const fn airborne(&self) -> bool {
        self.airborne_since.is_some()
    }

    /// In the air for a moment, and not tilted far.
    pub(crate) fn is_steady(&self, now: Instant, vehicle: &Vehicle) -> bool {
        self.airborne_since().is_some_and(|since| now.since(since) > STEADY_AFTER)
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
    pub fn step(&mut self, now: Instant, vehicle: &Vehicle) -> Option<FlightEvent> {
        self.note_arming(now, vehicle);
        let idles = self.idles(now, vehicle);
        let says = Self::autopilot_says(now, vehicle).filter(|flies| !flies || !idles);
        let flies = self.armed
            && can_fly(vehicle)
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

    fn note_arming(&mut self, now: Instant, vehicle: &Vehicle) {
        let Some(heartbeat) = vehicle.heartbeat.get() else { return };
        if !heartbeat.armed {
            (self.seen_disarmed, self.armed_height_m) = (true, None);
        } else if self.seen_disarmed && !self.armed {
            self.armed_height_m = height_m(now, vehicle);
        }
        self.armed = heartbeat.armed;
        let flying = |throttle| throttle >= FLYING_THROTTLE;
        self.driven = self.armed && (self.driven || throttle(now, vehicle).is_some_and(flying));
        let idles = !self.armed || throttle(now, vehicle).is_some_and(|throttle| throttle < IDLE_THROTTLE);
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
            self.height_above_start_m(now, vehicle).is_some_and(|height_m| height_m < NEAR_GROUND_M);
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
        let throttle = throttle(now, vehicle);
        let enough = if self.airborne() { IDLE_THROTTLE } else { FLYING_THROTTLE };
        let little = throttle.is_some_and(|throttle| throttle < enough);
        let low =
            self.height_above_start_m(now, vehicle).is_some_and(|height_m| height_m.abs() < TAKEOFF_HEIGHT_M);
        // Of what stands, an estimator may drift away while its sensors rest.
        let off = throttle.is_some_and(|throttle| throttle < IDLE_THROTTLE);
        let rests = !self.airborne() && off && vehicle.inertial.is_level(now);
        if ((little && low) || rests) && vehicle.hovers(now) == Some(true) {
            return true;
        }
        let moves = |speed_mps: Option<f32>| speed_mps.is_some_and(|speed_mps| speed_mps.abs() > MOVES_MPS);
        if moves(climb_mps(now, vehicle)) || moves(ground_speed_mps(now, vehicle)) {
            return false;
        }
        let height_m = self.height_above_start_m(now, vehicle).or_else(|| self.rise_m(now, vehicle));
        let within = |limit_m: f32| height_m.is_none_or(|height_m| height_m.abs() < limit_m);
        match vehicle.hovers(now).or_else(|| has_wings(vehicle).then_some(false)) {
            Some(true) => {
                let shakes = vehicle.inertial.shakes(now);
                // Some logs tell a throttle that says nothing.
                let told = throttle.filter(|_| self.driven || shakes != Some(true));
                let off = told.is_some_and(|throttle| throttle < IDLE_THROTTLE);
                if self.airborne() {
                    let idles = throttle.is_some_and(|throttle| throttle < FLYING_THROTTLE);
                    let calm = shakes == Some(false) && within(STANDS_M);
                    return (off && (self.driven || within(DRIFT_M))) || (idles && calm);
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
                let off = throttle.is_some_and(|throttle| throttle < FLYING_THROTTLE);
                off && slow && height_m.is_some_and(|height_m| height_m < TAKEOFF_HEIGHT_M)
            }
            None => false,
        }
    }

    /// Whether it stands without thrust.
    pub(crate) fn is_at_rest(&self, now: Instant, vehicle: &Vehicle) -> bool {
        let off = throttle(now, vehicle).map_or(!vehicle.armed(), |throttle| throttle < IDLE_THROTTLE / 2.0);
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
        let is_fast =
            |speed_mps: Option<f32>| speed_mps.is_some_and(|speed_mps| speed_mps > PLANE_FLYING_MPS);
        // Wind alone shows an airspeed on the ground.
        let by_air = is_fast(airspeed_mps(now, vehicle)) && (self.airborne() || has_thrust(FLYING_THROTTLE));
        let fast = has_wings(vehicle) && (is_fast(speed_mps) || by_air);
        let Some(height_m) = self.height_above_start_m(now, vehicle) else {
            // Without any word about height, speed or thrust it goes on with what it does.
            if self.airborne() {
                return fast || throttle.is_none_or(|throttle| throttle > IDLE_THROTTLE);
            }
            // Motors are tried on the bench: the barometer says so.
            let rose = self.rise_m(now, vehicle).is_none_or(|rise_m| rise_m > TAKEOFF_HEIGHT_M);
            return fast || (has_thrust(FLYING_THROTTLE) && rose && !has_wings(vehicle));
        };
        if self.airborne() {
            // It hovers over a valley.
            let hangs =
                height_m < -STANDS_M && vehicle.hovers(now) == Some(true) && has_thrust(FLYING_THROTTLE);
            return height_m > LANDED_HEIGHT_M || speed_mps.unwrap_or(0.0) > STILL_MPS || by_air || hangs;
        }
        height_m > TAKEOFF_HEIGHT_M || fast
    }
}

fn can_fly(vehicle: &Vehicle) -> bool {
    vehicle.kind() != VehicleKind::Surface
}

fn has_wings(vehicle: &Vehicle) -> bool {
    matches!(vehicle.kind(), VehicleKind::Plane | VehicleKind::Vtol)
}

/// Height above home; above the local origin where there is no global position.
pub(crate) fn height_m(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    let global = vehicle.global.within(now, MOTION_AGE).map(|global| global.relative_altitude.0);
    let local = || vehicle.local.within(now, MOTION_AGE).map(|local| -local.position[2].0);
    global.or_else(local).filter(|height_m| height_m.is_finite())
}

/// The part of the throttle that the autopilot gives.
fn throttle(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    let hud = vehicle.hud.within(now, MOTION_AGE);
    hud.and_then(|hud| hud.throttle).map(|throttle| throttle.0).filter(|part| part.is_finite())
}

/// The speed through the air, in m/s.
fn airspeed_mps(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    let hud = vehicle.hud.within(now, MOTION_AGE);
    hud.and_then(|hud| hud.airspeed)
        .map(|speed| speed.0)
        .filter(|speed| (0.0..=SPEED_MAX_MPS).contains(speed))
}

/// The altitude of the pilot's display, of the barometer where there is no position.
fn altitude_m(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    let hud = vehicle.hud.within(now, MOTION_AGE);
    hud.and_then(|hud| hud.altitude).map(|altitude| altitude.0).filter(|height_m| height_m.is_finite())
}

/// Speed upwards from the best source that is fresh, in m/s.
pub(crate) fn climb_mps(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    let global = vehicle.global.within(now, MOTION_AGE).map(|global| -global.velocity[2].0);
    let local = || vehicle.local.within(now, MOTION_AGE).map(|local| -local.velocity[2].0);
    let hud = || vehicle.hud.within(now, MOTION_AGE).and_then(|hud| hud.climb).map(|climb| climb.0);
    global.or_else(local).or_else(hud).filter(|climb| climb.abs() <= SPEED_MAX_MPS)
}

/// Speed over ground from the best source that is fresh, in m/s.
pub fn ground_speed_mps(now: Instant, vehicle: &Vehicle) -> Option<f32> {
    let norm = |north: f32, east: f32| libm::sqrtf(north * north + east * east);
    let global =
        vehicle.global.within(now, MOTION_AGE).map(|global| norm(global.velocity[0].0, global.velocity[1].0));
    let local =
        || vehicle.local.within(now, MOTION_AGE).map(|local| norm(local.velocity[0].0, local.velocity[1].0));
    let hud = || vehicle.hud.within(now, MOTION_AGE).and_then(|hud| hud.groundspeed).map(|speed| speed.0);
    global.or_else(local).or_else(hud).filter(|speed| (0.0..=SPEED_MAX_MPS).contains(speed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::{GlobalPosition, Heartbeat, Hud, Observation, Source, VtolState};
    use crate::units::{Fraction, Metres, MetresPerSecond};

    const AUTOPILOT: Source = Source { system: 1, component: 1 };

    fn fly(kind: VehicleKind, heights_m: &[(u64, f32)]) -> Vec<(u64, FlightEvent)> {
        let mut vehicle = Vehicle::unknown();
        let mut flight = Flight::grounded();
        let mut events = Vec::new();
        let mut now_ms = 0;
        for (until_ms, height_m) in heights_m {
            while now_ms < *until_ms {
                let now = Instant::from_millis(now_ms);
                let heartbeat = Heartbeat { armed: now_ms >= 1_000, kind, ..Heartbeat::default() };
                vehicle.observe(now, AUTOPILOT, &Observation::Heartbeat(heartbeat));
                let global =
                    GlobalPosition { relative_altitude: Metres(*height_m), ..GlobalPosition::default() };
                vehicle.observe(now, AUTOPILOT, &Observation::GlobalPosition(global));
                events.extend(flight.step(now, &vehicle).map(|event| (now_ms, event)));
                now_ms += 50;
            }
        }
        events
    }

    #[test]
    fn height_above_the_place_of_arming_is_a_take_off() {
        let heights = [(5_000, 20.0), (10_000, 25.0), (30_000, 20.1)];
        // Two seconds of standing, and then the flight is over.
        let expected = [(5_500, FlightEvent::TakeOff), (19_950, FlightEvent::Landing)];
        assert_eq!(fly(VehicleKind::Rotorcraft, &heights), expected);
    }

    #[test]
    fn a_submarine_never_flies() {
        assert_eq!(fly(VehicleKind::Surface, &[(5_000, 0.0), (10_000, 25.0)]), []);
    }

    #[test]
    fn a_bounce_and_a_touch_and_go_are_one_flight() {
        let heights = [
            (5_000, 0.0),
            (20_000, 25.0),
            (25_000, 0.0),
            (26_000, 3.0),
            (32_000, 0.0),
            (50_000, 25.0),
            (70_000, 0.0),
        ];
        let events: Vec<_> =
            fly(VehicleKind::Rotorcraft, &heights).into_iter().map(|(_, event)| event).collect();
        assert_eq!(events, [FlightEvent::TakeOff, FlightEvent::Landing]);
    }

    /// Armed all along; what the autopilot says of it, each for so many messages, two a second.
    fn told(kind: VehicleKind, words: &[(u64, LandedState)]) -> Vec<(u64, FlightEvent)> {
        let (mut vehicle, mut flight, mut events, mut now_ms) =
            (Vehicle::unknown(), Flight::grounded(), Vec::new(), 0);
        let heartbeat = Heartbeat { armed: true, kind, ..Heartbeat::default() };
        for (messages, landed) in words {
            for _ in 0..messages * 10 {
                let now = Instant::from_millis(now_ms);
                vehicle.observe(now, AUTOPILOT, &Observation::Heartbeat(heartbeat));
                if now_ms % 500 == 0 {
                    vehicle.observe(now, AUTOPILOT, &Observation::Landed(*landed, VtolState::Unknown));
                }
                events.extend(flight.step(now, &vehicle).map(|event| (now_ms, event)));
                now_ms += 50;
            }
        }
        events
    }

    #[test]
    fn the_autopilots_own_word_counts() {
        let words = [
            (10, LandedState::OnGround),
            (4, LandedState::TakingOff),
            (20, LandedState::InAir),
            (10, LandedState::Landing),
            (40, LandedState::OnGround),
        ];
        let expected = [(7_600, FlightEvent::TakeOff), (29_950, FlightEvent::Landing)];
        assert_eq!(told(VehicleKind::Rotorcraft, &words), expected);
    }

    #[test]
    fn a_rover_never_flies_whatever_its_landed_state_says() {
        assert_eq!(told(VehicleKind::Surface, &[(10, LandedState::OnGround), (40, LandedState::InAir)]), []);
    }

    #[test]
    fn one_wrong_word_is_no_landing() {
        let mut words = vec![(10, LandedState::OnGround), (20, LandedState::InAir)];
        words.extend([(1, LandedState::OnGround), (40, LandedState::InAir)]);
        assert_eq!(told(VehicleKind::Rotorcraft, &words).len(), 1);
    }

    #[test]
    fn a_landed_state_that_is_lost_leaves_the_decision_to_what_else_is_known() {
        let (mut vehicle, mut flight, mut events) = (Vehicle::unknown(), Flight::grounded(), Vec::new());
        for now_ms in (0..60_000).step_by(50) {
            let now = Instant::from_millis(now_ms);
            let heartbeat =
                Heartbeat { armed: now_ms >= 1_000, kind: VehicleKind::Rotorcraft, ..Heartbeat::default() };
            vehicle.observe(now, AUTOPILOT, &Observation::Heartbeat(heartbeat));
            let height_m = if (5_000..50_000).contains(&now_ms) { 30.0 } else { 0.0 };
            let global = GlobalPosition { relative_altitude: Metres(height_m), ..GlobalPosition::default() };
            vehicle.observe(now, AUTOPILOT, &Observation::GlobalPosition(global));
            if (5_000..20_000).contains(&now_ms) {
                vehicle.observe(now, AUTOPILOT, &Observation::Landed(LandedState::InAir, VtolState::Unknown));
            }
            events.extend(flight.step(now, &vehicle));
        }
        assert_eq!(events, [FlightEvent::TakeOff, FlightEvent::Landing]);
    }

    #[test]
    fn who_is_heard_first_in_the_air_goes_on_in_the_air_at_once() {
        let (mut vehicle, mut flight) = (Vehicle::unknown(), Flight::grounded());
        let mut events = Vec::new();
        for now_ms in (0..2_000).step_by(50) {
            let now = Instant::from_millis(now_ms);
            let heartbeat = Heartbeat { armed: true, kind: VehicleKind::Rotorcraft, ..Heartbeat::default() };
            vehicle.observe(now, AUTOPILOT, &Observation::Heartbeat(heartbeat));
            let global = GlobalPosition { relative_altitude: Metres(50.0), ..GlobalPosition::default() };
            vehicle.observe(now, AUTOPILOT, &Observation::GlobalPosition(global));
            events.extend(flight.step(now, &vehicle).map(|event| (now_ms, event)));
        }
        assert_eq!(events, [(500, FlightEvent::Resumed)]);
    }

    /// Armed from 1 s on, without any position: its throttle and its airspeed, each until a time.
    fn fly_by_hud(kind: VehicleKind, said: &[(u64, f32, f32)], height_m: Option<f32>) -> Vec<FlightEvent> {
        let (mut vehicle, mut flight, mut events, mut now_ms) =
            (Vehicle::unknown(), Flight::grounded(), Vec::new(), 0);
        for (until_ms, throttle, airspeed_mps) in said {
            while now_ms < *until_ms {
                let now = Instant::from_millis(now_ms);
                let heartbeat = Heartbeat { armed: now_ms >= 1_000, kind, ..Heartbeat::default() };
                vehicle.observe(now, AUTOPILOT, &Observation::Heartbeat(heartbeat));
                let hud = Hud {
                    throttle: Some(Fraction(*throttle)),
                    airspeed: Some(MetresPerSecond(*airspeed_mps)),
                    ..Hud::default()
                };
                vehicle.observe(now, AUTOPILOT, &Observation::Hud(hud));
                if let Some(height_m) = height_m {
                    // Down into a valley, where it stays.
                    let height_m =
                        if now_ms < 5_000 { 0.0 } else { (20.0 - now_ms as f32 / 500.0).max(height_m) };
                    let relative_altitude = Metres(height_m);
                    let global = GlobalPosition { relative_altitude, ..GlobalPosition::default() };
                    vehicle.observe(now, AUTOPILOT, &Observation::GlobalPosition(global));
                }
                events.extend(flight.step(now, &vehicle));
                now_ms += 50;
            }
        }
        events
    }

    #[test]
    fn a_plane_without_a_position_flies_by_its_airspeed_and_a_wind_over_the_runway_is_no_flight() {
        let flown = [(5_000, 0.0, 3.0), (40_000, 0.6, 18.0), (50_000, 0.0, 12.0), (60_000, 0.0, 2.0)];
        let expected = [FlightEvent::TakeOff, FlightEvent::Landing];
        assert_eq!(fly_by_hud(VehicleKind::Plane, &flown, None), expected);
        assert_eq!(fly_by_hud(VehicleKind::Plane, &[(60_000, 0.0, 12.0)], None), []);
    }

    #[test]
    fn a_multicopter_that_hovers_below_its_place_of_arming_flies_until_it_stands_there() {
        let hovers = [(5_000, 0.0, 0.0), (60_000, 0.5, 0.0)];
        assert_eq!(fly_by_hud(VehicleKind::Rotorcraft, &hovers, Some(-15.0)), [FlightEvent::TakeOff]);
        let lands = [(5_000, 0.0, 0.0), (60_000, 0.5, 0.0), (80_000, 0.02, 0.0)];
        let expected = [FlightEvent::TakeOff, FlightEvent::Landing];
        assert_eq!(fly_by_hud(VehicleKind::Rotorcraft, &lands, Some(-15.0)), expected);
    }
}
