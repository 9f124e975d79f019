//! The recorder on a card in memory: its sectors when the card is pulled, swapped, full or failing.

use crate::common;

use std::cell::RefCell;
use std::rc::Rc;

use common::{MIB_BLOCKS, MemCard, held};
use hums_blackbox::parity::{
    COLUMNS, Column, PARITY_SECTORS, Parity, STRETCH_SECTORS, data_blocks, parity_block,
};
use hums_blackbox::record::{LastSession, PreviousEnd};
use hums_blackbox::{Header, Sector, SectorSink, Writer};
use hums_core::clock::{Instant, Span};
use hums_recorder::card::Card;
use hums_recorder::recorder::ROW_BLOCKS;
use hums_recorder::{BLOCK_BYTES, Block, CardDevice, CardState, CardStatus, LogName, Recorder, WaitReason};

struct Sink(Vec<Sector>);

impl SectorSink for Sink {
    fn room(&self) -> usize {
        usize::MAX
    }

    fn put(&mut self, sector: &Sector) {
        self.0.push(*sector);
    }
}

/// `count` frames of 100 bytes that do not compress.
fn sectors(count: u32) -> Vec<Sector> {
    let (mut sink, mut writer) = (Sink(Vec::new()), Box::new(Writer::new()));
    let mut state = 1_u32;
    for index in 0..count {
        let noise: [u8; 100] = std::array::from_fn(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        });
        writer
            .frame(Instant::from_millis(u64::from(index)), &noise, false, &mut sink)
            .expect("there is room");
    }
    writer.finish(&mut sink);
    sink.0
}

fn put(
    recorder: &mut Recorder<'_, impl CardDevice>,
    now: Instant,
    sector: &Sector,
) -> Result<usize, WaitReason> {
    let mut waiting = [*sector.bytes()];
    loop {
        match recorder.write(now, &mut waiting) {
            Err(WaitReason::Searching) => {}
            written => return written,
        }
    }
}

fn write_all(recorder: &mut Recorder<'_, impl CardDevice>, sectors: &[Sector]) {
    let mut blocks: Vec<Block> = sectors.iter().map(|sector| *sector.bytes()).collect();
    let mut waiting = blocks.as_mut_slice();
    while !waiting.is_empty() {
        let done = recorder.write(Instant::ZERO, waiting).expect("a card that takes it");
        waiting = &mut waiting[done..];
    }
}

fn stored(device: &MemCard) -> Vec<(LogName, u32, Header)> {
    let status = CardStatus::new();
    let card = Card::mount(device, &status, held()).expect("it mounts");
    let mut names = Vec::new();
    card.logs(|entry| names.push(entry.name)).expect("it lists");
    names.sort_unstable();
    let mut found = Vec::new();
    for name in names {
        let mut segment = card.segment(name).expect("it is there");
        for at in 0..segment.blocks() {
            let mut block = [0; BLOCK_BYTES];
            card.read(&mut segment, at, &mut block).expect("it reads");
            if let Ok(header) = Header::read(&block) {
                found.push((name, at, header));
            }
        }
    }
    found
}

fn numbers(device: &MemCard) -> Vec<u32> {
    stored(device)
        .into_iter()
        .filter(|(.., header)| !header.partial)
        .map(|(.., header)| header.number)
        .collect()
}

#[test]
fn a_card_that_comes_back_goes_on_where_it_was() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut recorder = Recorder::new(&device, &status, held(), 7);
    let all = sectors(2_000);
    let mut now_ms = 0;
    for (index, sector) in all.iter().enumerate() {
        device.broken.set((100..110).contains(&index) && now_ms < 5_000);
        while put(&mut recorder, Instant::from_millis(now_ms), sector) == Err(WaitReason::Later) {
            assert_ne!(status.read().state, CardState::Recording);
            now_ms += 100;
            device.broken.set(now_ms < 5_000);
        }
    }
    assert_eq!(numbers(&device), (0..all.len() as u32).collect::<Vec<_>>());
    let names: Vec<_> = stored(&device).into_iter().map(|(name, ..)| name).collect();
    assert_eq!((names.first().unwrap().segment, names.last().unwrap().segment), (0, 1), "a new segment");
    assert_eq!(names.last().unwrap().session, 1, "the same session");
    assert!(status.take_group_wanted());
    assert!(status.read().write_errors > 0);
}

