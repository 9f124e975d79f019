//! A check's value: a quantity with its limit, or a state.

use std::fmt::{self, Display, Formatter};

use hums_core::health::check_named;

use crate::names::{unit_name, vocabulary};
use crate::source::told::Finding;
use crate::summary::is_possible;

/// Should be zero: a limit below one means "any", and is not shown.
const COUNTS: [&str; 2] = ["card_errors", "record_lost"];

/// A value for people.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShownValue {
    /// `None` if unknown; number and limit are not for people.
    State(Option<&'static str>),
    /// A quantity if known; limit if meaningful.
    Quantity(Option<f32>, Option<f32>),
}

/// The shown value and limit of a check.
pub fn shown(check: &str, value: f32, limit: f32) -> ShownValue {
    if check_named(check).is_some_and(|check| check.unit.is_flag()) {
        return ShownValue::State(name(check, value));
    }
    let finite = |value: f32| value.is_finite().then_some(value);
    let says_nothing = COUNTS.contains(&check) && limit < 1.0;
    ShownValue::Quantity(finite(value), finite(limit).filter(|_| !says_nothing))
}

/// A number as people read it: two decimals at most. A value that no sensor can have is not written out.
pub fn short(value: f32) -> String {
    if !is_possible(&value) {
        return format!("{value:.0e}");
    }
    let text = format!("{value:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A quantity with its unit.
pub fn quantity(value: f32, unit: &str) -> String {
    let unit = unit_name(unit);
    let space = if matches!(unit, "" | "°") { "" } else { " " };
    let doubt = if is_possible(&value) { "" } else { ", which no sensor can have" };
    format!("{}{space}{unit}{doubt}", short(value))
}

/// The values of a problem with their unit. Values that are not known, and a worst that reads as the onset, are empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Values {
    /// At its onset.
    pub onset: String,
    /// The worst, as `at worst 3.2 V`.
    pub worst: String,
}

impl Values {
    /// Values of these numbers, which may be NaN.
    pub fn new(onset: f32, worst: Option<f32>, unit: &str) -> Self {
        let known = |value: &f32| value.is_finite();
        let words = |value: f32| quantity(value, unit);
        let onset = Some(onset).filter(known).map(words).unwrap_or_default();
        let worst = worst.filter(known).map(words).filter(|worst| *worst != onset);
        Self { onset, worst: worst.map_or_else(String::new, |worst| format!("at worst {worst}")) }
    }
}

impl Display for Values {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let between = if self.onset.is_empty() || self.worst.is_empty() { "" } else { ", " };
        write!(formatter, "{}{between}{}", self.onset, self.worst)
    }
}

/// The state of a finding, or its values and limit: `3.4 V, at worst 3.3 V (limit 3.5 V)`. A state that only repeats the
/// level is left out.
pub fn measured(finding: &Finding) -> String {
    let Finding { check, level, value, worst, limit, unit, .. } = finding;
    let (words, limit) = match shown(check, *value, *limit) {
        ShownValue::State(state) => {
            (state.filter(|state| !state.ends_with(level.name())).unwrap_or_default().to_owned(), None)
        }
        ShownValue::Quantity(_, limit) => (Values::new(*value, *worst, unit).to_string(), limit),
    };
    let limit = limit.filter(|_| !words.is_empty());
    words + &limit.map_or_else(String::new, |limit| format!(" (limit {})", quantity(limit, unit)))
}

/// A finding by its name, with [`measured`]: `battery 1 cell low, 3.4 V (limit 3.5 V)`.
pub fn finding_words(finding: &Finding) -> String {
    let parts = [finding.name(), measured(finding)];
    parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(", ")
}

/// The state that a value of a check is; `None` for a check of a quantity.
pub fn name(check: &str, value: f32) -> Option<&'static str> {
    let names: &[&str] = match check {
        // MAV_STATE
        "autopilot_state" => &[
            "uninitialized",
            "booting",
            "calibrating",
            "standby",
            "active",
            "critical",
            "emergency",
            "powering off",
            "flight termination",
        ],
        // GPS_FIX_TYPE
        "gps_fix" => &[
            "no receiver",
            "no fix",
            "2D fix",
            "3D fix",
            "3D fix with DGPS",
            "RTK float",
            "RTK fixed",
            "static",
            "PPP",
        ],
        // GPS_JAMMING_STATE, GPS_SPOOFING_STATE
        "gps_jamming" | "gps_spoofing" => &["unknown", "ok", "mitigated", "detected"],
        "autopilot_reboot" => &["no", "restarted"],
        // Ranks of MAV_BATTERY_CHARGE_STATE, ESC_FAILURE_FLAGS, the recorder.
        "batt_state" => &["normal", "low or unhealthy", "critical, emergency or failed"],
        "esc_failure" => &["no failure", "a failure", "motor stuck or ESC failed"],
        "recording" => &["recording", "not recording", "not recording while armed"],
        "compass_unused" => &["used", "not used"],
        "motor_off" => &["driven", "driven", "given next to nothing"],
        "batt_fault" if value >= 2.0 => return Some("several faults"),
        "batt_fault" => &["no fault", "one fault"],
        // `hums_core::cause::Urgency`
        alert if alert.ends_with("_alert") => &["over", "a warning", "critical"],
        _ => return None,
    };
    let place = (value >= 0.0 && value.fract() == 0.0).then_some(value as usize)?;
    names.get(place).copied()
}

