//! One cause, one finding: which check's alarm explains that of which other one.
//!
//! A dead motor tips the vehicle over, a receiver without a fix makes the estimator doubt, and what is silent has no data at all. Who
//! hears of all of it at once does not hear the cause. So a finding names the check that explains it, where that has an alarm which is
//! as bad or worse and begins within 12 s of it; it is recorded like any other, and not told to the ground. Where that alarm ended, or fell
//! below it, 8 s ago it is told by itself. A rise of level is an onset too.
//!
//! A mishap explains only what begins with it or after it ([`is_with_mishap`]): what came before may be its cause, and stands by itself.

use super::finding::{Level, Subsystem};
use super::tables::check_named;
use crate::time::{Instant, Span};

/// A cause and its effect begin within this: the longest debounce of an effect is 10 s, and figures are smoothed. An alarm that has
/// stood for longer explains nothing new.
const NEAR: Span = Span::from_secs(12);
/// What begins so shortly before a mishap begins with it: both are seen at a step, and by samples.
const WITH_MISHAP: Span = Span::from_millis(200);

const GNSS: &[&str] = &[
    "gps_fix",
    "gps_jamming",
    "gps_spoofing",
    "gps_stuck",
    "gps_speed",
    "gps_height",
    "gnss_alert",
    "gps_accuracy",
    "gps_satellites",
    "gps_hdop",
    "gps_sats_fall",
    "gps_hdop_rise",
];
const SENSORS: &[&str] = &[
    "accel_stuck",
    "gyro_stuck",
    "compass_stuck",
    "baro_stuck",
    "accel_alert",
    "gyro_alert",
    "compass_alert",
    "baro_alert",
    "airspeed_alert",
    "accel_mismatch",
    "gyro_mismatch",
    "gyro_noise",
    "imu_gps",
    "compass_mismatch",
    "baro_mismatch",
    "baro_noise",
    "baro_height",
    "compass_unused",
    "compass_heading",
    "ekf_compass",
    "ekf_mag_ratio",
];
const SHAKING: &[&str] = &["vibration", "vibration_px4", "vibration_rise", "clipping", "vibration_alert"];
const DRIVE: &[&str] =
    &["motor_loss", "motor_output", "motor_off", "motor_imbalance", "esc_failure", "drive_alert"];
/// Checks that see a wire and not what it leads to: they explain no attitude, no mishap and no act of the autopilot.
const TELEMETRY: &[&str] = &["esc_silent"];
const BATTERY: &[&str] =
    &["cell_voltage", "batt_remaining", "batt_fault", "batt_state", "battery_alert", "cell_deviation"];
const LINKS: &[&str] = &["rc_alert", "gcs_alert", "heartbeat"];
const ESTIMATOR: &[&str] = &["ekf_variance", "ekf_failsafe", "ekf_test_ratio", "ekf_climb", "ekf_alert"];
const SECOND: &[&str] = &["ahrs2_tilt", "ahrs2_height", "ahrs2_position"];
/// What the autopilot does because of anything. A text that no table knows (`autopilot_alert`) may be of anything else, as of a kill switch.
const ACTS: &[&str] = &["failsafe_alert", "autopilot_state"];

