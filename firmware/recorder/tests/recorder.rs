//! The recorder on a card in memory: what happens to sectors when the card is pulled, swapped, full or failing.

mod common;

use std::cell::RefCell;
use std::rc::Rc;

use common::{MIB_BLOCKS, MemCard, held};
use hums_blackbox::{Header, SECTOR_BYTES, Sector, SectorSink, Writer};
use hums_core::time::Instant;
use hums_recorder::card::Card;
use hums_recorder::{CardState, CardStatus, LogName, Recorder, Written};

struct Sink(Vec<Sector>);

impl SectorSink for Sink {
    fn room(&self) -> usize {
        usize::MAX
    }

    fn put(&mut self, sector: &Sector) {
        self.0.push(*sector);
    }
}

/// Sectors of a made-up recording: `count` frames of 100 bytes that do not compress.
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

/// The sectors of one session that a card holds: (number, place) in the order of segments and blocks.
fn stored(device: &MemCard) -> Vec<(LogName, u32, Header)> {
    let status = CardStatus::new();
    let mut card =
        Card::mount(device.clone(), &status, held()).map_err(|(_, error)| error).expect("it mounts");
    let mut names = Vec::new();
    card.logs(|entry| names.push(entry.name)).expect("it lists");
    names.sort_unstable();
    let mut found = Vec::new();
    for name in names {
        card.open(name).expect("it opens");
        for at in 0..card.open_blocks() {
            let mut block = [0; SECTOR_BYTES];
            card.read(at, &mut block).expect("it reads");
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
    let mut recorder = Recorder::new(device.clone(), &status, held(), 7);
    let all = sectors(2_000);
    let mut now_ms = 0;
    for (index, sector) in all.iter().enumerate() {
        device.broken.set((100..110).contains(&index) && now_ms < 5_000);
        let mut sector = *sector;
        while recorder.write(Instant::from_millis(now_ms), &mut sector) == Written::Later {
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
fn on_another_card_the_next_group_begins_a_session_and_the_rest_is_counted() {
    let first = MemCard::formatted(64 * MIB_BLOCKS);
    let second = MemCard::new(64 * MIB_BLOCKS);
    hums_recorder::format::format(&second, 99).expect("it formats");
    let slot = Slot(Rc::new(RefCell::new(first.clone())));
    let status = CardStatus::new();
    let mut recorder = Recorder::new(slot.clone(), &status, held(), 7);
    let all = sectors(2_000);
    for sector in &all[..100] {
        assert_eq!(recorder.write(Instant::ZERO, &mut sector.clone()), Written::Done);
    }
    first.broken.set(true);
    assert_eq!(recorder.write(Instant::from_millis(10), &mut all[100].clone()), Written::Later);
    *slot.0.borrow_mut() = second.clone();
    for sector in &all[100..] {
        assert_eq!(recorder.write(Instant::from_millis(2_000), &mut sector.clone()), Written::Done);
    }
    first.broken.set(false);
    let (before, after) = (numbers(&first), numbers(&second));
    assert_eq!(before, (0..100).collect::<Vec<_>>());
    let group = all[100..].iter().find(|sector| sector.starts_group()).expect("there is one").number();
    assert_eq!(after, (group..all.len() as u32).collect::<Vec<_>>());
    let lost: u32 = all[100..group as usize].iter().map(|sector| u32::from(sector.frames())).sum();
    assert_eq!(status.read().frames_lost, lost);
}

/// A slot whose card can be exchanged.
#[derive(Clone)]
struct Slot(Rc<RefCell<MemCard>>);

impl embedded_sdmmc::BlockDevice for Slot {
    type Error = common::Broken;
    fn read(
        &self,
        blocks: &mut [embedded_sdmmc::Block],
        at: embedded_sdmmc::BlockIdx,
    ) -> Result<(), Self::Error> {
        self.0.borrow().read(blocks, at)
    }
    fn write(
        &self,
        blocks: &[embedded_sdmmc::Block],
        at: embedded_sdmmc::BlockIdx,
    ) -> Result<(), Self::Error> {
        self.0.borrow().write(blocks, at)
    }
    fn num_blocks(&self) -> Result<embedded_sdmmc::BlockCount, Self::Error> {
        self.0.borrow().num_blocks()
    }
}

impl hums_recorder::CardDevice for Slot {}

#[test]
fn a_full_card_overwrites_its_oldest_log_and_keeps_the_newest() {
    let device = MemCard::formatted(40 * MIB_BLOCKS);
    let status = CardStatus::new();
    let sessions = 40;
    for session in 0..sessions {
        let mut recorder = Recorder::new(device.clone(), &status, held(), session);
        for sector in sectors(100) {
            assert_eq!(recorder.write(Instant::ZERO, &mut sector.clone()), Written::Done);
        }
        recorder.finish();
    }
    let names: Vec<_> = stored(&device).into_iter().map(|(name, ..)| name.session).collect();
    assert_eq!(names.iter().max(), Some(&sessions));
    assert!(*names.iter().min().unwrap() > 1, "the oldest one is gone");
    assert!(status.read().segments_overwritten > 0);
}

#[test]
fn a_card_without_room_or_logs_is_told_full() {
    let device = MemCard::formatted(40 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut card =
        Card::mount(device.clone(), &status, held()).map_err(|(_, error)| error).expect("it mounts");
    // Fill the card with a log, then make it somebody else's file.
    let name = LogName { session: 5, segment: 0 };
    card.create(name, (card.layout().data_bytes() - 1_024) as u32).expect("it fits");
    let root = card.layout().data_start;
    drop(card);
    device.blocks.borrow_mut().get_mut(&root).expect("the directory")[8..11].copy_from_slice(b"JPG");
    let mut recorder = Recorder::new(device.clone(), &status, held(), 1);
    assert_eq!(recorder.write(Instant::ZERO, &mut sectors(10)[0].clone()), Written::Later);
    assert_eq!(status.read().state, CardState::Full);
}

#[test]
fn a_torn_partial_never_takes_the_older_copy_with_it() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut recorder = Recorder::new(device.clone(), &status, held(), 1);
    let (mut writer, mut sink) = (Box::new(Writer::new()), Sink(Vec::new()));
    let mut places = Vec::new();
    for copy in 0..4 {
        writer.frame(Instant::from_millis(copy), &[0xFD; 30], false, &mut sink).expect("there is room");
        let mut partial = Sector::zeroed();
        assert!(writer.partial(&mut partial));
        assert_eq!(recorder.write(Instant::ZERO, &mut partial), Written::Done);
        places.push(device.journal.borrow().last().expect("a write").0);
    }
    assert!(sink.0.is_empty(), "the sector is still in progress");
    assert!(places.windows(2).all(|pair| pair[0].abs_diff(pair[1]) == 1), "{places:?}");
    assert_eq!(stored(&device).len(), 2, "the newest copy and the one before");
}