/// The meaning of a check's alarm, as a sentence.
pub fn meaning(check: &str) -> &'static str {
    vocabulary(check).map_or("", |words| words.meaning)
}

/// Names by bit of `MAV_SYS_STATUS_SENSOR`; empty for the two that `sensors` ignores.
const SENSORS: [&str; 32] = [
    "gyroscope",
    "accelerometer",
    "compass",
    "barometer",
    "differential pressure",
    "GPS",
    "optical flow",
    "vision position",
    "rangefinder",
    "external ground truth",
    "rate control",
    "attitude stabilisation",
    "yaw control",
    "altitude control",
    "horizontal position control",
    "motor outputs",
    "",
    "second gyroscope",
    "second accelerometer",
    "second compass",
    "geofence",
    "AHRS",
    "terrain data",
    "reversed motors",
    "logging",
    "battery",
    "proximity sensor",
    "satellite link",
    "",
    "obstacle avoidance",
    "propulsion",
    "extended status",
];

/// Names of bits of `MAV_SYS_STATUS_SENSOR`.
pub fn sensors(bits: u32) -> impl Iterator<Item = &'static str> {
    (0..)
        .zip(SENSORS)
        .filter(move |(bit, name)| bits & (1 << bit) != 0 && !name.is_empty())
        .map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use hums_core::health::checks;

    use super::*;

    #[test]
    fn a_state_is_named_and_a_quantity_is_none() {
        assert_eq!(name("autopilot_state", 5.0), Some("critical"));
        assert_eq!(name("autopilot_state", 6.0), Some("emergency"));
        assert_eq!((name("autopilot_state", 99.0), name("autopilot_state", f32::NAN)), (None, None));
        assert_eq!(name("cell_voltage", 3.0), None);
    }

    #[test]
    fn no_number_of_a_state_is_shown_and_each_has_words() {
        for check in checks().filter(|check| check.unit.is_flag()) {
            let limits = [check.limits.warn, check.limits.critical]
                .into_iter()
                .flatten()
                .map(|limit| limit.spec().default);
            let highest = limits.fold(0.0, f32::max).ceil() as u8;
            for value in 0..=highest {
                let shown = shown(check.name, f32::from(value), 0.5);
                assert!(matches!(shown, ShownValue::State(Some(_))), "{} {value}: {shown:?}", check.name);
            }
            assert_eq!(shown(check.name, f32::NAN, 0.5), ShownValue::State(None));
        }
    }

    #[test]
    fn a_problem_has_the_value_of_its_onset_and_the_worst_if_that_reads_otherwise() {
        let words = |onset, worst, unit| Values::new(onset, worst, unit).to_string();
        for (onset, worst, unit, expected) in [
            (10.223, Some(22.014), "times", "10.22 \u{d7} usual, at worst 22.01 \u{d7} usual"),
            (3.4, Some(3.399), "V", "3.4 V"),
            (3.4, None, "V", "3.4 V"),
            (f32::NAN, Some(31.0), "deg", "at worst 31\u{b0}"),
            (f32::NAN, Some(f32::NAN), "deg", ""),
            (0.256, Some(3e38), "", "0.26, at worst 3e38, which no sensor can have"),
        ] {
            assert_eq!(words(onset, worst, unit), expected);
        }
        assert_eq!(
            (short(-2.6e9), short(999_999.0), short(10.0)),
            ("-3e9".into(), "999999".into(), "10".into())
        );
    }

    #[test]
    fn a_limit_that_means_any_is_not_shown() {
        assert_eq!(shown("card_errors", 3.0, 0.5), ShownValue::Quantity(Some(3.0), None));
        assert_eq!(shown("card_errors", 12.0, 10.0), ShownValue::Quantity(Some(12.0), Some(10.0)));
        assert_eq!(shown("ekf_test_ratio", 0.7, 0.5), ShownValue::Quantity(Some(0.7), Some(0.5)));
    }

    #[test]
    fn sensors_are_named_and_the_receiver_and_the_pre_arm_checks_are_none() {
        assert_eq!(sensors(0x1001_0024).collect::<Vec<_>>(), ["compass", "GPS"]);
    }
}
