//! The documents that the tables make: `docs/parameters.md`, the checks in `docs/health.md` and `docs/check.md`, and the
//! counters in `docs/usage.md` follow the code. `HUMS_WRITE_DOCS=1 cargo test -p hums-core-tests docs` writes them.
#![expect(clippy::panic, clippy::unwrap_used, reason = "that is how a test fails")]

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use hums_core::exposure;
use hums_core::health::{Check, Said, Side, VOCABULARY, When, checks};
use hums_core::params::{Param, Params, TABLE};
use hums_core::time::Millis;

/// The inputs of each check, and the source of its limits unless a parameter is.
const INPUTS: &str = "\
batt_remaining: BATTERY_STATUS; SYS_STATUS where no battery reports itself
cell_voltage: BATTERY_STATUS: the lowest cell, or the pack by its cells, without the sag of its load; SYS_STATUS likewise; armed and lithium
batt_state: BATTERY_STATUS: charge_state; 1 low or unhealthy, 2 critical, emergency or failed
cell_deviation: BATTERY_STATUS: highest less lowest cell
cell_dev_lasting: BATTERY_STATUS: the same for a minute
batt_resistance: BATTERY_STATUS: slope of voltage over current, above that earlier in the session
batt_fault: BATTERY_STATUS: fault bits set
batt_temperature: BATTERY_STATUS
rail_5v_low: POWER_STATUS
rail_5v_high: POWER_STATUS
battery_due: components of kind battery: percent of the limit that trips first
battery_alert: STATUSTEXT, EVENT; SYS_STATUS: battery; HIGH_LATENCY2
esc_silent: ESC_STATUS, ESC_INFO, ESC_TELEMETRY: silence beyond three of its own intervals, or five of more than 0.7 s, and as many other messages came as in three usual intervals, or another ESC reports
esc_temperature: ESC_INFO, ESC_TELEMETRY
esc_failure: ESC_INFO: failure flags; 1 any, 2 motor stuck or ESC failed
esc_errors: ESC_INFO: error count, a minute; wraps are no errors
motor_loss: ESC_STATUS, ESC_TELEMETRY: current in percent of the mean of the others that lift, on rotors, throttle above 20 %; not where half of them stand nearly still and nothing spins: the autopilot stops them to turn; nor a motor that turns at 50 to 90 % of the others' speed, whose command was cut
motor_imbalance: ESC_STATUS, ESC_TELEMETRY: speed against the middle one and the nearest other one, in steady flight
motor_output: SERVO_OUTPUT_RAW: one motor's pulse alone above what is usual in this flight, percent of what motors are given; 100 if it alone is at the end of its range; 4, 6 or 8 motors in level flight
motor_off: SERVO_OUTPUT_RAW: 2 if a motor is given next to nothing while the others carry; the same motors
thrust_lost: VFR_HUD: how long throttle was full without a climb; on wings, with a sink
roll_rate: ATTITUDE_TARGET against ATTITUDE: body rate that is wanted and missing, less a part of what is wanted
pitch_rate: the same messages
drive_due: components of kind motor, propeller, ESC
drive_alert: STATUSTEXT, EVENT; SYS_STATUS: motor outputs, propulsion; HIGH_LATENCY2
cylinder_head: EFI_STATUS
exhaust_gas: EFI_STATUS
fuel_pressure: EFI_STATUS
generator_speed: GENERATOR_STATUS: not while it is off or starts; once it has reached its limits since it was switched on, in this flight
engine_due: components of kind engine
vibration: VIBRATION of ArduPilot: the worst axis
vibration_px4: VIBRATION of PX4: the accelerometer metric
vibration_rise: VIBRATION: the worst axis, or PX4's accelerometer metric, over what is usual in this flight; on rotors away from the ground; told after 10 s
clipping: VIBRATION: clipped samples of a flight, since ten seconds without any
load_factor: SCALED_IMU, RAW_IMU, HIGHRES_IMU: specific force over gravity, while VIBRATION is below 60
airframe_due: components of kind airframe, other
vibration_alert: STATUSTEXT, EVENT
ekf_variance: EKF_STATUS_REPORT: the largest variance but the compass's
ekf_failsafe: EKF_STATUS_REPORT: the second largest of compass, velocity, position; not of planes
ekf_compass: EKF_STATUS_REPORT: the compass's variance
ekf_test_ratio: ESTIMATOR_STATUS: the largest test ratio but the compass's
ekf_mag_ratio: ESTIMATOR_STATUS: the compass's test ratio
compass_heading: RAW_IMU, SCALED_IMU, HIGHRES_IMU: heading of the first compass's field, against ATTITUDE's, beyond its usual range in this flight; while it turns little
compass_unused: ESTIMATOR_STATUS: no test ratio of a compass that had 20 of them in this flight
accel_mismatch: RAW_IMU, SCALED_IMU, SCALED_IMU2, SCALED_IMU3 of one moment: difference of the forces beyond its usual range in this flight; on rotors, away from the ground, turning little
imu_gps: RAW_IMU, SCALED_IMU, HIGHRES_IMU: force of the first sensor, turned by ATTITUDE, less the change of GPS_RAW_INT's velocity and of the climb, beyond its own steps and what a late receiver makes of it; of planes without the climb; not of VTOLs, not in fast turns
gyro_mismatch: the same messages: difference of the rates, likewise; on wings too, and in fast turns where they come within 5 ms; not of VTOLs
gyro_noise: VIBRATION of PX4: the gyro metric
compass_mismatch: the same messages: difference of the fields, percent of their length, likewise; not of VTOLs, not in fast turns, not where HIGHRES_IMU comes
baro_mismatch: SCALED_PRESSURE, SCALED_PRESSURE2, SCALED_PRESSURE3, HIGHRES_IMU: difference of the pressures as height, likewise
baro_height: SCALED_PRESSURE, HIGHRES_IMU: height of the first barometer against GPS_RAW_INT's, beyond its usual range in this flight
baro_noise: the same messages: steps of that height from sample to sample less the climb of GLOBAL_POSITION_INT, LOCAL_POSITION_NED or VFR_HUD, likewise
ekf_climb: the same messages: climb by that height against VFR_HUD's, over a second, less the change of the dynamic pressure of the speed; on rotors
ahrs2_tilt: AHRS2 against ATTITUDE: angle between the two verticals; with an exact receiver
ahrs2_height: AHRS2 against GLOBAL_POSITION_INT: difference of the altitudes, beyond what is usual in this flight; with an exact receiver
ahrs2_position: AHRS2 against GLOBAL_POSITION_INT: distance, less half a second of flight; with an exact receiver, where EKF_STATUS_REPORT calls the position absolute
accel_stuck: RAW_IMU, SCALED_IMU, SCALED_IMU2, SCALED_IMU3, HIGHRES_IMU: how long forces were the same
gyro_stuck: the same messages: rates
compass_stuck: the same messages: fields
baro_stuck: SCALED_PRESSURE, SCALED_PRESSURE2, SCALED_PRESSURE3, HIGHRES_IMU: how long the pressure was the same, while it climbed or sank; or for 10 s where it trembled before
gps_stuck: GPS_RAW_INT, GPS2_RAW: how long position, height and speed were the same
gps_speed: GPS_RAW_INT, GPS2_RAW: speed and course less the way between positions, over four seconds
gps_height: GPS_RAW_INT: what its height moved in four seconds less the climb of GLOBAL_POSITION_INT, LOCAL_POSITION_NED or VFR_HUD, where the barometer (SCALED_PRESSURE, HIGHRES_IMU) did less than half of it
gps_satellites: GPS_RAW_INT, GPS2_RAW, where the receiver does not tell an accuracy within half of GPS_HACC_WARN
gps_sats_fall: GPS_RAW_INT, GPS2_RAW: satellites fewer than usual in this flight, in percent of these; with a 3D fix
gps_hdop: the same messages, likewise
gps_hdop_rise: GPS_RAW_INT, GPS2_RAW: dilution as a multiple of the usual one of this flight, which is 1 at least
gps_accuracy: GPS_RAW_INT, GPS2_RAW: horizontal accuracy
gps_fix: GPS_RAW_INT, GPS2_RAW: fix type, of a receiver that had one
gps_jamming: GNSS_INTEGRITY
gps_spoofing: GNSS_INTEGRITY
gyro_alert: STATUSTEXT, EVENT; SYS_STATUS; HIGH_LATENCY2
accel_alert: STATUSTEXT, EVENT; SYS_STATUS; ESTIMATOR_STATUS; HIGH_LATENCY2
compass_alert: STATUSTEXT, EVENT; SYS_STATUS; HIGH_LATENCY2
baro_alert: STATUSTEXT, EVENT; SYS_STATUS; HIGH_LATENCY2
airspeed_alert: STATUSTEXT, EVENT; SYS_STATUS; HIGH_LATENCY2
gnss_alert: STATUSTEXT, EVENT; SYS_STATUS; EKF_STATUS_REPORT, ESTIMATOR_STATUS: glitch; HIGH_LATENCY2; from the first fix on
ranging_alert: STATUSTEXT, EVENT; SYS_STATUS: optical flow, vision, laser, proximity
terrain_alert: STATUSTEXT, EVENT; HIGH_LATENCY2
ekf_alert: STATUSTEXT, EVENT; SYS_STATUS: control of attitude and position, AHRS; EKF_STATUS_REPORT, ESTIMATOR_STATUS: attitude or position lost; HIGH_LATENCY2
heartbeat: HEARTBEAT of the autopilot: its age
frames_lost: sequence numbers on the autopilot's port, ten seconds
position_silent: GLOBAL_POSITION_INT, LOCAL_POSITION_NED: how long before the latest ATTITUDE or HEARTBEAT the last one came
rc_rssi: RC_CHANNELS; device scale
radio_rssi: RADIO_STATUS; device scale
radio_margin: RADIO_STATUS: signal above noise, the worse end; not of a radio that hears no other one
rc_alert: STATUSTEXT, EVENT; SYS_STATUS: a receiver that was healthy; HIGH_LATENCY2
gcs_alert: STATUSTEXT, EVENT; HIGH_LATENCY2
load: SYS_STATUS
mcu_temperature: MCU_STATUS
autopilot_reboot: ATTITUDE, SYSTEM_TIME: a boot time that falls while it is armed, for 30 s; not after 10 s of silence
autopilot_state: HEARTBEAT: MAV_STATE, if it is worse than at the arming
processor_alert: STATUSTEXT, EVENT
logging_alert: STATUSTEXT, EVENT; SYS_STATUS
fence_alert: STATUSTEXT, EVENT; SYS_STATUS; HIGH_LATENCY2
failsafe_alert: STATUSTEXT, EVENT
autopilot_alert: STATUSTEXT of severity 0 to 3, EVENT of level 0 to 2, whose meaning is not known
roll: ATTITUDE, against ATTITUDE_TARGET or NAV_CONTROLLER_OUTPUT
pitch: ATTITUDE, against ATTITUDE_TARGET or NAV_CONTROLLER_OUTPUT
attitude_alert: STATUSTEXT, EVENT
recording: our recorder: 1 not recording, 2 not recording while armed
record_queue: our recorder: the sector queue
record_lost: our recorder: frames lost, ten seconds
card_stall: our recorder: how long the card has kept it waiting
card_errors: our recorder: block writes that the card refused, ten seconds
card_room: our recorder: the share of the card that logs can have
card_due: components of kind card
free_fall: RAW_IMU, SCALED_IMU, HIGHRES_IMU: specific force below 0.3 g, with the throttle of VFR_HUD; on rotors
impact: the same: a shock, with the speed of GLOBAL_POSITION_INT breaking off or the vehicle on its side, then stillness
tumbling: ATTITUDE, or the inertial messages: body rates for 0.5 s, on wings for 1.5 s
disarmed_in_air: HEARTBEAT: disarmed or terminated out of a flight, and then it falls, sinks or glides
sinking: GLOBAL_POSITION_INT, LOCAL_POSITION_NED, VFR_HUD: for 0.5 s where the autopilot flies and does not want it (POSITION_TARGET_LOCAL_NED); or a loss of 7 m with full throttle
overturned: ATTITUDE: the top down by more than 100 degrees; the inertial messages: it lies over, with throttle of late, slower than 12 m/s; for 0.7 s, on rotors
crash_alert: STATUSTEXT, EVENT
";

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../docs").join(name)
}

