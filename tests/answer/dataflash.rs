//! Every field of every message of an autopilot's own log, as pymavlink reads it.

use std::io::Write as _;

use hums::mavlink::values::Scalar;
use hums::source::item::{CellValue, Item, Needs, Row, Rows};
use hums::source::recording::LogPlace;
use hums_tests::{flights, oracle};
use serde_json::Value as Json;

fn same(ours: &CellValue<'_>, theirs: &Json) -> bool {
    match ours {
        CellValue::Unknown => theirs.is_null(),
        CellValue::Number(Scalar::Unsigned(value)) => theirs.as_u64() == Some(*value),
        CellValue::Number(Scalar::Signed(value)) => theirs.as_i64() == Some(*value),
        // JSON has no number for it.
        CellValue::Number(Scalar::Single(value)) if !value.is_finite() => theirs.is_null(),
        CellValue::Number(Scalar::Double(value)) if !value.is_finite() => theirs.is_null(),
        CellValue::Number(Scalar::Single(value)) => {
            theirs.as_f64().map(|theirs| theirs as f32) == Some(*value)
        }
        // `serde_json` reads a number to its last bit but one.
        CellValue::Number(Scalar::Double(value)) => {
            theirs.as_f64().is_some_and(|theirs| (theirs - value).abs() <= 2.0 * f64::EPSILON * value.abs())
        }
        CellValue::Flag(value) => theirs.as_bool() == Some(*value),
        CellValue::Text(value) => theirs.as_str() == Some(value),
        CellValue::Bytes(bytes) => {
            let theirs = theirs.as_str().unwrap_or_default().as_bytes();
            let digits = |(pair, byte): (&[u8], &u8)| pair == format!("{byte:02x}").as_bytes();
            theirs.len() == 2 * bytes.len() && theirs.chunks(2).zip(bytes.iter()).all(digits)
        }
    }
}

#[test]
fn every_field_of_every_message_of_an_autopilots_own_log_is_read_as_pymavlink_reads_it() {
    let compressed = flights::root().join("tests/labelled/bin/f12_gps_jump.bin.gz");
    let recording = LogPlace::file(&compressed).open().unwrap();
    // Pymavlink maps the file into memory: no compression.
    let mut plain = tempfile::Builder::new().suffix(".bin").tempfile().unwrap();
    let mut input = hums::source::input::Input::open(&compressed).unwrap();
    std::io::copy(&mut input, &mut plain).unwrap();
    plain.flush().unwrap();
    let theirs = oracle::dataflash(plain.path());
    let mut theirs = theirs.lines().map(|line| serde_json::from_str::<(String, Vec<Json>)>(line).unwrap());
    let (mut messages, mut values) = (0_u64, 0);
    let mut compare = |row: Row<'_>| {
        let (name, expected) = theirs.next().expect("pymavlink has fewer messages");
        assert_eq!(row.table.name, name, "message {messages}");
        assert_eq!(row.values.len(), expected.len(), "{name}");
        for ((column, ours), theirs) in row.table.columns.iter().zip(row.values).zip(&expected) {
            assert!(same(ours, theirs), "{name}.{} of message {messages}: {ours:?}, {theirs}", column.name);
        }
        messages += 1;
        values += expected.len();
    };
    let want = Needs { rows: Rows::All, ..Needs::default() };
    recording
        .read(want, &mut |_, item| {
            if let Item::Row(row) = item {
                compare(row);
            }
            Ok(())
        })
        .unwrap();
    assert!(theirs.next().is_none(), "pymavlink has more messages");
    assert!(messages > 20_000 && values > 200_000, "{messages} messages, {values} values");
}
