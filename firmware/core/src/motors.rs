//! Motors by what their ESCs send: silence, speeds against each other, and currents.
//!
//! Only a motor that was seen lifting can be lost by its current. A VTOL's motors that push stand still in hover and
//! may help against the wind; its motors that lift stop on the wings. So each motor gets a [`Role`] while the vehicle
//! is armed:
//!
//! | in the air | role |
//! |---|---|
//! | it takes its share of the current in hover | lifts |
//! | on a VTOL: no current in its first sample of hover, or current on the wings | pushes, until it is armed again |
//!
//! A motor with too little current is not lost in two cases:
//!
//! 1. Half of the motors that lift, or more, stand nearly still and the vehicle does not spin. A VTOL that turns
//!    against the wind stops its motors of one sense of rotation. A vehicle that lost two of four spins.
//! 2. It turns at half of the others' speed or more, and slower than they do. Its command was cut, as in hard
//!    braking, and it takes next to nothing until it has slowed down. A dead motor stands; one without its propeller
//!    turns faster.

use core::ops::Range;

use crate::health::Inputs;
use crate::latest::Reading;
use crate::observation::{EscGroup, MOTORS_MAX, VehicleKind};
use crate::outputs::MotorOutputs;
use crate::thrust::{CARRIES, Power};
use crate::time::{BootMs, FRESH, Millis, PAUSE, Stamp};
use crate::trend::Rate;
use crate::units::Rpm;
use crate::vehicle::{Motor, Vehicle};

/// A motor that never turned faster is not fitted.
const TURNING_RPM: f32 = 100.0;
/// An ESC is silent when it misses this many of its own intervals, or more if they are longer than [`SLOW_S`]. If a fifth of
/// the messages is lost, three in a row are lost every two minutes, and five in a row every hour.
const INTERVALS_MISSED: f32 = 3.0;
const INTERVALS_MISSED_SLOW: f32 = 5.0;
const SLOW_S: f32 = 0.7;
/// Of more messages between two of an ESC some are of a list of parameters.
const MESSAGES_MAX: u16 = 1_000;
/// A link on which nothing at all came for so long was silent, unless it often is: streams of one a second have such pauses.
const SILENCE_S: f32 = 0.3;
const SILENCE_PAUSES: f32 = 3.0;
/// A pause counts as at most this, s. Each observation shortens the longest one by this part, so it is forgotten
/// after some hundred.
const PAUSE_MAX_S: f32 = 1.0;
const PAUSE_FADES: f32 = 1.0 / 64.0;
/// Below this part of their highest speed motors do not carry a vehicle (thrust goes by the square).
const FLYING_PART: f32 = 0.2;
/// Below this part of the middle speed a motor is lost; no control in steady flight drives it there.
const LOST_PART: f32 = 0.4;
/// A vehicle that turned fast within this drives each motor as it needs to.
const TURNED: Millis = Millis::from_secs(2);
const SMOOTHING_S: f32 = 1.0;
/// ESCs that do not measure current say zero for all, and then nothing follows.
const CURRENT_MIN_A: f32 = 0.5;
/// From this part of the mean of the others a motor takes its share; below [`IDLE_PART`] it stands nearly still.
const SHARE_PART: f32 = 0.3;
const IDLE_PART: f32 = 0.1;
/// A motor that turns so fast, as a part of the mean of the others, slows down because it was told to.
const SLOWS_PART: Range<f32> = 0.5..0.9;
/// 60 degrees a second: a vehicle that lost two motors of four spins faster within a moment.
const SPINS_RAD_S: f32 = 1.05;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Role {
    #[default]
    Unknown,
    Lifts,
    Pushes,
}

state! {
    /// One motor.
    struct Track {
        errors: Option<Rate>,
        /// Smoothed interval between messages that carry speed or current, s; 0 before there are two.
        interval_s: f32,
        last: Stamp,
        highest_rpm: f32,
        smooth_rpm: f32,
        role: Role = Role::Unknown,
    }
}