#[track_caller]
fn assert_is(name: &str, wanted: &str) {
    if std::env::var_os("HUMS_WRITE_DOCS").is_some() {
        fs::write(path(name), wanted).unwrap();
    }
    let found = fs::read_to_string(path(name)).unwrap_or_default();
    assert!(found == wanted, "docs/{name} is not what the code says: write it anew (see this test's file)");
}

fn number(value: f32) -> String {
    if value.is_nan() { "off".to_owned() } else { format!("{value}") }
}

#[test]
fn the_parameters_are_documented_as_they_are() {
    let mut text = "# Parameters\n\n\
        Made from the table in `firmware/core/src/params.rs` by `firmware/core/tests/docs.rs`. Set by `hums sim --params FILE`, by a\n\
        ground station over MAVLink, and kept over power-off. A change is recorded with who made it and applies at once. Ground stations get\n\
        these words from the box, or from a file: [companion.md](companion.md#settings-in-words).\n\n\
        | name | unit | default | range | what it is | more, and where the default comes from |\n|---|---|---|---|---|---|\n"
        .to_owned();
    for param in Param::ALL {
        let (spec, words) = (param.spec(), param.words());
        let (unit, default, what) = (words.unit, number(spec.default), hums_core_tests::short(param));
        let options = words.options.iter().enumerate().map(|(number, option)| format!("{number} {option}"));
        let options = options.collect::<Vec<_>>().join(", ");
        let options = if options.is_empty() { options } else { format!(": {options}") };
        let _ = writeln!(
            text,
            "| {} | {unit} | {default} | {} to {} | {what}{options} | {} |",
            spec.name, spec.min, spec.max, words.source
        );
    }
    assert_is("parameters.md", &text);
}

