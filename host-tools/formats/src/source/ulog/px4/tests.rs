//! Observations from topics of several versions.

use crate::source::ulog::tests::writer::{Read, Writer, read};

const SECOND: u64 = 1_000_000;

/// Name, fields, messages with seconds.
type Topic<'a> = (&'a str, &'a str, &'a [(u64, Vec<u8>)]);

fn log(topics: &[Topic<'_>]) -> Read {
    let mut writer = Writer::new(SECOND);
    for (name, fields, _) in topics {
        writer = writer.format(&format!("{name}:uint64_t timestamp;{fields}"));
    }
    for (id, (name, ..)) in topics.iter().enumerate() {
        writer = writer.subscribe(id as u16, 0, name);
    }
    let of = |(id, topic): (usize, &Topic<'_>)| {
        let messages = topic.2.iter().map(move |(second, data)| (*second, id as u16, data.clone()));
        messages.collect::<Vec<_>>()
    };
    let mut messages: Vec<(u64, u16, Vec<u8>)> = topics.iter().enumerate().flat_map(of).collect();
    messages.sort_by_key(|(second, ..)| *second);
    for (second, id, data) in messages {
        writer = writer.data(id, second * SECOND, &data);
    }
    read(&writer.bytes)
}

fn observations(read: &Read, kind: &str) -> Vec<String> {
    let of = |text: &&str| text.strip_prefix("1: ").is_some_and(|text| text.starts_with(kind));
    read.of("observation").into_iter().filter(of).map(str::to_owned).collect()
}

const STATUS: &str = "uint8_t arming_state;uint8_t nav_state;bool failsafe;uint8_t system_type;";

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

#[test]
fn a_position_is_the_same_in_the_names_and_scales_of_all_versions() {
    let old = [
        &474_000_000_i32.to_le_bytes()[..],
        &85_000_000_i32.to_le_bytes(),
        &488_000_i32.to_le_bytes(),
        &[3, 14],
    ]
    .concat();
    let new =
        [&47.4_f64.to_le_bytes()[..], &8.5_f64.to_le_bytes(), &488.0_f64.to_le_bytes(), &[3, 14]].concat();
    let end = "uint8_t fix_type;uint8_t satellites_used;";
    let of = |name, fields: &str, data| {
        let read = log(&[(name, &format!("{fields}{end}"), &[(2, data)])]);
        observations(&read, "Gnss(")
    };
    let old = of("vehicle_gps_position", "int32_t lat;int32_t lon;int32_t alt;", old);
    let new = of("sensor_gps", "double latitude_deg;double longitude_deg;double altitude_msl_m;", new);
    assert_eq!(old, new);
    assert!(
        old[0].contains("latitude_deg: 47.4, longitude_deg: 8.5") && old[0].contains("Metres(488.0)"),
        "{old:?}"
    );
    assert!(old[0].contains("satellites: Some(14)") && old[0].contains("fix: 3"), "{old:?}");
}

#[test]
fn the_state_is_what_the_heartbeat_would_say() {
    let armed_with = |topic: &str, field: &str, data: [u8; 4]| {
        let read = log(&[
            (topic, &format!("bool {field};"), &[(2, vec![1])]),
            ("vehicle_status", STATUS, &[(2, vec![1, 4, 0, 2]), (3, data.to_vec())]),
        ]);
        let last = observations(&read, "Heartbeat(").last().cloned().expect("a heartbeat");
        let state = last.split("state: ").nth(1).and_then(|rest| rest.split(',').next()).map(str::to_owned);
        (last.contains("armed: true"), state.expect("a state"))
    };
    assert_eq!(armed_with("nothing", "x", [1, 4, 0, 2]), (false, "3".to_owned()));
    assert_eq!(armed_with("nothing", "x", [2, 4, 0, 2]), (true, "4".to_owned()));
    assert_eq!(armed_with("nothing", "x", [2, 4, 1, 2]), (true, "5".to_owned()), "failsafe");
    assert_eq!(armed_with("nothing", "x", [2, 13, 0, 2]), (true, "8".to_owned()), "termination");
    assert_eq!(
        armed_with("actuator_armed", "manual_lockdown", [2, 4, 0, 2]),
        (true, "8".to_owned()),
        "until v1.16"
    );
    assert_eq!(armed_with("actuator_armed", "kill", [2, 4, 0, 2]), (true, "8".to_owned()), "since v1.17");
}

#[test]
fn a_mode_is_told_when_it_changes_with_the_number_that_mavlink_has() {
    let read = log(&[(
        "vehicle_status",
        STATUS,
        &[(2, vec![2, 4, 0, 2]), (3, vec![2, 4, 0, 2]), (4, vec![2, 18, 0, 2])],
    )]);
    assert_eq!(read.of("mode"), ["50593792 Hold", "100925440 Land"]);
}

#[test]
fn a_battery_without_cells_has_the_voltage_of_the_whole_and_unknown_is_not_minus_one() {
    let fields = "float voltage_v;float current_a;float remaining;float discharged_mah;bool connected;uint8_t cell_count;float[4] voltage_cell_v;";
    let whole = |cells: [f32; 4]| {
        let data = [floats(&[15.5, -1.0, 0.87, -1.0]), vec![1, 4], floats(&cells)].concat();
        observations(&log(&[("battery_status", fields, &[(2, data)])]), "Battery(").remove(0)
    };
    let without = whole([0.0; 4]);
    assert!(without.contains("voltage: Some(Volts(15.5)), current: None, consumed: None"), "{without}");
    assert!(without.contains("cells: [None"), "{without}");
    let with = whole([3.5, 3.75, 4.0, 4.0]);
    assert!(
        with.contains(
            "cells: [Some(CellVoltage(3500)), Some(CellVoltage(3750)), Some(CellVoltage(4000)), Some(CellVoltage(4000)), None"
        ),
        "{with}"
    );
    assert!(with.contains("voltage: Some(Volts(15.25))"), "{with}");
}

#[test]
fn a_batterys_warning_is_its_charge_state() {
    let of = |warning: u8, connected: u8| {
        let fields = "float voltage_v;bool connected;uint8_t warning;";
        let data = [floats(&[15.5]), vec![connected, warning]].concat();
        let said = observations(&log(&[("battery_status", fields, &[(2, data)])]), "Battery(").remove(0);
        let charge = said.split("charge: ").nth(1).and_then(|rest| rest.split([',', ' ']).next());
        charge.expect("a charge state").parse::<u8>().expect("a number")
    };
    // None, low, critical, emergency, failed, unhealthy, charging, invalid.
    assert_eq!([0, 1, 2, 3, 4, 6, 7, 5].map(|warning| of(warning, 1)), [1, 2, 3, 4, 5, 6, 7, 0]);
    assert_eq!(of(2, 0), 0, "no battery is connected");
    let silent = log(&[(
        "battery_status",
        "float voltage_v;bool connected;",
        &[(2, [floats(&[15.5]), vec![1]].concat())],
    )]);
    assert!(observations(&silent, "Battery(")[0].contains("charge: 0"), "a log without the field");
}

#[test]
fn a_receiver_that_falls_silent_has_no_fix_any_more_but_not_after_a_dropout() {
    let messages: Vec<(u64, Vec<u8>)> = (2..20).map(|second| (second, vec![2, 4, 0, 2])).collect();
    let read = log(&[
        ("vehicle_status", STATUS, &messages),
        ("sensor_gps", "uint8_t fix_type;", &[(2, vec![3]), (3, vec![3])]),
    ]);
    let fixes = observations(&read, "Gnss(");
    assert!(fixes.len() > 10 && fixes[2..].iter().all(|gnss| gnss.contains("fix: 0")), "{fixes:?}");
    let first = read.items.iter().find(|(_, item)| item.contains("Gnss(") && item.contains("fix: 0"));
    assert_eq!(first.map(|(at, _)| *at), Some(6 * SECOND));
}

#[test]
fn an_escs_temperature_in_kelvin_is_not_a_fire() {
    let fields = "uint8_t esc_count;esc_report[2] esc;";
    let report = |rpm: i32, temperature: f32| [&rpm.to_le_bytes()[..], &temperature.to_le_bytes()].concat();
    let data = [vec![2], report(5_000, 295.15), report(0, 40.0)].concat();
    let log = Writer::new(SECOND)
        .format("esc_report:int32_t esc_rpm;float esc_temperature;")
        .format(&format!("esc_status:uint64_t timestamp;{fields}"))
        .subscribe(0, 0, "esc_status")
        .data(0, 2 * SECOND, &data);
    let escs = observations(&read(&log.bytes), "Escs(");
    assert!(escs[0].contains("rpm: Some(Rpm(5000.0))") && escs[0].contains("Celsius(22"), "{escs:?}");
    assert!(escs[0].contains("rpm: None") && escs[0].contains("Celsius(40.0)"), "{escs:?}");
}

#[test]
fn an_attitude_is_that_of_its_quaternion_and_fast_topics_are_thinned() {
    let half = 0.5_f32.sqrt();
    let mut log = Writer::new(SECOND).format("vehicle_attitude:uint64_t timestamp;float[4] q;").subscribe(
        0,
        0,
        "vehicle_attitude",
    );
    for step in 0..100 {
        log = log.data(0, 2 * SECOND + step * 4_000, &floats(&[half, half, 0.0, 0.0]));
    }
    let attitudes = observations(&read(&log.bytes), "Attitude(");
    assert_eq!(attitudes.len(), 8);
    assert!(
        attitudes[0].contains("roll: Radians(1.57") && attitudes[0].contains("boot_ms: Some(2000)"),
        "{attitudes:?}"
    );
}

#[test]
fn a_shock_between_two_samples_that_are_handed_on_is_handed_on_as_one() {
    let format = "sensor_combined:uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;";
    let mut log = Writer::new(SECOND).format(format).subscribe(0, 0, "sensor_combined");
    for step in 0..100 {
        let force = if step == 40 { 170.0 } else { 9.8 };
        log = log.data(0, 2 * SECOND + step * 4_000, &floats(&[0.0, 0.0, 0.0, 0.0, 0.0, -force]));
    }
    let read = read(&log.bytes);
    assert_eq!(observations(&read, "Imu(").len(), 8);
    assert_eq!(observations(&read, "Shock("), ["1: Shock(MetresPerSecond2(170.0))"]);
}

#[test]
fn the_wanted_attitude_is_a_quaternion_and_before_v1_6_two_angles() {
    let half = 0.5_f32.sqrt();
    for (fields, values) in [
        ("float roll_body;float pitch_body;float[4] q_d;", vec![0.0, 0.0, half, half, 0.0, 0.0]),
        ("float[4] q_d;", vec![half, half, 0.0, 0.0]),
        ("float roll_body;float pitch_body;", vec![core::f32::consts::FRAC_PI_2, 0.0]),
    ] {
        let format = format!("vehicle_attitude_setpoint:uint64_t timestamp;{fields}");
        let log = Writer::new(SECOND).format(&format).subscribe(0, 0, "vehicle_attitude_setpoint");
        let log = log.data(0, 2 * SECOND, &floats(&values));
        let wanted = observations(&read(&log.bytes), "AttitudeSetpoint(");
        assert!(wanted.len() == 1 && wanted[0].contains("roll: Radians(1.57"), "{fields} {wanted:?}");
    }
}

#[test]
fn the_wanted_rates_go_with_the_wanted_attitude() {
    let log = Writer::new(SECOND)
        .format("vehicle_attitude_setpoint:uint64_t timestamp;float[4] q_d;")
        .format("vehicle_rates_setpoint:uint64_t timestamp;float roll;float pitch;float yaw;")
        .subscribe(0, 0, "vehicle_attitude_setpoint")
        .subscribe(1, 0, "vehicle_rates_setpoint");
    let log = log.data(1, 2 * SECOND, &floats(&[0.5, -0.25, 0.0]));
    let log = log.data(0, 2 * SECOND, &floats(&[1.0, 0.0, 0.0, 0.0]));
    let log = log.data(0, 3 * SECOND, &floats(&[1.0, 0.0, 0.0, 0.0]));
    let wanted = observations(&read(&log.bytes), "AttitudeSetpoint(");
    assert!(
        wanted[0].contains("about: [RadiansPerSecond(0.5), RadiansPerSecond(-0.25), RadiansPerSecond(0.0)]"),
        "{wanted:?}"
    );
    assert!(wanted[1].contains("rates: None"), "they are old: {wanted:?}");
}

#[test]
fn the_rates_of_an_attitude_are_its_own_or_those_of_the_gyros() {
    let attitude = [1.0, 0.0, 0.0, 0.0];
    let old =
        "vehicle_attitude:uint64_t timestamp;float rollspeed;float pitchspeed;float yawspeed;float[4] q;";
    let log = Writer::new(SECOND).format(old).subscribe(0, 0, "vehicle_attitude");
    let log = log.data(0, 2 * SECOND, &floats(&[&[5.5, -6.5, 7.5], &attitude[..]].concat()));
    let attitudes = observations(&read(&log.bytes), "Attitude(");
    assert!(attitudes[0].contains("RadiansPerSecond(5.5), RadiansPerSecond(-6.5)"), "{attitudes:?}");

    let log = Writer::new(SECOND)
        .format("vehicle_attitude:uint64_t timestamp;float[4] q;")
        .format("vehicle_angular_velocity:uint64_t timestamp;float[3] xyz;")
        .subscribe(0, 0, "vehicle_attitude")
        .subscribe(1, 0, "vehicle_angular_velocity");
    let log = log.data(1, 2 * SECOND, &floats(&[5.5, -6.5, 7.5])).data(0, 2 * SECOND, &floats(&attitude));
    let attitudes = observations(&read(&log.bytes), "Attitude(");
    assert!(attitudes[0].contains("RadiansPerSecond(5.5), RadiansPerSecond(-6.5)"), "{attitudes:?}");
}

#[test]
fn a_log_without_the_estimators_status_has_its_test_ratios_as_the_status_has_them() {
    let fields = "float[2] gps_hvel;float gps_vvel;float[2] gps_hpos;float baro_vpos;float[3] mag_field;float heading;";
    let squares = [0.04, 0.25, 0.01, 0.81, 0.09, 0.16, 0.0, f32::NAN, 0.36, 0.49];
    let ratios = ("estimator_innovation_test_ratios", fields, &[(3, floats(&squares))][..]);
    let flags = ("estimator_status_flags", "bool cs_tilt_align;bool cs_gnss_fault;", &[(2, vec![1, 1])][..]);
    let found = observations(&log(&[flags, ratios]), "Estimator(");
    assert_eq!(found.len(), 1, "{found:?}");
    for figure in [
        "TestRatio",
        "velocity: Some(0.5)",
        "position_horizontal: Some(0.9",
        "position_vertical: Some(0.4",
        "compass: Some(0.7",
        "flags: 1025",
    ] {
        assert!(found[0].contains(figure), "{figure}: {found:?}");
    }
    let status = ("estimator_status", "float vel_test_ratio;", &[(2, floats(&[0.125]))][..]);
    let found = observations(&log(&[status, ratios]), "Estimator(");
    assert!(found.len() == 1 && found[0].contains("velocity: Some(0.125)"), "the status counts: {found:?}");
}

#[test]
fn flags_of_failsafes_are_named_while_the_vehicle_is_in_failsafe() {
    let flags = "bool gcs_connection_lost;uint8_t battery_warning;bool fd_motor_failure;";
    let read = log(&[
        ("vehicle_status", STATUS, &[(2, vec![2, 4, 0, 2]), (4, vec![2, 5, 1, 2]), (6, vec![2, 4, 0, 2])]),
        ("failsafe_flags", flags, &[(3, vec![1, 1, 0]), (5, vec![1, 2, 1])]),
    ]);
    let told: Vec<&str> = read.of("fact").into_iter().filter(|fact| fact.starts_with("Failsafes")).collect();
    let named = ["ground station", "ground station, battery, motor failure", ""];
    assert_eq!(told.len(), named.len(), "{told:?}");
    assert!(told.iter().zip(named).all(|(told, named)| told.ends_with(named)), "{told:?}");
}

#[test]
fn that_no_other_computer_flies_it_is_a_failsafe_in_the_offboard_mode_only() {
    let status = format!("{STATUS}uint8_t nav_state_user_intention;");
    let told = |nav: u8, meant: u8| {
        let read = log(&[
            ("vehicle_status", &status, &[(2, vec![2, nav, 1, 2, meant])]),
            (
                "failsafe_flags",
                "bool offboard_control_signal_lost;uint8_t battery_warning;",
                &[(3, vec![1, 2])],
            ),
        ]);
        let facts = read.of("fact");
        facts.iter().rfind(|fact| fact.starts_with("Failsafes")).map(|fact| (*fact).to_owned())
    };
    for (nav, meant, offboard) in [(1, 1, false), (14, 14, true), (4, 14, true)] {
        let told = told(nav, meant).expect("a failsafe");
        assert!(
            told.contains("battery") && told.contains("offboard control") == offboard,
            "{nav} {meant}: {told}"
        );
    }
}

#[test]
fn the_climb_that_is_wanted_is_that_of_the_position_setpoint() {
    let read = log(&[(
        "vehicle_local_position_setpoint",
        "float vz;",
        &[(2, floats(&[9.5])), (3, floats(&[f32::NAN]))],
    )]);
    let wanted = observations(&read, "ClimbWanted(");
    assert!(wanted.len() == 1 && wanted[0].contains("-9.5"), "{wanted:?}");
}

#[test]
fn the_throttle_is_that_of_the_motors_where_nothing_else_tells_it() {
    let motors = [&[0.5, 0.7, f32::NAN, 0.0][..], &[f32::NAN; 8]].concat();
    let throttle = |thrust: bool| {
        let status = ("vehicle_status", STATUS, &[(2, vec![2, 4, 0, 2])][..]);
        let position = ("vehicle_local_position", "float x;", &[(5, floats(&[1.0]))][..]);
        let motors = ("actuator_motors", "float[12] control;", &[(3, floats(&motors))][..]);
        let wanted = [(4, floats(&[0.0, 0.0, -0.25]))];
        let wanted = ("vehicle_thrust_setpoint", "float[3] xyz;", if thrust { &wanted[..] } else { &[] });
        let hud = observations(&log(&[status, motors, wanted, position]), "Hud(").remove(0);
        hud.split("throttle: Some(Fraction(")
            .nth(1)
            .and_then(|rest| rest.split(')').next())
            .expect("a throttle")
            .to_owned()
    };
    assert_eq!((throttle(false).as_str(), throttle(true).as_str()), ("0.6", "0.25"));
}

const DOCUMENT: &str = include_str!("../../../../../../docs/ulog.md");

#[test]
fn each_topic_that_serves_is_in_the_document_and_none_is_missing() {
    for list in super::LISTS.iter().copied().flatten() {
        assert!(DOCUMENT.contains(&format!("`{}`", list.name)), "{} is not in docs/ulog.md", list.name);
    }
    for name in [
        "battery_status",
        "sensor_combined",
        "vehicle_attitude",
        "vehicle_local_position",
        "vehicle_global_position",
        "vehicle_gps_position",
        "sensor_gps",
        "estimator_status",
        "estimator_status_flags",
        "estimator_innovation_test_ratios",
        "failsafe_flags",
        "vehicle_status",
        "vehicle_land_detected",
        "actuator_outputs",
        "actuator_motors",
        "esc_status",
        "cpuload",
        "vehicle_imu_status",
        "event",
        "log_message",
    ] {
        assert!(super::topic(name).is_some(), "{name} serves no check");
    }
}

#[test]
fn utc_beyond_all_numbers_is_no_panic() {
    const UTC_US: u64 = 1_700_000_000_000_000;
    let mut writer = Writer::new(SECOND)
        .format(&format!("vehicle_status:uint64_t timestamp;{STATUS}"))
        .format("sensor_gps:uint64_t timestamp;uint64_t time_utc_usec;uint8_t fix_type;")
        .subscribe(0, 0, "vehicle_status")
        .subscribe(1, 0, "sensor_gps")
        .data(0, SECOND, &[1, 4, 0, 2])
        .data(1, SECOND, &[&UTC_US.to_le_bytes()[..], &[3]].concat());
    for number in 0..40 {
        writer = writer.data(0, u64::MAX - 40 * SECOND + number * SECOND, &[1, 4, 0, 2]);
    }
    let read = read(&writer.bytes);
    let told = observations(&read, "SystemTime(");
    assert!(told.last().is_some_and(|last| last.contains(&u64::MAX.to_string())), "{told:?}");
}
