//! Slow figures: a battery's internal resistance against its own past, and rates of counters that wrap.

use crate::time::{BootMs, Millis};
use crate::units::{Amperes, Volts};

state! {
    /// A battery's internal resistance: the slope of its voltage over its current, from exponential means.
    pub(crate) struct Resistance {
        current_a: f32,
        voltage_v: f32,
        variance_a2: f32,
        variance_v2: f32,
        covariance_va: f32,
        samples: u16,
        /// The baseline of later figures, ohm; 0 before there is one.
        baseline_ohm: f32,
        /// The last figure from a large change of the current, ohm; 0 before there is one.
        sag_ohm: f32,
    }
}

impl Resistance {
    /// Weight of a new sample in the means: they look back about 60 samples.
    const WEIGHT: f32 = 1.0 / 60.0;
    /// Minimum variance of the current for a slope, A2.
    const VARIANCE_MIN_A2: f32 = 0.5;
    /// The part of the voltage's variance that the current must explain. A voltage that falls for another reason (an
    /// empty battery, a failing cell) gives no resistance.
    const EXPLAINED_MIN: f32 = 0.7;
    const SAMPLES_MIN: u16 = 120;
    const SAMPLES_BASELINE: u16 = 480;
    /// A figure from a large change: this many samples, and a spread of the current of this part of its mean. A
    /// failing cell lowers the voltage without such a change.
    const SAMPLES_SAG: u16 = 20;
    const SPREAD_SAG: f32 = 0.2;

    pub(crate) fn take(&mut self, voltage: Option<Volts>, current: Option<Amperes>) {
        let (Some(voltage), Some(current)) = (voltage, current) else { return };
        let (voltage_v, current_a) = (voltage.0, current.0);
        if !voltage_v.is_finite() || !current_a.is_finite() {
            return;
        }
        if self.samples == 0 {
            (self.current_a, self.voltage_v) = (current_a, voltage_v);
        }
        let (from_mean_a, from_mean_v) = (current_a - self.current_a, voltage_v - self.voltage_v);
        self.current_a += Self::WEIGHT * from_mean_a;
        self.voltage_v += Self::WEIGHT * from_mean_v;
        let old = 1.0 - Self::WEIGHT;
        self.variance_a2 = old * (self.variance_a2 + Self::WEIGHT * from_mean_a * from_mean_a);
        self.variance_v2 = old * (self.variance_v2 + Self::WEIGHT * from_mean_v * from_mean_v);
        self.covariance_va = old * (self.covariance_va + Self::WEIGHT * from_mean_a * from_mean_v);
        self.samples = self.samples.saturating_add(1);
        if self.baseline_ohm == 0.0 && self.samples >= Self::SAMPLES_BASELINE {
            self.baseline_ohm = self.ohm().unwrap_or(0.0);
        }
        let spread_a = Self::SPREAD_SAG * self.current_a;
        if self.samples >= Self::SAMPLES_SAG && self.variance_a2 >= spread_a * spread_a {
            self.sag_ohm = self.slope_ohm().unwrap_or(self.sag_ohm);
        }
    }

    /// The sag of the voltage under this current, volts; 0 while unknown.
    pub(crate) fn sag_v(&self, current: Amperes) -> f32 {
        let sag_v = self.sag_ohm * current.0;
        if sag_v.is_finite() { sag_v.max(0.0) } else { 0.0 }
    }

    /// In ohm; `None` while the current has not varied enough.
    pub(crate) fn ohm(&self) -> Option<f32> {
        self.slope_ohm().filter(|_| self.samples >= Self::SAMPLES_MIN)
    }

    fn slope_ohm(&self) -> Option<f32> {
        let enough = self.variance_a2 >= Self::VARIANCE_MIN_A2
            && self.covariance_va * self.covariance_va
                >= Self::EXPLAINED_MIN * self.variance_a2 * self.variance_v2;
        let ohm = -self.covariance_va / self.variance_a2;
        // No flying battery has less than a milliohm or more than one ohm.
        (enough && ohm > 0.001 && ohm < 1.0).then_some(ohm)
    }

    pub(crate) fn rise_percent(&self) -> Option<f32> {
        let ohm = self.ohm()?;
        (self.baseline_ohm > 0.0).then(|| (ohm / self.baseline_ohm - 1.0) * 100.0)
    }
}

