//! Long directories, of our own logs and of other files. Our own search does not count as the card's time.

use crate::rig;

use hums_core::clock::Span;
use hums_recorder::card::SEGMENT_BYTES_MAX;
use hums_recorder::layout::Layout;
use hums_recorder::{Buffers, Card, CardState, CardStatus, LogName};
use hums_sdcard::{Fault, Kind, MS, Medium, Model, Plan};
use rig::Rig;

const GIB: u32 = 2_097_152;
const END: u32 = 0x0FFF_FFFF;

/// Each with a row of clusters.
fn fill(medium: &Medium, entries: impl Iterator<Item = ([u8; 11], u8, u32)>) {
    let layout = Layout::read(medium).expect("it is formatted");
    let entries: Vec<_> = entries.collect();
    let root_clusters = (entries.len() as u32 * 32 / 512 + 1).div_ceil(layout.cluster_blocks);
    let mut fat = vec![0x0FFF_FFF8, END];
    let mut chain = |clusters: u32| {
        let first = fat.len() as u32;
        fat.extend((1..clusters).map(|next| first + next));
        fat.push(END);
        first
    };
    assert_eq!(chain(root_clusters), layout.root);
    let mut directory = Vec::new();
    for (name, attributes, clusters) in &entries {
        let first = if *clusters > 0 { chain(*clusters) } else { 0 };
        let mut entry = [0; 32];
        entry[..11].copy_from_slice(name);
        entry[11] = *attributes;
        entry[20..22].copy_from_slice(&first.to_le_bytes()[2..]);
        entry[26..28].copy_from_slice(&first.to_le_bytes()[..2]);
        entry[28..].copy_from_slice(&(clusters * layout.cluster_blocks * 512).to_le_bytes());
        directory.extend(entry);
    }
    assert!(fat.len() as u32 <= layout.clusters + 2, "it is not so large");
    let fat: Vec<u8> = fat.into_iter().flat_map(u32::to_le_bytes).collect();
    for (start, bytes) in [(layout.fat_start, fat), (layout.data_start, directory)] {
        for (at, bytes) in (start..).zip(bytes.chunks(512)) {
            medium.patch(at, 0, bytes);
        }
    }
}

/// 8 MiB each, and a foreign file.
fn own_logs(medium: &Medium, percent: u32) -> u32 {
    let layout = Layout::read(medium).expect("it is formatted");
    let clusters = SEGMENT_BYTES_MAX / (layout.cluster_blocks * 512);
    let logs = (layout.clusters - 400) / clusters * percent / 100;
    let name = |log: u32| LogName { session: log / 4 + 1, segment: log % 4 }.short();
    let other = (*b"PHOTO   JPG", 0x20, 300);
    fill(medium, core::iter::once(other).chain((0..logs).map(|log| (name(log), 0x20, clusters))));
    logs
}

fn is_stall(rig: &Rig) -> bool {
    rig.was_told("stall", 0) || rig.findings.iter().any(|(_, check, _)| *check == "card_stall")
}

#[test]
fn a_large_card_of_own_logs_is_recorded_on_half_a_second_after_power_on() {
    for (gib, percent) in [(32, 90), (64, 90), (118, 90), (118, 100)] {
        let medium = Medium::formatted(gib * GIB);
        let logs = own_logs(&medium, percent);
        let before = medium.writes();
        let refusal = Plan::always(Fault::WriteError).from(3_000 * MS).times(8);
        let mut rig = Rig::new(Model::new(Kind::Sdxc, medium.clone()).with(refusal));
        while medium.writes() == before && rig.slot.now_ns() < 5_000 * MS {
            rig.run_to(rig.slot.now_ns() / MS + 1);
        }
        let recording_ms = rig.slot.now_ns() / MS;
        println!("{gib} GiB, {logs} logs: {recording_ms} ms until the first block is written");
        rig.run_to(500);
        rig.assert_state(CardState::Recording);
        assert!(rig.status.read().blocks_written > 0, "{logs} logs");
        rig.run_to(6_000);
        assert!(!is_stall(&rig), "{:?} {:?}", rig.texts, rig.findings);
        assert!(rig.longest < Span::from_millis(500), "{:?}", rig.longest);
        let reading = rig.status.read();
        assert_eq!(reading.segments_overwritten, if percent == 100 { reading.segments } else { 0 });
        assert_eq!(reading.segments, 2);
        let (found, lost) = rig.finish(&[&medium]);
        assert_eq!((lost, found[0].gaps.len()), (0, 0));
    }
}

/// More segments than noted oldest logs: recording never waits for the directory.
#[test]
fn a_new_segment_on_a_full_large_card_takes_less_than_half_of_what_the_queue_rides_out() {
    let medium = Medium::formatted(118 * GIB);
    let logs = own_logs(&medium, 100);
    let refusals = 40;
    let card = (0..refusals).fold(Model::new(Kind::Sdxc, medium.clone()), |card, second| {
        card.with(Plan::always(Fault::WriteError).from((3_000 + second * 500) * MS).times(8))
    });
    let mut rig = Rig::new(card);
    rig.run_to(3_000 + refusals * 500 + 3_000);
    rig.assert_state(CardState::Recording);
    assert!(!is_stall(&rig), "{:?} {:?}", rig.texts, rig.findings);
    println!("{logs} logs: {:?} at most", rig.longest);
    assert!(rig.longest < Span::from_millis(1_250), "{:?}", rig.longest);
    let reading = rig.status.read();
    let gone = reading.segments_overwritten;
    assert!(gone == reading.segments && gone > 10, "{reading:?}");
    let (found, lost) = rig.finish(&[&medium]);
    assert_eq!((lost, found[0].gaps.len()), (0, 0));
    let status = CardStatus::new();
    let buffers = Buffers::new();
    let card = Card::mount(&medium, &status, &buffers).expect("it mounts");
    let mut oldest = LogName { session: LogName::SESSION_MAX, segment: 0 };
    card.logs(|log| oldest = oldest.min(log.name)).expect("it lists");
    assert_eq!(oldest, LogName { session: gone / 4 + 1, segment: gone % 4 });
}

#[test]
fn a_card_with_a_hundred_thousand_entries_of_others_is_recorded_on() {
    for entries in [60_000_u32, 100_000] {
        let medium = Medium::formatted(32 * GIB);
        let name = |number: u32| -> [u8; 11] {
            format!("F{number:07}TXT").into_bytes().try_into().expect("eleven bytes")
        };
        fill(&medium, (0..entries).map(|number| (name(number), 0x20, 0)));
        let mut rig = Rig::new(Model::new(Kind::Sdhc, medium.clone()));
        rig.run_to(10_000);
        rig.assert_state(CardState::Recording);
        assert!(!is_stall(&rig), "{:?}", rig.texts);
        rig.finish_whole(&medium);
    }
}

#[test]
fn a_foreign_file_or_folder_with_the_last_number_does_not_end_the_numbers() {
    for attributes in [0x20, 0x10] {
        let medium = Medium::formatted(GIB / 16);
        let last = LogName { session: LogName::SESSION_MAX, segment: LogName::SEGMENT_MAX };
        let own = LogName { session: 41, segment: 3 };
        fill(&medium, [(last.short(), attributes, 1), (own.short(), 0x20, 64)].into_iter());
        for session in [42, 43] {
            let mut rig = Rig::new(Model::new(Kind::Sdsc, medium.clone()));
            rig.run_to(3_000);
            rig.assert_state(CardState::Recording);
            assert_eq!(rig.status.read().session, session);
        }
    }
}
