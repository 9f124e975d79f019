//! Golden files: version 3 on the card. They never change; a new version adds its own.
//!
//! `mixed-3.log` holds frames and records made by `stream` below, in several groups. To write it anew (only before
//! the version is published): `HUMS_GOLDEN=write cargo test -p hums-blackbox golden::`.

use crate::{card, container};

use std::path::PathBuf;

use card::Card;
use hums_blackbox::record::{Boot, Clock, Moment, Note, Stats, Usage};
use hums_blackbox::{Record, SECTOR_BYTES, Writer};
use hums_core::clock::Instant;
use hums_dialect::crc;

fn stream() -> Vec<(u64, Vec<u8>, bool)> {
    let mut frames = Vec::new();
    let mut state = 1_u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 16
    };
    let mut sequence = 0_u8;
    for index in 0..6_000_u32 {
        let time_ms = 10 * index + random() % 3;
        let noise = random() as f32 * 1e-6;
        let attitude: Vec<u8> = time_ms
            .to_le_bytes()
            .into_iter()
            .chain([0.1_f32, -0.2, 1.5].into_iter().flat_map(|angle| (angle + noise).to_le_bytes()))
            .chain([noise, 2.0 * noise, -noise].into_iter().flat_map(f32::to_le_bytes))
            .collect();
        let hud: Vec<u8> = [12.25_f32, 12.5, (index / 7) as f32 * 0.01, noise]
            .into_iter()
            .flat_map(f32::to_le_bytes)
            .chain([(index % 360) as u8, ((index % 360) >> 8) as u8, 55, 0])
            .collect();
        let mut named = time_ms.to_le_bytes().to_vec();
        named.extend_from_slice(&(index as f32).to_le_bytes());
        named.extend_from_slice(if index % 2 == 0 { b"alpha\0\0\0\0\0" } else { b"beta\0\0\0\0\0\0" });
        let (id, payload, extra) = match index % 5 {
            0 | 1 => (30, attitude, 39),
            2 => (74, hud, 20),
            3 => (251, named, 170),
            _ => (0, vec![0, 0, 0, 0, 2, 3, 81, 4, 3], 50),
        };
        let v1 = index % 50 == 4;
        let signed = index % 97 == 0;
        let id = if index % 211 == 0 { 0x00ab_cdef } else { id };
        let extra = if index % 301 == 0 { extra ^ 0x55 } else { extra };
        let system = if index % 5 == 4 { 255 } else { 1 };
        let mut body = payload;
        if !v1 {
            body.truncate(body.iter().rposition(|&byte| byte != 0).map_or(1, |last| last + 1));
        }
        let [a, b, c, _] = u32::to_le_bytes(id);
        let mut bytes = if v1 && id < 256 {
            vec![0xfe, body.len() as u8, sequence, system, 1, a]
        } else {
            vec![0xfd, body.len() as u8, u8::from(signed), 0, sequence, system, 1, a, b, c]
        };
        bytes.extend_from_slice(&body);
        let sum = crc::step(crc::update(crc::START, &bytes[1..]), extra);
        bytes.extend_from_slice(&sum.to_le_bytes());
        if signed && bytes[0] == 0xfd {
            bytes.push(7);
            bytes.extend_from_slice(&u64::from(index).to_le_bytes()[..6]);
            bytes.extend_from_slice(&u64::from(random()).to_le_bytes()[..6]);
        }
        if index % 500 == 7 {
            frames.push((u64::from(time_ms), bytes.clone(), true));
        }
        frames.push((u64::from(time_ms), bytes, index % 301 != 0 && id < 0x1_0000));
        if index % 31 != 0 {
            sequence = sequence.wrapping_add(1);
        }
    }
    let mut latest = 0;
    for frame in &mut frames {
        latest = frame.0.max(latest);
        frame.0 = latest;
    }
    frames
}

fn write() -> Vec<u8> {
    let (mut writer, mut card) = (Box::new(Writer::new()), Card::default());
    let boot = Boot { version: "1.0.0", git: "golden", board: "test", boots: 3, ..Boot::default() };
    writer.record(Instant::ZERO, &Record::Boot(boot), &mut card).expect("room");
    for (index, (at, bytes, verified)) in stream().iter().enumerate() {
        let at = Instant::from_millis(*at);
        writer.frame(at, bytes, *verified, &mut card).expect("room");
        if index == 100 {
            let clock = Clock { boot: at, utc_micros: 1_700_000_000_000_000, source: 1 };
            writer.record(at, &Record::Clock(clock), &mut card).expect("room");
        }
        if index % 1_000 == 999 {
            let stats = Stats { frames_in: index as u64, ..Stats::default() };
            writer.record(at, &Record::Stats(stats), &mut card).expect("room");
            let note = Note { severity: 6, text: "a thousand more" };
            writer.record(at, &Record::Note(note), &mut card).expect("room");
            let counters = [(0, index as f32 / 8.0), (1, 0.0), (7, -1.5), (8, f32::NAN)];
            writer
                .record(at, &Record::Usage(Usage::new(Moment::Periodic, &counters)), &mut card)
                .expect("room");
            // An unknown kind with a time, halves and bytes; and one with a head that counts too much.
            let [a, b, c, d, ..] = at.as_micros().to_le_bytes();
            let known =
                [200, 0x1f, 3, 4, a, b, c, d, 0, 0, 0, 0, 1, 2, 3, 4, 0, 0, 9, 0, 0, 0x80, 255, 255, 1, 2];
            writer.record(at, &Record::read(&known), &mut card).expect("room");
            writer.record(at, &Record::read(&[201, 1, 200, 0, 5]), &mut card).expect("room");
        }
    }
    assert!(writer.finish(&mut card));
    card.0.iter().flat_map(|sector| *sector.bytes()).collect()
}

fn golden() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/mixed-3.log"))
}

#[test]
fn the_writer_writes_version_3_as_it_always_did() {
    let log = write();
    if std::env::var("HUMS_GOLDEN").is_ok_and(|word| word == "write") {
        std::fs::write(golden(), &log).expect("writable");
    }
    let expected = std::fs::read(golden()).expect("the golden file");
    assert!(log == expected, "the coded form has changed: that is a new version of the format");
}

#[test]
fn the_reader_reads_version_3() {
    let log = std::fs::read(golden()).expect("the golden file");
    let log = container::read(log.as_chunks::<SECTOR_BYTES>().0);
    assert!(log.frames == stream() && log.gaps.is_empty());
    assert_eq!(log.records, 32);
    assert!(log.end.closed && log.end.groups >= 2, "{:?}", log.end);
}
