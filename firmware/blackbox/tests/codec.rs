//! The codec, from outside: any input of a link comes back bit for bit, with its times.

use crate::log::{self, Item};
use crate::{card, common, container, frames};

use card::Card;
use common::Random;
use frames::{Frame, checksum, frames_of};
use hums_blackbox::record::{Clock, Note, RECORD_BYTES_MAX};
use hums_blackbox::{
    Assembler, Entry, FRAME_BYTES_MAX, GroupDecoder, Outline, Record, SECTOR_BYTES, Sector, Writer,
};
use hums_core::clock::Instant;
use proptest::prelude::*;

fn read(sectors: &[Sector]) -> (Vec<Frame>, Vec<String>) {
    let log = container::read(sectors.iter().map(Sector::bytes));
    assert_eq!(log.gaps, []);
    (log.frames, log.notes)
}

fn round_trip(frames: &[Frame]) -> usize {
    let (mut writer, mut card) = (Box::new(Writer::new()), Card::default());
    for (at, bytes, verified) in frames {
        writer.frame(Instant::from_millis(*at), bytes, *verified, &mut card).expect("room");
    }
    writer.finish(&mut card);
    let (found, _) = read(&card.0);
    assert_eq!(found.len(), frames.len());
    for (index, (found, expected)) in found.iter().zip(frames).enumerate() {
        assert_eq!(found, expected, "frame {index}");
    }
    card.0.len() * SECTOR_BYTES
}

impl Random {
    fn chance(&mut self, one_in: usize) -> bool {
        self.below(one_in) == 0
    }
}

#[derive(Clone, Copy, Debug)]
struct Link {
    messages: usize,
    /// One in this many; 0: none.
    odd_one_in: usize,
    signed: bool,
}

/// Messages of the dialect whose fields wander, both versions, some signed, some odd.
fn stream(seed: u64, count: usize, link: Link) -> Vec<Frame> {
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let all = hums_dialect::messages();
    let ids: Vec<_> = (0..link.messages).map(|_| &all[random.below(all.len())]).collect();
    let mut payloads: Vec<Vec<u8>> =
        ids.iter().map(|message| vec![0; usize::from(message.len_max)]).collect();
    let (mut sequence, mut at, mut signature_time) = (0_u8, 1_000_u64, 1 << 40_u64);
    let mut frames: Vec<Frame> = Vec::new();
    for _ in 0..count {
        let which = random.below(ids.len());
        let (message, payload) = (ids[which], &mut payloads[which]);
        for _ in 0..random.below(4) {
            if let Some(place) = (!payload.is_empty()).then(|| random.below(payload.len())) {
                payload[place] = match random.below(3) {
                    0 => payload[place].wrapping_add(1),
                    1 => 0,
                    _ => random.next() as u8,
                };
            }
        }
        let odd = link.odd_one_in > 0 && random.chance(link.odd_one_in);
        let kind = if odd { 1 + random.below(9) } else { 0 };
        at += if random.chance(4) { random.next() % 400 } else { 0 };
        if kind == 1 {
            sequence = sequence.wrapping_add(random.next() as u8);
        }
        let id = if kind == 2 { 0x0080_0000 | message.id } else { message.id };
        let v1 = kind == 3 && id < 256;
        let mut body = payload.clone();
        match kind {
            4 => body.truncate(body.len() / 2),
            5 => body.resize(255, random.next() as u8),
            _ => {}
        }
        if v1 {
            body.truncate(usize::from(message.len_base));
        } else if kind != 6 {
            let len = body.iter().rposition(|&byte| byte != 0).map_or(1, |last| last + 1);
            body.resize(len, 0);
        }
        let system = if kind == 7 { random.next() as u8 } else { 1 };
        let [a, b, c, _] = id.to_le_bytes();
        let mut bytes = if v1 {
            vec![0xfe, body.len() as u8, sequence, system, 1, a]
        } else {
            vec![0xfd, body.len() as u8, u8::from(link.signed), 0, sequence, system, 1, a, b, c]
        };
        bytes.extend_from_slice(&body);
        let bad = kind == 8;
        let crc = if bad { random.next() as u16 } else { checksum(&bytes[1..], message.crc_extra) };
        let verified = !bad && id == message.id;
        bytes.extend_from_slice(&crc.to_le_bytes());
        if link.signed && !v1 {
            signature_time += random.next() % 3_000;
            bytes.push(7);
            bytes.extend_from_slice(&u64::to_le_bytes(signature_time)[..6]);
            bytes.extend_from_slice(&random.next().to_le_bytes()[..6]);
        }
        if kind == 9
            && let Some((_, last, verified)) = frames.last().cloned()
        {
            frames.push((at, last, verified));
            continue;
        }
        sequence = sequence.wrapping_add(1);
        frames.push((at, bytes, verified));
    }
    frames
}

