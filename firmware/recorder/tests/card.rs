//! The card layer against a card in memory with a journal of block writes, so that power can be cut at each of them.

use crate::common;

use common::{Broken, MIB_BLOCKS, MemCard, held};
use hums_recorder::card::{Card, CardError, LogEntry};
use hums_recorder::format::{BLOCKS_MIN, FormatError, format};
use hums_recorder::layout::{Layout, LayoutError};
use hums_recorder::{BLOCK_BYTES, Block, CardState, CardStatus, LogName};

const FIRST: LogName = LogName { session: 1, segment: 0 };
const SECOND: LogName = LogName { session: 2, segment: 0 };

fn mount<'a>(card: &'a MemCard, status: &'a CardStatus) -> Card<'a, MemCard> {
    Card::mount(card, status, held()).expect("the card mounts")
}

fn logs(card: &Card<'_, MemCard>) -> Vec<LogEntry> {
    let mut logs = Vec::new();
    card.logs(|entry| logs.push(entry)).expect("the directory reads");
    logs
}

fn create(card: &mut Card<'_, MemCard>, name: LogName, bytes: u32) -> Result<(), CardError<Broken>> {
    loop {
        match card.create(name, bytes) {
            Err(CardError::Searching) => {}
            created => return created,
        }
    }
}

fn pattern(seed: u32) -> Block {
    std::array::from_fn(|index| (seed as usize * 31 + index) as u8)
}

#[test]
fn a_segment_reads_back_after_a_remount() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut card = mount(&device, &status);
    card.create(FIRST, 1 << 20).expect("there is room");
    assert_eq!(card.open_blocks(), 2048);
    for index in (0..2048).rev() {
        card.write(index, &[pattern(index)]).expect("in place");
    }
    drop(card);
    let mut card = mount(&device, &status);
    assert_eq!(logs(&card).iter().map(|log| (log.name, log.bytes)).collect::<Vec<_>>(), [(FIRST, 1 << 20)]);
    let mut segment = card.segment(FIRST).expect("it is there");
    let mut block = [0; BLOCK_BYTES];
    for index in 0..2048 {
        card.read(&mut segment, index, &mut block).expect("it reads");
        assert_eq!(block, pattern(index), "block {index}");
    }
    assert_eq!(card.read(&mut segment, 2048, &mut block), Err(CardError::NotFound));
    card.open(FIRST).expect("it is there");
    assert_eq!(card.write(2048, &[block]), Err(CardError::NotOpen));
}

#[test]
fn a_write_of_many_blocks_takes_one_command_for_each_row_of_clusters() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut card = mount(&device, &status);
    card.create(FIRST, 64 * 1024).expect("there is room");
    card.create(SECOND, 64 * 1024).expect("there is room");
    let layout = *card.layout();
    let cluster_of = |block: u32| (block - layout.data_start) / layout.cluster_blocks + 2;
    let first_of = |card: &mut Card<'_, MemCard>, name| {
        card.open(name).expect("it is there");
        device.journal.borrow_mut().clear();
        card.write(0, &[pattern(0)]).expect("in place");
        cluster_of(device.journal.borrow()[0].0)
    };
    let (first, second) = (first_of(&mut card, FIRST), first_of(&mut card, SECOND));
    drop(card);
    // After its fifth cluster the first segment goes on in the second one's, and the other way round.
    let link = |from: u32, to: u32| {
        let (block, offset) = (layout.fat_start + from / 128, from as usize % 128 * 4);
        device.blocks.borrow_mut().entry(block).or_insert([0; 512])[offset..offset + 4]
            .copy_from_slice(&to.to_le_bytes());
    };
    link(first + 4, second + 5);
    link(second + 4, first + 5);
    let mut card = mount(&device, &status);
    card.open(FIRST).expect("it is there");
    device.journal.borrow_mut().clear();
    device.writes.set(0);
    let all: Vec<Block> = (0..64).map(pattern).collect();
    let row = 5 * layout.cluster_blocks as usize;
    assert_eq!(card.write(0, &all), Ok(row));
    assert_eq!(card.write(row as u32, &all[row..]), Ok(64 - row));
    assert_eq!((device.writes.get(), device.journal.borrow().len()), (2, 64));
    let mut segment = card.segment(FIRST).expect("it is there");
    for index in (0..64).rev() {
        let mut block = [0; BLOCK_BYTES];
        card.read(&mut segment, index, &mut block).expect("it reads");
        assert_eq!(block, pattern(index), "block {index}");
    }
}