impl Track {
    fn is_fitted(&self) -> bool {
        self.highest_rpm > TURNING_RPM
    }

    fn take(&mut self, at: BootMs, motor: &Motor) {
        if motor.moved_at != Some(at) || self.last == Stamp::at(at) {
            return;
        }
        let interval_s = self.last.age(at).map(Millis::as_secs_f32);
        self.last = Stamp::at(at);
        // A pause is not a rhythm: it must not make the next pause look normal.
        if let Some(interval_s) = interval_s.filter(|interval_s| *interval_s < 5.0) {
            let weight = if self.interval_s == 0.0 { 1.0 } else { 0.1 };
            self.interval_s += weight * (interval_s - self.interval_s);
        }
        if let Some(rpm) = motor.esc.rpm.and_then(Rpm::finite) {
            let speed = rpm.0.abs();
            self.highest_rpm = self.highest_rpm.max(speed);
            let step_s = interval_s.unwrap_or(SMOOTHING_S);
            self.smooth_rpm += step_s / (SMOOTHING_S + step_s) * (speed - self.smooth_rpm);
        }
    }
}

state! {
    pub(crate) struct Motors {
        tracks: [Track; MOTORS_MAX] = [Track::default(); MOTORS_MAX],
        pub(crate) outputs: MotorOutputs,
        /// When the vehicle was heard last.
        heard: Option<BootMs>,
        /// When it was heard again after a silence, or a plane had no throttle last.
        resumed: BootMs,
        /// The longest recent pause between two observations, s.
        pause_s: f32,
        /// Messages since the last one of any ESC, and eight times their smoothed number between two.
        messages: u16,
        interval_messages: u16,
        /// The motor whose speed is furthest from the others'.
        furthest: u8,
    }
}

impl Motors {
    pub(crate) fn hear(&mut self, at: BootMs) {
        let pause_s = self.heard.map(|heard| at.since(heard).as_secs_f32());
        if pause_s.is_none_or(|pause_s| pause_s > SILENCE_S.max(SILENCE_PAUSES * self.pause_s)) {
            self.resumed = at;
        }
        let pause_s = pause_s.unwrap_or(0.0).min(PAUSE_MAX_S);
        self.pause_s = pause_s.max(self.pause_s * (1.0 - PAUSE_FADES));
        self.heard = Some(at);
        self.messages = self.messages.saturating_add(1);
    }

    pub(crate) const fn resume(&mut self, at: BootMs) {
        self.resumed = at;
    }

    pub(crate) fn take(&mut self, at: BootMs, group: &EscGroup, vehicle: &Vehicle, airborne: bool) {
        if !vehicle.armed() {
            self.tracks.iter_mut().for_each(|track| track.role = Role::Unknown);
        }
        let messages = core::mem::take(&mut self.messages).min(MESSAGES_MAX);
        let usual = self.interval_messages;
        self.interval_messages = if usual == 0 { 8 * messages } else { usual - usual / 8 + messages };
        let first = usize::from(group.first);
        let of_group = self.tracks.iter_mut().zip(&vehicle.motors).skip(first);
        for ((track, motor), esc) in of_group.zip(&group.escs) {
            if let Some(errors) = esc.and_then(|esc| esc.errors) {
                track.errors.get_or_insert(Rate::new(at, errors)).take(at, errors);
            }
            track.take(at, motor);
        }
        if airborne {
            self.find_roles(at, vehicle, first..(first + group.escs.len()).min(MOTORS_MAX));
        }
    }

