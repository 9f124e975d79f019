//! Whether a multicopter stands on something, by its throttle, its accelerometer and the air pressure. No estimator is asked, for one
//! that is lost drifts.
//!
//! Thrust grows at least as fast as the throttle does: with less than half of the throttle that it hovers with, rotors carry less than
//! half of the weight. An accelerometer that feels all of the weight then feels the ground, or the drag of a fall, which the pressure
//! shows. A flare takes that from the speed over ground, for less than [`SHOWS`].

use super::evidence::{FRESH, LEARNT_S, Support, is_near_ground, on_rotors};
use super::{Kind, Mishap, STILL_RATE};
use crate::flight;
use crate::modes::is_made_to_turn;
use crate::motion::{climb_mps, throttle};
use crate::params::Params;
use crate::time::{Instant, Span, Stamp};
use crate::units::{GRAVITY, norm};
use crate::vehicle::Vehicle;

/// It is seen for so long.
const SHOWS: Span = Span::from_secs(4);
/// The weight, in g, with the scale error of a sensor. More of it is a bias, which may be what lost the estimate.
const WEIGHT_G: core::ops::Range<f32> = 0.85..2.0;
/// What stands, and moves so fast by its estimate, has a lost one, m/s.
const LOST_MPS: f32 = 2.0;
/// The pressure rose until it stood: it did not slow down before the ground. A pressure of before is up to 2 s old.
const UNTIL: Span = Span::from_secs(1);
/// The pressure stays within this, hPa: 1.2 m.
const STAYS_HPA: f32 = 0.15;

impl Mishap {
    /// Whether it has stood on something for a while, by no estimator's word.
    pub(crate) fn is_supported(&self, now: Instant) -> bool {
        self.support.since.age(now).is_some_and(|age| age >= SHOWS)
    }

    /// What is known of the ground without an estimator.
    pub(crate) fn support(&self, now: Instant) -> flight::Support {
        flight::Support {
            is_supported: self.is_supported(now),
            flying_throttle: self.support.flying_throttle(),
            has_pressure: self.pressure.now(now).is_some(),
        }
    }

    pub(super) fn note_throttle(&mut self, at: Instant, vehicle: &Vehicle) {
        let part = throttle(at, vehicle).unwrap_or(0.0);
        if self.armed && part > self.support.idle_throttle() {
            self.driven_at = at;
        }
        let level = climb_mps(at, vehicle).is_some_and(|climb_mps| climb_mps.abs() < 1.0);
        let hovers = level
            && part > 0.0
            && !is_near_ground(at, vehicle)
            && self.support.flies
            && on_rotors(at, vehicle)
            && self.shock.is_none();
        self.support.take_throttle(at, part, hovers);
    }

    /// One step.
    pub(super) fn note_support(&mut self, now: Instant, vehicle: &Vehicle, params: &Params) {
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
            && self.rate < STILL_RATE;
        let now_hpa = self.pressure.now(now).filter(|_| rests);
        let stays = now_hpa.is_some_and(|now_hpa| libm::fabsf(now_hpa - hpa) < STAYS_HPA);
        match now_hpa {
            None => self.support.since = Stamp::NONE,
            Some(_) if self.support.since.is_set() && stays => {}
            Some(now_hpa) => (self.support.since, self.support.hpa) = (Stamp::at(now), now_hpa),
        }
        // An autopilot whose estimate climbs takes the thrust away, and flies into the ground.
        let is_lost = || climb_mps(now, vehicle).is_some_and(|climb_mps| climb_mps.abs() > LOST_MPS);
        if self.support.flies
            && self.is_supported(now)
            && is_lost()
            && let Some(since) = self.support.since.instant(now)
            && (self.pressure.rose_at() + UNTIL).is_after(since)
        {
            self.hit_at = since;
            self.see(now, Kind::Impact, 0.0, params);
        }
    }
}
