//! Container tests: entries read back as written, around any damaged sectors.

use std::collections::HashSet;

use hums_blackbox::record::{Mark, MarkReason, Note};
use hums_blackbox::{Cause, ENTRY_SECTORS_MAX, Entry, Full, Record, Sector, SectorSink, Writer};
use hums_core::clock::Instant;
use hums_dialect::crc;
use proptest::prelude::*;

use crate::log::{self, End, Item};

const SESSION: u32 = 0xfeed_0001;

struct Queue {
    sectors: Vec<Sector>,
    capacity: usize,
}

impl SectorSink for Queue {
    fn room(&self) -> usize {
        self.capacity - self.sectors.len()
    }

    fn put(&mut self, sector: &Sector) {
        assert!(self.room() > 0, "the writer exceeds the room it was given");
        self.sectors.push(*sector);
    }
}

fn queue() -> Queue {
    Queue { sectors: Vec::new(), capacity: 1 << 20 }
}

type Frame = (u64, Vec<u8>, bool);

fn frames(count: usize, seed: u32) -> Vec<Frame> {
    let mut state = seed | 1;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 16
    };
    (0..count)
        .map(|index| {
            let len = 8 + (random() % 40) as usize;
            let bytes: Vec<u8> = (0..len).map(|_| random() as u8).collect();
            let verified = index % 7 != 0 && !may_be_a_frame(&bytes);
            (index as u64 * 3, bytes, verified)
        })
        .collect()
}

fn may_be_a_frame(bytes: &[u8]) -> bool {
    matches!(bytes, [0xfd | 0xfe, ..])
}

fn write(frames: &[Frame], finish: bool) -> Vec<Sector> {
    let (mut writer, mut queue) = (Box::new(Writer::new()), queue());
    for (at, bytes, verified) in frames {
        writer.frame(Instant::from_millis(*at), bytes, *verified, &mut queue).expect("room");
    }
    if finish {
        assert!(writer.finish(&mut queue));
    }
    queue.sectors.iter_mut().for_each(|sector| sector.seal(SESSION));
    queue.sectors
}

#[derive(Default)]
pub(crate) struct Log {
    pub(crate) frames: Vec<Frame>,
    pub(crate) gaps: Vec<hums_blackbox::Gap>,
    pub(crate) records: usize,
    pub(crate) notes: Vec<String>,
    pub(crate) end: End,
}

pub(crate) fn read<'a>(blocks: impl IntoIterator<Item = &'a [u8; 512]>) -> Log {
    let mut log = Log::default();
    log.end = log::read(blocks, |item| match item {
        Item::Entry(Entry::Frame { at, bytes, verified }) => {
            log.frames.push((at.as_millis(), bytes.to_vec(), verified));
        }
        Item::Entry(Entry::Record { record, .. }) => {
            log.records += 1;
            if let Record::Note(note) = record {
                log.notes.push(note.text.to_owned());
            }
        }
        Item::Gap(gap) => log.gaps.push(gap),
    });
    log
}

fn bytes(sectors: &[Sector]) -> Vec<[u8; 512]> {
    sectors.iter().map(|sector| *sector.bytes()).collect()
}

fn is_subsequence(part: &[Frame], whole: &[Frame]) -> bool {
    let mut whole = whole.iter();
    part.iter().all(|frame| whole.any(|other| other == frame))
}

#[test]
fn a_clean_log_reads_back_over_several_groups() {
    let frames = frames(3_000, 1);
    let sectors = write(&frames, true);
    assert!(sectors.iter().filter(|sector| sector.starts_group()).count() > 2);
    let log = read(&bytes(&sectors));
    assert_eq!(log.frames, frames);
    assert_eq!(log.gaps, []);
    assert!(log.end.closed);
    let counted: u32 = sectors.iter().map(|sector| u32::from(sector.frames())).sum();
    assert_eq!(counted, 3_000);
}

