//! The phases of a flight: on the ground, in the air, in a mishap, down.
//!
//! Five witnesses say each step that the vehicle flies or stands (`witness`): the autopilot's word, height, thrust,
//! inertial sensors, speed. A majority of them moves the phase:
//!
//! | phase | evidence | for | next |
//! |---|---|---|---|
//! | ground | two witnesses of flight, more than of standing; or the word, the height, or the only one that tells, and none against it | 0.6 s | airborne |
//! | ground | the same against the word | 5 s | airborne |
//! | airborne | the word and another one that it stands, and two more than of flight | at once | touched |
//! | airborne | two witnesses of standing, more than of flight; or the only one that tells | 2 s | touched |
//! | touched | as on the ground | as there | airborne: a bounce, a touch-and-go |
//! | touched | | 8 s since the touch | ground: the flight is over |
//! | airborne, touched | disarmed, and not watched | at once | ground: the flight is over |
//! | any, in a flight | a sign of a mishap: free fall, tumbling, overturned, sinking, disarmed in the air | as the sign | falling |
//! | any, in a flight; falling | a shock, and it lies still | as the sign | impacted |
//! | falling, impacted | two witnesses of standing, more than of flight | still for 1 s, or 5 s after the last sign | down |
//! | falling, impacted | two witnesses of flight, more than of standing; with power | 5 s after the last sign | airborne |
//! | falling, impacted | no majority: down if it is off or silent, or two say that it stands; it flies otherwise | 30 s after the last sign | down, airborne |
//! | down | armed again; or two witnesses of flight, more than of standing | at once; 4 s | ground |
//!
//! A take-off and a landing have the time at which their majority began. While the autopilot's word is that the
//! vehicle flies, it has not landed. Without power, or with less than 5 % of throttle on rotors, a vehicle does not
//! take off. With less than 10 % it does after 5 s, if two witnesses agree and none disagrees. A bad inertial sensor
//! makes no sign: it falls or turns for 5 s while two other witnesses report flight and the vehicle does not sink.
//! Surface vehicles never fly (PX4 calls an armed rover "in air").
//!
//! Signs of a mishap (`signs`) count while the vehicle is armed and for 10 s afterwards; docs/health.md has their
//! table. Outside of a flight they are reported once for each arming ([`MishapChange::OnBench`]), but a vehicle that its
//! own rotors turned over has had a mishap. `hums check` judges a fall during a loss of the link, and of a vehicle
//! that was off before its first message.

mod disarming;
mod signs;
mod touchdown;
mod witness;

use crate::latest::Reading;
use crate::mishap::{Location, MishapChange, MishapKind, Report};
use crate::motion::{Kinematics, MOVES_MPS, OFF, STILL_MPS, climb_mps, ground_speed_mps, height_m, throttle};
use crate::observation::VehicleKind;
use crate::parameters::Params;
use crate::pressure::Pressure;
use crate::thrust::{Power, Thrust};
use crate::time::{BootMs, Millis, SILENT, Stamp};
use crate::units::norm;
use crate::vehicle::Vehicle;
use disarming::DisarmWatch;
pub(crate) use signs::overturned_deg;
use signs::{Peak, Shock, Signs};
use touchdown::Touchdown;
use witness::{HEIGHT, THRUST, Votes, WORD, is_on_wings, on_rotors};

