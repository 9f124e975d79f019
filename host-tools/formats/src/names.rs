//! Names of numbers in a log.

use std::borrow::Cow;

use hums_core::exposure::{BINS, ExposureQuantity};
use hums_core::figures::Quantity;
use hums_core::observation::MOTORS_MAX;
use hums_core::usage::{
    EXPOSURE_FIRST, FIGURE_FIRST, MOTOR_REVOLUTIONS_FIRST, MOTOR_TIME_FIRST, UsageCounter,
};
use hums_link::vocabulary::{self, Words};

use crate::trend_words::WORDS;

/// `UNKNOWN_12345` where the dialect has none.
pub fn message_name(id: u32) -> Cow<'static, str> {
    match hums_dialect::message(id) {
        Some(message) => Cow::Borrowed(message.name),
        None => Cow::Owned(format!("UNKNOWN_{id}")),
    }
}

/// The board's, or trends'.
pub fn vocabulary(check: &str) -> Option<&'static Words> {
    let of_trends = || WORDS.iter().find(|words| words.said.check == check);
    vocabulary::vocabulary(check).or_else(of_trends)
}

/// The fault that a check finds, in the words of radio texts: `battery 1, 2 cell low`; of any part, `battery cell low`.
pub fn check_name(check: &str, instances: &[u8]) -> String {
    let Some(words) = vocabulary(check) else { return check.replace('_', " ") };
    let fault = words.said.alarm.split('|').next().unwrap_or_default();
    let numbers: Vec<String> = instances.iter().map(|of| (u16::from(*of) + 1).to_string()).collect();
    if numbers.is_empty() { fault.replacen(" #", "", 1) } else { fault.replacen('#', &numbers.join(", "), 1) }
}

/// A unit for people; logs have ASCII.
pub fn unit_name(unit: &str) -> &str {
    match unit {
        "degC" => "\u{b0}C",
        "deg" => "\u{b0}",
        "deg/s" => "\u{b0}/s",
        "m/s2" => "m/s\u{b2}",
        "1/min" => "per min",
        "times" => "\u{d7} usual",
        other => other,
    }
}

/// The meaning of a counter's number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CounterName {
    /// A counter of the vehicle.
    Vehicle(&'static str),
    /// A counter of one motor, numbered from 0: name and motor.
    Motor(&'static str, u8),
    /// Seconds that a quantity stood from the first figure to the second; infinite where the range has no end.
    Exposure(ExposureQuantity, f32, f32),
    /// A figure of a flight.
    Figure(Quantity),
}

/// `None` for a number of a later version.
pub fn counter_meaning(number: u8) -> Option<CounterName> {
    let motor = |first: u8| number.checked_sub(first).filter(|motor| usize::from(*motor) < MOTORS_MAX);
    if let Some(motor) = motor(MOTOR_TIME_FIRST) {
        return Some(CounterName::Motor("run_time_s", motor));
    }
    if let Some(motor) = motor(MOTOR_REVOLUTIONS_FIRST) {
        return Some(CounterName::Motor("revolutions", motor));
    }
    if let Some(quantity) = number.checked_sub(FIGURE_FIRST) {
        return Quantity::from_index(usize::from(quantity)).map(CounterName::Figure);
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
        .find(|counter| counter.number() == number)
        .map(|counter| CounterName::Vehicle(counter.name()))
}

/// `flight_time_s`, `motor0_run_time_s`; `counter_123` if unknown.
pub fn counter_name(number: u8) -> String {
    match counter_meaning(number) {
        Some(CounterName::Vehicle(name)) => name.to_owned(),
        Some(CounterName::Motor(name, motor)) => format!("motor{motor}_{name}"),
        Some(CounterName::Exposure(quantity, from, to)) => {
            let (name, unit) = (quantity.name(), quantity.unit());
            let range = match (from.is_finite(), to.is_finite()) {
                (false, _) => format!("below_{to}"),
                (true, false) => format!("from_{from}"),
                (true, true) => format!("{from}_to_{to}"),
            };
            format!("{name}_{}_{unit}_s", range.replace('.', "_"))
        }
        Some(CounterName::Figure(quantity)) => match quantity {
            Quantity::Vibration => "steady_vibration_m_s2".to_owned(),
            Quantity::HoverThrottle => "steady_hover_throttle".to_owned(),
            Quantity::Resistance(battery) => format!("steady_battery{battery}_resistance_ohm"),
            Quantity::MotorSpeed(motor) => format!("steady_motor{motor}_speed_off_percent"),
            Quantity::HoverPower => "steady_hover_power_w".to_owned(),
            Quantity::MotorOutput(motor) => format!("steady_motor{motor}_output_off_percent"),
            Quantity::Capacity(battery) => format!("steady_battery{battery}_capacity_ah"),
        },
        None => format!("counter_{number}"),
    }
}

/// The source of time by the stored number.
pub fn clock_source_name(number: u8) -> &'static str {
    match number {
        1 => "SYSTEM_TIME",
        2 => "recording",
        3 => "GNSS",
        _ => "unknown",
    }
}

/// The kind of a monitor's fault.
pub fn fault_name(number: u8) -> &'static str {
    match number {
        1 => "panic",
        2 => "hard_fault",
        3 => "watchdog",
        _ => "unknown",
    }
}