#[test]
fn a_segment_that_the_card_made_and_did_not_say_so_is_of_the_session() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut recorder = Recorder::new(&device, &status, held(), 7);
    let (all, unsaid) = (sectors(2_000), LogName { session: 1, segment: 1 });
    let mut now_ms = 0;
    for (index, sector) in all.iter().enumerate() {
        device.broken.set(index == 100);
        while put(&mut recorder, Instant::from_millis(now_ms), sector) == Err(WaitReason::Later) {
            device.broken.set(false);
            device.unsaid.set((now_ms < 2_500).then(|| unsaid.short()));
            now_ms += 100;
        }
    }
    let name = recorder.log_name().expect("it records");
    assert_eq!(name.session, 1);
    assert!(name > unsaid, "{name:?}");
    assert_eq!(numbers(&device), (0..all.len() as u32).collect::<Vec<_>>());
}

#[test]
fn on_another_card_the_next_group_begins_a_session_and_the_rest_is_counted() {
    let first = MemCard::formatted(64 * MIB_BLOCKS);
    let second = MemCard::new(64 * MIB_BLOCKS);
    hums_recorder::format::format(&second, 99).expect("it formats");
    let slot = Slot(Rc::new(RefCell::new(first.clone())));
    let status = CardStatus::new();
    let mut recorder = Recorder::new(&slot, &status, held(), 7);
    let all = sectors(2_000);
    for sector in &all[..100] {
        assert_eq!(put(&mut recorder, Instant::ZERO, sector), Ok(1));
    }
    first.broken.set(true);
    assert_eq!(put(&mut recorder, Instant::from_millis(10), &all[100]), Err(WaitReason::Later));
    *slot.0.borrow_mut() = second.clone();
    for sector in &all[100..] {
        assert_eq!(put(&mut recorder, Instant::from_millis(2_000), sector), Ok(1));
    }
    first.broken.set(false);
    let (before, after) = (numbers(&first), numbers(&second));
    assert_eq!(before, (0..100).collect::<Vec<_>>());
    let group = all[100..].iter().find(|sector| sector.starts_group()).expect("there is one").number();
    assert_eq!(after, (group..all.len() as u32).collect::<Vec<_>>());
    let lost: u32 = all[100..group as usize].iter().map(|sector| u32::from(sector.frames())).sum();
    assert_eq!(status.read().frames_lost, lost);
}

#[derive(Clone)]
struct Slot(Rc<RefCell<MemCard>>);

impl CardDevice for Slot {
    type Error = common::Broken;
    fn read(&self, blocks: &mut [Block], at: u32) -> Result<(), Self::Error> {
        self.0.borrow().read(blocks, at)
    }
    fn write(&self, blocks: &[Block], at: u32) -> Result<(), Self::Error> {
        self.0.borrow().write(blocks, at)
    }
    fn num_blocks(&self) -> Result<u32, Self::Error> {
        self.0.borrow().num_blocks()
    }
}

#[test]
fn a_full_card_overwrites_its_oldest_log_and_keeps_the_newest() {
    let device = MemCard::formatted(40 * MIB_BLOCKS);
    let status = CardStatus::new();
    let sessions = 40;
    for session in 0..sessions {
        let mut recorder = Recorder::new(&device, &status, held(), session);
        for sector in sectors(100) {
            assert_eq!(put(&mut recorder, Instant::ZERO, &sector), Ok(1));
        }
        recorder.finish();
    }
    let names = || stored(&device).into_iter().map(|(name, ..)| name.session).collect::<Vec<_>>();
    let before = names();
    assert_eq!(before.iter().max(), Some(&sessions));
    assert!(*before.iter().min().unwrap() > 1, "the oldest one is gone");
    assert!(status.read().segments_overwritten > 0);
    // A card whose logs must stay.
    device.keeps_logs.set(true);
    let mut recorder = Recorder::new(&device, &status, held(), sessions);
    assert_eq!(put(&mut recorder, Instant::ZERO, &sectors(10)[0]), Err(WaitReason::Later));
    assert_eq!((status.read().state, names()), (CardState::Full, before));
}