/// In the air for so long it has left the ground.
const SETTLED: Millis = Millis::from_secs(3);
/// Steady flight is not tilted further, rad.
const STEADY_TILT_RAD: f32 = 0.26;
/// Speed of a climb or a descent, m/s; half of it near the ground.
const VERTICAL_MPS: f32 = 0.7;
/// Within this height of the place of arming it takes off or lands, m.
const NEAR_GROUND_M: f32 = 3.0;
/// A clear majority moves the phase after so long: one wrong message at 2 Hz does not last.
const BRIEF: Millis = Millis::from_millis(600);
/// A majority against the word begins a flight after so long, as long as a landed state lasts that is not told again.
const LONG: Millis = SILENT;
/// A majority without the word ends one after so long: a slow hover near the ground is shorter.
const LANDS: Millis = Millis::from_secs(2);
/// On the ground, still armed, for so long: the flight is over, and the vehicle is known to stand. A plane rolls on from a touch-and-go within this.
const GROUND_LASTS: Millis = Millis::from_secs(8);
/// How long after disarming it is watched.
const WATCHED: Millis = Millis::from_secs(10);
/// A mishap ends this long after its last sign.
const RECOVERED: Millis = Millis::from_secs(5);
/// A mishap without a majority is decided after so long.
const GIVEN_UP: Millis = Millis::from_secs(30);
/// A vehicle that was down has taken off again after so long.
const TAKEN_OFF: Millis = Millis::from_secs(4);
/// A vehicle is still after so long.
const STILL: Millis = Millis::from_secs(1);
/// A still vehicle turns slower, rad/s.
const STILL_RADPS: f32 = 0.3;
/// A still vehicle carries about its weight, g.
const STILL_G: core::ops::Range<f32> = 0.7..1.3;
/// A pressure that rose no longer ago rises still.
const RISES: Millis = Millis::from_millis(300);
/// If a vehicle had throttle within this time before it lay over, its rotors turned it over.
const DRIVEN: Millis = Millis::from_secs(5);

numbered! {
    /// A part of the flight.
    pub enum Phase {
        /// On the ground.
        Ground "ground",
        /// The first metres up.
        TakeOff "take_off",
        /// Standing in the air.
        Hover "hover",
        /// Going up.
        Climb "climb",
        /// Going somewhere.
        Cruise "cruise",
        /// Going down.
        Descent "descent",
        /// The last metres down.
        Landing "landing",
    }
}

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

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    #[default]
    Ground,
    Airborne,
    /// On the ground for a moment: the flight goes on.
    Touched,
    Falling,
    Impacted,
    Down,
}

impl Stage {
    const fn is_mishap(self) -> bool {
        matches!(self, Self::Falling | Self::Impacted | Self::Down)
    }

    const fn has_hit(self) -> bool {
        matches!(self, Self::Impacted | Self::Down)
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "facts that have nothing to do with each other")]
struct Arming {
    is_armed: bool,
    /// Armed and not terminated.
    is_on: bool,
    off_at: Option<BootMs>,
    /// A disarmed vehicle was seen: it is at its place of arming when it is armed next.
    seen_off: bool,
    /// It was level since the arming.
    stood: bool,
    /// It was in the air since the arming.
    flew: bool,
    /// A sign outside of a flight was reported since the arming.
    on_bench: bool,
}

state! {
    struct Beat {
        at: BootMs,
        height_m: Option<f32>,
    }

    struct Felt {
        at: BootMs,
        load_g: Option<f32>,
        /// The part of the force that pushes from above, g.
        from_above_g: f32,
        rate_radps: f32,
    }

    /// The phases of a flight.
    pub struct Flight {
        stage: Stage,
        airborne_since: Option<BootMs>,
        /// A flight is open, and when the vehicle was in the air last.
        flew_at: Option<BootMs>,
        changing_since: Option<BootMs>,
        seen_on_ground: bool,
        /// Pressure or position show it away from the ground; without both, the autopilot does not call it landed.
        pub(crate) is_clear: bool,
        /// Since when the estimate of height and speed has been lost.
        lost_since: Stamp,
        arming: Arming,
        beat: Beat,
        heard_at: BootMs,
        pub(crate) pressure: Pressure,
        pub(crate) thrust: Thrust,
        pub(crate) motion: Kinematics,
        felt: Felt,
        /// Its greatest height with all its thrust, which fades.
        peak: Peak,
        watch: Option<DisarmWatch>,
        signs: Signs,
        shock: Option<Shock>,
        still_since: Stamp,
        flies_since: Stamp,
        /// Since when it is carried without rotors, and the pressure then, hPa.
        supported: Option<(BootMs, f32)>,
        hit_at: BootMs,
        touchdown: Touchdown,
        /// The hardest touch of this flight, or of its mishap, m/s.
        pub(crate) touch_mps: f32,
        /// When it leaned by more than 45 degrees, or turned fast, last, while armed.
        tilted_at: Option<BootMs>,
        /// The position at which a mishap began, or ended.
        place: Location,
    }
}