#[test]
fn a_calm_link_is_small_and_comes_back() {
    let frames = stream(7, 20_000, Link { messages: 30, odd_one_in: 0, signed: false });
    let bytes: usize = frames.iter().map(|frame| frame.1.len() + 8).sum();
    let log = round_trip(&frames);
    assert!(log * 4 < bytes, "{log} of {bytes}");
}

#[test]
fn a_rough_link_comes_back() {
    round_trip(&stream(8, 20_000, Link { messages: 60, odd_one_in: 5, signed: false }));
}

/// Every seventh entry in full. Returns time, id, length and verification.
fn outlines(sectors: &[Sector]) -> Vec<(u64, u32, usize, bool)> {
    let id = |bytes: &[u8]| match *bytes {
        [0xfe, _, _, _, _, id, ..] => u32::from(id),
        [0xfd, _, _, _, _, _, _, a, b, c, ..] => u32::from_le_bytes([a, b, c, 0]),
        _ => panic!("no frame: {bytes:?}"),
    };
    let (mut assembler, mut decoder) = (Assembler::new(), Box::new(GroupDecoder::new()));
    let mut steps = Vec::new();
    for sector in sectors {
        assembler.feed(sector.bytes());
        steps.extend(assembler.next());
    }
    assembler.end();
    steps.extend(std::iter::from_fn(|| assembler.next()));
    let mut found = Vec::new();
    for step in &steps {
        decoder.push(&step.header, &step.sector).expect("in order");
        loop {
            let next = if found.len() % 7 == 0 {
                decoder.next_entry().map(|entry| entry.map(Outline::Whole))
            } else {
                decoder.next_outline()
            };
            match next.map(|outline| outline.expect("sound")) {
                Some(Outline::Frame { at, id, bytes, verified }) => {
                    found.push((at.as_millis(), id, bytes, verified));
                }
                Some(Outline::Whole(Entry::Frame { at, bytes, verified })) => {
                    found.push((at.as_millis(), id(bytes), bytes.len(), verified));
                }
                Some(Outline::Whole(Entry::Record { .. })) => {}
                None => break,
            }
        }
    }
    found
}

#[test]
fn an_outline_says_of_a_frame_what_the_frame_says() {
    for (messages, odd_one_in, signed) in [(30, 0, false), (60, 5, false), (400, 3, true)] {
        let frames = stream(13, 10_000, Link { messages, odd_one_in, signed });
        let (mut writer, mut card) = (Box::new(Writer::new()), Card::default());
        for (at, bytes, verified) in &frames {
            writer.frame(Instant::from_millis(*at), bytes, *verified, &mut card).expect("room");
        }
        writer.finish(&mut card);
        let found = outlines(&card.0);
        assert_eq!(found.len(), frames.len());
        for ((at, id, len, verified), (expected_at, bytes, expected)) in found.into_iter().zip(&frames) {
            let expected_id = match bytes[0] {
                0xfe => u32::from(bytes[5]),
                _ => u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]),
            };
            assert_eq!((at, id, len, verified), (*expected_at, expected_id, bytes.len(), *expected));
        }
    }
}