#[test]
fn a_log_that_stops_anywhere_reads_up_to_its_last_full_sector() {
    let frames = frames(1_500, 2);
    let blocks = bytes(&write(&frames, true));
    for len in 0..blocks.len() {
        let log = read(&blocks[..len]);
        let counted: usize =
            blocks[..len].iter().map(|block| usize::from(Sector::from_bytes(*block).frames())).sum();
        assert_eq!(log.frames, frames[..counted], "{len} sectors");
        assert_eq!(log.gaps, []);
        assert!(!log.end.closed);
    }
}

#[test]
fn a_missing_or_damaged_sector_costs_at_most_the_rest_of_its_group() {
    let frames = frames(3_000, 3);
    let blocks = bytes(&write(&frames, true));
    for victim in (0..blocks.len()).step_by(5) {
        for damage in [false, true] {
            let mut blocks = blocks.clone();
            if damage {
                blocks[victim][100] ^= 4;
            } else {
                blocks.remove(victim);
            }
            let log = read(&blocks);
            assert!(is_subsequence(&log.frames, &frames));
            let last = victim + 1 == blocks.len() + usize::from(!damage);
            if !last || damage {
                assert_eq!(log.gaps.len(), 1, "sector {victim}");
            }
            if let Some(missing) = log.gaps.first().and_then(|gap| gap.frames)
                && victim > 0
                && log.gaps[0].to.is_some()
            {
                assert_eq!(log.frames.len() + missing as usize, frames.len(), "sector {victim}");
            }
            assert!(log.frames.len() + 64 * 30 > frames.len());
        }
    }
}

#[test]
fn partial_copies_in_both_places_are_superseded_or_complete_the_log() {
    let frames = frames(400, 4);
    let (mut writer, mut queue) = (Box::new(Writer::new()), queue());
    let mut medium: Vec<[u8; 512]> = Vec::new();
    let mut second_place = false;
    for (count, (at, bytes, verified)) in frames.iter().enumerate() {
        writer.frame(Instant::from_millis(*at), bytes, *verified, &mut queue).expect("room");
        medium.truncate(queue.sectors.len().max(medium.len()));
        for (place, sector) in queue.sectors.iter().enumerate() {
            let mut sector = *sector;
            sector.seal(SESSION);
            medium.resize(medium.len().max(place + 1), [0; 512]);
            medium[place] = *sector.bytes();
        }
        let mut partial = Sector::zeroed();
        if count % 3 == 0 && writer.partial(&mut partial) {
            partial.seal(SESSION);
            let place = queue.sectors.len() + usize::from(second_place);
            second_place = !second_place;
            medium.resize(medium.len().max(place + 1), [0; 512]);
            medium[place] = *partial.bytes();
            let log = read(&medium);
            assert_eq!(log.frames, frames[..=count]);
            assert_eq!(log.gaps, []);
        }
    }
}

#[test]
fn a_copy_is_made_only_of_a_sector_with_something_new() {
    let (mut writer, mut queue, mut copy) = (Box::new(Writer::new()), queue(), Sector::zeroed());
    for (at, bytes, verified) in frames(50, 4) {
        writer.frame(Instant::from_millis(at), &bytes, verified, &mut queue).expect("room");
        let sectors = queue.sectors.len();
        assert!(writer.partial(&mut copy) || sectors > 0);
        assert!(!writer.partial(&mut copy), "nothing came since the last copy");
    }
}

#[test]
fn stale_sectors_and_zeros_after_the_end_are_no_part_of_the_log() {
    let (old, new) = (frames(300, 5), frames(100, 6));
    let mut old = write(&old, true);
    for sector in &mut old {
        sector.seal(7);
    }
    let mut blocks = bytes(&write(&new, true));
    blocks.push([0; 512]);
    blocks.extend(bytes(&old));
    let log = read(&blocks);
    assert_eq!(log.frames, new);
    assert_eq!(log.gaps, []);
    let counts = log.end.blocks;
    assert_eq!((counts.empty, counts.stale), (1, old.len() as u64));
}