impl Flight {
    /// Whether it is in the air; in a mishap, whether it was.
    pub const fn airborne(&self) -> bool {
        self.airborne_since.is_some()
    }

    /// In the air for a moment, not just leaving the ground.
    pub(crate) fn is_settled(&self, now: BootMs) -> bool {
        self.airborne_since.is_some_and(|since| now.since(since) > SETTLED)
    }

    pub(crate) fn is_steady(&self, now: BootMs, vehicle: &Vehicle) -> bool {
        self.is_settled(now)
            && vehicle.attitude.get().is_none_or(|attitude| attitude.lean_rad() < STEADY_TILT_RAD)
    }

    /// When it left the ground last, while it is in the air.
    pub const fn airborne_since(&self) -> Option<BootMs> {
        self.airborne_since
    }

    /// Whether a flight has begun and not ended: in the air, on the ground for a moment, or in a mishap.
    pub const fn is_open(&self) -> bool {
        self.flew_at.is_some()
    }

    /// Whether a majority says that it stands, and has not lasted yet: this time is flight if the vehicle flies on, and ground if not.
    pub const fn may_have_landed(&self) -> bool {
        self.airborne() && self.changing_since.is_some()
    }

    /// Whether it was ever seen on the ground: a flight that goes on without that began before the vehicle was heard.
    pub const fn was_on_ground(&self) -> bool {
        self.seen_on_ground
    }

    pub(crate) const fn stands(&self) -> bool {
        self.seen_on_ground && !self.is_open()
    }

    /// Whether a vehicle on rotors has never flown since it was armed, and has been level and still for a second.
    pub(crate) fn stayed(&self, now: BootMs, vehicle: &Vehicle) -> bool {
        on_rotors(now, vehicle) && !self.arming.flew && vehicle.inertial.is_level_for(now, STILL)
    }

    /// Whether it stands without thrust.
    pub(crate) fn is_at_rest(&self, now: BootMs, vehicle: &Vehicle) -> bool {
        let off = throttle(now, vehicle).map_or(!vehicle.armed(), |throttle| throttle < OFF);
        !self.is_open() && !self.in_mishap() && off && vehicle.heartbeat.get().is_some()
    }

    pub(crate) fn in_mishap(&self) -> bool {
        self.stage.is_mishap() || self.watch.is_some()
    }

    /// Whether it was disarmed out of a flight, and that it falls is not seen yet.
    pub const fn is_watched(&self) -> bool {
        self.watch.is_some()
    }

    pub(crate) fn is_down(&self) -> bool {
        self.stage == Stage::Down
    }

    pub(crate) fn has_tilted(&self, now: BootMs) -> bool {
        self.tilted_at.is_some_and(|at| now.since(at) <= RECOVERED)
    }

