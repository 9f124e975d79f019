//! Whether a motor takes its share of the current while the vehicle hangs on its rotors.
//!
//! Only a motor that was seen lifting can be lost. A VTOL's motors that push stand still in hover and may help against the wind; its
//! motors that lift stop on the wings. So while the vehicle is armed each motor is known as one that lifts or as one that does not:
//!
//! | seen in the air | then the motor |
//! |---|---|
//! | it takes its share in hover | lifts |
//! | on a VTOL: nothing in its first sample of hover, or current on the wings | pushes, and is not judged until it is armed again |
//!
//! Where half of the motors that lift, or more, stand nearly still and the vehicle does not spin, its autopilot drives them there:
//! a VTOL that turns against the wind stops its motors of one sense of rotation. A vehicle that lost two of four spins.
//!
//! A motor that turns at half of the others' speed or more, and slower than they do, is no lost one: its command was cut, as in hard
//! braking, and it takes next to nothing until it has slowed down. One that is dead stands; one without its propeller turns faster.

use core::ops::Range;

use crate::flight::FLYING_THROTTLE;
use crate::latest::Reading;
use crate::observation::{MOTORS_MAX, VehicleKind};
use crate::time::{Instant, PAUSE};
use crate::vehicle::{Motor, Vehicle};

/// ESCs that do not measure current say zero for all, and then nothing follows.
const CURRENT_MIN_A: f32 = 0.5;
/// From this part of the mean of the others a motor takes its share; below [`IDLE_PART`] it stands nearly still.
const SHARE_PART: f32 = 0.3;
const IDLE_PART: f32 = 0.1;
/// A motor that turns so fast, as a part of the mean of the others, slows down because it was told to.
const SLOWS_PART: Range<f32> = 0.5..0.9;
/// 60 degrees a second: what lost two motors of four spins faster within a moment.
const SPINS_RAD_S: f32 = 1.05;

/// What is known of the motors since the vehicle was armed, a bit for each.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Currents {
    lifts: u16,
    pushes: u16,
}

const _: () = assert!(MOTORS_MAX <= 16);

impl Currents {
    pub(crate) const fn new() -> Self {
        Self { lifts: 0, pushes: 0 }
    }

    /// The ESCs of these motors told of themselves.
    pub(crate) fn take(&mut self, now: Instant, vehicle: &Vehicle, airborne: bool, motors: Range<usize>) {
        if !vehicle.armed() {
            *self = Self::new();
        }
        let of_group = !(u16::MAX << motors.end) & (u16::MAX << motors.start);
        let on_wings = vehicle.hovers(now) == Some(false);
        let known = if on_wings { self.pushes } else { self.lifts | self.pushes };
        // Mostly all is known: this is done with each message of an ESC.
        if !airborne || of_group & !known == 0 {
            return;
        }
        let total = Total::of(now, vehicle, u16::MAX);
        let winged = vehicle.kind() == VehicleKind::Vtol;
        for motor in motors.filter(|motor| known & (1 << motor) == 0) {
            let bit = 1 << motor;
            let Some(own_a) = current_a(now, vehicle, motor) else { continue };
            if on_wings && own_a > CURRENT_MIN_A {
                self.pushes |= bit;
            }
            let Some(part) = total.part(now, vehicle, own_a) else { continue };
            if winged && part < IDLE_PART {
                self.pushes |= bit;
            } else if part >= SHARE_PART {
                self.lifts |= bit;
            }
        }
    }

    /// A motor's current in percent of the mean of the others that lift, while the throttle asks for thrust and the vehicle hangs
    /// on its rotors; `None` for a motor that was not seen lifting.
    pub(crate) fn percent(&self, now: Instant, vehicle: &Vehicle, motor: u8) -> Option<Reading> {
        let lifting = self.lifts & !self.pushes;
        if lifting & 1_u16.checked_shl(u32::from(motor))? == 0 {
            return None;
        }
        let own_a = current_a(now, vehicle, usize::from(motor))?;
        let part = Total::of(now, vehicle, lifting).part(now, vehicle, own_a)?;
        if part < SHARE_PART
            && (self.slows_down(now, vehicle, usize::from(motor)) || self.is_driven_so(now, vehicle))
        {
            return None;
        }
        // Measured when this motor told it: a value that is held is one sample.
        let at = vehicle.motors.get(usize::from(motor))?.moved_at?;
        Some(Reading { at, value: part * 100.0 })
    }