#[test]
fn a_card_without_room_or_logs_is_told_full() {
    let device = MemCard::formatted(40 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut card = Card::mount(&device, &status, held()).expect("it mounts");
    let name = LogName { session: 5, segment: 0 };
    card.create(name, (card.layout().data_bytes() - 1_024) as u32).expect("it fits");
    let root = card.layout().data_start;
    drop(card);
    device.blocks.borrow_mut().get_mut(&root).expect("the directory")[8..11].copy_from_slice(b"JPG");
    let mut recorder = Recorder::new(&device, &status, held(), 1);
    assert_eq!(put(&mut recorder, Instant::ZERO, &sectors(10)[0]), Err(WaitReason::Later));
    assert_eq!(status.read().state, CardState::Full);
}

#[test]
fn no_log_is_overwritten_while_there_is_room_that_nothing_points_to() {
    let device = MemCard::formatted(40 * MIB_BLOCKS);
    let record = |session: u32| {
        let status = CardStatus::new();
        let mut recorder = Recorder::new(&device, &status, held(), session);
        assert_eq!(put(&mut recorder, Instant::ZERO, &sectors(10)[0]), Ok(1));
        recorder.finish();
        status.read().segments_overwritten
    };
    for session in 1..=6 {
        assert_eq!(record(session), 0);
    }
    for hint in [2_u32, 3, 1000, 2500, u32::MAX] {
        device.blocks.borrow_mut().get_mut(&2049).expect("the information sector")[492..496]
            .copy_from_slice(&hint.to_le_bytes());
        let before = device.reads.get();
        assert_eq!(record(hint), 0, "hint {hint}");
        assert!(device.reads.get() - before < 2_000, "{} blocks read", device.reads.get() - before);
    }
    let mut names: Vec<_> = stored(&device).into_iter().map(|(name, ..)| name.session).collect();
    names.dedup();
    assert_eq!(names, (1..=11).collect::<Vec<_>>());
}

#[test]
fn a_torn_partial_never_takes_the_older_copy_with_it() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut recorder = Recorder::new(&device, &status, held(), 1);
    let (mut writer, mut sink) = (Box::new(Writer::new()), Sink(Vec::new()));
    let mut places = Vec::new();
    for copy in 0..4 {
        writer.frame(Instant::from_millis(copy), &[0xFD; 30], false, &mut sink).expect("there is room");
        let mut partial = Sector::zeroed();
        assert!(writer.partial(&mut partial));
        assert_eq!(put(&mut recorder, Instant::ZERO, &partial), Ok(1));
        places.push(device.journal.borrow().last().expect("a write").0);
    }
    assert!(sink.0.is_empty(), "the sector is still in progress");
    assert!(places.windows(2).all(|pair| pair[0].abs_diff(pair[1]) == 1), "{places:?}");
    assert_eq!(stored(&device).len(), 2, "the newest copy and the one before");
}

