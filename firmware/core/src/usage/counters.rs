//! The counters: their stored numbers, their names, which carry the unit, and how they add up over sessions.

use crate::exposure::{BINS, ExposureQuantity};
use crate::figures::Quantity as Steady;
use crate::observation::MOTORS_MAX;

/// How a counter adds up over sessions, and its stored form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Time that adds up; stored in tenths of a second in 32 bits: 119,000 hours.
    Tenths,
    /// Events that add up; 32 bits.
    Count,
    /// Half cycles that add up; 32 bits of halves.
    Halves,
    /// A quantity that adds up; double precision.
    Amount,
    /// The greatest of all; single precision.
    Highest,
    /// The least of all, infinite while never measured; single precision.
    Lowest,
}

impl Form {
    /// Bytes of the stored form.
    pub const fn bytes(self) -> usize {
        match self {
            Self::Amount => 8,
            _ => 4,
        }
    }

    /// The value of a counter that has counted nothing.
    pub const fn nothing(self) -> f64 {
        match self {
            Self::Lowest => f64::INFINITY,
            _ => 0.0,
        }
    }
}

macro_rules! counters {
    ($($(#[$doc:meta])* $variant:ident = $number:literal $form:ident $name:literal;)*) => {
        /// The place of a counter in [`UsageCounter::ALL`].
        #[repr(u8)]
        enum Place {
            $($variant,)*
        }

        /// A usage counter. The numbers are stored in logs and never change meaning.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum UsageCounter {
            $($(#[$doc])* $variant = $number,)*
        }

        impl UsageCounter {
            /// All counters except those of motors. New ones are appended: the stored lifetime follows this order.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// The place in [`Self::ALL`].
            pub const fn place(self) -> usize {
                match self {
                    $(Self::$variant => Place::$variant as usize,)*
                }
            }

            /// How it adds up over sessions, and how it is stored.
            pub const fn form(self) -> Form {
                match self {
                    $(Self::$variant => Form::$form,)*
                }
            }

            /// The name, which ends in the unit.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                }
            }
        }
    };
}

counters! {
    /// Seconds since power-on.
    Powered = 0 Tenths "powered_time_s";
    /// Seconds armed.
    Armed = 1 Tenths "armed_time_s";
    /// Seconds in the air.
    Flight = 2 Tenths "flight_time_s";
    /// Take-offs.
    Flights = 3 Count "flights";
    /// Landings.
    Landings = 4 Count "landings";
    /// Metres over ground while in the air.
    Distance = 5 Amount "distance_m";
    /// The greatest height above home, metres.
    HeightMax = 6 Highest "height_max_m";
    /// The greatest speed over ground, m/s.
    SpeedMax = 7 Highest "speed_max_m_s";
    /// The greatest load factor in the air, units of gravity.
    LoadFactorMax = 8 Highest "load_factor_max_g";
    /// Charge taken from all batteries, ampere hours.
    Charge = 9 Amount "charge_ah";
    /// Energy taken from all batteries, watt hours.
    Energy = 10 Amount "energy_wh";
    /// The highest current of all batteries together, amperes.
    CurrentMax = 11 Highest "current_max_a";
    /// The lowest battery voltage while armed, volts.
    VoltageMin = 12 Lowest "voltage_min_v";
    /// The highest vibration while armed, on the autopilot's own scale, m/s2.
    VibrationMax = 13 Highest "vibration_max_m_s2";
    /// Reboots of the autopilot.
    AutopilotReboots = 14 Count "autopilot_reboots";
    /// Landings faster than the limit of a hard one.
    HardLandings = 15 Count "hard_landings";
    /// The fastest touchdown, m/s downwards.
    TouchdownMax = 16 Highest "touchdown_max_m_s";
    /// Full discharges of all batteries together that the charge taken makes.
    BatteryCycles = 17 Amount "battery_cycles";
    /// Seconds on the ground with an autopilot that is heard.
    Ground = 20 Tenths "ground_time_s";
    /// Seconds in the first metres up.
    TakeOff = 21 Tenths "take_off_time_s";
    /// Seconds standing in the air.
    Hover = 22 Tenths "hover_time_s";
    /// Seconds going up.
    Climb = 23 Tenths "climb_time_s";
    /// Seconds going somewhere.
    Cruise = 24 Tenths "cruise_time_s";
    /// Seconds going down.
    Descent = 25 Tenths "descent_time_s";
    /// Seconds in the last metres down.
    Landing = 26 Tenths "landing_time_s";
    /// Rainflow cycles of the load factor in the air, ranges from 0.25 g.
    LoadCycles0 = 30 Halves "load_cycles_from_0_25_g";
    /// Ranges from 0.5 g.
    LoadCycles1 = 31 Halves "load_cycles_from_0_5_g";
    /// Ranges from 1 g.
    LoadCycles2 = 32 Halves "load_cycles_from_1_g";
    /// Ranges from 1.5 g.
    LoadCycles3 = 33 Halves "load_cycles_from_1_5_g";
    /// Ranges from 2 g.
    LoadCycles4 = 34 Halves "load_cycles_from_2_g";
    /// Ranges from 3 g.
    LoadCycles5 = 35 Halves "load_cycles_from_3_g";
    /// Ranges from 4 g.
    LoadCycles6 = 36 Halves "load_cycles_from_4_g";
    /// Flights that a mishap ended.
    Mishaps = 18 Count "mishaps";
}

/// Counters one a motor: run time in seconds from this number on, motor by motor.
pub const MOTOR_TIME_FIRST: u8 = 100;
/// Counters one a motor: revolutions from this number on, motor by motor.
pub const MOTOR_REVOLUTIONS_FIRST: u8 = 120;

/// Time in ranges: seconds from this number on, quantity by quantity and range by range.
pub const EXPOSURE_FIRST: u8 = 140;
/// Figures of a flight: from this number on, by [`crate::figures::Quantity::index`].
pub const FIGURE_FIRST: u8 = 200;

const _: () = assert!(EXPOSURE_FIRST as usize + BINS * ExposureQuantity::ALL.len() <= FIGURE_FIRST as usize);
const _: () = assert!(FIGURE_FIRST as usize + Steady::COUNT <= 256);

/// The meaning of a stored counter number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CounterName {
    /// A counter of the vehicle.
    Vehicle(&'static str),
    /// A counter of one motor, numbered from 0: name and motor.
    Motor(&'static str, u8),
    /// Seconds that a quantity stood from the first figure to the second; infinite where the range has no end.
    Exposure(ExposureQuantity, f32, f32),
    /// A figure of a flight.
    Figure(Steady),
}

/// The number of the time that a quantity stood in a range.
pub const fn exposure_number(quantity: ExposureQuantity, bin: usize) -> u8 {
    EXPOSURE_FIRST + quantity as u8 * BINS as u8 + bin as u8
}

/// The number of a flight's figure.
pub const fn figure_number(quantity: Steady) -> u8 {
    FIGURE_FIRST + quantity.index() as u8
}

/// The meaning of a stored counter number; `None` for a number of a later version.
pub fn counter_name(number: u8) -> Option<CounterName> {
    let motor = |first: u8| number.checked_sub(first).filter(|motor| usize::from(*motor) < MOTORS_MAX);
    if let Some(motor) = motor(MOTOR_TIME_FIRST) {
        return Some(CounterName::Motor("run_time_s", motor));
    }
    if let Some(motor) = motor(MOTOR_REVOLUTIONS_FIRST) {
        return Some(CounterName::Motor("revolutions", motor));
    }
    if let Some(quantity) = number.checked_sub(FIGURE_FIRST) {
        return Steady::from_index(usize::from(quantity)).map(CounterName::Figure);
    }
    if let Some(range) = number.checked_sub(EXPOSURE_FIRST) {
        let quantity = ExposureQuantity::ALL.get(usize::from(range) / BINS)?;
        let (edges, bin) = (quantity.edges(), usize::from(range) % BINS);
        let from = bin.checked_sub(1).map_or(f32::NEG_INFINITY, |below| edges[below]);
        let to = edges.get(bin).copied().unwrap_or(f32::INFINITY);
        return Some(CounterName::Exposure(*quantity, from, to));
    }
    UsageCounter::ALL
        .iter()
        .find(|counter| **counter as u8 == number)
        .map(|counter| CounterName::Vehicle(counter.name()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_and_figures_are_named_by_their_numbers() {
        let first = exposure_number(ExposureQuantity::Vibration, 0);
        let name = counter_name(first);
        assert_eq!(name, Some(CounterName::Exposure(ExposureQuantity::Vibration, f32::NEG_INFINITY, 1.0)));
        let last = counter_name(exposure_number(ExposureQuantity::Current, BINS - 1));
        assert_eq!(last, Some(CounterName::Exposure(ExposureQuantity::Current, 160.0, f32::INFINITY)));
        let motor = Steady::MotorSpeed(11);
        assert_eq!(counter_name(figure_number(motor)), Some(CounterName::Figure(motor)));
    }

    #[test]
    fn every_counter_has_a_number_of_its_own_and_a_name() {
        let mut count = 0;
        for number in 0..=255 {
            if let Some(name) = counter_name(number) {
                count += 1;
                assert!(!matches!(name, CounterName::Vehicle("")), "{number}");
            }
        }
        assert_eq!(
            count,
            UsageCounter::ALL.len() + 2 * MOTORS_MAX + BINS * ExposureQuantity::ALL.len() + Steady::COUNT
        );
    }
}