    /// Whether a motor turns slower than the others that lift, and not much slower.
    fn slows_down(&self, now: Instant, vehicle: &Vehicle, motor: usize) -> bool {
        let lifting = self.lifts & !self.pushes;
        let rpm = |motor: usize| {
            let motor = vehicle.motors.get(motor).filter(|motor| is_fresh(now, motor))?;
            motor.esc.rpm.map(|rpm| libm::fabsf(rpm.0)).filter(|rpm| rpm.is_finite())
        };
        let Some(own) = rpm(motor) else { return false };
        let others = (0..MOTORS_MAX).filter(|other| *other != motor && lifting & (1 << other) != 0);
        let (sum, count) =
            others.filter_map(rpm).fold((0.0, 0_u8), |(sum, count), rpm| (sum + rpm, count + 1));
        SLOWS_PART.contains(&(own * f32::from(count) / sum))
    }

    /// Whether half of the motors that lift stand nearly still and the vehicle does not spin.
    fn is_driven_so(&self, now: Instant, vehicle: &Vehicle) -> bool {
        let lifting = self.lifts & !self.pushes;
        let currents = || {
            let lifts = |motor: &usize| lifting & (1 << motor) != 0;
            (0..MOTORS_MAX).filter(lifts).filter_map(|motor| current_a(now, vehicle, motor))
        };
        let most_a = currents().fold(0.0, f32::max);
        let idle = currents().filter(|current_a| *current_a < SHARE_PART * most_a).count();
        let rates = vehicle.attitude.within(now, PAUSE).and_then(|attitude| attitude.rates);
        let spins = rates.is_none_or(|rates| rates.into_iter().any(|rate| rate.0.abs() > SPINS_RAD_S));
        2 * idle >= currents().count() && !spins
    }
}

/// What a motor takes, in amperes. Noise around zero may be negative.
fn current_a(now: Instant, vehicle: &Vehicle, motor: usize) -> Option<f32> {
    let motor = vehicle.motors.get(motor)?;
    let fresh = is_fresh(now, motor);
    motor.esc.current.map(|current| current.0.max(0.0)).filter(|current| fresh && current.is_finite())
}

fn is_fresh(now: Instant, motor: &Motor) -> bool {
    motor.moved_at.is_some_and(|at| now.since(at) <= PAUSE)
}

/// What several motors take together.
struct Total {
    sum_a: f32,
    count: u8,
}

impl Total {
    fn of(now: Instant, vehicle: &Vehicle, among: u16) -> Self {
        let motors = (0..MOTORS_MAX).filter(|motor| among & (1 << motor) != 0);
        let currents = motors.filter_map(|motor| current_a(now, vehicle, motor));
        let (sum_a, count) =
            currents.fold((0.0, 0), |(sum_a, count), current_a| (sum_a + current_a, count + 1));
        Self { sum_a, count }
    }

    /// The current of one of them as a part of the mean of the others, while the throttle asks for thrust in hover.
    fn part(&self, now: Instant, vehicle: &Vehicle, own_a: f32) -> Option<f32> {
        let throttle = vehicle.hud.within(now, PAUSE)?.throttle?.0;
        let others = self.count.checked_sub(1)?;
        let mean_a = (self.sum_a - own_a) / f32::from(others);
        let asked = vehicle.hovers(now) == Some(true) && throttle > FLYING_THROTTLE;
        (asked && others >= 2 && mean_a > CURRENT_MIN_A).then(|| own_a / mean_a)
    }
}