    fn find_roles(&mut self, now: BootMs, vehicle: &Vehicle, motors: Range<usize>) {
        let on_wings = vehicle.hovers(now) == Some(false);
        let is_known = |role: Role| role == Role::Pushes || (role == Role::Lifts && !on_wings);
        let Some(tracks) = self.tracks.get_mut(motors.clone()) else { return };
        // Mostly all is known.
        if tracks.iter().all(|track| is_known(track.role)) {
            return;
        }
        let winged = vehicle.kind() == VehicleKind::Vtol;
        for (track, motor) in tracks.iter_mut().zip(motors).filter(|(track, _)| !is_known(track.role)) {
            let Some(own_a) = current_a(now, vehicle, motor) else { continue };
            if on_wings && own_a > CURRENT_MIN_A {
                track.role = Role::Pushes;
            }
            match current_part(now, vehicle, motor, |_| true) {
                Some(part) if winged && part < IDLE_PART => track.role = Role::Pushes,
                Some(part) if part >= SHARE_PART => track.role = Role::Lifts,
                _ => {}
            }
        }
    }

    fn track(&self, motor: u8) -> Option<&Track> {
        self.tracks.get(usize::from(motor))
    }

    fn lifts(&self, motor: usize) -> bool {
        self.tracks.get(motor).is_some_and(|track| track.role == Role::Lifts)
    }