/// The file of parameter descriptions that Mission Planner reads, in its own terms. It takes any component that is
/// not an autopilot for an `ArduCopter2`.
#[test]
fn mission_planner_gets_the_words_of_every_parameter() {
    let mut text = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n\
        <!-- Made by firmware/core/tests/docs.rs. Where it goes: docs/companion.md. -->\n<Params>\n  <ArduCopter2>\n"
        .to_owned();
    for param in Param::ALL {
        let (spec, words) = (param.spec(), param.words());
        let _ = writeln!(text, "    <{}>", spec.name);
        let mut say = |element: &str, value: &dyn std::fmt::Display| {
            let value = value.to_string().replace('&', "&amp;").replace('<', "&lt;");
            if !value.is_empty() {
                let _ = writeln!(text, "      <{element}>{value}</{element}>");
            }
        };
        say("DisplayName", &hums_core_tests::short(param));
        let meaning =
            hums_core_tests::meaning(param).map_or_else(String::new, |meaning| format!("{meaning} "));
        let (more, default) = (hums_core_tests::long(param), number(spec.default));
        say("Description", &format!("{meaning}{more} Default: {default}."));
        say("Units", &words.unit);
        say("Range", &format!("{} {}", spec.min, spec.max));
        let options = words.options.iter().enumerate().map(|(number, option)| format!("{number}:{option}"));
        say("Values", &options.collect::<Vec<_>>().join(","));
        say("RebootRequired", &"False");
        let _ = writeln!(text, "    </{}>", spec.name);
    }
    text += "  </ArduCopter2>\n</Params>\n";
    assert_is("stations/ParameterMetaData.xml", &text);
}

