//! The checks that name the cause of each class of fault.
//!
//! A pilot or mechanic who reads the check's text knows which part to examine. A general check (a failsafe, "a sensor
//! is unhealthy", a large variance of the estimator) names no cause.

#[derive(Debug)]
pub(super) struct Class {
    /// As in `labels.json`.
    pub(super) name: &'static str,
    pub(super) about: &'static str,
    /// None if no check does yet.
    pub(super) checks: &'static [&'static str],
}

pub(super) const CLASSES: &[Class] = &[
    Class {
        name: "propulsion",
        about: "motors, propellers, ESCs, control surfaces",
        checks: &[
            "esc_silent",
            "esc_temperature",
            "esc_failure",
            "esc_errors",
            "motor_loss",
            "motor_imbalance",
            "motor_output",
            "motor_off",
            "thrust_lost",
            "roll_rate",
            "pitch_rate",
            "drive_alert",
            // Propellers and motors first.
            "vibration",
            "vibration_px4",
            "vibration_rise",
            "vibration_trend",
            "free_fall",
            "motor_trend",
            "throttle_trend",
            "power_trend",
            "weight_trend",
        ],
    },
    Class {
        name: "power",
        about: "batteries and supplies",
        checks: &[
            "batt_remaining",
            "cell_voltage",
            "cell_deviation",
            "cell_dev_lasting",
            "batt_resistance",
            "batt_capacity",
            "batt_fault",
            "batt_temperature",
            "batt_state",
            "rail_5v_low",
            "rail_5v_high",
            "battery_alert",
        ],
    },
    Class {
        name: "gnss",
        about: "satellite navigation",
        checks: &[
            "gps_satellites",
            "gps_hdop",
            "gps_sats_fall",
            "gps_hdop_rise",
            "gps_accuracy",
            "gps_fix",
            "gps_jamming",
            "gps_spoofing",
            "gps_stuck",
            "gps_speed",
            "gps_height",
            "gnss_alert",
        ],
    },
    Class {
        name: "compass",
        about: "compasses",
        checks: &[
            "compass_alert",
            "ekf_compass",
            "ekf_mag_ratio",
            "compass_unused",
            "compass_heading",
            "compass_mismatch",
            "compass_stuck",
        ],
    },
    Class {
        name: "barometer",
        about: "barometers",
        checks: &["baro_alert", "baro_mismatch", "baro_height", "baro_noise", "baro_stuck", "ekf_climb"],
    },
    Class {
        name: "inertial",
        about: "accelerometers, gyros, airspeed",
        checks: &[
            "accel_alert",
            "gyro_alert",
            "airspeed_alert",
            "accel_mismatch",
            "gyro_mismatch",
            "gyro_noise",
            "imu_gps",
            "accel_stuck",
            "gyro_stuck",
        ],
    },
    Class {
        name: "vibration",
        about: "vibration",
        checks: &["vibration", "vibration_px4", "vibration_rise", "clipping", "vibration_alert"],
    },
    Class {
        name: "attitude",
        about: "loss of attitude",
        checks: &["roll", "pitch", "roll_rate", "pitch_rate", "tumbling", "overturned", "attitude_alert"],
    },
    Class {
        name: "crash",
        about: "disarmed in the air, falls, impacts",
        checks: &[
            "free_fall",
            "impact",
            "tumbling",
            "disarmed_in_air",
            "sinking",
            "overturned",
            "crash_alert",
        ],
    },
    Class {
        name: "link",
        about: "links of the autopilot",
        checks: &["heartbeat", "frames_lost", "position_silent", "gcs_alert"],
    },
    Class { name: "rc", about: "remote control", checks: &["rc_rssi", "rc_alert"] },
    Class {
        name: "computer",
        about: "computers on board",
        checks: &["load", "mcu_temperature", "autopilot_reboot"],
    },
    Class { name: "weather", about: "wind and gusts, which are no fault", checks: &[] },
    Class { name: "nominal", about: "nothing wrong", checks: &[] },
];

pub(super) fn of(class: &str) -> Option<&'static Class> {
    CLASSES.iter().find(|one| one.name == class)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use hums::names::vocabulary;

    use super::*;

    #[test]
    fn classes_are_known_once_and_name_checks_that_there_are() {
        let names: BTreeSet<&str> = CLASSES.iter().map(|class| class.name).collect();
        assert_eq!(names.len(), CLASSES.len());
        for check in CLASSES.iter().flat_map(|class| class.checks) {
            assert!(vocabulary(check).is_some(), "there is no check {check}");
        }
    }
}