/// What explains, and what it explains: the nearest to the cause first, in each row too.
const ROWS: &[(&[&str], &[&str])] = &[
    // An ESC's silence is counted while others are heard: a heartbeat that is late explains none.
    (&["heartbeat"], &["frames_lost", "gcs_alert"]),
    (&["autopilot_reboot"], &["esc_silent", "ekf_alert"]),
    (TELEMETRY, &["thrust_lost", "vibration_rise"]),
    (DRIVE, &["roll_rate", "pitch_rate", "roll", "pitch", "attitude_alert", "thrust_lost", "vibration_rise"]),
    (&["motor_loss"], &["motor_output", "motor_off", "motor_imbalance", "drive_alert"]),
    (&["motor_output", "motor_off", "motor_imbalance"], &["drive_alert"]),
    // Control follows the attitude, and that the gyros. One that is noisy turns nothing over.
    (
        &["gyro_stuck", "gyro_alert", "gyro_mismatch", "imu_gps"],
        &["roll_rate", "pitch_rate", "roll", "pitch", "attitude_alert"],
    ),
    (&["roll_rate"], &["roll"]),
    (&["pitch_rate"], &["pitch"]),
    (&["roll_rate", "pitch_rate"], &["attitude_alert", "thrust_lost"]),
    (
        &["gps_fix", "gps_jamming", "gps_spoofing"],
        &["gnss_alert", "gps_accuracy", "gps_satellites", "gps_hdop", "gps_sats_fall", "gps_hdop_rise"],
    ),
    (&["gps_satellites", "gps_hdop", "gps_accuracy"], &["gps_sats_fall", "gps_hdop_rise"]),
    (&["gps_sats_fall"], &["gps_hdop_rise"]),
    (&["gps_stuck"], &["gps_speed", "gps_height", "gnss_alert"]),
    // The autopilot's word goes by its innovations, which sensors make as well: it explains no measurement.
    (&["gps_speed", "gps_height"], &["gnss_alert"]),
    (GNSS, ESTIMATOR),
    (GNSS, &["baro_height", "position_silent"]),
    (&["heartbeat", "frames_lost"], &["position_silent"]),
    (&["accel_stuck", "accel_alert"], &["accel_mismatch"]),
    (&["gps_fix", "gps_jamming", "gps_spoofing", "gps_stuck", "gps_speed", "gps_height"], &["imu_gps"]),
    (
        &["accel_stuck", "gyro_stuck", "accel_alert", "gyro_alert", "accel_mismatch", "gyro_mismatch"],
        &["imu_gps", "gnss_alert", "vibration_alert"],
    ),
    // ArduPilot's word on vibration goes by the same innovations.
    (&["vibration", "vibration_px4", "clipping"], &["imu_gps", "gnss_alert"]),
    (&["imu_gps"], &["gnss_alert", "baro_noise", "vibration_alert"]),
    (&["compass_stuck", "compass_alert"], &["compass_mismatch"]),
    (&["gyro_stuck", "gyro_alert"], &["gyro_mismatch"]),
    (
        &["gyro_stuck", "gyro_alert", "gyro_mismatch", "gyro_noise", "imu_gps"],
        &["compass_alert", "compass_unused", "compass_heading", "ekf_compass", "ekf_mag_ratio"],
    ),
    (
        &["compass_stuck", "compass_alert", "compass_mismatch"],
        &["ekf_compass", "ekf_mag_ratio", "compass_unused", "compass_heading"],
    ),
    (&["compass_unused", "compass_heading"], &["ekf_compass", "ekf_mag_ratio"]),
    (&["baro_stuck", "baro_alert"], &["baro_height", "baro_noise", "baro_mismatch"]),
    (SENSORS, ESTIMATOR),
    (SHAKING, ESTIMATOR),
    (GNSS, SECOND),
    (SENSORS, SECOND),
    (SHAKING, SECOND),
    (ESTIMATOR, SECOND),
    // ArduPilot's word on vibration is what `imu_gps` explains, and a mismatch that.
    (&["vibration", "vibration_px4", "vibration_rise", "clipping"], &["accel_mismatch", "gyro_mismatch"]),
    (SHAKING, &["load_factor"]),
    // Height control follows the estimator.
    (&["ekf_climb"], &["ekf_variance", "ekf_failsafe", "ekf_test_ratio", "ekf_alert", "thrust_lost"]),
    (&["vibration", "vibration_px4"], &["vibration_rise", "clipping", "vibration_alert"]),
    (&["cell_voltage", "batt_remaining"], &["batt_state", "battery_alert"]),
    (&["batt_state"], &["battery_alert"]),
    (BATTERY, ACTS),
    (LINKS, ACTS),
    (GNSS, ACTS),
    (SENSORS, ACTS),
    (DRIVE, ACTS),
    (ESTIMATOR, ACTS),
    (&["failsafe_alert"], &["autopilot_state"]),
    (&["motor_trend"], &["throttle_trend", "power_trend"]),
    (&["throttle_trend"], &["power_trend"]),
    // What a card that is out of its slot, or dead, looks like before and while nothing is recorded.
    (&["recording"], &["card_errors", "card_stall", "record_queue", "record_lost"]),
];

/// Whether a check is of what drives the vehicle: its alarm tells better what to do than that the vehicle sinks.
pub(super) fn is_of_drive(check: &str) -> bool {
    DRIVE.contains(&check) || TELEMETRY.contains(&check)
}

/// Whether a mishap explains what a part says.
pub const fn is_of_mishap(part: Subsystem) -> bool {
    matches!(
        part,
        Subsystem::Propulsion
            | Subsystem::Structure
            | Subsystem::Navigation
            | Subsystem::Computer
            | Subsystem::Attitude
    )
}

