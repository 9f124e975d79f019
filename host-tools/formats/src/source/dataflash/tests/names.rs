//! The messages in use, and the purpose of the others.

use std::fmt::Write as _;

use hums_core::observation::Observation;

use super::seen;
use super::writer::Writer;

const DOCUMENT: &str = include_str!("../../../../../../docs/dataflash.md");

#[test]
fn each_message_that_is_asked_for_serves_or_is_told_to_be_rows_only() {
    let (_, rows) = DOCUMENT.split_once("## Only rows").expect("a list of what is only read as rows");
    for name in [
        "GPS", "GPS2", "CURR", "BAT", "IMU", "IMU2", "VIBE", "ESC", "RCOU", "CTUN", "MODE", "EV", "ERR",
        "MSG", "ATT", "NKF4", "XKF4", "MAG", "BARO", "POWR", "RAD", "PARM", "ORGN", "TERR",
    ] {
        let serves = crate::source::dataflash::observe::has_handler(name);
        let is_row = rows.contains(&format!("| `{name}` |"));
        assert!(serves != is_row, "{name}: serves, or is told to be rows only");
        assert!(is_row || DOCUMENT.contains(name), "{name} is not in docs/dataflash.md");
    }
}

#[test]
fn each_sensor_is_told_with_its_number_a_compass_with_its_inertial_sensor_and_what_motors_are_given() {
    let mut log = Writer::new();
    log.format(150, "MAG", "QBhhh", "TimeUS,I,MagX,MagY,MagZ");
    log.format(151, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ");
    log.format(152, "BARO", "QBf", "TimeUS,I,Press");
    log.format(153, "RCOU", "QHH", "TimeUS,C1,C2");
    let time = 1_000_000_u64.to_le_bytes();
    let field = [200_i16, -50, 400].map(i16::to_le_bytes).concat();
    let inertial = [0.0_f32, 0.0, 0.1, 0.0, 0.0, -9.8].map(f32::to_le_bytes).concat();
    log.raw(150, &[&time, &[1], &field]);
    log.raw(151, &[&time, &[0], &inertial]);
    log.raw(151, &[&time, &[1], &inertial]);
    log.raw(152, &[&time, &[1], &100_000.0_f32.to_le_bytes()]);
    log.raw(153, &[&time, &[1_100_u16, 1_900].map(u16::to_le_bytes).concat()]);
    let of = |observation: &Observation| match observation {
        Observation::Imu(imu) => Some(format!("{} {:?}", imu.instance, imu.field)),
        Observation::Air(air) => Some(format!("{} {:?}", air.instance, air.pressure)),
        Observation::Outputs(outputs) => Some(format!("{:?}", &outputs.pulses[..3])),
        _ => None,
    };
    let told: Vec<String> = seen(&log.bytes).find(of);
    assert_eq!(
        told,
        [
            "0 None",
            "1 Some([Gauss(0.2), Gauss(-0.05), Gauss(0.4)])",
            "1 Some(Hectopascals(1000.0))",
            "[1100, 1900, 0]"
        ]
    );
}

#[test]
fn a_height_is_above_the_home_that_the_log_tells_where_nothing_else_does() {
    let heights = |kind: u8| {
        let mut log = Writer::new();
        log.format(150, "ORGN", "QBLLf", "TimeUS,Type,Lat,Lng,Alt");
        log.format(151, "GPS", "QBBfLLf", "TimeUS,Status,NSats,HDop,Lat,Lng,Alt");
        let origin = [&1_000_000_u64.to_le_bytes()[..], &[kind], &[1; 8], &100.0_f32.to_le_bytes()].concat();
        log.raw(150, &[&origin]);
        for (second, altitude) in [(2_u64, 130.0_f32), (3, 140.0)] {
            let place = [474_000_000_i32.to_le_bytes(), 85_000_000_i32.to_le_bytes()].concat();
            let time = (second * 1_000_000).to_le_bytes();
            log.raw(151, &[&time, &[3, 12], &0.8_f32.to_le_bytes(), &place, &altitude.to_le_bytes()]);
        }
        let of = |observation: &Observation| match observation {
            Observation::GlobalPosition(position) => Some(position.relative_altitude.0),
            _ => None,
        };
        seen(&log.bytes).find(of)
    };
    assert_eq!(heights(1), [30.0, 40.0], "above home");
    assert_eq!(heights(0), [0.0, 10.0], "the estimator's origin is not home: above the first fix");
}

#[test]
fn a_log_that_names_no_firmware_tells_its_vehicle_by_a_parameter() {
    let types = |software: f32| {
        let mut log = Writer::new();
        log.format(162, "PARM", "QNf", "TimeUS,Name,Value");
        let mut name = [0; 16];
        name[..13].copy_from_slice(b"SYSID_SW_TYPE");
        log.raw(162, &[&1_000_000_u64.to_le_bytes(), &name, &software.to_le_bytes()]);
        log.attitudes(1..3);
        let mut types = seen(&log.bytes).find(|observation| match observation {
            Observation::Heartbeat(heartbeat) => Some(heartbeat.type_number),
            _ => None,
        });
        types.dedup();
        types
    };
    assert_eq!((types(10.0), types(0.0), types(20.0), types(99.0)), (vec![2], vec![1], vec![10], vec![0]));
}

#[test]
fn body_rates_and_those_that_are_wanted_are_in_degrees_since_3_4_and_in_hundredths_before_and_grow_old() {
    let rates = |firmware: &str, rate: f32| {
        let mut log = format!(
            "{firmware}\n\
             FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
             FMT, 150, 23, ATT, Qccccc, TimeUS,DesRoll,Roll,DesPitch,Pitch,Yaw\n\
             FMT, 151, 63, RATE, Qfffffffff, TimeUS,RDes,R,ROut,PDes,P,POut,YDes,Y,YOut\n"
        );
        let _ = writeln!(log, "RATE, 1000000, {}, {rate}, 0.1, 0, {rate}, 0.1, 0, 0, 0", 2.0 * rate);
        for time_us in [1_100_000, 1_600_000] {
            let _ = writeln!(log, "ATT, {time_us}, 1.0, 1.0, 2.0, 2.0, 3.0");
        }
        let degrees = |rate: hums_core::units::RadiansPerSecond| rate.0.to_degrees().round();
        let seen = seen(log.as_bytes());
        let wanted = seen.find(|observation| match observation {
            Observation::AttitudeSetpoint(wanted) => Some(wanted.rates.map(|rates| rates.about.map(degrees))),
            _ => None,
        });
        let flown = seen.find(|observation| match observation {
            Observation::Attitude(attitude) => Some(attitude.rates.map(|rates| rates.map(degrees))),
            _ => None,
        });
        (wanted, flown)
    };
    let known = (vec![Some([20.0, 0.0, 0.0]), None], vec![Some([10.0, 10.0, 0.0]), None]);
    assert_eq!(rates("ArduCopter V4.6.3 (3fc7011a)", 10.0), known);
    assert_eq!(rates("ArduCopter V3.3.3 (acf2e10c)", 1_000.0), known);
    let unknown = (vec![None; 2], vec![None; 2]);
    assert_eq!(rates("ArduCopter", 10.0), unknown, "nobody knows the unit");
    assert_eq!(rates("ArduCopter V3.4-dev (acf2e10c)", 10.0), unknown, "it changed in these");
}

#[test]
fn the_gyro_tells_the_unit_of_the_rates_where_the_version_does_not() {
    let last_dps = |firmware: &str, rate: f32, gyro_dps: f32| {
        let mut log = format!(
            "{firmware}\n\
             FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
             FMT, 150, 23, ATT, Qccccc, TimeUS,DesRoll,Roll,DesPitch,Pitch,Yaw\n\
             FMT, 151, 63, RATE, Qfffffffff, TimeUS,RDes,R,ROut,PDes,P,POut,YDes,Y,YOut\n\
             FMT, 152, 35, IMU, Qffffff, TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ\n"
        );
        for time_us in (0..10_u32).map(|step| 1_000_000 + step * 100_000) {
            let gyro = gyro_dps.to_radians();
            let _ = writeln!(log, "IMU, {time_us}, {gyro}, 0, 0, 0, 0, -9.8");
            let _ = writeln!(log, "RATE, {}, {rate}, {rate}, 0.1, 0, 0, 0.1, 0, 0, 0", time_us + 10_000);
            let _ = writeln!(log, "ATT, {}, 1.0, 1.0, 2.0, 2.0, 3.0", time_us + 20_000);
        }
        let attitudes = seen(log.as_bytes()).find(|observation| match observation {
            Observation::Attitude(attitude) => {
                Some(attitude.rates.map(|rates| rates[0].0.to_degrees().round()))
            }
            _ => None,
        });
        attitudes.last().copied().flatten()
    };
    for firmware in ["ArduCopter V3.4-dev (acf2e10c)", "ArduCopter"] {
        assert_eq!(last_dps(firmware, 3_000.0, 33.0), Some(30.0), "hundredths");
        assert_eq!(last_dps(firmware, 30.0, 33.0), Some(30.0), "degrees");
        assert_eq!(last_dps(firmware, 3.0, 3.3), None, "it turns too little to tell");
        assert_eq!(last_dps(firmware, 30.0, 330.0), None, "neither of them");
    }
    assert_eq!(last_dps("ArduCopter V4.6.3 (3fc7011a)", 3_000.0, 33.0), Some(3_000.0), "the version tells");
}

#[test]
fn a_copter_without_a_frame_class_has_the_motors_that_are_defined() {
    let types = |motors: usize, frame_class: &str| {
        let names: Vec<String> = (1..=motors).map(|motor| format!("Mot{motor}")).collect();
        let log = format!(
            "ArduCopter V3.1.5 (3c57e771)\n\
             FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
             FMT, 129, 23, PARM, Nf, Name,Value\n\
             FMT, 150, 17, ATT, Iccccc, TimeMS,DesRoll,Roll,DesPitch,Pitch,Yaw\n\
             FMT, 151, {}, MOT, {}, {}\n\
             {frame_class}\
             ATT, 1000, 1.0, 1.0, 2.0, 2.0, 3.0\n",
            3 + 2 * motors,
            "h".repeat(motors),
            names.join(",")
        );
        seen(log.as_bytes()).find(|observation| match observation {
            Observation::Heartbeat(heartbeat) => Some(heartbeat.type_number),
            _ => None,
        })
    };
    assert_eq!([4, 6, 8].map(|motors| types(motors, "")), [[2], [13], [14]]);
    assert_eq!(types(4, "PARM, FRAME_CLASS, 2\n"), [13], "the parameter says it better");
}