fn inputs() -> impl Iterator<Item = (&'static str, &'static str)> {
    INPUTS.lines().filter_map(|line| line.split_once(": "))
}

fn assert_holds(document: &str, name: &str, table: &str) {
    let begin = format!("<!-- {name}: made by firmware/core/tests/docs.rs -->\n");
    let end = format!("<!-- end of {name} -->\n");
    let found = fs::read_to_string(path(document)).unwrap();
    let (before, rest) = found.split_once(&begin).expect("a place for the table");
    let (_, after) = rest.split_once(&end).expect("and it ends");
    assert_is(document, &format!("{before}{begin}{table}{end}{after}"));
}

fn limit(param: Option<Param>) -> String {
    param.map_or_else(
        || "–".to_owned(),
        |param| {
            let spec = &TABLE[param as usize];
            format!("{} ({})", number(Params::defaults().get(param)), spec.name)
        },
    )
}

fn seconds(span: Millis) -> String {
    format!("{} s", span.as_secs_f32())
}

fn row(check: &Check) -> String {
    let input = inputs().find(|(name, _)| *name == check.name);
    let (_, input) = input.unwrap_or_else(|| panic!("{}: say in INPUTS what it reads", check.name));
    let side = if check.limits.side == Side::Above { ">" } else { "<" };
    let when = match check.when {
        When::Always => "always",
        When::Armed => "armed",
        When::InFlight => "in flight",
    };
    let source = check.limits.critical.or(check.limits.warn).map_or("", |param| param.words().source);
    format!(
        "| {} | {} | {input} | {when} | {side} | {} | {} | {} | {}, {} | {} | {} | {source} |",
        check.subsystem.name(),
        check.name,
        check.unit.name(),
        limit(check.limits.warn),
        limit(check.limits.critical),
        seconds(check.debounce[0].span()),
        seconds(check.debounce[1].span()),
        check.limits.hysteresis,
        check.stale_after().map_or_else(|| "–".to_owned(), seconds),
    )
}

