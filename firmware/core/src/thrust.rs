//! Thrust by the throttle that the autopilot gives, against the throttle that the vehicle hovers with.
//!
//! Thrust grows at least as fast as the throttle. So below half of the hover throttle rotors carry less than half of the weight. Until that
//! is learnt, a multicopter hovers at a quarter to three quarters of its throttle and idles below a tenth.

use crate::motion::IDLE_THROTTLE;
use crate::time::{BootMs, Millis, PAUSE};

pub(crate) const CARRIES: f32 = 0.2;
/// Full throttle. Controllers keep some back for attitude.
pub(crate) const FULL: f32 = 0.95;
const HOVER_PART: f32 = 0.5;
/// Time constant of the hover throttle, and the hover time until it is known, s.
const HOVER_S: f32 = 10.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Power {
    Idle,
    Little,
    Carries,
    /// Enough to climb.
    Full,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Thrust {
    hover: f32,
    hovered_s: f32,
    at: BootMs,
    /// Last time armed with more than idle throttle; zero for never.
    driven_at: BootMs,
    /// Whether the throttle reached its level of flight since arming: only then its values have a meaning.
    pub(crate) has_flown: bool,
}

impl Thrust {
    pub(crate) fn forget(&mut self) {
        (self.hovered_s, self.has_flown) = (0.0, false);
    }

    pub(crate) fn take(&mut self, at: BootMs, part: f32, hovers: bool) {
        let step_s = at.since(core::mem::replace(&mut self.at, at)).min(PAUSE).as_secs_f32();
        if part > self.idle().min(IDLE_THROTTLE) {
            self.driven_at = at;
        }
        self.has_flown |= part >= CARRIES;
        if hovers {
            let weight = if self.hover > 0.0 { step_s / (HOVER_S + step_s) } else { 1.0 };
            self.hover += weight * (part - self.hover);
            self.hovered_s += step_s;
        }
    }

    pub(crate) fn is_learnt(&self) -> bool {
        self.hovered_s >= HOVER_S
    }

    fn idle(&self) -> f32 {
        if self.is_learnt() { HOVER_PART * self.hover } else { IDLE_THROTTLE }
    }

    pub(crate) fn power(&self, part: f32) -> Power {
        let carries = if self.is_learnt() { self.idle() } else { CARRIES };
        match part {
            part if part >= FULL => Power::Full,
            part if part >= carries => Power::Carries,
            part if part >= self.idle() => Power::Little,
            _ => Power::Idle,
        }
    }

    pub(crate) fn was_driven(&self, now: BootMs, within: Millis) -> bool {
        self.driven_at != BootMs::ZERO && now.since(self.driven_at) <= within
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vehicle_that_hovers_with_little_throttle_is_carried_by_it() {
        let mut thrust = Thrust::default();
        assert_eq!(
            [0.05, 0.15, 0.4, 0.95].map(|part| thrust.power(part)),
            [Power::Idle, Power::Little, Power::Carries, Power::Full]
        );
        for at_ms in (0..12_000).step_by(200) {
            thrust.take(BootMs::from_millis(at_ms), 0.09, true);
        }
        assert_eq!([0.03, 0.09].map(|part| thrust.power(part)), [Power::Idle, Power::Carries]);
        thrust.forget();
        assert_eq!(thrust.power(0.09), Power::Idle, "with another payload");
    }
}