/// Whether what is wrong since a time begins with a mishap or after it, and not before.
pub fn is_with_mishap(since: Instant, mishap_since: Instant) -> bool {
    mishap_since.since(since) <= WITH_MISHAP
}

/// Whether an alarm of one check explains one of another, by their rows alone.
pub fn explains(cause: &str, effect: &str) -> bool {
    ROWS.iter().any(|(causes, effects)| effects.contains(&effect) && causes.contains(&cause))
}

/// An alarm of a check.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alarm<'a> {
    /// Its onset: when it began, or rose to its level.
    pub since: Instant,
    /// The check.
    pub check: &'a str,
    /// Which one, where there are several.
    pub instance: u8,
    /// Its level.
    pub level: Level,
}

impl Alarm<'_> {
    /// Whether both began within [`NEAR`] of each other.
    fn is_near(&self, other: &Alarm<'_>) -> bool {
        self.since.since(other.since) <= NEAR && other.since.since(self.since) <= NEAR
    }

    /// Whether both may be of the same motor, battery or receiver.
    fn may_concern(&self, other: &Alarm<'_>) -> bool {
        let thing = |alarm: &Alarm<'_>| check_named(alarm.check).and_then(|check| check.of.thing());
        thing(self).is_none() || thing(self) != thing(other) || self.instance == other.instance
    }
}