#[test]
fn frames_with_flags_that_we_know_need_no_more_than_their_outline() {
    let frames = [
        vec![0xfe, 1, 0, 1, 1, 200, 7, 1, 2],
        vec![0xfd, 1, 0, 0, 1, 1, 1, 3, 2, 1, 7, 1, 2],
        [&[0xfd, 1, 1, 0, 2, 1, 1, 4, 3, 2, 7, 1, 2][..], &[9; 13]].concat(),
        vec![0xfd, 1, 2, 0, 3, 1, 1, 5, 4, 3, 7, 1, 2],
    ];
    let (mut writer, mut card) = (Box::new(Writer::new()), Card::default());
    for bytes in &frames {
        writer.frame(Instant::ZERO, bytes, false, &mut card).expect("room");
    }
    assert!(writer.finish(&mut card));
    let (mut assembler, mut decoder) = (Assembler::new(), Box::new(GroupDecoder::new()));
    assembler.feed(card.0[0].bytes());
    assembler.end();
    while let Some(step) = assembler.next() {
        decoder.push(&step.header, &step.sector).expect("in order");
    }
    for (id, len) in [(200, 9), (0x01_0203, 13), (0x02_0304, 26)] {
        let outline = Outline::Frame { at: Instant::ZERO, id, bytes: len, verified: false };
        assert_eq!(decoder.next_outline(), Some(Ok(outline)));
    }
    let whole = Entry::Frame { at: Instant::ZERO, bytes: &frames[3], verified: false };
    assert_eq!(decoder.next_outline(), Some(Ok(Outline::Whole(whole))));
}

#[test]
fn signed_frames_come_back() {
    round_trip(&stream(9, 10_000, Link { messages: 20, odd_one_in: 20, signed: true }));
}

#[test]
fn more_messages_and_senders_than_the_model_holds_come_back() {
    let link = Link { messages: 400, odd_one_in: 2, signed: false };
    round_trip(&stream(10, 20_000, link));
}

#[test]
fn the_longest_frames_without_any_pattern_come_back() {
    let mut random = Random(11);
    let frames: Vec<Frame> = (0..500)
        .map(|index| {
            let mut bytes: Vec<u8> = (0..FRAME_BYTES_MAX).map(|_| random.next() as u8).collect();
            if index % 2 == 0 {
                bytes[..3].copy_from_slice(&[0xfd, 255, 1]);
            }
            (index * 40_000_000_000, bytes, index % 3 == 0)
        })
        .take_while(|frame| frame.0 < 1 << 48)
        .collect();
    round_trip(&frames);
}

#[test]
fn records_among_frames_come_back_in_order() {
    let frames = stream(12, 3_000, Link { messages: 20, odd_one_in: 10, signed: false });
    let (mut writer, mut card) = (Box::new(Writer::new()), Card::default());
    let clock = Clock { boot: Instant::ZERO, utc_micros: 1_700_000_000_000_000, source: 1 };
    writer.record(Instant::ZERO, &Record::Clock(clock), &mut card).expect("room");
    for (index, (at, bytes, verified)) in frames.iter().enumerate() {
        let at = Instant::from_millis(*at);
        writer.frame(at, bytes, *verified, &mut card).expect("room");
        if index % 10 == 0 {
            let text = format!("note {index}");
            writer.record(at, &Record::Note(Note { severity: 5, text: &text }), &mut card).expect("room");
        }
    }
    writer.finish(&mut card);
    let (found, notes) = read(&card.0);
    assert_eq!(found, frames);
    assert_eq!(notes.len(), 300);
    assert_eq!(notes[299], "note 2990");
}

