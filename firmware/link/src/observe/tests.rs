//! The traps, one by one.
use hums_core::cause::{Alert, Cause, Causes, Urgency};
use hums_core::observation::{
    Autopilot, CellVoltage, EstimatorScale, LandedState, Observation, SystemTime, VehicleKind, VtolState,
};
use hums_core::units::{
    Amperes, Celsius, Fraction, Gauss, Hectopascals, Metres, MetresPerSecond, MetresPerSecond2, Rpm, Volts,
};
use hums_dialect::ardupilotmega as ap;
use hums_dialect::{MavlinkVersion, MessageData};
use proptest::prelude::*;

use super::fields::unix_time;
use super::*;
use crate::packet::Packet;

/// `commander_failsafe_enter_hold` of PX4's event definitions.
const FAILSAFE_HOLD: u32 = 13_704_694;

/// MAVLink 2, zeros at the end left out.
fn said<M: MessageData>(message: &M) -> Option<Observation> {
    let mut bytes = [0; 255];
    let len = message.ser(MavlinkVersion::V2, &mut bytes);
    by_id(M::ID, &bytes[..len])
}

#[test]
fn ground_stations_gimbals_and_companions_are_no_vehicles() {
    for (kind, autopilot) in [(6, 8), (6, 3), (26, 8), (18, 8), (18, 12), (2, 8)] {
        assert_eq!(by_id(0, &[0, 0, 0, 0, kind, autopilot, 0, 4, 3]), None, "{kind} {autopilot}");
    }
}

#[test]
fn a_vehicle_of_a_type_that_is_newer_than_our_list_is_a_vehicle() {
    let Some(Observation::Heartbeat(heartbeat)) = by_id(0, &[1, 0, 0, 0, 250, 12, 0x81, 4, 3]) else {
        panic!("not recognised")
    };
    assert_eq!(
        (heartbeat.kind, heartbeat.autopilot, heartbeat.armed),
        (VehicleKind::Other, Autopilot::Px4, true)
    );
}

#[test]
fn the_wanted_attitude_is_told_in_degrees_and_as_a_quaternion() {
    let wanted = |said: Option<Observation>| match said {
        Some(Observation::AttitudeSetpoint(wanted)) => {
            Some([wanted.roll.0, wanted.pitch.0].map(f32::to_degrees))
        }
        _ => None,
    };
    let nav = ap::NAV_CONTROLLER_OUTPUT_DATA { nav_roll: -35.0, nav_pitch: 12.5, ..Default::default() };
    assert_eq!(wanted(said(&nav)), Some([-35.0, 12.5]));
    assert_eq!(wanted(said(&ap::NAV_CONTROLLER_OUTPUT_DATA { nav_pitch: f32::NAN, ..nav })), None);
    let (sin, cos) = 15_f32.to_radians().sin_cos();
    let target = ap::ATTITUDE_TARGET_DATA { q: [cos, 0.0, -sin, 0.0], ..Default::default() };
    let [roll, pitch] = wanted(said(&target)).unwrap();
    assert!(roll.abs() < 1e-3 && (pitch + 30.0).abs() < 1e-3, "{roll} {pitch}");
    assert_eq!(wanted(said(&ap::ATTITUDE_TARGET_DATA { q: [0.0; 4], ..target })), None, "nothing yet");
}

#[test]
fn wanted_rates_come_with_the_attitude_about_whose_axes_they_may_be() {
    let q = [1.0, 0.0, 0.0, 0.0];
    let target = ap::ATTITUDE_TARGET_DATA {
        q,
        type_mask: ap::AttitudeTargetTypemask::empty(),
        body_roll_rate: 0.5,
        body_pitch_rate: -1.0,
        body_yaw_rate: 2.0,
        ..Default::default()
    };
    let rates = |target: &ap::ATTITUDE_TARGET_DATA| match said(target) {
        Some(Observation::AttitudeSetpoint(wanted)) => wanted.rates,
        _ => panic!(),
    };
    let told = rates(&target).expect("told");
    assert_eq!((told.about.map(|rate| rate.0), told.of), ([0.5, -1.0, 2.0], Some(q)));
    assert_eq!(rates(&ap::ATTITUDE_TARGET_DATA { body_yaw_rate: f32::NAN, ..target }), None);
}