/// The finished sector is written at its own place; if the newest copy is there, a second copy exists by then.
#[test]
fn a_torn_whole_sector_never_takes_the_newest_copy_with_it() {
    for copies in 1..5_u64 {
        let device = MemCard::formatted(64 * MIB_BLOCKS);
        let status = CardStatus::new();
        let mut recorder = Recorder::new(&device, &status, held(), 1);
        let (mut writer, mut sink) = (Box::new(Writer::new()), Sink(Vec::new()));
        let mut frames = 0;
        for copy in 0..copies {
            writer.frame(Instant::from_millis(copy), &[0xFD; 30], false, &mut sink).expect("there is room");
            let mut partial = Sector::zeroed();
            assert!(writer.partial(&mut partial));
            frames = partial.frames();
            assert_eq!(put(&mut recorder, Instant::ZERO, &partial), Ok(1));
        }
        writer.finish(&mut sink);
        assert_eq!(put(&mut recorder, Instant::ZERO, &sink.0[0]), Ok(1));
        assert_eq!(numbers(&device), [0], "the sector itself is whole");
        let is_sector = |(_, bytes): &&(u32, [u8; 512])| Header::read(bytes).is_ok();
        let torn = device.journal.borrow().iter().rfind(is_sector).expect("a write").0;
        device.blocks.borrow_mut().get_mut(&torn).expect("written")[256..].fill(0);
        let left = stored(&device).into_iter().map(|(.., header)| header.frames).max();
        assert!(left >= Some(frames), "{copies} copies: {left:?} of {frames} frames");
    }
}

#[test]
fn sectors_that_wait_together_are_written_together() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut recorder = Recorder::new(&device, &status, held(), 7);
    let all = sectors(2_000);
    assert_eq!(recorder.write(Instant::ZERO, &mut []), Ok(0), "the segment is made");
    device.writes.set(0);
    write_all(&mut recorder, &all);
    assert_eq!(numbers(&device), (0..all.len() as u32).collect::<Vec<_>>());
    let (blocks, commands) = (all.len() as u32 + PARITY_SECTORS, device.writes.get());
    assert_eq!((status.read().blocks_written, status.read().writes), (blocks, commands));
    println!("{blocks} blocks in {commands} commands");
    assert!(commands * (ROW_BLOCKS as u32 - 1) < blocks, "{blocks} blocks in {commands} commands");
}

#[test]
fn a_write_that_fails_half_way_is_repeated_from_its_first_sector() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut recorder = Recorder::new(&device, &status, held(), 7);
    let all = sectors(60);
    assert_eq!(recorder.write(Instant::ZERO, &mut []), Ok(0), "the segment is made");
    device.fail_after.set(Some(5));
    write_all(&mut recorder, &all[..8]);
    assert_eq!(numbers(&device), (0..8).collect::<Vec<_>>());
    assert_eq!(status.read().write_errors, 1);
    assert!(stored(&device).iter().all(|(name, ..)| name.segment == 0), "no new segment was needed");
}

#[test]
fn a_card_that_refuses_writes_at_random_loses_no_earlier_log() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut earlier = Recorder::new(&device, &status, held(), 1);
    for sector in sectors(100) {
        assert_eq!(put(&mut earlier, Instant::ZERO, &sector), Ok(1));
    }
    earlier.finish();
    let before: Vec<_> = stored(&device).into_iter().map(|(name, ..)| name).collect();

    device.refused_permille.set(200);
    for session in 2..8 {
        let mut recorder = Recorder::new(&device, &status, held(), session);
        for row in sectors(2_000).chunks(8) {
            assert_eq!(recorder.write(Instant::ZERO, &mut []), Ok(0), "the segment is made");
            write_all(&mut recorder, row);
        }
        recorder.finish();
    }
    let after = stored(&device);
    let kept = after.iter().filter(|(name, ..)| before.contains(name)).count();
    assert_eq!(kept, before.len(), "the earlier session's sectors");
    let last = after.iter().map(|(name, ..)| name.session).max();
    assert_eq!(last, Some(7), "each session has its own log");
    assert_eq!(status.read().segments_overwritten, 0);
    assert!(status.read().write_errors > 500, "{:?}", status.read());
}

