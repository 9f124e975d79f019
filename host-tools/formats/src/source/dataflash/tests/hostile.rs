//! Hostile bytes: no panic, bounded memory, rising time ([`Seen`](super::Seen)).

use super::super::binary::{Binary, Piece, Window};
use super::super::format::Formats;
use super::read;
use super::writer::Writer;

fn small() -> Vec<u8> {
    let mut log = Writer::new();
    log.format(160, "MSG", "QZ", "TimeUS,Message");
    log.format(161, "GPS", "QBIHBcLLeffff", "TimeUS,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw");
    log.format(162, "PARM", "QNf", "TimeUS,Name,Value");
    log.attitudes(1..3);
    log.units(150, "sddd", "FBBB");
    log.message(2.5, "ArduCopter V4.6.3 (92b0cd78)");
    log.raw(162, &[&2_600_000_u64.to_le_bytes(), b"LOG_DISARMED\0\0\0\0", &0_f32.to_le_bytes()]);
    log.raw(161, &[&[9; 50]]);
    log.attitudes(3..6);
    log.bytes
}

#[test]
fn a_log_that_is_cut_anywhere_is_read_up_to_there() {
    let whole = small();
    for length in 0..whole.len() {
        let part = whole.get(..length).unwrap_or_default();
        let (seen, _) = read(part).expect("damage is no failure");
        let damaged: u64 = seen.gaps.iter().map(|gap| gap.2).sum();
        assert!(damaged < 258, "cut at {length}: {:?}", seen.gaps);
    }
}

#[test]
fn the_first_part_of_a_log_has_the_messages_that_its_reading_has_whatever_is_damaged() {
    let whole = small();
    for at in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes.iter_mut().skip(at).take(1 + at % 7).for_each(|byte| *byte ^= 0x5A);
        let mut all = Formats::new();
        for kind in [128, 150, 160, 161, 162] {
            all.lengths.told[kind] = if kind == 128 { 89 } else { 27 };
        }
        let (mut window, mut first) = (Window::new(&bytes), Vec::new());
        let lengths = &mut all.lengths.clone();
        while let Some((kind, payload, place, _)) = window.next(lengths) {
            first.push((kind, payload.to_vec(), place as u64));
        }
        let (mut binary, mut read) = (Binary::new(&bytes[..]), Vec::new());
        while let Some(piece) = binary.next(&mut all.lengths).expect("memory") {
            if let Piece::Message { kind, payload, place, .. } = piece {
                read.push((kind, payload.to_vec(), place));
            }
        }
        assert_eq!(first, read, "damaged at {at}");
    }
}

#[test]
fn a_definition_of_every_length_is_survived() {
    for length in 0..=u8::MAX {
        for characters in ["", "Q", "QZZZZZZZ", "?", "QQQQQQQQQQQQQQQQ"] {
            let mut log = Writer::new();
            log.attitudes(0..1);
            log.format_of(160, length, "ODD", characters, "TimeUS,A,B,C");
            log.bytes.extend([0xA3, 0x95, 160].repeat(200));
            log.attitudes(1..40);
            let (seen, _) = read(&log.bytes).expect("damage is no failure");
            let last = seen.rows.last().is_some_and(|row| row.starts_with("ATT 39000000"));
            assert!(last, "{length} {characters}: {:?}", seen.gaps);
        }
    }
}

#[test]
fn a_file_that_redefines_for_ever_takes_no_memory() {
    let mut log = Writer::new();
    for round in 0..20_000_u32 {
        let columns = format!("TimeUS,A{round}");
        log.format(160, "X", "QB", &columns);
        log.raw(160, &[&u64::from(round).to_le_bytes(), &[1]]);
    }
    let want = super::Needs { rows: super::Rows::All, ..super::Needs::default() };
    let mut names = std::collections::BTreeSet::new();
    let mut rows = 0;
    let summary = super::binary(&log.bytes[..], want, &mut |_, item| {
        if let super::Item::Row(row) = item {
            rows += 1;
            names.insert(row.table.name.clone());
        }
        Ok(())
    });
    assert!(summary.is_ok() && rows > 20_000);
    assert!(names.len() < 30, "{}", names.len());
}

#[test]
fn bytes_that_look_like_heads_for_ever_take_no_time() {
    let mut log = Writer::new();
    log.attitudes(1..2);
    log.bytes.extend([0xA3, 0x95, 150].repeat(400_000));
    let started = std::time::Instant::now();
    assert!(read(&log.bytes).is_ok());
    assert!(started.elapsed().as_secs() < 20, "{:?}", started.elapsed());
}