#[test]
fn a_full_queue_refuses_without_harm() {
    let frames = frames(2_000, 8);
    let (mut writer, mut queue) = (Box::new(Writer::new()), Queue { sectors: Vec::new(), capacity: 8 });
    let (mut card, mut taken, mut refused) = (Vec::new(), Vec::new(), 0);
    for (index, (at, bytes, verified)) in frames.iter().enumerate() {
        match writer.frame(Instant::from_millis(*at), bytes, *verified, &mut queue) {
            Ok(()) => taken.push(frames[index].clone()),
            Err(full) => {
                assert_eq!(full, Full::NoRoom);
                assert!(queue.room() < ENTRY_SECTORS_MAX);
                refused += 1;
            }
        }
        if index % 300 == 299 {
            card.append(&mut queue.sectors);
        }
    }
    card.append(&mut queue.sectors);
    assert!(writer.finish(&mut queue));
    card.append(&mut queue.sectors);
    for sector in &mut card {
        sector.seal(SESSION);
    }
    assert!(refused > 0);
    let log = read(&bytes(&card));
    assert_eq!(log.frames, taken);
    assert_eq!(log.gaps, []);
}

#[test]
fn records_stand_among_frames_and_restart_begins_a_group() {
    let (mut writer, mut queue) = (Box::new(Writer::new()), queue());
    for index in 0..50_u64 {
        let text = format!("note {index}");
        let note = Record::Note(Note { severity: 6, text: &text });
        writer.record(Instant::from_millis(index), &note, &mut queue).expect("room");
        writer.frame(Instant::from_millis(index), &[index as u8; 12], false, &mut queue).expect("room");
        if index == 24 {
            assert!(writer.restart(&mut queue));
        }
    }
    assert!(writer.finish(&mut queue));
    queue.sectors.iter_mut().for_each(|sector| sector.seal(SESSION));
    let log = read(&bytes(&queue.sectors));
    assert_eq!(log.frames.len(), 50);
    assert_eq!(log.notes.len(), 50);
    assert_eq!(log.notes[49], "note 49");
    assert_eq!(queue.sectors.iter().filter(|sector| sector.starts_group()).count(), 2);
    let start = queue.sectors.iter().rposition(Sector::starts_group).expect("a group");
    let log = read(&bytes(&queue.sectors[start..]));
    assert_eq!((log.frames.len(), log.gaps.len()), (25, 0));
}

#[derive(Clone, Copy, Debug)]
enum Misplaced {
    Swapped,
    Copied,
    /// Twice, later ones moved back.
    Inserted,
}

#[test]
fn a_page_in_a_wrong_place_costs_no_more_than_the_groups_that_it_touches() {
    let frames = frames(9_000, 3);
    let blocks = bytes(&write(&frames, true));
    let group = frames.len() / (blocks.len() / 64);
    for page in [1, 8, 32] {
        let pages = blocks.len() / page;
        for (one, other) in [(0, pages - 1), (1, pages / 2), (pages / 3, pages - 2), (2, 3), (pages - 1, 1)] {
            for how in [Misplaced::Swapped, Misplaced::Copied, Misplaced::Inserted] {
                let mut damaged = blocks.clone();
                let (from, to) = (one * page, other * page);
                match how {
                    Misplaced::Swapped => (0..page).for_each(|at| damaged.swap(from + at, to + at)),
                    Misplaced::Copied => damaged.copy_within(from..from + page, to),
                    Misplaced::Inserted => {
                        let copy = damaged[from..from + page].to_vec();
                        damaged.splice(to..to, copy);
                    }
                }
                let what = format!("{how:?}: page {one} of {page} sectors, {other} of {pages}");
                let log = read(&damaged);
                assert!(is_subsequence(&log.frames, &frames), "{what}");
                let lost = frames.len() - log.frames.len();
                assert!(lost <= 4 * group, "{what}: {lost} frames of {} lost", frames.len());
                let end = &log.end;
                let noticed = end.blocks.misplaced > 0 || !log.gaps.is_empty() || !end.closed;
                assert!(noticed, "{what}: {end:?}");
            }
        }
    }
}