#[test]
fn lost_pages_are_made_again_from_parity() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut recorder = Recorder::new(&device, &status, held(), 7);
    let all = sectors(6_000);
    let (mut left, mut now) = (all.len() - 1, Instant::ZERO);
    for (index, sector) in all[..left].iter().enumerate() {
        if index == 700 {
            device.fail_after.set(Some(0));
        }
        now = now + Span::from_millis(if index == left - 1 { 10_000 } else { 1 });
        assert_eq!(put(&mut recorder, now, sector), Ok(1));
    }
    let status = CardStatus::new();
    let card = Card::mount(&device, &status, held()).expect("it mounts");
    let mut segment = card.segment(LogName { session: 1, segment: 0 }).expect("it is there");
    let blocks = segment.blocks();
    let mut read = |at: u32| {
        let mut block = [0; BLOCK_BYTES];
        card.read(&mut segment, at, &mut block).expect("it reads");
        block
    };
    assert_eq!(read(0)[11..15], [0; 4], "the first sector is where the file begins");
    let mut stretch = 0;
    while left > 0 {
        let sectors = (STRETCH_SECTORS as usize).min(left) as u32;
        let first = stretch * STRETCH_SECTORS;
        let header = Header::read(&read(first)).expect("a sector");
        assert!(first + sectors <= data_blocks(blocks));
        for column in 0..COLUMNS as u32 {
            let mut sums = Column::new(header.session);
            for sum in [column, column + COLUMNS as u32] {
                let block = read(parity_block(blocks, stretch) + sum);
                let parity = Parity::read(&block).expect("parity");
                assert!(
                    parity.last + COLUMNS as u32 >= first + sectors,
                    "all but what came after it is covered"
                );
                sums.sum(&parity, &block);
            }
            let rows = (first + column..first + sectors).step_by(COLUMNS);
            let lost: Vec<_> = rows.clone().filter(|at| [7, 23].contains(&((at - first) / 8))).collect();
            rows.filter(|at| !lost.contains(at)).for_each(|at| sums.sector(at, &read(at)));
            let made = sums.solve(&lost);
            for (lost, made) in lost.iter().zip(made) {
                assert_eq!(made.expect("it is made again").bytes(), &read(*lost), "sector {lost}");
            }
        }
        (stretch, left) = (stretch + 1, left - sectors as usize);
    }
    assert!(stretch >= 2, "{stretch} stretches");
}

#[test]
fn the_next_start_finds_where_the_session_before_ended() {
    for count in [0_u32, 1, 7, 100, 2_000, 30_000] {
        let device = MemCard::formatted(64 * MIB_BLOCKS);
        let status = CardStatus::new();
        let mut recorder = Recorder::new(&device, &status, held(), 7);
        let all = sectors(count);
        let written = if count == 0 { &[] } else { &all[..all.len() - 1] };
        assert_eq!(recorder.write(Instant::ZERO, &mut []), Ok(0), "the segment is made");
        for sector in written {
            assert_eq!(put(&mut recorder, Instant::ZERO, sector), Ok(1));
        }
        assert_eq!(status.take_before().map(|before| before.found), Some(PreviousEnd::Nothing));
        assert_eq!(status.take_before(), None, "told once");
        let frames = written.iter().map(|sector| u32::from(sector.frames())).sum();
        let before = found_at_next_start(&device);
        if written.is_empty() {
            assert_eq!((before.found, before.number), (PreviousEnd::Unreadable, 1));
            continue;
        }
        let session = stored(&device)[0].2.session;
        let check = check_of(written.last().expect("it is not empty"));
        let sectors = written.len() as u32;
        let expected = LastSession { found: PreviousEnd::Frames, number: 1, session, sectors, frames, check };
        assert_eq!(before, expected, "{count} frames");
        assert_eq!(
            Recorder::new(&device, &CardStatus::new(), held(), 9).write(Instant::ZERO, &mut []),
            Ok(0)
        );
        let again = found_at_next_start(&device);
        assert_eq!((again.session, again.sectors), (session, written.len() as u32));
    }
}

fn check_of(sector: &Sector) -> u32 {
    let mut sector = *sector;
    sector.seal(1);
    Header::read(sector.bytes()).expect("a sector").check
}