#[test]
fn writing_in_place_touches_neither_fat_nor_directory() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut card = mount(&device, &status);
    card.create(FIRST, 1 << 20).expect("there is room");
    device.journal.borrow_mut().clear();
    for index in 0..2048 {
        card.write(index, &[pattern(index)]).expect("in place");
    }
    assert_eq!(device.journal.borrow().len(), 2048);
    let layout = card.layout();
    let behind_root = layout.data_start + layout.cluster_blocks..layout.end();
    assert!(device.journal.borrow().iter().all(|(at, _)| behind_root.contains(at)), "only the segment");
}

/// Every prefix of the journal, whole and with the last block torn either way, is a valid card. All listed logs are
/// readable to their ends, and logs of earlier sessions are unchanged.
#[test]
fn a_cut_at_any_write_leaves_the_card_in_order() {
    let device = MemCard::formatted(40 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut card = mount(&device, &status);
    card.create(FIRST, 256 * 1024).expect("there is room");
    card.write(7, &[pattern(7)]).expect("in place");
    let before = device.blocks.borrow().clone();
    device.journal.borrow_mut().clear();
    card.create(SECOND, 4 << 20).expect("there is room");
    card.write(0, &[pattern(0)]).expect("in place");
    let oldest = logs(&card)[0];
    card.recycle(&oldest, LogName { session: 3, segment: 0 }).expect("it is there");
    card.write(1, &[pattern(1)]).expect("in place");

    let journal = device.journal.borrow().clone();
    assert!(journal.len() > 20 && journal.len() < 200, "{} writes", journal.len());
    let mut blocks = before;
    for (cut, (at, new)) in journal.iter().enumerate() {
        let old = blocks.get(at).copied().unwrap_or([0; 512]);
        for torn in 0..3 {
            let mut block = if torn == 0 { old } else { *new };
            match torn {
                1 => block[256..].copy_from_slice(&old[256..]),
                2 => block[..256].copy_from_slice(&old[..256]),
                _ => {}
            }
            let mut after = blocks.clone();
            after.insert(*at, block);
            check_in_order(&MemCard::with(device.size, after), cut);
        }
        blocks.insert(*at, *new);
    }
}

fn check_in_order(device: &MemCard, cut: usize) {
    let status = CardStatus::new();
    let card = mount(device, &status);
    let found = logs(&card);
    assert!(!found.is_empty() && found.len() <= 2, "cut {cut}: {found:?}");
    for log in found {
        let opened = card.segment(log.name).map_err(|error| format!("cut {cut}: {}: {error}", log.name));
        let mut segment = opened.expect("it is there");
        let mut block = [0; BLOCK_BYTES];
        for index in 0..segment.blocks() {
            card.read(&mut segment, index, &mut block)
                .map_err(|error| format!("cut {cut}: {} {index}: {error}", log.name))
                .expect("it reads");
            if log.name == FIRST && index == 7 {
                assert_eq!(block, pattern(7), "cut {cut}");
            }
        }
    }
}

#[test]
fn a_full_card_says_so_and_keeps_its_free_clusters() {
    let device = MemCard::formatted(40 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut card = mount(&device, &status);
    card.create(FIRST, 30 << 20).expect("there is room");
    assert_eq!(create(&mut card, SECOND, 30 << 20), Err(CardError::Full));
    card.create(SECOND, 4 << 20).expect("what is left can still be used");
    assert_eq!(logs(&card).len(), 2);
}

#[test]
fn a_recycled_segment_keeps_its_size_under_its_new_name() {
    let device = MemCard::formatted(40 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut card = mount(&device, &status);
    card.create(FIRST, 1 << 20).expect("there is room");
    let oldest = logs(&card)[0];
    device.journal.borrow_mut().clear();
    card.recycle(&oldest, SECOND).expect("it is there");
    assert_eq!(device.journal.borrow().len(), 1, "one block write");
    assert_eq!(logs(&card).iter().map(|log| (log.name, log.bytes)).collect::<Vec<_>>(), [(SECOND, 1 << 20)]);
    assert_eq!(card.recycle(&oldest, FIRST), Err(CardError::Damaged), "the entry is another one now");
}

#[test]
fn a_directory_of_more_than_a_cluster_grows() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut card = mount(&device, &status);
    for session in 1..=60 {
        card.create(LogName { session, segment: 0 }, 64 * 1024).expect("there is room");
    }
    assert_eq!(logs(&card).len(), 60);
}

#[test]
fn cards_that_cannot_be_used_are_told_and_left_alone() {
    let status = CardStatus::new();
    let reason = |card: &MemCard| Card::mount(card, &status, held()).err();
    let empty = MemCard::new(64 * MIB_BLOCKS);
    assert_eq!(reason(&empty), Some(CardError::Foreign(LayoutError::NoPartitionTable)));
    let damage = |at: u32, offset: usize, bytes: &[u8]| {
        let card = MemCard::formatted(64 * MIB_BLOCKS);
        let mut blocks = card.blocks.borrow_mut();
        blocks.entry(at).or_insert([0; 512])[offset..offset + bytes.len()].copy_from_slice(bytes);
        drop(blocks);
        card
    };
    assert_eq!(reason(&damage(0, 450, &[7])), Some(CardError::Foreign(LayoutError::NotFat32(7))));
    for (offset, bytes) in [
        (11, &[0, 4][..]),
        (13, &[0]),
        (13, &[3]),
        (16, &[0]),
        (36, &[255; 4]),
        (32, &[255; 4]),
        (44, &[255; 4]),
    ] {
        let card = damage(2048, offset, bytes);
        assert!(
            matches!(reason(&card), Some(CardError::Foreign(LayoutError::BadVolume(_)))),
            "offset {offset}: {:?}",
            reason(&card)
        );
        assert!(card.journal.borrow().is_empty());
    }
    let broken = MemCard::formatted(64 * MIB_BLOCKS);
    broken.broken.set(true);
    assert_eq!(reason(&broken), Some(CardError::Device(Broken)));
}

#[test]
fn a_fat_full_of_nonsense_is_an_error_and_never_a_panic() {
    let mut state = 0x9E37_79B9_u32;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state
    };
    for round in 0..200 {
        let device = MemCard::formatted(40 * MIB_BLOCKS);
        let status = CardStatus::new();
        let mut card = mount(&device, &status);
        card.create(FIRST, 512 * 1024).expect("there is room");
        let layout = *card.layout();
        drop(card);
        for _ in 0..40 {
            let span = if random() % 2 == 0 { 4 } else { layout.data_start - layout.fat_start + 2 };
            let at = layout.fat_start + random() % span;
            let offset = random() as usize % 128 * 4;
            let value = if random() % 2 == 0 { random() } else { random() % (layout.clusters + 4) };
            let mut blocks = device.blocks.borrow_mut();
            blocks.entry(at).or_insert([0; 512])[offset..offset + 4].copy_from_slice(&value.to_le_bytes());
        }
        if let Ok(mut card) = Card::mount(&device, &status, held()) {
            let _ = card.logs(|_| {});
            let _ = card.create(SECOND, 512 * 1024);
            let _ = card.open(FIRST);
            let mut block = [0; BLOCK_BYTES];
            let Ok(mut segment) = card.segment(FIRST) else { continue };
            for index in 0..segment.blocks().min(5_000) {
                if card.read(&mut segment, index, &mut block).is_err() || card.write(index, &[block]).is_err()
                {
                    break;
                }
            }
        }
        assert_eq!(status.read().state, CardState::Unknown, "round {round}");
    }
}

#[test]
fn a_card_too_small_for_fat32_is_not_formatted() {
    let card = MemCard::new(BLOCKS_MIN - 1);
    assert_eq!(format(&card, 1), Err(FormatError::TooSmall));
    assert!(card.journal.borrow().is_empty());
    format(&MemCard::new(BLOCKS_MIN), 1).expect("the smallest card");
}

const FAT_START: u32 = 2048 + 32;

fn change(device: &MemCard, at: u32, change: impl FnOnce(&mut [u8; 512])) {
    change(device.blocks.borrow_mut().entry(at).or_insert([0; 512]));
}

fn forget_hint(device: &MemCard) {
    change(device, 2048 + 1, |info| info[488..496].fill(0xFF));
}

fn set_hint(device: &MemCard, cluster: u32) {
    change(device, 2048 + 1, |info| info[492..496].copy_from_slice(&cluster.to_le_bytes()));
}

#[test]
fn a_damaged_information_sector_keeps_nobody_from_recording_and_is_mended() {
    for (at, bytes) in [(0, 512), (0, 16), (484, 4), (508, 4)] {
        let device = MemCard::formatted(64 * MIB_BLOCKS);
        let info = Layout::read(&device).expect("a card").info;
        change(&device, info, |block| block[at..at + bytes].fill(0));
        let status = CardStatus::new();
        mount(&device, &status).create(FIRST, 1 << 20).expect("there is room");
        assert!(logs(&mount(&device, &status)).iter().any(|log| log.name == FIRST));
        change(&device, info, |block| {
            assert_eq!(
                [&block[..4], &block[484..488], &block[508..]],
                [b"RRaA", b"rrAa", &[0, 0, 0x55, 0xAA]]
            );
        });
    }
}

#[test]
fn the_root_directory_is_no_free_cluster_where_its_fat_was_lost() {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    mount(&device, &status).create(FIRST, 1 << 20).expect("there is room");
    change(&device, FAT_START, |block| block[8..12].fill(0));
    change(&device, 2048 + 1, |info| info[492..496].copy_from_slice(&2_u32.to_le_bytes()));
    let mut card = mount(&device, &status);
    card.create(SECOND, 1 << 20).expect("there is room");
    card.write(0, &[pattern(9)]).expect("in place");
    assert_eq!(
        logs(&mount(&device, &status)).iter().map(|log| log.name).collect::<Vec<_>>(),
        [FIRST, SECOND]
    );
}

#[test]
fn a_log_whose_fat_was_lost_is_chained_again_and_not_written_over() {
    // The whole FAT, its beginning, its middle and its end.
    for lost in [0..17, 0..5, 5..9, 12..17] {
        let device = MemCard::formatted(64 * MIB_BLOCKS);
        let status = CardStatus::new();
        let mut card = mount(&device, &status);
        card.create(FIRST, 1 << 20).expect("there is room");
        for index in 0..2048 {
            card.write(index, &[pattern(index)]).expect("in place");
        }
        drop(card);
        for at in lost.clone() {
            // The first three entries are the media, the flags and the root directory.
            change(&device, FAT_START + at, |block| block[if at == 0 { 12 } else { 0 }..].fill(0));
        }
        forget_hint(&device);
        let mut card = mount(&device, &status);
        card.create(SECOND, 1 << 20).expect("there is room");
        for index in 0..2048 {
            card.write(index, &[pattern(9999)]).expect("in place");
        }
        let mut segment = card.segment(FIRST).expect("it is there");
        let mut block = [0; BLOCK_BYTES];
        // If the FAT goes on behind the lost part, only the place of the link to there is unknown.
        let blocks = if lost.end == 17 { 2048 } else { lost.end * 128 - 3 };
        for index in 0..blocks {
            card.read(&mut segment, index, &mut block).expect("it reads");
            assert_eq!(block, pattern(index), "block {index}, lost {lost:?}");
        }
    }
}

#[test]
fn free_clusters_that_no_log_lost_are_taken() {
    let third = LogName { session: 3, segment: 0 };
    let fourth = LogName { session: 4, segment: 0 };
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut card = mount(&device, &status);
    card.create(FIRST, 1 << 20).expect("there is room");
    card.create(SECOND, 1 << 20).expect("there is room");
    drop(card);
    let free = |from: u32, to: u32| {
        for cluster in from..to {
            let at = cluster as usize % 128 * 4;
            change(&device, FAT_START + cluster / 128, |block| block[at..at + 4].fill(0));
        }
    };
    let root =
        *device.blocks.borrow().iter().find(|(_, block)| block.starts_with(&FIRST.short())).expect("root").0;
    free(3, 2051);
    change(&device, root, |block| block[0] = 0xE5);
    set_hint(&device, 3);
    let mut card = mount(&device, &status);
    card.create(third, 3 << 19).expect("there is room");
    drop(card);
    free(2051, 4099);
    change(&device, root, |block| block[32] = 0xE5);
    set_hint(&device, 2051);
    device.journal.borrow_mut().clear();
    let mut card = mount(&device, &status);
    card.create(fourth, 1 << 20).expect("there is room");
    card.write(0, &[pattern(4)]).expect("in place");
    let first_block = device.journal.borrow().last().expect("written").0;
    let data_start = root;
    assert_eq!(first_block, data_start + 2051 - 2, "in the second log's place");
    let mut segment = card.segment(third).expect("it is there");
    let mut block = [0; BLOCK_BYTES];
    card.read(&mut segment, 3071, &mut block).expect("its chain is as it was");
}

/// The spare entries of the FAT's last block continue the chain of the card's last clusters.
#[test]
fn a_row_of_clusters_outside_of_the_card_is_refused() {
    let mut device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut card = mount(&device, &status);
    card.create(FIRST, 64 * 1024).expect("there is room");
    let layout = *card.layout();
    drop(card);
    let (end, inside) = (layout.clusters + 2, 5);
    let first = end - inside;
    assert_ne!(end % 128, 0, "the FAT's last block has spare entries");
    for cluster in first..end.next_multiple_of(128) {
        let at = cluster as usize % 128 * 4;
        change(&device, layout.fat_start + cluster / 128, |block| {
            block[at..at + 4].copy_from_slice(&(cluster + 1).to_le_bytes());
        });
    }
    for block in device.blocks.borrow_mut().values_mut() {
        let entries = block.as_chunks_mut::<32>().0;
        if let Some(entry) = entries.iter_mut().find(|entry| entry.starts_with(&FIRST.short())) {
            entry[20..22].copy_from_slice(&((first >> 16) as u16).to_le_bytes());
            entry[26..28].copy_from_slice(&(first as u16).to_le_bytes());
        }
    }
    device.size += MIB_BLOCKS;
    let mut card = mount(&device, &status);
    card.open(FIRST).expect("it is there");
    device.journal.borrow_mut().clear();
    let all: Vec<Block> = (0..64).map(pattern).collect();
    let row = (inside * layout.cluster_blocks) as usize;
    assert_eq!(card.write(0, &all), Ok(row));
    assert_eq!(card.write(row as u32, &all[row..]), Err(CardError::Damaged));
    let behind = layout.data_start + layout.clusters * layout.cluster_blocks;
    let written: Vec<u32> = device.journal.borrow().iter().map(|(at, _)| *at).collect();
    assert_eq!(written, (behind - row as u32..behind).collect::<Vec<_>>());
}

#[test]
fn a_segment_is_chained_through_whatever_clusters_are_free() {
    const LAST: u32 = 0x0FFF_FFFF;
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    change(&device, 2048, |boot| boot[16] = 2);
    let layout = *mount(&device, &status).layout();
    let entries = |copy: u32| -> Vec<u32> {
        let blocks = device.blocks.borrow();
        let fat = (0..layout.fat_blocks).flat_map(|index| {
            let at = layout.fat_start + copy * layout.fat_stride + index;
            blocks.get(&at).copied().unwrap_or([0; 512])
        });
        let bytes: Vec<u8> = fat.collect();
        bytes.chunks_exact(4).map(|entry| u32::from_le_bytes(entry.try_into().expect("four"))).collect()
    };
    for cluster in (3..layout.clusters + 2).filter(|cluster| cluster % 3 != 0) {
        let at = cluster as usize % 128 * 4;
        for copy in 0..layout.fat_copies {
            let block = layout.fat_start + copy * layout.fat_stride + cluster / 128;
            change(&device, block, |block| block[at..at + 4].copy_from_slice(&LAST.to_le_bytes()));
        }
    }
    let hint = (layout.clusters + 2) / 128 * 128 - 3 * 128;
    change(&device, layout.info, |block| block[492..496].copy_from_slice(&hint.to_le_bytes()));
    let before = entries(0);
    let wanted = 500;
    let mut card = mount(&device, &status);
    card.create(FIRST, wanted * layout.cluster_blocks * 512).expect("there is room");

    let after = entries(0);
    assert!(after[3..] == entries(1)[3..], "the copies differ");
    let changed: Vec<u32> =
        (0..).zip(&before).zip(&after).filter(|((_, a), b)| a != b).map(|((n, _), _)| n).collect();
    assert_eq!(changed.len(), wanted as usize);
    assert!(changed.iter().all(|cluster| before[*cluster as usize] == 0), "somebody's cluster");
    assert!(*changed.last().expect("some") < 3 * wanted + 128, "{changed:?}");
    let mut cluster = changed[0];
    let mut walked = vec![cluster];
    while after[cluster as usize] != LAST {
        cluster = after[cluster as usize];
        walked.push(cluster);
    }
    walked.sort_unstable();
    assert_eq!(walked, changed, "the chain is not of what was taken");
    let mut segment = card.segment(FIRST).expect("it is there");
    assert_eq!(segment.blocks(), wanted * layout.cluster_blocks);
    let last = segment.blocks() - 1;
    card.read(&mut segment, last, &mut [0; BLOCK_BYTES]).expect("its chain ends with it");
}

fn with_deleted(is_deleted: impl Fn(u32) -> bool) -> MemCard {
    let device = MemCard::formatted(64 * MIB_BLOCKS);
    let status = CardStatus::new();
    let mut card = mount(&device, &status);
    let names = (0..21).map(|session| LogName { session: session + 1, segment: 0 });
    for name in names.clone() {
        card.create(name, 1 << 20).expect("there is room");
    }
    for (at, name) in (0..).zip(names).filter(|(at, _)| is_deleted(*at)) {
        let mut blocks = device.blocks.borrow_mut();
        let mut entries = blocks.values_mut().flat_map(|block| block.as_chunks_mut::<32>().0);
        entries.find(|entry| entry.starts_with(&name.short())).expect("its entry")[0] = 0xE5;
        for cluster in 3 + at * 2048..3 + (at + 1) * 2048 {
            let block = blocks.get_mut(&(FAT_START + cluster / 128)).expect("chained");
            block[cluster as usize % 128 * 4..][..4].fill(0);
        }
    }
    set_hint(&device, 3 + (0..21).find(|at| is_deleted(*at)).expect("one") * 2048);
    device
}

#[test]
fn a_directory_that_is_walked_over_while_a_segment_is_made_loses_no_log() {
    let device = with_deleted(|at| at < 20);
    let status = CardStatus::new();
    let mut card = mount(&device, &status);
    for segment in 0..12 {
        create(&mut card, LogName { session: 30, segment }, 1 << 20).expect("there is room");
        assert_eq!(logs(&card).len() as u32, 2 + segment);
    }
}

#[test]
fn a_read_that_fails_while_a_segment_is_made_costs_no_log() {
    for reads in 0.. {
        let device = with_deleted(|at| at % 2 == 1);
        let status = CardStatus::new();
        let mut card = mount(&device, &status);
        device.fail_read_after.set(Some(reads));
        let mut made = 0;
        for segment in 0..4 {
            made += usize::from(create(&mut card, LogName { session: 30, segment }, 3 << 19).is_ok());
        }
        let is_all = device.fail_read_after.take().is_some();
        assert!(made >= 3, "{reads}: {made}");
        let found = logs(&mount(&device, &status));
        assert_eq!(found.len(), 11 + made, "the read after {reads}");
        if is_all {
            break;
        }
    }
}
