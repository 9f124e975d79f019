//! Air pressure as a height: how far the vehicle is above its place of arming, and whether it sinks.
//!
//! A change of pressure `dp` at the pressure `p` is a change of height of `-SCALE_HEIGHT_M * dp / p`. So a metre is 0.120 hPa at sea level
//! and 0.073 hPa at 4,000 m.

use crate::time::{BootMs, Millis, PAUSE};

/// Metres of height for a relative change of pressure: the scale height of air at 15 degrees, R T / (M g).
pub(crate) const SCALE_HEIGHT_M: f32 = 8_430.0;
/// A barometer that repeats its value for longer is stuck: its height is not known. One at rest repeats a value for a second or two.
const STUCK: Millis = Millis::from_secs(5);
const WINDOW: Millis = Millis::from_secs(1);
/// Parachutes let drones down at 4 to 6 m/s (ASTM F3322 leaves it to the energy of the impact).
const PARACHUTE_MPS: f32 = 4.0;
/// Part of a speed, as seconds, that the pressure must show: the vehicle may have begun within it, and a slow stream
/// has old pressures.
const SHOWN_S: f32 = 0.3;
/// Wind and propellers change the height by this much, m.
pub(crate) const NOISE_M: f32 = 0.8;

/// The estimator of the pressure: the first barometer's values, and that at the arming.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Pressure {
    hpa: f32,
    changed_at: BootMs,
    /// The first pressure of this window and of the one before, hPa; 0 for none.
    began_hpa: f32,
    before_hpa: f32,
    window: BootMs,
    pub(crate) sank_at: BootMs,
    /// Pressure at the arming, hPa; 0 for none.
    armed_hpa: f32,
}

impl Pressure {
    pub(crate) fn take(&mut self, at: BootMs, hpa: f32) {
        if !hpa.is_finite() || hpa <= 0.0 {
            return;
        }
        if at.since(self.window) >= WINDOW {
            let goes_on = at.since(self.window) <= PAUSE;
            (self.before_hpa, self.began_hpa, self.window) =
                (if goes_on { self.began_hpa } else { 0.0 }, hpa, at);
        }
        if hpa.to_bits() != self.hpa.to_bits() {
            self.changed_at = at;
        }
        self.hpa = hpa;
        // The pressure before is at least a second old.
        if self.before_hpa > 0.0 && self.rise_m(self.before_hpa) < -PARACHUTE_MPS {
            self.sank_at = at;
        }
    }

    pub(crate) fn arm(&mut self, now: BootMs, armed: bool) {
        self.armed_hpa = if armed && self.is_fresh(now) { self.hpa } else { 0.0 };
    }

    fn rise_m(&self, from_hpa: f32) -> f32 {
        SCALE_HEIGHT_M * (from_hpa - self.hpa) / self.hpa
    }

    fn is_fresh(&self, now: BootMs) -> bool {
        self.hpa > 0.0 && now.since(self.window) <= PAUSE
    }

    pub(crate) fn now(&self, now: BootMs) -> Option<f32> {
        (self.is_fresh(now) && now.since(self.changed_at) <= PAUSE).then_some(self.hpa)
    }

    /// Height above the place of arming, m; `None` if the arming was not received, or the barometer is stuck.
    pub(crate) fn height_m(&self, now: BootMs) -> Option<f32> {
        let known = self.armed_hpa > 0.0 && self.is_fresh(now) && now.since(self.changed_at) <= STUCK;
        known.then(|| self.rise_m(self.armed_hpa))
    }

    pub(crate) fn is_within(&self, of_hpa: f32, limit_m: f32) -> bool {
        libm::fabsf(self.rise_m(of_hpa)) < limit_m
    }

    /// Time since it last sank as fast as under a parachute; `None` without a barometer that measures.
    pub(crate) fn steady_for(&self, now: BootMs) -> Option<Millis> {
        self.now(now).map(|_| now.since(self.sank_at))
    }

    /// `climb_mps` is of one to two seconds, negative in a sink; `None` without a barometer that measures.
    pub(crate) fn follows(&self, now: BootMs, climb_mps: f32) -> Option<bool> {
        let least_m = (SHOWN_S * libm::fabsf(climb_mps)).max(NOISE_M);
        self.now(now).filter(|_| self.before_hpa > 0.0)?;
        let rise_m = self.rise_m(self.before_hpa);
        Some(libm::fabsf(rise_m) > least_m && rise_m * climb_mps > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_height_is_right_at_sea_level_and_at_four_thousand_metres() {
        // ICAO standard atmosphere: pressures of two heights that are 20 m apart.
        for (from_hpa, to_hpa) in [(1_013.25, 1_010.85), (616.60, 614.98)] {
            let mut pressure = Pressure::default();
            pressure.take(BootMs::from_millis(1_000), from_hpa);
            pressure.arm(BootMs::from_millis(1_000), true);
            pressure.take(BootMs::from_millis(2_000), to_hpa);
            let height_m = pressure.height_m(BootMs::from_millis(2_000)).unwrap_or(0.0);
            assert!((18.0..24.0).contains(&height_m), "{from_hpa}: {height_m}");
        }
    }

    #[test]
    fn a_stuck_barometer_has_no_height() {
        let mut pressure = Pressure::default();
        pressure.take(BootMs::from_millis(1_000), 950.0);
        pressure.arm(BootMs::from_millis(1_000), true);
        for at_ms in (1_000..20_000).step_by(200) {
            pressure.take(BootMs::from_millis(at_ms), 950.0);
        }
        assert_eq!(pressure.height_m(BootMs::from_millis(20_000)), None);
    }
}