#[test]
fn sectors_behind_the_first_of_a_ring_are_left_over_and_not_misplaced() {
    let frames = frames(6_000, 9);
    let blocks = bytes(&write(&frames, true));
    let starts: Vec<_> =
        (0..blocks.len()).filter(|at| Sector::from_bytes(blocks[*at]).starts_group()).collect();
    let (first, last) = (starts[2], starts[starts.len() - 1]);
    let mut medium = blocks[first..].to_vec();
    medium.extend_from_slice(&blocks[blocks.len() - last..first]);
    let mut few = blocks[first..first + 9].to_vec();
    few.extend_from_slice(&blocks[40..60]);
    for medium in [medium, few] {
        let log = read(&medium);
        assert_eq!((log.gaps.len(), log.end.blocks.misplaced), (0, 0));
        assert!(!log.frames.is_empty() && !is_subsequence(&log.frames[..1], &frames[..1_000]));
    }
}

#[test]
fn an_end_mark_says_how_many_frames_came_before_it_and_is_read_from_the_copy_in_progress() {
    let (mut writer, mut queue) = (Box::new(Writer::new()), queue());
    for (index, (at, bytes, verified)) in frames(500, 4).iter().enumerate() {
        writer.frame(Instant::from_millis(*at), bytes, *verified, &mut queue).expect("room");
        if index % 100 != 99 {
            continue;
        }
        writer.mark(Instant::from_millis(*at), MarkReason::Landed, &mut queue).expect("room");
        let mut sectors = queue.sectors.clone();
        let mut partial = Sector::zeroed();
        if writer.partial(&mut partial) {
            sectors.push(partial);
        }
        for sector in &mut sectors {
            sector.seal(SESSION);
        }
        let (mut frames, mut last) = (0, None);
        log::read(sectors.iter().map(Sector::bytes), |item| match item {
            Item::Entry(Entry::Frame { .. }) => frames += 1,
            Item::Entry(Entry::Record { record: Record::Mark(mark), .. }) => last = Some((mark, frames)),
            _ => {}
        });
        let (Mark { why, sector, frames }, read) = last.expect("a mark");
        assert_eq!((why, frames, read), (MarkReason::Landed, index as u32 + 1, index + 1));
        assert!(sector as usize + 1 >= queue.sectors.len(), "{sector}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_bytes_come_back(
        entries in prop::collection::vec(
            (0_u64..5_000, prop::collection::vec(any::<u8>(), 0..=280), any::<bool>()),
            0..200,
        )
    ) {
        let mut at = 0;
        let frames: Vec<Frame> = entries
            .into_iter()
            .map(|(step, bytes, verified)| {
                at += step;
                let verified = verified && !may_be_a_frame(&bytes);
                (at, bytes, verified)
            })
            .collect();
        let log = read(&bytes(&write(&frames, true)));
        prop_assert_eq!(log.frames, frames);
        prop_assert_eq!(log.gaps, []);
    }

    #[test]
    fn no_blocks_whatever_panic_or_hang(
        seed in any::<u32>(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), 0_usize..512, any::<u8>(), any::<bool>()), 0..20),
    ) {
        let frames = frames(400, seed);
        let mut blocks = bytes(&write(&frames, true));
        for (index, at, value, reseal) in damage {
            let block = &mut blocks[index.index(frames.len() / 40)];
            block[at] ^= value;
            if reseal {
                let mut sector = Sector::from_bytes(*block);
                sector.seal(SESSION);
                *block = *sector.bytes();
            }
        }
        let log = read(&blocks);
        prop_assert!(log.frames.len() < 1_000_000);
    }
}