    fn speeds(&self) -> impl Iterator<Item = (u8, f32)> + Clone + '_ {
        let tracks = (0..).zip(&self.tracks);
        tracks.filter(|(_, track)| track.is_fitted()).map(|(motor, track)| (motor, track.smooth_rpm))
    }

    pub(crate) fn errors(&self, motor: u8) -> Option<f32> {
        Some(self.track(motor)?.errors?.per_minute() as f32)
    }

    /// Seconds since an ESC last sent speed or current, once it has missed some of its own intervals; 0 before. Up to when the vehicle was
    /// received last, since the link resumed: a silent link says nothing about an ESC, nor does a slow one that delivers as few other messages.
    pub(crate) fn silence(&self, now: BootMs, motor: u8) -> Option<Reading> {
        let (heard, track) = (self.heard?, self.track(motor)?);
        let silence_s = heard.since(track.last.instant(heard)?.later(self.resumed)).as_secs_f32();
        let intervals = if track.interval_s > SLOW_S { INTERVALS_MISSED_SLOW } else { INTERVALS_MISSED };
        let age_s = |track: &Track| track.last.age(heard).map_or(f32::INFINITY, Millis::as_secs_f32);
        // Groups of ESCs follow each other.
        let others_come = self.tracks.iter().any(|other| age_s(other) + track.interval_s < age_s(track));
        let missed = track.interval_s > 0.0
            && silence_s > intervals * track.interval_s
            && (others_come
                || 8.0 * f32::from(self.messages) > intervals * f32::from(self.interval_messages));
        Some(Reading { at: heard.earlier(now), value: if missed { silence_s } else { 0.0 } })
    }

    /// Motors that carry the vehicle do not fail together; the wire of their telemetry does.
    pub(crate) fn are_silent(&self, now: BootMs) -> bool {
        let mut known =
            (0..).zip(&self.tracks).filter(|(_, track)| track.interval_s > 0.0).map(|(motor, _)| motor);
        let is_silent = |motor| self.silence(now, motor).is_some_and(|silence| silence.value > 0.0);
        known.clone().count() > 1 && known.all(is_silent)
    }

    /// A motor's share of the current, percent, for the check of lost ones: 0 of a motor that stopped. `None` of a motor that is shut off,
    /// and of one that nothing is known of.
    pub(crate) fn share(&self, now: BootMs, vehicle: &Vehicle, motor: u8) -> Option<Reading> {
        let share = || self.current_share(now, vehicle, motor).filter(|_| !self.outputs.is_off(motor));
        self.stopped(vehicle, motor).or_else(share)
    }

    /// 0 % of a motor that turned and stands while it is given all there is: control asks it for thrust, and nothing comes. Its ESC's speed
    /// alone may be wrong. `None` of any other.
    fn stopped(&self, vehicle: &Vehicle, motor: u8) -> Option<Reading> {
        // A motor that stood before the vehicle was received never turned.
        let turned = self.outputs.was_found_at_end(motor) || self.track(motor).is_some_and(Track::is_fitted);
        let place = usize::from(motor);
        let known = vehicle.motors.get(place).filter(|known| turned && known.esc.rpm.is_some())?;
        let stands = self.outputs.is_full(motor)
            && !turns(vehicle, place)
            && (0..MOTORS_MAX).any(|other| turns(vehicle, other));
        Reading::new(known.moved_at.filter(|_| stands), Some(0.0))
    }

    /// A motor's current in percent of the mean of the others that lift, while there is thrust and the vehicle hangs
    /// on its rotors; `None` for a motor that was not seen lifting.
    fn current_share(&self, now: BootMs, vehicle: &Vehicle, motor: u8) -> Option<Reading> {
        let place = Some(usize::from(motor)).filter(|place| self.lifts(*place))?;
        let part = current_part(now, vehicle, place, |motor| self.lifts(motor))?;
        if part < SHARE_PART && (self.slows_down(now, vehicle, place) || self.is_driven_so(now, vehicle)) {
            return None;
        }
        // Measured when this motor sent it: a value that is held is one sample.
        Reading::new(vehicle.motors.get(place)?.moved_at, Some(part * 100.0))
    }

    fn slows_down(&self, now: BootMs, vehicle: &Vehicle, motor: usize) -> bool {
        let rpm = |motor: usize| {
            let motor =
                vehicle.motors.get(motor).filter(|known| self.lifts(motor) && is_fresh(now, known))?;
            motor.esc.rpm.map(|rpm| libm::fabsf(rpm.0)).filter(|rpm| rpm.is_finite())
        };
        against_others(motor, rpm).is_some_and(|(own, mean, _)| SLOWS_PART.contains(&(own / mean)))
    }

    fn is_driven_so(&self, now: BootMs, vehicle: &Vehicle) -> bool {
        let currents = || {
            let lifting = (0..MOTORS_MAX).filter(|motor| self.lifts(*motor));
            lifting.filter_map(|motor| current_a(now, vehicle, motor))
        };
        let most_a = currents().fold(0.0, f32::max);
        let idle = currents().filter(|current_a| *current_a < SHARE_PART * most_a).count();
        let rates = vehicle.attitude.within(now, PAUSE).and_then(|attitude| attitude.rates);
        let spins = rates.is_none_or(|rates| rates.into_iter().any(|rate| rate.0.abs() > SPINS_RAD_S));
        2 * idle >= currents().count() && !spins
    }

    /// The distance of a motor's speed from the middle one of all, or from the nearest other motor if that is less.
    /// It is in percent of the middle speed, in steady flight. It is 0 for all but the motor furthest from the
    /// middle: if one is lost the others turn as they must to make up for it. `None` of a motor that is shut off.
    ///
    /// A turn, a lean and a load on one side drive motors in twos, threes and fours: one sense of rotation, the front, the
    /// upper ones of coaxial pairs. So a motor is off if no other one is near it.
    pub(crate) fn imbalance(&self, inputs: &Inputs<'_>, motor: u8) -> Option<Reading> {
        let Inputs { now, vehicle, flight, .. } = *inputs;
        let track = self.track(motor).filter(|track| track.is_fitted() && !self.outputs.is_off(motor))?;
        let middle = self.middle_speed()?;
        // If one is lost, the opposite one may stop too.
        let lost = track.smooth_rpm < LOST_PART * middle;
        // On the ground, still armed, each motor idles as it likes.
        if flight.power(now, vehicle) == Some(Power::Idle)
            || !vehicle.is_multicopter()
            || !self.turn_as_in_flight(now, middle)
            || !(lost || vehicle.inertial.turns_little(now, TURNED))
            || !flight.is_steady(now, vehicle)
        {
            return None;
        }
        let alone = if lost { f32::INFINITY } else { self.nearest(motor, track.smooth_rpm) };
        let off = (track.smooth_rpm - middle).abs().min(alone) / middle * 100.0;
        let is_named = self.furthest == motor;
        Reading::new(track.last.instant(now), Some(if is_named { off } else { 0.0 }))
    }

    fn nearest(&self, motor: u8, own: f32) -> f32 {
        let others = self.speeds().filter(|(other, _)| *other != motor);
        others.map(|(_, speed)| (speed - own).abs()).reduce(f32::min).unwrap_or(0.0)
    }

    /// It stays the one that was found first until another is twice as far: if one is lost, others follow.
    pub(crate) fn step(&mut self) {
        let Some(middle) = self.middle_speed() else { return };
        let own = self.speeds().find(|(motor, _)| *motor == self.furthest);
        let own = own.map_or(0.0, |(_, speed)| 2.0 * (speed - middle).abs());
        let further = self.speeds().fold((self.furthest, own), |(furthest, most), (motor, speed)| {
            let off = (speed - middle).abs();
            if off > most { (motor, off) } else { (furthest, most) }
        });
        self.furthest = further.0;
    }

    fn middle_speed(&self) -> Option<f32> {
        let speeds = || self.speeds().map(|(_, speed)| speed);
        let half = speeds().count() / 2;
        let is_middle = |speed: &f32| {
            speeds().filter(|other| other < speed).count() <= half.saturating_sub(1)
                && speeds().filter(|other| other > speed).count() <= half
        };
        speeds().find(is_middle).filter(|speed| *speed >= TURNING_RPM)
    }

    fn turn_as_in_flight(&self, now: BootMs, middle_rpm: f32) -> bool {
        let mut fitted = self.tracks.iter().filter(|track| track.is_fitted());
        fitted.all(|track| {
            track.last.age(now).is_some_and(|age| age <= FRESH)
                && middle_rpm >= FLYING_PART * track.highest_rpm
        })
    }

    /// A motor's speed against the mean of the others, signed percent; `None` for a missing motor, or while
    /// the others do not turn.
    pub(crate) fn departure(&self, motor: u8) -> Option<f32> {
        let speed = |motor: usize| {
            self.tracks.get(motor).filter(|track| track.is_fitted()).map(|track| track.smooth_rpm)
        };
        let (own, mean, _) = against_others(motor.into(), speed)?;
        (mean >= TURNING_RPM).then(|| (own - mean) / mean * 100.0)
    }
}