#[test]
fn the_end_of_the_session_before_is_found_behind_damaged_pages_and_stale_sectors() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut recorder = Recorder::new(&device, &status, held(), 7);
    let all = sectors(4_000);
    for sector in &all[..all.len() - 1] {
        assert_eq!(put(&mut recorder, Instant::ZERO, sector), Ok(1));
    }
    let (reads_before, whole) = (device.reads.get(), device.blocks.borrow().clone());
    let first =
        device.journal.borrow().iter().find(|(_, bytes)| Header::read(bytes).is_ok()).map(|(at, _)| *at);
    let first = first.expect("a sector was written");
    assert_eq!(found_at_next_start(&device).sectors, all.len() as u32 - 1);
    let reads = device.reads.get() - reads_before;
    // Some 80 of them are the FAT of the previous session, which is followed once in the search for room. Some 60 are
    // the new session's, up to its parity. Clusters of one block take 64 times the FAT of a large card.
    assert!(reads < 600, "{reads} blocks were read");
    for page in (1..all.len() as u32 / 8 - 1).step_by(3) {
        device.blocks.replace(whole.clone());
        for at in 8 * page..8 * page + 8 {
            device.blocks.borrow_mut().insert(first + at, [0xff; 512]);
        }
        let before = found_at_next_start(&device);
        assert_eq!(before.sectors, all.len() as u32 - 1, "page {page}");
    }
    device.blocks.replace(whole.clone());
    for at in 0..200 {
        let mut sector = Sector::from_bytes(*all[at].bytes());
        sector.seal(99);
        device.blocks.borrow_mut().insert(first + all.len() as u32 + at as u32, *sector.bytes());
    }
    assert_eq!(found_at_next_start(&device).sectors, all.len() as u32 - 1);
}

#[test]
fn the_end_is_found_wherever_power_goes_around_the_beginning_of_a_file() {
    let (mut begun, mut fuller_copies) = (0, 0);
    for older_sessions in [0, 20] {
        let device = MemCard::formatted(40 * MIB_BLOCKS);
        for session in 0..older_sessions {
            let mut recorder = Recorder::new(&device, leaked(), held(), session);
            for sector in sectors(300) {
                assert_eq!(put(&mut recorder, Instant::ZERO, &sector), Ok(1));
            }
        }
        device.journal.borrow_mut().clear();
        let mut blocks = device.blocks.borrow().clone();
        let session = record_files(&device);
        let (mut frames, mut newest, mut since_begun) = (0, None::<Header>, u32::MAX);
        for (at, block) in device.journal.take() {
            let held_before = blocks.insert(at, block).unwrap_or([0; 512]);
            let own = Header::read(&block).ok().filter(|header| header.session == session);
            let is_metadata = own.is_none() && Parity::read(&block).is_none();
            since_begun = if is_metadata { 0 } else { since_begun.saturating_add(1) };
            let (before, mut is_fuller) = (newest, false);
            if let Some(own) = own {
                match before.filter(|before| before.number == own.number) {
                    Some(before) if !before.partial => continue,
                    Some(before) => is_fuller = !own.partial && before.frames > own.frames,
                    None => {}
                }
                frames += if own.partial { 0 } else { u32::from(own.frames) };
                newest = Some(own);
            }
            fuller_copies += u32::from(is_fuller);
            let Some(newest) = newest.filter(|_| since_begun < 4 || is_fuller) else { continue };
            begun += u32::from(is_metadata);
            let card = MemCard::with(device.size, blocks.clone());
            let found = found_at_next_start(&card);
            let frames = frames + if newest.partial { u32::from(newest.frames) } else { 0 };
            let number = newest.number;
            let ends = (found.found, found.session, found.sectors, found.frames, found.check);
            assert_eq!(
                ends,
                (PreviousEnd::Frames, session, number + 1, frames, newest.check),
                "{older_sessions}, sector {number}"
            );
            let Some(before) = before.filter(|_| own.is_some()) else { continue };
            let mut torn = held_before;
            torn[..256].copy_from_slice(&block[..256]);
            card.blocks.borrow_mut().insert(at, torn);
            let found = found_at_next_start(&card);
            let ends = [before.number + 1, number + 1];
            assert!(found.session == session && ends.contains(&found.sectors), "{found:?} of {ends:?}");
        }
    }
    assert!(begun > 8 && fuller_copies > 0, "{begun} writes to begin files, {fuller_copies} fuller copies");
}

