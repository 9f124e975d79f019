//! Which messages serve, and what the rest is for.

use hums_core::observation::Observation;

use super::seen;
use super::writer::Writer;

/// What is said of these logs.
const DOCUMENT: &str = include_str!("../../../../../docs/dataflash.md");

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
