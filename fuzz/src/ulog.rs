//! Any bytes behind the header of a PX4 log. Reading ends, its times never fall, each row has as many values as its
//! table has columns, and the number of all columns is limited.

use std::collections::BTreeMap;
use std::sync::Arc;

use hums::source::item::{Item, Needs, Reader as _, Rows};
use hums::source::ulog::Ulog;
use hums_core::clock::Instant;

/// Columns of all tables at most: `COLUMNS_MAX` of the reader, and its own tables.
const COLUMNS_MAX: usize = 65_536 + 7;

/// The header, at 1 s.
const HEADER: [u8; 16] = [b'U', b'L', b'o', b'g', 1, 0x12, 0x35, 1, 0x40, 0x42, 0x0f, 0, 0, 0, 0, 0];

/// Reads the input as a log, with a header if it lacks one.
pub fn check(data: &[u8]) {
    let bytes = if data.starts_with(&HEADER[..7]) { data.to_vec() } else { [&HEADER[..], data].concat() };
    let mut last = Instant::ZERO;
    let mut tables = BTreeMap::new();
    let want = Needs { observations: true, rows: Rows::All, ..Needs::default() };
    let _ = Ulog::new(bytes.as_slice()).read(want, &mut |at, item| {
        assert!(at >= last, "time falls from {last:?} to {at:?}");
        last = at;
        if let Item::Row(row) = item {
            assert_eq!(row.values.len(), row.table.columns.len(), "{}", row.table.name);
            tables.insert(row.table.name.clone(), Arc::clone(row.table));
        }
        Ok(())
    });
    let columns: usize = tables.values().map(|table| table.columns.len()).sum();
    assert!(columns <= COLUMNS_MAX, "{columns} columns");
}

/// A log with a few topics of PX4, for the corpus.
pub fn log() -> Vec<u8> {
    let mut out = HEADER.to_vec();
    let mut message = |kind: u8, parts: &[&[u8]]| {
        let body = parts.concat();
        out.extend((body.len() as u16).to_le_bytes());
        out.push(kind);
        out.extend(body);
    };
    message(b'B', &[&[0; 40]]);
    message(b'I', &[&[16], b"char[3] sys_name", b"PX4"]);
    message(b'P', &[&[18], b"int32_t MAV_SYS_ID", &1_i32.to_le_bytes()]);
    message(b'Q', &[&[1, 7], b"float A", &0.5_f32.to_le_bytes()]);
    let topics: [&[u8]; 4] = [
        b"vehicle_status:uint64_t timestamp;uint8_t arming_state;uint8_t nav_state;bool failsafe;uint8_t system_type;",
        b"vehicle_attitude:uint64_t timestamp;float[4] q;",
        b"esc_status:uint64_t timestamp;uint8_t esc_count;esc_report[2] esc;uint8_t[3] _padding0;",
        b"esc_report:int32_t esc_rpm;float esc_voltage;float esc_current;",
    ];
    for topic in topics {
        message(b'F', &[topic]);
    }
    for (id, name) in [&b"vehicle_status"[..], b"vehicle_attitude", b"esc_status"].into_iter().enumerate() {
        message(b'A', &[&[0, id as u8, 0], name]);
    }
    for second in 2..6_u64 {
        let time = (second * 1_000_000).to_le_bytes();
        message(b'D', &[&[0, 0], &time, &[2, 4, 0, 2]]);
        message(b'D', &[&[1, 0], &time, &[0, 0, 128, 63], &[0; 12]]);
        message(b'D', &[&[2, 0], &time, &[2], &[7; 24]]);
        message(b'S', &[&[0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12]]);
        message(b'L', &[b"4", &time, b"low battery"]);
        message(b'O', &[&[20, 0]]);
    }
    out
}