/// An event by its number in a log.
pub fn event_name(number: u8) -> &'static str {
    match number {
        1 => "armed",
        2 => "disarmed",
        3 => "take_off",
        4 => "landing",
        5 => "snapshot",
        6 => "card_in",
        7 => "card_out",
        8 => "critical",
        9 => "phase",
        10 => "autopilot_reboot",
        11 => "other_airframe",
        12 => "by_link",
        13 => "other_vehicle",
        14 => "flight_resumed",
        15 => "mishap",
        16 => "mishap_down",
        17 => "mishap_over",
        18 => "mishap_on_bench",
        _ => "other",
    }
}

/// Names of `MAV_AUTOPILOT`, as met in the field.
pub fn autopilot_name(number: u8) -> String {
    match number {
        0 => "generic".into(),
        3 => "ArduPilot".into(),
        12 => "PX4".into(),
        other => format!("MAV_AUTOPILOT {other}"),
    }
}

/// Names of `MAV_TYPE`, as met in the field.
pub fn type_name(number: u8) -> String {
    let name = match number {
        0 => "generic",
        1 => "fixed wing",
        2 => "quadrotor",
        3 => "coaxial helicopter",
        4 => "helicopter",
        10 => "ground rover",
        11 => "surface boat",
        12 => "submarine",
        13 => "hexarotor",
        14 => "octorotor",
        15 => "tricopter",
        19..=25 => "VTOL",
        29 => "dodecarotor",
        _ => return format!("MAV_TYPE {number}"),
    };
    name.into()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use hums_core::usage::{exposure_number, figure_number};

    use super::*;

    #[test]
    fn every_number_has_a_name_of_its_own_and_ranges_say_their_ends() {
        let names: HashSet<String> = (0..=u8::MAX).map(counter_name).collect();
        assert_eq!(names.len(), 256);
        for range in
            ["vibration_below_1_m_s2_s", "vibration_1_to_2_5_m_s2_s", "esc_temperature_from_110_degc_s"]
        {
            assert!(names.contains(range), "{range}");
        }
    }

    #[test]
    fn ranges_and_figures_are_named_by_their_numbers() {
        let first = exposure_number(ExposureQuantity::Vibration, 0);
        let name = counter_meaning(first);
        assert_eq!(name, Some(CounterName::Exposure(ExposureQuantity::Vibration, f32::NEG_INFINITY, 1.0)));
        let last = counter_meaning(exposure_number(ExposureQuantity::Current, BINS - 1));
        assert_eq!(last, Some(CounterName::Exposure(ExposureQuantity::Current, 160.0, f32::INFINITY)));
        let motor = Quantity::MotorSpeed(11);
        assert_eq!(counter_meaning(figure_number(motor)), Some(CounterName::Figure(motor)));
    }

    #[test]
    fn every_counter_has_a_number_of_its_own_and_a_name() {
        let mut count = 0;
        for number in 0..=255 {
            if let Some(name) = counter_meaning(number) {
                count += 1;
                assert!(!matches!(name, CounterName::Vehicle("")), "{number}");
            }
        }
        assert_eq!(
            count,
            UsageCounter::ALL.len() + 2 * MOTORS_MAX + BINS * ExposureQuantity::ALL.len() + Quantity::COUNT
        );
    }
}