#[test]
fn zeros_of_a_second_estimator_are_what_it_does_not_know() {
    let second = |message: &ap::AHRS2_DATA| match said(message) {
        Some(Observation::SecondEstimate(second)) => second,
        _ => panic!(),
    };
    let told = ap::AHRS2_DATA {
        roll: 0.1,
        pitch: -0.2,
        yaw: 3.0,
        altitude: 584.5,
        lat: -353_632_620,
        lng: 1_491_652_370,
    };
    let all = second(&told);
    assert_eq!(all.attitude.map(|angles| angles.map(|angle| angle.0)), Some([0.1, -0.2, 3.0]));
    assert_eq!(all.altitude, Some(Metres(584.5)));
    assert!(all.position.is_some_and(|place| (place.latitude_deg + 35.363_262).abs() < 1e-9));
    let nowhere = second(&ap::AHRS2_DATA { lat: 0, lng: 0, ..told.clone() });
    assert_eq!((nowhere.position, nowhere.altitude), (None, None));
    assert_eq!(second(&ap::AHRS2_DATA { roll: 0.0, pitch: 0.0, yaw: 0.0, ..told }).attitude, None);
}

#[test]
fn the_climb_that_is_wanted_is_read_where_it_is_meant() {
    let target = |mask: u16, down: f32| {
        let packet = Packet::new(85).f32(24, down).u16(48, mask).u8(50, 1);
        by_id(85, packet.payload())
    };
    assert_eq!(target(0, 9.5), Some(Observation::ClimbWanted(MetresPerSecond(-9.5))));
    assert_eq!((target(32, 9.5), target(0, f32::NAN)), (None, None));
}

#[test]
fn what_the_autopilot_says_is_wrong_is_read_of_texts_events_and_flags() {
    let text = |severity: u8, words: &str, part: u8| {
        let packet = Packet::new(253).u8(0, severity).text(1, 50, words).u8(53, part);
        by_id(253, packet.payload())
    };
    let warning = |cause| Some(Observation::Alert(Alert { cause, urgency: Urgency::Warning }));
    assert_eq!(text(2, "EKF3 lane switch 1", 0), warning(Cause::Estimator));
    assert_eq!((text(6, "EKF3 lane switch 1", 0), text(2, "", 0), text(200, "x", 0)), (None, None, None));
    assert_eq!(by_id(253, &[2, 0xFF, b'!']), warning(Cause::Other), "no UTF-8");
    let event = Packet::new(410).u32(0, 1 << 24 | FAILSAFE_HOLD).u8(12, 0x52).u8(13 + 7, 1);
    assert_eq!(by_id(410, event.payload()), warning(Cause::RemoteControl));
    let flags = Packet::new(235).u16(22, 8 | 4096);
    let causes = Causes::NONE.with(Cause::Accelerometer).with(Cause::Estimator);
    assert_eq!(by_id(235, flags.payload()), Some(Observation::Failing(causes)));
}

#[test]
fn unknown_system_status_is_none_of_the_values() {
    let message = ap::SYS_STATUS_DATA {
        load: u16::MAX,
        voltage_battery: u16::MAX,
        current_battery: -1,
        battery_remaining: -1,
        ..Default::default()
    };
    let Some(Observation::SystemStatus(status)) = said(&message) else { panic!() };
    assert_eq!((status.load, status.voltage, status.current, status.remaining), (None, None, None, None));
    let px4 = ap::SYS_STATUS_DATA { load: 123, current_battery: -100, ..message };
    let Some(Observation::SystemStatus(status)) = said(&px4) else { panic!() };
    assert_eq!((status.load, status.current), (Some(Fraction(0.123)), None));
}

fn battery(voltages: [u16; 10], voltages_ext: [u16; 4]) -> hums_core::observation::Battery {
    let message =
        ap::BATTERY_STATUS_DATA { voltages, voltages_ext, current_battery: -1, ..Default::default() };
    let Some(Observation::Battery(battery)) = said(&message) else { panic!() };
    battery
}