    /// One step, at least every 50 ms: changes of a mishap and of the flight.
    pub fn step(
        &mut self,
        now: BootMs,
        vehicle: &Vehicle,
        params: &Params,
    ) -> (Option<MishapChange>, Option<FlightEvent>) {
        self.note_power(now, vehicle, params);
        self.motion.step(now, vehicle);
        self.lost_since.run(self.loses_estimate(now, vehicle), now, Millis::ZERO);
        self.note_support(now, vehicle, params);
        self.note_still(now, vehicle);
        self.judge_disarming(now, vehicle, params);
        self.judge_shock(now, vehicle, params);
        let votes = self.ask(now, vehicle);
        self.is_clear = votes.is_clear;
        self.doubt(now, vehicle, votes);
        let seen = self.signs.seen.take();
        let change = match (self.stage, seen) {
            (Stage::Falling | Stage::Impacted, _) => self.judge_mishap(now, vehicle, votes),
            (Stage::Down, _) => self.judge_wreck(now, vehicle, votes),
            (_, Some(kind)) => self.judge_sign(now, vehicle, kind, params),
            (_, None) => None,
        };
        let event = match self.stage {
            Stage::Down => self.close(),
            Stage::Falling | Stage::Impacted => self.hold(now),
            _ if self.watch.is_some() || self.shock.is_some_and(|shock| shock.has_hit) => self.hold(now),
            _ => self.advance(now, vehicle, votes),
        };
        self.note_touch(now, vehicle);
        (change, event)
    }

    fn note_touch(&mut self, now: BootMs, vehicle: &Vehicle) {
        let height_m = height_m(now, vehicle);
        if !self.airborne() {
            let touch_mps = self.touchdown.take(now, height_m);
            self.touch_mps = self.touch_mps.max(if self.is_down() { 0.0 } else { touch_mps });
        } else if let (Some(climb_mps), Some(height_m)) = (climb_mps(now, vehicle), height_m) {
            self.touchdown.step(now, -climb_mps, self.motion.sink.greatest(now), height_m);
        }
    }

    fn note_power(&mut self, now: BootMs, vehicle: &Vehicle, params: &Params) {
        let Some(heartbeat) = vehicle.heartbeat.get() else { return };
        let armed = heartbeat.armed;
        if armed != self.arming.is_armed {
            let is_seen = armed && self.arming.seen_off;
            self.pressure.arm(now, is_seen);
            self.motion.arm(now, vehicle, is_seen);
        }
        self.arming.seen_off |= !armed;
        self.arming.is_armed = armed;
        if !self.airborne() && (!armed || self.power(now, vehicle) == Some(Power::Idle)) {
            self.motion.idle(now, vehicle);
        }
        // A terminated vehicle stays armed, and its motors are off.
        let powered = armed && vehicle.terminated_since.is_none();
        if powered && !self.arming.is_on {
            // Armed again in the air it flies on; on the ground another flight begins.
            if self.stage == Stage::Down && self.arming.off_at.is_some() {
                self.calm();
            }
            (self.arming.on_bench, self.arming.off_at, self.heard_at) = (false, None, now);
            (self.arming.stood, self.arming.flew) = (false, false);
            self.watch = None;
            self.thrust.forget();
        }
        let beat_at = vehicle.heartbeat.at().unwrap_or(self.beat.at);
        // The height of the beat before: PX4's is 0 from the disarming on, and home may be another one.
        let mut before_m = self.beat.height_m;
        if beat_at != self.beat.at {
            before_m = core::mem::replace(&mut self.beat.height_m, height_m(now, vehicle));
            self.beat.at = beat_at;
        }
        self.arming.stood |= powered && vehicle.inertial.is_level(now);
        if self.arming.is_on && !powered {
            self.arming.off_at = Some(now);
            if self.is_open() && !self.stage.is_mishap() {
                let height_m = before_m.or_else(|| height_m(now, vehicle));
                self.note_disarming(now, vehicle, params, height_m);
            }
        }
        self.arming.is_on = powered;
    }