/// Heartbeats in three groups, with their sectors; `change` comes before the writer.
fn three_groups(change: impl Fn(usize, &mut Vec<u8>)) -> (Vec<Sector>, Vec<Frame>) {
    let (mut writer, mut queue, mut frames) = (Box::new(Writer::new()), queue(), Vec::new());
    for index in 0..1_500_u64 {
        let noise = index.wrapping_mul(0x9e37_79b9_7f4a_7c15).to_be_bytes();
        let mut frame = [&[0xfe, 9, index as u8, 1, 1, 0], &noise[..], &[3]].concat();
        let sum = crc::step(crc::update(crc::START, &frame[1..]), 50);
        frame.extend_from_slice(&sum.to_le_bytes());
        frames.push((10 * index, frame.clone(), true));
        change(index as usize, &mut frame);
        writer.frame(Instant::from_millis(10 * index), &frame, true, &mut queue).expect("room");
        if index == 499 || index == 999 {
            assert!(writer.restart(&mut queue));
        }
    }
    assert!(writer.finish(&mut queue));
    queue.sectors.iter_mut().for_each(|sector| sector.seal(SESSION));
    (queue.sectors, frames)
}

fn strangers(log: &Log, frames: &[Frame], sectors: &[Sector]) -> (usize, usize) {
    let most = sectors.iter().map(|sector| usize::from(sector.frames())).max().unwrap_or(0);
    let came: HashSet<&Frame> = frames.iter().collect();
    (log.frames.iter().filter(|frame| !came.contains(frame)).count(), most)
}

#[test]
fn a_frame_that_changed_after_its_checksum_was_looked_at_is_told() {
    let (sectors, frames) = three_groups(|index, frame| {
        if index == 700 {
            frame[9] ^= 4;
        }
    });
    let log = read(&bytes(&sectors));
    let [gap] = log.gaps[..] else { panic!("{:?}", log.gaps) };
    assert_eq!(gap.cause, Cause::Altered);
    let from = gap.from.expect("frames before it").as_millis() as usize / 10;
    let (strangers, most) = strangers(&log, &frames, &sectors);
    assert!(strangers == 1 && (700..700 + most).contains(&from), "{strangers} wrong, {from}");
    assert_eq!((&log.frames[..700], &log.frames[from + 1..]), (&frames[..700], &frames[1_000..]));
    assert_eq!(gap.frames, Some(999 - from as u32));
}

#[test]
fn a_sector_that_changed_before_it_got_its_checksum_is_told() {
    let (sectors, frames) = three_groups(|_, _| {});
    let second = 1 + sectors[1..].iter().position(Sector::starts_group).expect("three groups");
    for at in (0..7).chain(11..19).chain((19..508).step_by(5)) {
        for (victim, bit) in [(second, at % 8), (second + 3, (at + 3) % 8)] {
            let mut changed = sectors.clone();
            let mut bytes_of = *changed[victim].bytes();
            bytes_of[at] ^= 1 << bit;
            changed[victim] = Sector::from_bytes(bytes_of);
            changed[victim].seal(SESSION);
            let log = read(&bytes(&changed));
            let (strangers, most) = strangers(&log, &frames, &sectors);
            let is_whole = log.frames == frames;
            assert!(is_whole || !log.gaps.is_empty(), "byte {at}: {} frames, untold", log.frames.len());
            assert!(strangers <= most, "byte {at}: {strangers} wrong, of {most} in a sector");
            assert!(
                log.frames.len() + 501 > frames.len() || log.frames.ends_with(&frames[1_000..]),
                "byte {at}"
            );
        }
    }
}

#[test]
fn each_group_goes_on_from_the_check_that_the_sector_before_it_has() {
    let (sectors, _) = three_groups(|_, _| {});
    let mut check = 0;
    for sector in &sectors {
        let header = hums_blackbox::Header::read(sector.bytes()).expect("a sector");
        if let Some(preamble) = sector.preamble() {
            assert_eq!(preamble.chain, check);
        }
        check = header.check;
    }
    assert!(sectors.iter().filter(|sector| sector.starts_group()).count() == 3 && check != 0);
}