#[test]
fn every_check_is_documented_as_it_is() {
    let mut table = "| subsystem | check | reads | when | bad | unit | warning | critical | debounce | hysteresis | stale after | source |\n\
        |---|---|---|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for check in checks() {
        let _ = writeln!(table, "{}", row(check));
    }
    assert_holds("health.md", "checks", &table);
    for (name, _) in inputs() {
        assert!(checks().any(|check| check.name == name), "there is no check {name}");
    }
}

#[test]
fn every_check_is_explained_as_people_are_told() {
    let mut table = "| check | name | means | do | needs |\n|---|---|---|---|---|\n".to_owned();
    for words in VOCABULARY {
        let Said { check, name, part, .. } = words.said;
        let part = if part.is_empty() { String::new() } else { format!(", by {part}") };
        let _ = writeln!(
            table,
            "| {check} | {name}{part} | {} | {} | {} |",
            words.meaning, words.action, words.needs
        );
    }
    assert_holds("check.md", "words", &table);
}

#[test]
fn every_text_of_a_check_is_in_the_runbook() {
    let mut table = "| HUMS: | if critical | what is so | what to do |\n|---|---|---|---|\n".to_owned();
    let mut told = Vec::new();
    for (words, check) in VOCABULARY.iter().zip(checks()) {
        let Said { alarm, advice, .. } = words.said;
        // The same fault on another autopilot's scale, or after another time, has the same text.
        if told.contains(&alarm) {
            continue;
        }
        told.push(alarm);
        let unit = match check.unit.name() {
            "" => String::new(),
            "degC" => " C".to_owned(),
            "1/min" => " per min".to_owned(),
            "times" => " x".to_owned(),
            unit => format!(" {unit}"),
        };
        let value = words.said.around_value(check.unit.name());
        let value =
            value.map_or_else(String::new, |(before, after)| format!(": {before}*value*{unit}{after}"));
        let alarm = alarm.split('|').next().unwrap().replace('#', "*n*");
        let _ = writeln!(table, "| {alarm}{value} | {advice} | {} | {} |", words.meaning, words.action);
    }
    assert_holds("runbook.md", "texts", &table);
}

#[test]
fn every_counter_is_documented() {
    let mut table = "| counter | over sessions | definition |\n|---|---|---|\n".to_owned();
    let mut words = Vec::new();
    for line in include_str!("../src/usage/counters.rs").split_once("counters! {").unwrap().1.lines() {
        if let Some(text) = line.trim().strip_prefix("/// ") {
            words.push(text);
        } else if let Some((form, name)) = line.split_once(" \"") {
            let over = if form.ends_with("Highest") {
                "greatest"
            } else if form.ends_with("Lowest") {
                "least"
            } else {
                "sum"
            };
            let _ = writeln!(
                table,
                "| `{}` | {over} | {} |",
                name.trim_end_matches("\";"),
                words.join(" ").trim_end_matches('.')
            );
            words.clear();
        } else if line == "}" {
            break;
        }
    }
    assert_holds("usage.md", "counters", &table);
    let text = fs::read_to_string(path("usage.md")).unwrap();
    for quantity in exposure::ExposureQuantity::ALL {
        assert!(text.contains(&format!("`{}_", quantity.name())), "docs/usage.md does not know {quantity:?}");
    }
}