/// Which of the alarms explains another one: by its row, as bad or worse, of the same motor where both are of motors, and begun within
/// `NEAR` of it. A mishap, which is a state of the whole vehicle, explains whatever begins while it goes on. An alarm that
/// another cause of `effect` explains is no cause beside that one.
pub fn because<'a>(effect: &Alarm<'_>, alarms: impl Iterator<Item = Alarm<'a>> + Clone) -> Option<Alarm<'a>> {
    let at_least = match effect.level {
        // A silent link has no data, however long it is silent.
        Level::Stale => {
            return alarms
                .filter(|cause| effect.since.since(cause.since) > Span::ZERO || cause.is_near(effect))
                .find(|cause| cause.check == "heartbeat");
        }
        Level::Warning | Level::Critical => effect.level as u8,
        Level::Ok | Level::Advisory => return None,
    };
    let by_mishap = check_named(effect.check).is_some_and(|check| is_of_mishap(check.subsystem));
    let is_mishap =
        |cause: &str| check_named(cause).is_some_and(|check| check.subsystem == Subsystem::Mishap);
    // A mishap before all, then by row.
    let place = |cause: &Alarm<'_>| {
        if by_mishap && is_mishap(cause.check) {
            return is_with_mishap(effect.since, cause.since).then_some((0, 0));
        }
        if !cause.is_near(effect) || !cause.may_concern(effect) {
            return None;
        }
        let of_effect = (1..).zip(ROWS).filter(|(_, (_, effects))| effects.contains(&effect.check));
        let mut places = of_effect.filter_map(|(row, (causes, _))| {
            Some((row, causes.iter().position(|known| *known == cause.check)?))
        });
        places.next()
    };
    let causes = alarms
        .filter(|cause| cause.level as u8 >= at_least)
        .filter_map(|cause| Some((place(&cause)?, cause)));
    let (_, mut cause) = causes.clone().min_by_key(|(place, _)| *place)?;
    // Nothing explains itself by way of others, so this ends.
    while let Some((_, deeper)) =
        causes.clone().find(|(_, deeper)| deeper.is_near(&cause) && explains(deeper.check, cause.check))
    {
        cause = deeper;
    }
    Some(cause)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALARMS: [(&str, Level); 3] =
        [("gps_fix", Level::Critical), ("vibration", Level::Warning), ("heartbeat", Level::Warning)];

    fn why(effect: &'static str, level: Level) -> Option<&'static str> {
        why_of(effect, level, &ALARMS)
    }

    /// Of what is wrong since the beginning, as its alarms are.
    fn why_of(effect: &str, level: Level, alarms: &[(&'static str, Level)]) -> Option<&'static str> {
        let alarm = |check, level| Alarm { since: Instant::ZERO, check, instance: 0, level };
        let alarms = alarms.iter().map(|(cause, level)| alarm(*cause, *level));
        Some(because(&Alarm { since: Instant::ZERO, check: effect, instance: 0, level }, alarms)?.check)
    }

    #[test]
    fn each_name_is_a_check_and_nothing_explains_itself() {
        for (causes, effects) in ROWS {
            for name in causes.iter().chain(*effects) {
                assert!(check_named(name).is_some(), "there is no check {name}");
            }
            assert!(causes.iter().all(|cause| !effects.contains(cause)), "{causes:?}");
        }
    }

    #[test]
    fn nothing_explains_itself_by_way_of_others() {
        let mut left: Vec<&str> =
            ROWS.iter().flat_map(|(causes, effects)| causes.iter().chain(*effects)).copied().collect();
        // What nothing that is left explains goes: of a circle all stay.
        loop {
            let explained = |name: &&str| left.iter().any(|cause| explains(cause, name));
            let still: Vec<&str> = left.iter().copied().filter(explained).collect();
            if still.len() == left.len() {
                break;
            }
            left = still;
        }
        assert!(left.is_empty(), "each of these is explained by another one: {left:?}");
    }

    #[test]
    fn what_is_explained_itself_is_named_as_no_cause_beside_its_own() {
        let why = |effect, alarms: &[&'static str]| {
            let alarms: Vec<_> = alarms.iter().map(|check| (*check, Level::Warning)).collect();
            why_of(effect, Level::Warning, &alarms)
        };
        assert_eq!(why("ekf_alert", &["gnss_alert", "imu_gps"]), Some("imu_gps"));
        assert_eq!(why("ekf_alert", &["gnss_alert", "imu_gps", "gps_stuck"]), Some("gps_stuck"));
        assert_eq!(why("ekf_alert", &["compass_alert", "gyro_mismatch"]), Some("gyro_mismatch"));
        assert_eq!(why("gnss_alert", &["gps_speed"]), Some("gps_speed"));
        assert_eq!(why("gps_speed", &["gnss_alert"]), None, "who measures is not explained by who says so");
    }

    #[test]
    fn a_cause_that_was_seen_long_after_another_one_does_not_explain_it() {
        let at = |s: u64| Instant::from_millis(60_000 + 1_000 * s);
        let why = |gyro_s: u64| {
            let alarm = |at_s, check| Alarm { since: at(at_s), check, instance: 0, level: Level::Warning };
            let alarms = [alarm(0, "compass_alert"), alarm(gyro_s, "gyro_mismatch")];
            Some(because(&alarm(8, "ekf_alert"), alarms.into_iter())?.check)
        };
        assert_eq!(
            [why(5), why(13), why(20)],
            [Some("gyro_mismatch"), Some("compass_alert"), Some("compass_alert")]
        );
    }

    /// Whatever stands explains only what begins with it: every row, in both orders of time.
    #[test]
    fn a_standing_alarm_explains_only_what_begins_near_its_onset() {
        let at = |s: u64| Instant::from_millis(100_000 + 1_000 * s);
        for (causes, effects) in ROWS {
            for (check, effect) in
                causes.iter().flat_map(|cause| effects.iter().map(move |effect| (*cause, *effect)))
            {
                let cause = Alarm { since: at(40), check, instance: 0, level: Level::Critical };
                for (at_s, is_explained) in
                    [(0, false), (27, false), (28, true), (40, true), (52, true), (53, false), (90, false)]
                {
                    let effect = Alarm { since: at(at_s), check: effect, instance: 0, level: Level::Warning };
                    let is = because(&effect, core::iter::once(cause)).is_some();
                    assert_eq!(is, is_explained, "{check} at 40 s explains {effect:?}");
                }
            }
        }
    }

    #[test]
    fn a_wire_explains_no_attitude_no_mishap_and_no_act_of_the_autopilot() {
        for cause in TELEMETRY {
            for check in super::super::checks() {
                let never = matches!(check.subsystem, Subsystem::Attitude | Subsystem::Mishap);
                assert!(
                    !(explains(cause, check.name) && (never || ACTS.contains(&check.name))),
                    "{}",
                    check.name
                );
            }
        }
    }

    #[test]
    fn a_motor_explains_no_other_one() {
        let alarm = |check, instance| Alarm { since: Instant::ZERO, check, instance, level: Level::Critical };
        let why = |cause: u8, effect: u8| {
            because(&alarm("motor_output", effect), core::iter::once(alarm("motor_loss", cause))).is_some()
        };
        assert_eq!([why(2, 2), why(2, 3), why(0, 1)], [true, false, false]);
        assert!(because(&alarm("roll", 0), core::iter::once(alarm("motor_loss", 3))).is_some());
    }

    #[test]
    fn a_gyro_turns_a_vehicle_over_and_a_motor_comes_before_it() {
        for effect in ["roll", "pitch", "roll_rate", "pitch_rate", "attitude_alert", "compass_alert"] {
            for gyro in ["gyro_stuck", "gyro_alert", "gyro_mismatch", "imu_gps"] {
                assert_eq!(why_of(effect, Level::Warning, &[(gyro, Level::Warning)]), Some(gyro), "{effect}");
            }
        }
        let both = [("gyro_mismatch", Level::Warning), ("motor_loss", Level::Critical)];
        assert_eq!(why_of("roll", Level::Warning, &both), Some("motor_loss"));
        let turned = [("roll_rate", Level::Warning), ("gyro_stuck", Level::Warning)];
        assert_eq!(why_of("roll", Level::Warning, &turned), Some("gyro_stuck"));
    }

    #[test]
    fn the_cause_is_named_where_it_is_as_bad() {
        assert_eq!(why("ekf_failsafe", Level::Critical), Some("gps_fix"));
        assert_eq!(why("accel_mismatch", Level::Warning), Some("vibration"));
        assert_eq!(why("accel_mismatch", Level::Critical), None, "worse than what would explain it");
        assert_eq!(why("cell_voltage", Level::Critical), None);
        assert_eq!(why("failsafe_alert", Level::Critical), Some("gps_fix"));
        assert_eq!(why("autopilot_alert", Level::Warning), None, "nobody knows what it says");
        assert_eq!(why("cell_voltage", Level::Stale), Some("heartbeat"));
        assert_eq!(why("ekf_failsafe", Level::Ok), None);
        for looks in ["card_errors", "card_stall", "record_queue", "record_lost"] {
            let out = [("recording", Level::Critical)];
            assert_eq!(why_of(looks, Level::Warning, &out), Some("recording"), "a card that is out");
        }
    }

    #[test]
    fn an_accelerometer_explains_what_the_autopilot_says_of_vibration_and_a_receiver_that_hangs_comes_before_it()
     {
        let imu = ("imu_gps", Level::Warning);
        assert_eq!(why_of("vibration_alert", Level::Warning, &[imu]), Some("imu_gps"));
        assert_eq!(why_of("imu_gps", Level::Warning, &[("vibration_alert", Level::Warning)]), None);
        assert_eq!(why_of("imu_gps", Level::Warning, &[("vibration", Level::Warning)]), Some("vibration"));
        let both = [imu, ("gps_stuck", Level::Warning)];
        assert_eq!(why_of("gnss_alert", Level::Warning, &both), Some("gps_stuck"));
    }

    #[test]
    fn what_moves_the_estimator_explains_that_the_autopilot_doubts_its_receiver() {
        for cause in ["accel_alert", "gyro_stuck", "vibration", "imu_gps"] {
            assert_eq!(why_of("gnss_alert", Level::Warning, &[(cause, Level::Warning)]), Some(cause));
        }
    }

    #[test]
    fn a_mishap_comes_before_all_but_the_battery_and_the_links() {
        let alarms = [("gps_fix", Level::Critical), ("overturned", Level::Critical)];
        assert_eq!(why_of("ekf_failsafe", Level::Critical, &alarms), Some("overturned"));
        assert_eq!(why_of("load_factor", Level::Warning, &alarms), Some("overturned"));
        assert_eq!(why_of("cell_voltage", Level::Warning, &alarms), None);
        assert_eq!(why_of("impact", Level::Critical, &alarms), None);
    }

    #[test]
    fn a_mishap_explains_nothing_that_was_so_before_it() {
        let at = |ms: u64| Instant::from_millis(60_000 + ms);
        let why = |effect, mishap_ms: u64| {
            let alarm = |at_ms, check| Alarm { since: at(at_ms), check, instance: 0, level: Level::Critical };
            let alarms = [alarm(mishap_ms, "sinking"), alarm(3_000, "gps_fix")];
            Some(because(&alarm(0, effect), alarms.into_iter())?.check)
        };
        assert_eq!(why("motor_loss", 0), Some("sinking"));
        assert_eq!(why("motor_loss", 200), Some("sinking"), "at the same time, by samples");
        assert_eq!(why("motor_loss", 400), None, "it lost a motor, and then it sank");
        assert_eq!(why("ekf_failsafe", 400), Some("gps_fix"), "seen late");
    }
}
