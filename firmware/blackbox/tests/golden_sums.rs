//! Golden sums: length and CRC-32 of version 3's output for whole recordings and for a synthetic stream of all kinds
//! (`common/kinds.rs`). Like the golden files they never change. Writer and reader share the model, so a changed
//! model would still read back its own output: only fixed bytes show the change. A group names the table of layouts:
//! a new dialect (`layouts`) makes new sums, a new version of the format adds its own.

use crate::log::{self, Item};
use crate::{card, frames, kinds};

use std::path::Path;

use card::Card;
use frames::{Frame, checks, frame_len, frames_of};
use hums_blackbox::{Entry as ReadEntry, Record, SECTOR_BYTES, Writer};
use hums_core::clock::Instant;
use kinds::{Entry, entries};

fn write(batches: &[Vec<Entry>]) -> Vec<u8> {
    let (mut writer, mut card) = (Box::new(Writer::new()), Card::default());
    for batch in batches {
        for entry in batch {
            match entry {
                Entry::Frame(at, bytes, verified) => {
                    writer.frame(Instant::from_millis(*at), bytes, *verified, &mut card).expect("room");
                }
                Entry::Record(at, bytes) => {
                    let at = Instant::from_millis(*at);
                    writer.record(at, &Record::read(bytes), &mut card).expect("room");
                }
            }
        }
        assert!(writer.restart(&mut card));
    }
    assert!(writer.finish(&mut card));
    card.0.iter().flat_map(|sector| *sector.bytes()).collect()
}

/// Times only advance for the writer.
fn reads_back(log: &[u8], batches: &[Vec<Entry>]) {
    let (mut expected, mut latest) = (batches.iter().flatten(), 0);
    let end = log::read(log.as_chunks::<SECTOR_BYTES>().0, |item| match (item, expected.next()) {
        (Item::Entry(ReadEntry::Frame { at, bytes, verified }), Some(Entry::Frame(then, frame, fits))) => {
            latest = latest.max(*then);
            assert_eq!((at.as_millis(), bytes, verified), (latest, &frame[..], *fits));
        }
        (Item::Entry(ReadEntry::Record { at, record }), Some(Entry::Record(then, stored))) => {
            latest = latest.max(*then);
            assert_eq!((at.as_millis(), record), (latest, Record::read(stored)));
        }
        (item, entry) => panic!("{item:?} instead of {entry:?}"),
    });
    assert!(end.closed && expected.next().is_none(), "{end:?}");
}

/// CRC-32 as zlib computes it.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    })
}

/// Name, length, CRC-32.
type Sum = (&'static str, usize, u32);

fn sum_of(name: &'static str, batches: &[Vec<Entry>]) -> Sum {
    let log = write(batches);
    reads_back(&log, batches);
    (name, log.len(), crc32(&log))
}

const CHANGED: &str = "the coded form has changed: that is a new version of the format";

fn frames_of_line(line: &[u8]) -> Vec<Frame> {
    const MICROS_PER_BYTE: usize = 10_000_000 / 57_600;
    let (mut frames, mut at) = (Vec::new(), 0);
    while at < line.len() {
        let frame =
            frame_len(&line[at..]).and_then(|len| line.get(at..at + len)).filter(|frame| checks(frame));
        at += frame.map_or(1, <[u8]>::len);
        if let Some(frame) = frame {
            frames.push(((at * MICROS_PER_BYTE / 1_000) as u64, frame.to_vec(), true));
        }
    }
    frames
}

const RECORDINGS: [Sum; 4] = [
    ("ap_quad_guided.tlog", 346_112, 0x8222_db8b),
    ("ap_quad_faults.tlog", 466_432, 0xcd33_7f91),
    ("ap_quad_signed.raw", 433_152, 0x55ad_408b),
    ("px4_hil_quad_low.tlog", 214_016, 0x95a8_d5c9),
];

#[test]
fn recordings_are_coded_as_they_always_were() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/flights");
    let found = RECORDINGS.map(|(name, ..)| {
        let recording = std::fs::read(folder.join(name)).expect("readable");
        let frames = match name.rsplit_once('.') {
            Some((_, "raw")) => frames_of_line(&recording),
            _ => frames_of(&recording),
        };
        let batch = frames.into_iter().map(|(at, bytes, verified)| Entry::Frame(at, bytes, verified));
        sum_of(name, &[batch.collect()])
    });
    assert_eq!(found, RECORDINGS, "{CHANGED}");
}

/// Messages of a batch, entries, one odd frame in this many.
const MADE_UP: [(usize, usize, usize, Sum); 3] = [
    (16, 1_000, 0, ("calm", 427_008, 0xf89c_525e)),
    (20, 1_000, 6, ("rough", 411_648, 0x4b56_d140)),
    (400, 6_000, 10, ("more than the model holds", 281_088, 0x9d23_a544)),
];

#[test]
fn every_kind_of_message_and_value_and_oddity_is_coded_as_it_always_was() {
    let found = MADE_UP.map(|(at_once, count, odd_one_in, (name, ..))| {
        let batches = (100..).zip(hums_dialect::messages().chunks(at_once));
        let batches = batches.map(|(seed, messages)| entries(seed, messages, count, odd_one_in));
        sum_of(name, &batches.collect::<Vec<_>>())
    });
    assert_eq!(found, MADE_UP.map(|(.., sum)| sum), "{CHANGED}");
}
