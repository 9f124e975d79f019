//! Sums, maxima and minima of all counters, of one session or of many.

use super::counters::{Form, MOTOR_REVOLUTIONS_FIRST, MOTOR_TIME_FIRST, UsageCounter, exposure_number};
use crate::bytes::{Field, Fields, Unreadable};
use crate::exposure::{BINS, ExposureQuantity, Tenths};
use crate::observation::MOTORS_MAX;
use crate::vehicle::BATTERIES_MAX;

const RANGE_BYTES: usize = (BINS * ExposureQuantity::ALL.len()).div_ceil(8);

state! {
    /// Run time and revolutions of one motor.
    pub struct MotorTotals {
        /// Seconds that it turned.
        pub seconds: f64,
        /// Revolutions.
        pub revolutions: f64,
    }

    /// Everything that counts, added up.
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
        /// Full discharges of each battery, if the capacity is known.
        pub(crate) battery_cycles: [f64; BATTERIES_MAX],
        pub(crate) ranges: Tenths,
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

    /// Every known figure: its stored number and its value.
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
        for (quantity, bins) in ExposureQuantity::ALL.into_iter().zip(&self.ranges) {
            for (bin, tenths) in bins.iter().enumerate().filter(|(_, tenths)| **tenths > 0) {
                each(exposure_number(quantity, bin), f64::from(*tenths) / 10.0);
            }
        }
    }

    /// Adds the counters of another session, except the cycles of batteries: these are of components.
    pub fn join(&mut self, other: &Self) {
        for counter in UsageCounter::ALL {
            let value = other.raw(*counter);
            match counter.form() {
                Form::Highest | Form::Lowest => self.extend(*counter, value),
                _ => self.add(*counter, value),
            }
        }
        for (motor, other) in self.motors.iter_mut().zip(&other.motors) {
            motor.seconds += other.seconds;
            motor.revolutions += other.revolutions;
        }
        for (sum, other) in self.ranges.iter_mut().flatten().zip(other.ranges.iter().flatten()) {
            *sum = sum.saturating_add(*other);
        }
    }
}

/// Counters by their [`Form`]; seconds and revolutions of each motor; a bit for each range that was entered, then the tenths of a second of each marked range.
impl Field for Totals {
    fn code(&mut self, fields: &mut Fields<'_>) -> Result<(), Unreadable> {
        for (counter, value) in UsageCounter::ALL.iter().zip(&mut self.counters) {
            fields.counter(counter.form(), value)?;
        }
        let revolutions = if fields.short { Form::Count } else { Form::Amount };
        fields.list(
            &mut self.motors,
            |motor| motor.seconds > 0.0,
            |fields, motor| {
                fields.counter(Form::Tenths, &mut motor.seconds)?;
                fields.counter(revolutions, &mut motor.revolutions)
            },
        )?;
        let mut entered = [0_u8; RANGE_BYTES];
        for (place, _) in self.ranges.iter().flatten().enumerate().filter(|(_, tenths)| **tenths > 0) {
            entered[place / 8] |= 1 << (place % 8);
        }
        entered.code(fields)?;
        let ranges = self.ranges.iter_mut().flatten().enumerate();
        ranges
            .filter(|(place, _)| entered[place / 8] & 1 << (place % 8) != 0)
            .try_for_each(|(_, tenths)| fields.count(tenths))
    }
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
        let mut both = first;
        both.join(&second);
        assert_eq!(both.value(UsageCounter::Flights), Some(5.0));
        assert_eq!(both.value(UsageCounter::HeightMax), Some(80.0));
        assert_eq!(both.value(UsageCounter::VoltageMin), Some(13.7));
        assert_eq!(both.motors[3].revolutions.to_bits(), 2e6_f64.to_bits());
        let mut first_alone = Totals::default();
        first_alone.join(&first);
        assert_eq!(first_alone, first);
    }

    #[test]
    fn what_was_never_measured_has_no_value() {
        assert_eq!(Totals::default().value(UsageCounter::VoltageMin), None);
        assert_eq!(Totals::default().value(UsageCounter::BatteryCycles), None);
        assert_eq!(Totals::default().value(UsageCounter::Flights), Some(0.0));
    }
}
