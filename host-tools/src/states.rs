//! Values of checks that are states and not quantities, in MAVLink's words.

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
        _ => return None,
    };
    // What no state has is no number of one.
    let place = (value >= 0.0 && value.fract() == 0.0).then_some(value as usize)?;
    names.get(place).copied()
}

/// Names of the bits of `MAV_SYS_STATUS_SENSOR`, from bit 0; empty where it is no sensor (the check `sensors` leaves those
/// two out).
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

/// The names of these bits of `MAV_SYS_STATUS_SENSOR`.
pub fn sensors(bits: u32) -> impl Iterator<Item = &'static str> {
    (0..)
        .zip(SENSORS)
        .filter(move |(bit, name)| bits & (1 << bit) != 0 && !name.is_empty())
        .map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_named_and_a_quantity_is_none() {
        assert_eq!(name("autopilot_state", 5.0), Some("critical"));
        assert_eq!(name("autopilot_state", 6.0), Some("emergency"));
        assert_eq!((name("autopilot_state", 99.0), name("autopilot_state", f32::NAN)), (None, None));
        assert_eq!(name("cell_voltage", 3.0), None);
    }

    #[test]
    fn sensors_are_named_and_the_receiver_and_the_pre_arm_checks_are_none() {
        assert_eq!(sensors(0x1001_0024).collect::<Vec<_>>(), ["compass", "GPS"]);
    }
}