    /// Since when it has been still. The sensors are believed, and not the estimate, of a vehicle that is off, lies on its back, or was hit.
    fn note_still(&mut self, now: BootMs, vehicle: &Vehicle) {
        let ground_mps = ground_speed_mps(now, vehicle).unwrap_or(0.0);
        let speed_mps = ground_mps.max(climb_mps(now, vehicle).map_or(0.0, f32::abs));
        let was_hit = self.signs.worst[MishapKind::Impact as usize] > 0.0
            || self.shock.is_some_and(|shock| shock.dropped);
        let is_slow = speed_mps < STILL_MPS
            || (!self.arming.is_on && on_rotors(now, vehicle))
            || self.lies_on_its_back(vehicle)
            || self.was_thrown_down(now, vehicle)
            || (was_hit && self.felt.rate_radps < STILL_RADPS / 3.0);
        // Under a parachute it is carried, and goes down.
        let descends = self.pressure.steady_for(now).is_some_and(|span| span < RISES);
        let is_still = is_slow
            && !descends
            && self.is_slow_to_turn()
            && self.felt.load_g.is_none_or(|load_g| STILL_G.contains(&load_g));
        self.still_since.run(is_still, now, STILL);
    }

    fn is_slow_to_turn(&self) -> bool {
        self.felt.rate_radps < STILL_RADPS
    }

    fn is_still(&self, now: BootMs) -> bool {
        self.still_since.age(now).is_some_and(|age| age >= STILL)
    }

    fn judge_sign(
        &mut self,
        now: BootMs,
        vehicle: &Vehicle,
        kind: MishapKind,
        params: &Params,
    ) -> Option<MishapChange> {
        let is_own =
            self.is_open() || kind == MishapKind::Disarmed || self.is_turned_over(now, vehicle, kind);
        if !is_own {
            self.signs.worst = [0.0; MishapKind::COUNT];
            if !self.arming.is_on {
                return None;
            }
            let is_told = core::mem::replace(&mut self.arming.on_bench, true);
            return (!is_told).then_some(MishapChange::OnBench(kind));
        }
        self.stage = if kind == MishapKind::Impact { Stage::Impacted } else { Stage::Falling };
        self.place = Location::of(now, vehicle);
        if kind != MishapKind::Impact {
            self.touch_mps = 0.0;
        }
        let before_m = self.watch.take().and_then(|watch| watch.height_m);
        if let Some(height_m) = before_m.filter(|_| kind == MishapKind::Disarmed) {
            self.place.height_m = height_m as i16;
        }
        // A vehicle that turned over right after a shock hit something first.
        if let Some(shock) = self.shock.filter(|_| kind == MishapKind::Overturned) {
            self.touch(now, shock.sink_mps);
            self.see(now, MishapKind::Impact, shock.load_g, params);
        }
        Some(MishapChange::Began(kind))
    }

    fn judge_mishap(&mut self, now: BootMs, vehicle: &Vehicle, votes: Votes) -> Option<MishapChange> {
        let passed = now.since(self.signs.seen_at);
        let (is_long, is_given_up) = (passed >= RECOVERED, passed >= GIVEN_UP);
        let (flies, stands) = votes.count();
        let is_silent = vehicle.heartbeat.within(now, RECOVERED).is_none();
        let is_down = (stands >= 2 && stands > flies && (is_long || self.is_still(now)))
            || (is_given_up && (!self.arming.is_on || is_silent || (stands >= 2 && stands >= flies)));
        if is_down {
            (self.stage, self.flies_since) = (Stage::Down, Stamp::NONE);
            self.place = Location::of(now, vehicle);
            return Some(MishapChange::Down);
        }
        let flies_on = self.arming.is_on && ((is_long && flies >= 2 && flies > stands) || is_given_up);
        flies_on.then(|| {
            self.calm();
            MishapChange::FliesOn
        })
    }

    /// Whether it has taken off again.
    fn judge_wreck(&mut self, now: BootMs, vehicle: &Vehicle, votes: Votes) -> Option<MishapChange> {
        let is_flying =
            self.arming.is_on && self.takes_off(now, vehicle, votes).is_some() && votes.count().0 >= 2;
        self.flies_since.run(is_flying, now, TAKEN_OFF).then(|| {
            self.calm();
            MishapChange::FliesAgain
        })
    }