pub(crate) fn turns(vehicle: &Vehicle, motor: usize) -> bool {
    vehicle.motors.get(motor).and_then(|motor| motor.esc.rpm).is_some_and(|rpm| rpm.0.abs() > TURNING_RPM)
}

/// The current of a motor, A. Noise around zero may be negative.
fn current_a(now: BootMs, vehicle: &Vehicle, motor: usize) -> Option<f32> {
    let motor = vehicle.motors.get(motor).filter(|motor| is_fresh(now, motor))?;
    motor.esc.current.map(|current| current.0.max(0.0)).filter(|current| current.is_finite())
}

fn is_fresh(now: BootMs, motor: &Motor) -> bool {
    motor.moved_at.is_some_and(|at| now.since(at) <= PAUSE)
}

/// The mean is of the other motors here, while the throttle asks for thrust in hover.
fn current_part(now: BootMs, vehicle: &Vehicle, motor: usize, among: impl Fn(usize) -> bool) -> Option<f32> {
    let throttle = vehicle.hud.within(now, PAUSE)?.throttle?.0;
    let current = |motor| current_a(now, vehicle, motor).filter(|_| among(motor));
    let (own_a, mean_a, others) = against_others(motor, current)?;
    // PX4's motor failure check: below this throttle no motor is asked for much.
    let asked = vehicle.hovers(now) == Some(true) && throttle > CARRIES;
    (asked && others >= 2 && mean_a > CURRENT_MIN_A).then(|| own_a / mean_a)
}

fn against_others(motor: usize, figure: impl Fn(usize) -> Option<f32>) -> Option<(f32, f32, u8)> {
    let own = figure(motor)?;
    let others = (0..MOTORS_MAX).filter(|other| *other != motor).filter_map(figure);
    let (sum, count) = others.fold((0.0, 0_u8), |(sum, count), figure| (sum + figure, count + 1));
    (count > 0).then(|| (own, sum / f32::from(count), count))
}