/// Events of the last half to whole minute, of a counter that may wrap or start again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rate {
    count: u32,
    events: [u32; 2],
    half_began: BootMs,
}

impl Rate {
    const HALF: Millis = Millis::from_secs(30);
    /// A larger step is a counter that started again.
    const STEP_MAX: u32 = 10_000;

    pub(crate) const fn new(at: BootMs, count: u32) -> Self {
        Self { count, events: [0; 2], half_began: at }
    }

    pub(crate) fn take(&mut self, at: BootMs, count: u32) {
        let age = at.since(self.half_began);
        if age >= Self::HALF {
            let recent = age < Self::HALF + Self::HALF;
            self.events = [0, if recent { self.events[0] } else { 0 }];
            self.half_began = at;
        }
        let step = count.wrapping_sub(self.count);
        self.count = count;
        if step <= Self::STEP_MAX {
            self.events[0] = self.events[0].saturating_add(step);
        }
    }

    pub(crate) fn per_minute(&self) -> u32 {
        self.events[0].saturating_add(self.events[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{Amperes, Volts};

    fn load(resistance: &mut Resistance, ohm: f32, samples: u32) {
        for sample in 0..samples {
            let current = if sample / 5 % 2 == 0 { 10.0 } else { 20.0 };
            let voltage = 16.0 - ohm * current - 0.0005 * sample as f32;
            resistance.take(Some(Volts(voltage)), Some(Amperes(current)));
        }
    }

    #[test]
    fn resistance_is_found_under_a_changing_load_and_its_rise_against_the_baseline() {
        let mut resistance = Resistance::default();
        load(&mut resistance, 0.020, 600);
        assert!((resistance.ohm().expect("known") - 0.020).abs() < 0.001, "{resistance:?}");
        assert!(resistance.rise_percent().expect("known").abs() < 5.0);
        load(&mut resistance, 0.030, 600);
        assert!((resistance.rise_percent().expect("known") - 50.0).abs() < 6.0, "{resistance:?}");
    }

    #[test]
    fn a_steady_current_says_nothing_about_resistance() {
        let mut resistance = Resistance::default();
        (0..1_000).for_each(|_| resistance.take(Some(Volts(15.0)), Some(Amperes(12.0))));
        assert_eq!((resistance.ohm(), resistance.rise_percent()), (None, None));
    }

    #[test]
    fn a_voltage_that_falls_by_itself_is_no_resistance() {
        let mut resistance = Resistance::default();
        for sample in 0..1_000_u16 {
            let current = 12.0 + f32::from(sample * 7 % 10);
            let voltage = if sample < 600 { 12.6 } else { 11.0 };
            resistance.take(Some(Volts(voltage)), Some(Amperes(current)));
            assert_eq!(resistance.rise_percent(), None, "sample {sample}");
        }
    }

    #[test]
    fn the_sag_of_a_take_off_is_known_for_the_flight_and_a_failing_cell_is_no_sag() {
        let mut resistance = Resistance::default();
        let mut take = |volts, amperes, samples| {
            (0..samples).for_each(|_| resistance.take(Some(Volts(volts)), Some(Amperes(amperes))));
            resistance.sag_v(Amperes(amperes))
        };
        assert!(take(16.0, 0.4, 60).abs() < f32::EPSILON, "nothing changed yet");
        assert!((take(14.6, 12.4, 60) - 1.44).abs() < 0.1, "1.4 V at 12 A more");
        assert!((take(14.6, 12.4, 1_000) - 1.44).abs() < 0.1, "still known in a steady hover");
        // A failing cell takes a third of the voltage drop, with a current that rises by a tenth.
        assert!((take(13.0, 13.6, 600) - 1.58).abs() < 0.1);
    }

    #[test]
    fn a_counter_that_wraps_goes_on_and_one_that_starts_again_counts_nothing() {
        let mut rate = Rate::new(BootMs::ZERO, u32::MAX - 1);
        rate.take(BootMs::from_millis(1_000), 3);
        assert_eq!(rate.per_minute(), 5);
        rate.take(BootMs::from_millis(2_000), 0);
        assert_eq!(rate.per_minute(), 5, "a step back is a restart");
        rate.take(BootMs::from_millis(31_000), 1);
        assert_eq!(rate.per_minute(), 6);
        rate.take(BootMs::from_millis(200_000), 1);
        assert_eq!(rate.per_minute(), 0, "long ago");
    }
}