#[test]
fn a_sum_is_no_cell_and_nothing_measured_is_no_charge() {
    const NONE: u16 = u16::MAX;
    let sum = battery([12_600, NONE, NONE, NONE, NONE, NONE, NONE, NONE, NONE, NONE], [0; 4]);
    assert_eq!((sum.voltage, sum.remaining), (Some(Volts(12.6)), Some(Fraction(0.0))));
    assert_eq!(sum.cells_reported(), 0);
    // Above 65.534 V the rest is in the next place.
    let spilled = battery([65_534, 4_466, NONE, NONE, NONE, NONE, NONE, NONE, NONE, NONE], [0; 4]);
    assert_eq!((spilled.voltage, spilled.cells_reported()), (Some(Volts(70.0)), 0));
    let none = battery([NONE; 10], [0; 4]);
    assert_eq!((none.voltage, none.cells_reported(), none.remaining), (None, 0, None));
}

#[test]
fn cells_reach_into_the_extension() {
    let battery = battery([4_000; 10], [4_000, 3_900, 0, 0]);
    assert_eq!(battery.cells_reported(), 12);
    assert!((battery.voltage.expect("known").0 - 47.9).abs() < 1e-3);
    assert!(battery.cells[11].map(CellVoltage::volts) == Some(Volts(3.9)));
}

#[test]
fn battery_figures_have_their_own_scales_and_unknowns() {
    let message = ap::BATTERY_STATUS_DATA {
        current_battery: 2_734,
        current_consumed: 454,
        temperature: i16::MAX,
        battery_remaining: 86,
        ..Default::default()
    };
    let Some(Observation::Battery(known)) = said(&message) else { panic!() };
    assert_eq!((known.current, known.temperature), (Some(Amperes(27.34)), None));
    let unknown = ap::BATTERY_STATUS_DATA { current_consumed: -29, current_battery: -1, ..message };
    let Some(Observation::Battery(unknown)) = said(&unknown) else { panic!() };
    assert_eq!((unknown.consumed, unknown.current, unknown.remaining), (None, None, Some(Fraction(0.86))));
}

#[test]
fn a_receiver_that_knows_nothing_says_nothing() {
    let message = ap::GPS_RAW_INT_DATA {
        eph: u16::MAX,
        epv: u16::MAX,
        vel: u16::MAX,
        satellites_visible: u8::MAX,
        fix_type: ap::GpsFixType::GPS_FIX_TYPE_NO_GPS,
        ..Default::default()
    };
    let Some(Observation::Gnss(gnss)) = said(&message) else { panic!() };
    assert_eq!((gnss.fix, gnss.satellites, gnss.hdop, gnss.speed), (0, None, None, None));
    assert_eq!((gnss.position, gnss.altitude, gnss.accuracy), (None, None, None));
}

#[test]
fn a_fix_of_a_kind_that_is_newer_than_our_list_is_kept_and_the_rest_is_read() {
    let message = ap::GPS_RAW_INT_DATA { satellites_visible: 17, ..Default::default() };
    let mut bytes = [0; 255];
    message.ser(MavlinkVersion::V2, &mut bytes);
    bytes[28] = 99;
    let Some(Observation::Gnss(gnss)) = by_id(24, &bytes[..52]) else { panic!() };
    assert_eq!((gnss.fix, gnss.satellites), (99, Some(17)));
}

#[test]
fn time_is_utc_or_since_boot_by_its_size() {
    assert_eq!(unix_time(4_500_999), None);
    assert_eq!(unix_time(1_732_190_000_000_000), Some(1_732_190_000_000_000));
    let mut bytes = [0; 12];
    bytes[8] = 7;
    let time = SystemTime { utc_micros: None, boot_ms: 7 };
    assert_eq!(by_id(2, &bytes), Some(Observation::SystemTime(time)));
}