    fn calm(&mut self) {
        self.stage = match (self.airborne_since, self.flew_at) {
            (Some(_), _) => Stage::Airborne,
            (None, Some(_)) => Stage::Touched,
            (None, None) => Stage::Ground,
        };
        (self.signs.worst, self.signs.seen) = ([0.0; MishapKind::COUNT], None);
        self.watch = None;
        (self.shock, self.touch_mps, self.still_since, self.flies_since) =
            (None, 0.0, Stamp::NONE, Stamp::NONE);
        self.place = Location::default();
    }

    fn hold(&mut self, now: BootMs) -> Option<FlightEvent> {
        self.changing_since = None;
        self.flew_at = self.flew_at.map(|_| now);
        None
    }

    fn close(&mut self) -> Option<FlightEvent> {
        let is_open = self.is_open();
        self.seen_on_ground = true;
        (self.airborne_since, self.flew_at, self.changing_since) = (None, None, None);
        is_open.then_some(FlightEvent::Landing)
    }

    fn advance(&mut self, now: BootMs, vehicle: &Vehicle, votes: Votes) -> Option<FlightEvent> {
        if self.airborne() && !self.arming.is_armed {
            (self.airborne_since, self.changing_since) = (None, None);
        }
        let debounce = if self.airborne() { Self::lands(votes) } else { self.takes_off(now, vehicle, votes) };
        match debounce {
            None => {
                self.changing_since = None;
                let is_known = votes.known & (WORD | HEIGHT) != 0 || !self.arming.is_armed;
                self.seen_on_ground |= !self.airborne() && is_known && vehicle.heartbeat.get().is_some();
            }
            Some(debounce) => {
                let since = *self.changing_since.get_or_insert(now);
                if now.since(since) >= debounce {
                    self.changing_since = None;
                    // Both changes have the time at which their majority began. A landing is later if the autopilot's word was flight until now.
                    let flew_by_word = debounce == Millis::ZERO || votes.flies & WORD != 0;
                    let since = if self.airborne() && flew_by_word { now } else { since };
                    self.flew_at = self.flew_at.map(|_| since);
                    self.airborne_since = (!self.airborne()).then_some(since);
                }
            }
        }
        let (stage, event) = match (self.airborne(), self.flew_at) {
            (true, None) if self.seen_on_ground => (Stage::Airborne, Some(FlightEvent::TakeOff)),
            (true, None) => (Stage::Airborne, Some(FlightEvent::Resumed)),
            (true, Some(_)) => (Stage::Airborne, None),
            (false, Some(last)) if !self.arming.is_armed || now.since(last) >= GROUND_LASTS => {
                self.flew_at = None;
                (Stage::Ground, Some(FlightEvent::Landing))
            }
            (false, Some(_)) => (Stage::Touched, None),
            (false, None) => (Stage::Ground, None),
        };
        self.stage = stage;
        if self.airborne() {
            if self.flew_at.is_none() {
                self.touch_mps = 0.0;
            }
            (self.flew_at, self.arming.flew) = (Some(now), true);
        }
        event
    }

    fn takes_off(&self, now: BootMs, vehicle: &Vehicle, votes: Votes) -> Option<Millis> {
        let has_no_thrust = votes.stands & THRUST != 0
            && !is_on_wings(now, vehicle)
            && self.power(now, vehicle) != Some(Power::Full);
        if !self.arming.is_on || vehicle.kind() == VehicleKind::Surface {
            return None;
        }
        let (flies, stands) = votes.count();
        if has_no_thrust {
            let may_hover = throttle(now, vehicle).is_some_and(|part| part >= OFF);
            return (may_hover && flies >= 2 && votes.stands == THRUST).then_some(LONG);
        }
        let is_alone = stands == 0 && (votes.flies & (WORD | HEIGHT) != 0 || votes.flies == votes.known);
        let is_against = votes.stands & WORD != 0;
        if flies >= 1 && (is_alone || (flies >= 2 && flies > stands && !is_against)) {
            Some(BRIEF)
        } else {
            (flies >= 2 && flies > stands).then_some(LONG)
        }
    }