fn record_files(device: &MemCard) -> u32 {
    let status = leaked();
    let mut recorder = Recorder::new(device, status, held(), 99);
    let (mut writer, mut sink) = (Box::new(Writer::new()), Sink(Vec::new()));
    let mut partial = Sector::zeroed();
    let mut state = 1_u32;
    for index in 0..30_000_u32 {
        let now = Instant::from_millis(u64::from(index) * 50);
        if status.take_group_wanted() {
            assert!(writer.restart(&mut sink));
        }
        let noise: [u8; 250] = std::array::from_fn(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        });
        writer.frame(now, &noise[..=index as usize % 200], false, &mut sink).expect("there is room");
        for sector in sink.0.drain(..) {
            assert_eq!(put(&mut recorder, now, &sector), Ok(1));
        }
        if index % 5000 < 400 && writer.partial(&mut partial) {
            assert_eq!(put(&mut recorder, now, &partial), Ok(1));
        }
    }
    recorder.in_work().expect("it records").session
}

fn leaked() -> &'static CardStatus {
    Box::leak(Box::default())
}

#[test]
fn the_session_before_is_looked_for_once_the_first_sector_is_on_the_card() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let all = sectors(2_000);
    let earlier = CardStatus::new();
    let mut recorder = Recorder::new(&device, &earlier, held(), 7);
    for sector in &all {
        assert_eq!(put(&mut recorder, Instant::ZERO, sector), Ok(1));
    }
    drop(recorder);
    let status = CardStatus::new();
    let mut recorder = Recorder::new(&device, &status, held(), 8);
    assert_eq!(recorder.write(Instant::ZERO, &mut []), Ok(0));
    recorder.idle();
    assert_eq!(status.take_before(), None, "there is no sector yet");
    assert_eq!(put(&mut recorder, Instant::ZERO, &all[0]), Ok(1));
    assert_eq!(status.take_before(), None, "whatever waits is written first");
    recorder.idle();
    let before = status.take_before().expect("it was looked for");
    assert_eq!((before.number, before.sectors), (1, all.len() as u32));
    recorder.idle();
    assert_eq!(status.take_before(), None, "told once");
}