#[test]
fn highres_imu_gives_only_what_was_updated() {
    let message = ap::HIGHRES_IMU_DATA {
        zacc: -9.8,
        temperature: 20.0,
        fields_updated: ap::HighresImuUpdatedFlags::from_bits_retain(0b111),
        ..Default::default()
    };
    let Some(Observation::ImuAndAir(imu, air)) = said(&message) else { panic!() };
    assert_eq!(imu.acceleration, Some([0.0, 0.0, -9.8].map(MetresPerSecond2)));
    assert_eq!((imu.rate, imu.temperature, air.pressure), (None, None, None));
}

#[test]
fn the_second_and_third_sensors_are_of_their_own_and_fields_are_in_gauss() {
    let message =
        ap::SCALED_IMU2_DATA { zacc: -1_000, xmag: 210, ymag: -50, zmag: 400, ..Default::default() };
    let Some(Observation::Imu(imu)) = said(&message) else { panic!() };
    assert_eq!((imu.instance, imu.field), (1, Some([0.21, -0.05, 0.4].map(Gauss))));
    let message = ap::SCALED_IMU3_DATA { zacc: -1_000, ..Default::default() };
    let Some(Observation::Imu(imu)) = said(&message) else { panic!() };
    assert_eq!((imu.instance, imu.field), (2, None), "a compass that is not there");
    let message = ap::SCALED_PRESSURE2_DATA { press_abs: 1_000.0, ..Default::default() };
    let Some(Observation::Air(air)) = said(&message) else { panic!() };
    assert_eq!((air.instance, air.pressure), (1, Some(Hectopascals(1_000.0))));
}

#[test]
fn outputs_go_on_in_the_extension_and_none_is_nothing() {
    let message = ap::SERVO_OUTPUT_RAW_DATA {
        servo1_raw: 1_100,
        servo8_raw: u16::MAX,
        port: 1,
        servo9_raw: 1_900,
        servo12_raw: 1_200,
        ..Default::default()
    };
    let Some(Observation::Outputs(outputs)) = said(&message) else { panic!() };
    assert_eq!(outputs.port, 1);
    assert_eq!(outputs.pulses, [1_100, 0, 0, 0, 0, 0, 0, 0, 1_900, 0, 0, 1_200]);
}

#[test]
fn an_estimator_that_has_not_started_has_no_variances() {
    let message = ap::EKF_STATUS_REPORT_DATA {
        flags: ap::EkfStatusFlags::from_bits_retain(1_024),
        ..Default::default()
    };
    let Some(Observation::Estimator(estimator)) = said(&message) else { panic!() };
    assert_eq!((estimator.scale, estimator.velocity), (EstimatorScale::Variance, None));
    let running = ap::EKF_STATUS_REPORT_DATA { flags: ap::EkfStatusFlags::from_bits_retain(831), ..message };
    let Some(Observation::Estimator(estimator)) = said(&running) else { panic!() };
    assert_eq!(estimator.velocity, Some(0.0));
}

#[test]
fn an_exhaust_at_absolute_zero_and_a_fuel_pressure_of_zero_are_unknown() {
    let message = ap::EFI_STATUS_DATA {
        exhaust_gas_temperature: -273.15,
        cylinder_head_temperature: 201.0,
        ..Default::default()
    };
    let Some(Observation::Engine(engine)) = said(&message) else { panic!() };
    assert_eq!((engine.exhaust, engine.fuel_pressure), (None, None));
    assert_eq!(engine.cylinder_head, Some(Celsius(201.0)));
}

#[test]
fn a_generator_of_unknown_speed_has_none_and_new_flags_hide_neither_speed_nor_off() {
    let told = |message: &ap::GENERATOR_STATUS_DATA| {
        let Some(Observation::Generator(generator)) = said(message) else { panic!() };
        (generator.is_off, generator.speed)
    };
    let flags = ap::MavGeneratorStatusFlag::from_bits_retain;
    let running =
        ap::GENERATOR_STATUS_DATA { status: flags(4), generator_speed: 6_200, ..Default::default() };
    assert_eq!(told(&running), (false, Some(Rpm(6_200.0))));
    let unknown = ap::GENERATOR_STATUS_DATA { generator_speed: u16::MAX, ..running.clone() };
    assert_eq!(told(&unknown), (false, None));
    let newer = ap::GENERATOR_STATUS_DATA { status: flags(1 << 40 | 1), ..running };
    assert_eq!(told(&newer), (true, Some(Rpm(6_200.0))));
}