#[test]
fn records_of_any_shape_and_with_any_numbers_come_back() {
    let mut random = Random(13);
    let stored: Vec<Vec<u8>> = (0..3_000)
        .map(|index| {
            let (words, halves) = (random.below(125), random.below(10));
            let calm = random.below(2) == 0;
            // Sometimes with more or less than in the head, and up to the longest; with constant and jumping numbers.
            let len = match index % 10 {
                0 => random.below(RECORD_BYTES_MAX + 1),
                1 => RECORD_BYTES_MAX,
                _ => (4 + 4 * words + 2 * halves + random.below(20)).min(RECORD_BYTES_MAX),
            };
            let mut bytes: Vec<u8> = (0..len).map(|_| if calm { 7 } else { random.next() as u8 }).collect();
            let head =
                [100 + (index % 40) as u8, 1 + 0x10 * random.below(4) as u8, words as u8, halves as u8];
            bytes.iter_mut().zip(head).for_each(|(place, byte)| *place = byte);
            bytes
        })
        .filter(|bytes| bytes.len() >= 2)
        .collect();
    let (mut writer, mut card) = (Box::new(Writer::new()), Card::default());
    for (index, bytes) in stored.iter().enumerate() {
        let at = Instant::from_millis(index as u64 * 7);
        writer.record(at, &Record::read(bytes), &mut card).expect("room");
    }
    writer.finish(&mut card);
    let mut expected = stored.iter().enumerate();
    log::read(card.0.iter().map(Sector::bytes), |item| match item {
        Item::Entry(Entry::Record { at, record }) => {
            let (index, bytes) = expected.next().expect("no more than were written");
            assert_eq!((at.as_millis(), record), (index as u64 * 7, Record::read(bytes)));
        }
        other => panic!("{other:?}"),
    });
    assert_eq!(expected.next(), None);
}

#[test]
fn recorded_flights_come_back() {
    // The repository's own recordings; `HUMS_FLIGHTS` names further folders, separated by colons.
    let own = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/flights").to_owned();
    let more = std::env::var("HUMS_FLIGHTS").unwrap_or_default();
    let mut flights = 0;
    for folder in std::iter::once(own.as_str()).chain(more.split(':').filter(|folder| !folder.is_empty())) {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.extension().is_some_and(|extension| extension == "tlog") {
                let tlog = std::fs::read(&path).expect("readable");
                let frames = frames_of(&tlog);
                let log = round_trip(&frames);
                println!("{}: {} -> {log}", path.display(), tlog.len());
                assert!(log * 4 < tlog.len(), "{}", path.display());
                flights += 1;
            }
        }
    }
    println!("{flights} recordings; the made-up streams above stand in where there are none");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_stream_comes_back(
        seed in any::<u64>(),
        messages in 1_usize..120,
        odd_one_in in 0_usize..6,
        signed in any::<bool>(),
    ) {
        round_trip(&stream(seed, 600, Link { messages, odd_one_in, signed }));
    }

    #[test]
    fn damage_never_makes_up_a_frame(seed in any::<u64>(), bit in any::<prop::sample::Index>(), burst in 1_usize..64) {
        let frames = stream(seed, 1_500, Link { messages: 40, odd_one_in: 9, signed: false });
        let (mut writer, mut card) = (Box::new(Writer::new()), Card::default());
        for (at, bytes, verified) in &frames {
            writer.frame(Instant::from_millis(*at), bytes, *verified, &mut card).expect("room");
        }
        writer.finish(&mut card);
        let mut log: Vec<u8> = card.0.iter().flat_map(|sector| *sector.bytes()).collect();
        let first = bit.index(log.len() * 8 - burst);
        for bit in first..first + burst {
            log[bit / 8] ^= 1 << (bit % 8);
        }
        let (mut gaps, mut at) = (0, 0);
        let end = log::read(log.as_chunks::<SECTOR_BYTES>().0, |item| match item {
            Item::Entry(Entry::Frame { bytes, .. }) => {
                let found = frames[at..].iter().position(|frame| frame.1 == bytes);
                at += found.expect("a frame of the stream, in order") + 1;
            }
            Item::Gap(_) => gaps += 1,
            Item::Entry(Entry::Record { .. }) => {}
        });
        // If the last sector's header has lost its session and its number, the log is not closed.
        prop_assert!(gaps >= 1 || !end.closed);
    }
}