#[test]
fn the_only_log_of_a_full_card_is_looked_at_before_it_makes_room() {
    let device = MemCard::formatted(40 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut card = Card::mount(&device, &status, held()).expect("it mounts");
    card.create(LogName { session: 5, segment: 0 }, (card.layout().data_bytes() - 1_024) as u32)
        .expect("it fits");
    let all = sectors(200);
    for (at, sector) in (0..).zip(&all) {
        let mut sealed = *sector;
        sealed.seal(0x55);
        card.write(at, &[*sealed.bytes()]).expect("in place");
    }
    drop(card);
    let mut recorder = Recorder::new(&device, &status, held(), 1);
    for sector in &all {
        assert_eq!(put(&mut recorder, Instant::ZERO, sector), Ok(1));
        recorder.idle();
    }
    assert!(stored(&device).iter().all(|(name, ..)| name.session == 6), "it made room");
    let before = status.take_before().expect("it was looked for");
    assert_eq!((before.number, before.session, before.sectors), (5, 0x55, all.len() as u32));
}

fn found_at_next_start(device: &MemCard) -> LastSession {
    let whole = device.blocks.borrow().clone();
    let status = CardStatus::new();
    let mut recorder = Recorder::new(device, &status, held(), 8);
    assert_eq!(put(&mut recorder, Instant::ZERO, &sectors(1)[0]), Ok(1));
    recorder.idle();
    device.blocks.replace(whole);
    status.take_before().expect("it was looked for")
}

#[test]
fn a_folder_with_the_name_of_the_next_log_is_passed_by() {
    let device = MemCard::formatted(40 * MIB_BLOCKS);
    let record = |session| {
        let status = CardStatus::new();
        let mut recorder = Recorder::new(&device, &status, held(), session);
        assert_eq!(put(&mut recorder, Instant::ZERO, &sectors(10)[0]), Ok(1));
        recorder.log_name().expect("it records").session
    };
    assert_eq!((record(1), record(2)), (1, 2));
    // The second log becomes a folder.
    let name = LogName { session: 2, segment: 0 }.short();
    for block in device.blocks.borrow_mut().values_mut() {
        if let Some(at) = (0..512).step_by(32).find(|at| block[*at..].starts_with(&name)) {
            block[at + 11] |= 0x10;
        }
    }
    assert_eq!(record(3), 3);
}

#[test]
fn a_log_that_lost_its_part_of_the_fat_is_not_written_anew() {
    let device = MemCard::formatted(40 * MIB_BLOCKS);
    let record = |session, frames: u32| {
        let status = CardStatus::new();
        let mut recorder = Recorder::new(&device, &status, held(), session);
        let done = sectors(frames).iter().all(|sector| put(&mut recorder, Instant::ZERO, sector) == Ok(1));
        (done, recorder.log_name().map(|name| name.segment), status.read().state)
    };
    for session in 1..=15 {
        record(session, 10);
    }
    let fat = 2048 + 32;
    let end = [0xFF_u8; 512];
    device.blocks.borrow_mut().extend([(fat + 1, end), (fat + 2, end)]);
    assert_eq!(record(16, 1000), (true, Some(0), CardState::Recording));
    let names = || {
        let status = CardStatus::new();
        let card = Card::mount(&device, &status, held()).expect("it mounts");
        let mut names = Vec::new();
        card.logs(|entry| names.push(entry.name.session)).expect("it lists");
        names.sort_unstable();
        names
    };
    assert!(names().contains(&1) && names().contains(&16), "what the first one has stays: {:?}", names());
    let blocks = 600;
    device.blocks.borrow_mut().extend((fat..fat + blocks).map(|at| (at, end)));
    let before = names();
    assert_eq!(record(17, 1000), (false, None, CardState::Damaged));
    assert_eq!(names(), before);
}

#[test]
fn a_card_that_logs_fill_is_not_searched() {
    let device = MemCard::formatted(34 * MIB_BLOCKS);
    for session in 0..18 {
        let status = CardStatus::new();
        let mut recorder = Recorder::new(&device, &status, held(), session);
        let before = device.reads.get();
        assert_eq!(put(&mut recorder, Instant::ZERO, &sectors(10)[0]), Ok(1));
        assert_eq!(status.read().segments_overwritten, u32::from(session >= 15));
        // Its FAT has 540 blocks.
        assert!(device.reads.get() - before < 300, "{} blocks read", device.reads.get() - before);
        recorder.finish();
    }
}

#[test]
fn a_command_to_format_is_not_for_a_card_that_is_mounted_by_then() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let formatted = std::mem::take(&mut *device.blocks.borrow_mut());
    let status = CardStatus::new();
    let mut recorder = Recorder::new(&device, &status, held(), 7);
    assert_eq!(recorder.write(Instant::ZERO, &mut []), Err(WaitReason::Later));
    assert!(status.read().state.wants_format(), "{:?}", status.read().state);
    status.want_format();
    *device.blocks.borrow_mut() = formatted;
    let all = sectors(200);
    let now = Instant::from_millis(2_000);
    for sector in &all {
        assert_eq!(put(&mut recorder, now, sector), Ok(1));
        assert!(!recorder.format(now), "a mounted card is formatted");
        status.want_format();
    }
    assert_eq!(status.read().state, CardState::Recording);
    assert_eq!(numbers(&device), (0..all.len() as u32).collect::<Vec<_>>());
}