#[test]
fn escs_beyond_the_count_do_not_exist() {
    let message = ap::ESC_INFO_DATA { index: 4, count: 6, ..Default::default() };
    let Some(Observation::Escs(group)) = said(&message) else { panic!() };
    assert_eq!(group.first, 4);
    assert_eq!(group.escs.map(|esc| esc.is_some()), [true, true, false, false]);
}

#[test]
fn ardupilot_escs_come_in_hundredths_and_the_second_message_begins_at_motor_4() {
    let mut message = ap::ESC_TELEMETRY_5_TO_8_DATA::default();
    (message.voltage[1], message.current[1], message.rpm[1], message.count[1]) = (1_679, 80, 5_004, 9);
    let Some(Observation::Escs(group)) = said(&message) else { panic!() };
    assert_eq!((group.first, group.escs[0]), (4, None));
    let esc = group.escs[1].expect("fitted");
    assert_eq!((esc.voltage, esc.current, esc.temperature), (Some(Volts(16.79)), Some(Amperes(0.8)), None));
}

#[test]
fn a_parameter_of_the_batteries_is_read_in_either_autopilots_coding() {
    let value = |name: &str, value: f32, kind: u8| {
        let mut payload = [0; 25];
        payload[..4].copy_from_slice(&value.to_le_bytes());
        payload[8..8 + name.len()].copy_from_slice(name.as_bytes());
        payload[24] = kind;
        by_id(22, &payload)
    };
    let place = |name| hums_core::battery_cells::known(name).expect("known");
    let low = Some(Observation::Parameter(place("BATT_LOW_VOLT"), 21.6));
    assert_eq!(value("BATT_LOW_VOLT", 21.6, 9), low);
    // PX4 sends an INT32's bits, ArduPilot its value.
    let cells = Some(Observation::Parameter(place("BAT1_N_CELLS"), 6.0));
    assert_eq!(value("BAT1_N_CELLS", f32::from_bits(6), 6), cells);
    assert_eq!(value("BAT1_N_CELLS", 6.0, 6), cells);
    assert_eq!(value("WPNAV_SPEED", 500.0, 9), None);
}

#[test]
fn landed_state_is_the_second_byte() {
    assert_eq!(by_id(245, &[3, 1]), Some(Observation::Landed(LandedState::OnGround, VtolState::Hover)));
    assert_eq!(
        by_id(245, &[2]),
        Some(Observation::Landed(LandedState::Unknown, VtolState::Transition)),
        "trimmed: undefined"
    );
}

#[test]
fn unverified_frames_are_not_observed() {
    let bytes = [0xfe, 9, 78, 1, 1, 0, 0, 0, 0, 0, 2, 3, 81, 3, 3, 0x19, 0xf3];
    let frame = Frame::parse(&bytes).expect("a frame");
    assert!(observe(&frame).is_some());
    let mut other = bytes;
    other[16] ^= 1;
    assert!(observe(&Frame::parse(&other).expect("a frame")).is_none());
}

const USED: [u32; 39] = [
    0, 1, 2, 22, 24, 26, 27, 29, 30, 32, 33, 42, 46, 65, 74, 77, 105, 109, 116, 124, 125, 129, 147, 148, 193,
    225, 226, 230, 235, 241, 245, 253, 264, 290, 291, 339, 410, 441, 11_030,
];

proptest! {
    #[test]
    fn no_payload_panics(at in 0..USED.len(), payload in prop::collection::vec(any::<u8>(), 0..=255)) {
        by_id(USED[at], &payload);
    }

    #[test]
    fn no_payload_of_repeated_bytes_panics(at in 0..USED.len(), byte in any::<u8>(), len in 0..=255_usize) {
        by_id(USED[at], &[byte; 255][..len]);
    }
}