    fn lands(votes: Votes) -> Option<Millis> {
        let (flies, stands) = votes.count();
        if stands >= 2 && stands >= flies + 2 && votes.stands & WORD != 0 {
            Some(Millis::ZERO)
        } else {
            let is_alone = stands == 1 && votes.stands == votes.known;
            ((stands >= 2 && stands > flies) || is_alone).then_some(LANDS)
        }
    }

    /// The part of the flight now.
    pub fn phase(&self, now: BootMs, vehicle: &Vehicle) -> Phase {
        if !self.airborne() {
            return if self.flew_at == Some(now) { Phase::Landing } else { Phase::Ground };
        }
        let climb_mps = climb_mps(now, vehicle).unwrap_or(0.0);
        let near_ground =
            self.motion.rise_m(now, vehicle).is_some_and(|height_m| height_m.abs() < NEAR_GROUND_M);
        if near_ground && climb_mps > VERTICAL_MPS / 2.0 {
            Phase::TakeOff
        } else if near_ground && climb_mps < -VERTICAL_MPS / 2.0 {
            Phase::Landing
        } else if climb_mps > VERTICAL_MPS {
            Phase::Climb
        } else if climb_mps < -VERTICAL_MPS {
            Phase::Descent
        } else if ground_speed_mps(now, vehicle).is_some_and(|speed_mps| speed_mps > MOVES_MPS) {
            Phase::Cruise
        } else {
            Phase::Hover
        }
    }

    /// A check's reading: the worst of this mishap, 0 while there is none; `None` if the vehicle does not tell enough to see it.
    pub(crate) fn reading(&self, kind: MishapKind, now: BootMs, vehicle: &Vehicle) -> Option<Reading> {
        let value = self.signs.worst[kind as usize];
        if value > 0.0 {
            return Some(Reading { at: now, value });
        }
        let Vehicle { imu, attitude, heartbeat, .. } = vehicle;
        let measured = match kind {
            MishapKind::FreeFall | MishapKind::Overturned if vehicle.kind() == VehicleKind::Plane => None,
            MishapKind::FreeFall | MishapKind::Impact => {
                imu.read(|imu| Some(norm(imu.acceleration?.map(|axis| axis.0))))
            }
            MishapKind::Overturned => attitude.read(|attitude| Some(attitude.roll.0 + attitude.pitch.0)),
            MishapKind::Tumbling => attitude.read(|attitude| Some(norm(attitude.rates?.map(|axis| axis.0)))),
            MishapKind::Disarmed => heartbeat.read(|_| Some(0.0)),
            MishapKind::Sinking => climb_mps(now, vehicle).map(|value| Reading { at: now, value }),
        };
        let is_known =
            |reading: &Reading| reading.value.is_finite() && vehicle.kind() != VehicleKind::Surface;
        measured.filter(is_known).map(|Reading { at, .. }| Reading { at, value: 0.0 })
    }

    /// The report of a change to the ground, at the tick of the change.
    pub fn report(&self, change: MishapChange) -> Report {
        Report { change, place: self.place, touch: (self.touch_mps * 10.0) as u16 }
    }

    /// When the first shock of the latest impact was.
    pub const fn hit_at(&self) -> BootMs {
        self.hit_at
    }

    /// When it first hit something in this mishap; `None` where it did not.
    pub fn struck_at(&self) -> Option<BootMs> {
        (self.signs.worst[MishapKind::Impact as usize] > 0.0).then_some(self.hit_at)
    }

    /// The height above home of the last place that was told, metres.
    pub const fn height_m(&self) -> i16 {
        self.place.height_m
    }
}

#[cfg(test)]
mod tests;
