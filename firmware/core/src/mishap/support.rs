//! Whether a multicopter stands on something, by its throttle, its accelerometer and the air pressure. No estimator is asked, for one
//! that is lost drifts.
//!
//! Thrust grows at least as fast as the throttle does: with less than half of the throttle that it hovers with, rotors carry less than
//! half of the weight. An accelerometer that feels all of the weight then feels the ground, or the drag of a fall, which the pressure
//! shows. A flare takes that from the speed over ground, for less than [`SHOWS`].

use super::Mishap;
use super::evidence::{FRESH, IDLE_THROTTLE, THRUST_PART};
use crate::modes::is_made_to_turn;
use crate::motion::{climb_mps, throttle};
use crate::time::{Instant, Span, Stamp};
use crate::units::{GRAVITY, norm};
use crate::vehicle::Vehicle;

/// It is seen for so long.
const SHOWS: Span = Span::from_secs(4);
/// The weight, in g, with the scale error of a sensor.
const WEIGHT_G: core::ops::Range<f32> = 0.85..1.15;
/// The pressure stays within this, hPa: 1.2 m.
const STAYS_HPA: f32 = 0.15;
/// Faster body rates are no rest, rad/s.
const RESTS_RATE: f32 = 0.3;
/// The throttle of a hover is known after so long in it, s; and its time constant, s.
const LEARNT_S: f32 = 10.0;
const HOVER_S: f32 = 10.0;
/// Throttles come more often than this, s.
const STEP_MAX_S: f32 = 2.0;

/// What is known of what carries it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Support {
    /// It is in the air.
    pub(super) flies: bool,
    /// The part of the throttle that it hovers with, smoothed; 0 where it is not known.
    pub(super) hover_throttle: f32,
    /// How long it has hovered.
    hovered_s: f32,
    throttle_at: Instant,
    /// Since when something carries it that is not its rotors, and the pressure then, hPa.
    since: Stamp,
    hpa: f32,
}

impl Support {
    pub(super) const NOTHING: Self = Self {
        flies: false,
        hover_throttle: 0.0,
        hovered_s: 0.0,
        throttle_at: Instant::ZERO,
        since: Stamp::NONE,
        hpa: 0.0,
    };

    /// A throttle came, while it hovers or not.
    pub(super) fn take_throttle(&mut self, at: Instant, part: f32, hovers: bool) {
        let step_s = at.since(core::mem::replace(&mut self.throttle_at, at)).as_secs_f32().min(STEP_MAX_S);
        if hovers {
            let weight = if self.hover_throttle > 0.0 { step_s / (HOVER_S + step_s) } else { 1.0 };
            self.hover_throttle += weight * (part - self.hover_throttle);
            self.hovered_s += step_s;
        }
    }

    /// Whether this throttle carries less than half of the weight.
    pub(super) fn is_little(&self, part: f32) -> bool {
        part < THRUST_PART * self.hover_throttle
    }
}

impl Mishap {
    /// Whether it has stood on something for a while, by no estimator's word.
    pub(crate) fn is_supported(&self, now: Instant) -> bool {
        self.support.since.age(now).is_some_and(|age| age >= SHOWS)
    }

    pub(super) fn note_throttle(&mut self, at: Instant, vehicle: &Vehicle) {
        let part = throttle(at, vehicle).unwrap_or(0.0);
        if self.armed && part > IDLE_THROTTLE {
            self.driven_at = at;
        }
        let level = climb_mps(at, vehicle).is_some_and(|climb_mps| climb_mps.abs() < 1.0);
        let hovers = level && part > IDLE_THROTTLE && self.support.flies && self.shock.is_none();
        self.support.take_throttle(at, part, hovers);
    }

    /// One step.
    pub(super) fn note_support(&mut self, now: Instant, vehicle: &Vehicle) {
        let Support { hovered_s, hpa, .. } = self.support;
        let is_little = || throttle(now, vehicle).is_some_and(|part| self.support.is_little(part));
        let weight_g = || norm(vehicle.inertial.force()) / GRAVITY;
        let rests = self.armed
            && hovered_s >= LEARNT_S
            && vehicle.is_multicopter()
            && is_little()
            && !is_made_to_turn(vehicle)
            && now.since(self.felt_at) <= FRESH
            && WEIGHT_G.contains(&weight_g())
            && self.rate < RESTS_RATE;
        let now_hpa = self.pressure.now(now).filter(|_| rests);
        let stays = now_hpa.is_some_and(|now_hpa| libm::fabsf(now_hpa - hpa) < STAYS_HPA);
        match now_hpa {
            None => self.support.since = Stamp::NONE,
            Some(_) if self.support.since.is_set() && stays => {}
            Some(now_hpa) => (self.support.since, self.support.hpa) = (Stamp::at(now), now_hpa),
        }
    }
}
