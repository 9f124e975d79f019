//! Sums, maxima and minima of all counters, of one session or of many.

use super::counters::{Form, MOTOR_REVOLUTIONS_FIRST, MOTOR_TIME_FIRST, UsageCounter};
use crate::observation::MOTORS_MAX;
use crate::vehicle::BATTERIES_MAX;

state! {
    /// Run time and revolutions of one motor.
    pub struct MotorTotals {
        /// Seconds that it turned.
        pub seconds: f64,
        /// Revolutions.
        pub revolutions: f64,
    }

    /// Every counter, added up.
    pub struct Totals {
        counters: [f64; UsageCounter::ALL.len()] = {
            let mut counters = [0.0; _];
            let mut place = 0;
            while place < counters.len() {
                counters[place] = UsageCounter::ALL[place].form().nothing();
                place += 1;
            }
            counters
        },
        /// Motors by number.
        pub motors: [MotorTotals; MOTORS_MAX] = [MotorTotals::default(); MOTORS_MAX],
    }
}

impl Totals {
    /// A counter's raw value: infinite for a minimum that was never measured.
    pub const fn raw(&self, counter: UsageCounter) -> f64 {
        self.counters[counter as usize]
    }

    /// Sets a counter.
    pub const fn set(&mut self, counter: UsageCounter, value: f64) {
        self.counters[counter as usize] = value;
    }

    /// Adds to a counter.
    pub fn add(&mut self, counter: UsageCounter, amount: f64) {
        self.counters[counter as usize] += amount;
    }

    /// Takes one more value of a counter that keeps the greatest or the least.
    pub fn extend(&mut self, counter: UsageCounter, value: f64) {
        let known = &mut self.counters[counter as usize];
        *known = match counter.form() {
            Form::Lowest => known.min(value),
            _ => known.max(value),
        };
    }

    /// A counter's value; `None` for a minimum that was never measured, and for battery cycles without a known
    /// capacity.
    pub fn value(&self, counter: UsageCounter) -> Option<f64> {
        let value = self.raw(counter);
        let unknown = counter == UsageCounter::BatteryCycles && value <= 0.0;
        (value.is_finite() && !unknown).then_some(value)
    }

    /// Every known counter: its stored number and its value.
    pub fn for_each(&self, mut each: impl FnMut(u8, f64)) {
        for counter in UsageCounter::ALL {
            if let Some(value) = self.value(*counter) {
                each(counter.number(), value);
            }
        }
        for (motor, usage) in (0..).zip(&self.motors) {
            if usage.seconds > 0.0 {
                each(MOTOR_TIME_FIRST + motor, usage.seconds);
                each(MOTOR_REVOLUTIONS_FIRST + motor, usage.revolutions);
            }
        }
    }

    /// The sum of these and `later`.
    pub fn join(&self, later: &Self) -> Self {
        let mut both = *self;
        for counter in UsageCounter::ALL {
            let value = later.raw(*counter);
            match counter.form() {
                Form::Highest | Form::Lowest => both.extend(*counter, value),
                _ => both.add(*counter, value),
            }
        }
        for (motor, later) in both.motors.iter_mut().zip(&later.motors) {
            motor.seconds += later.seconds;
            motor.revolutions += later.revolutions;
        }
        both
    }
}

/// The counters of a session by which components wear: sums, without the cycles of the load factor.
#[derive(Clone, Copy, Debug)]
pub struct Wear<'a> {
    /// The session's counters.
    pub totals: &'a Totals,
    /// Full discharges of each battery.
    pub battery_cycles: &'a [f64; BATTERIES_MAX],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_add_up_and_extremes_stay() {
        let (mut first, mut second) = (Totals::default(), Totals::default());
        for (totals, flights, height, voltage) in
            [(&mut first, 2.0, 80.0, 14.1), (&mut second, 3.0, 60.0, 13.7)]
        {
            totals.add(UsageCounter::Flights, flights);
            totals.extend(UsageCounter::HeightMax, height);
            totals.extend(UsageCounter::VoltageMin, voltage);
            totals.motors[3].revolutions = 1e6;
        }
        let both = first.join(&second);
        assert_eq!(both.value(UsageCounter::Flights), Some(5.0));
        assert_eq!(both.value(UsageCounter::HeightMax), Some(80.0));
        assert_eq!(both.value(UsageCounter::VoltageMin), Some(13.7));
        assert_eq!(both.motors[3].revolutions.to_bits(), 2e6_f64.to_bits());
        assert_eq!(Totals::default().join(&first), first);
    }

    #[test]
    fn what_was_never_measured_has_no_value() {
        assert_eq!(Totals::default().value(UsageCounter::VoltageMin), None);
        assert_eq!(Totals::default().value(UsageCounter::BatteryCycles), None);
        assert_eq!(Totals::default().value(UsageCounter::Flights), Some(0.0));
    }
}
