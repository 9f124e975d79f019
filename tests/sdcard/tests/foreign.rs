//! Reported with their kind, never touched unasked, formatted on request.

use crate::rig;

use hums_core::clock::Instant;
use hums_recorder::CardState;
use hums_recorder::format::BLOCKS_MIN;
use hums_recorder::layout::Layout;
use hums_sdcard::{Event, Fault, Kind, MS, Medium, Model, Plan};
use rig::Rig;

const MIB: u32 = 2_048;
const FORMAT: u16 = 526;
const ACCEPTED: u8 = 0;
const TEMPORARILY_REJECTED: u8 = 1;
const DENIED: u8 = 2;
const FAILED: u8 = 4;

fn partitioned(kind: u8) -> Medium {
    let medium = Medium::new(128 * MIB);
    medium.patch(0, 446, &[0, 0, 2, 0, kind, 0xFE, 0xFF, 0xFF, 0, 8, 0, 0, 0, 0xF8, 3, 0]);
    medium.patch(0, 510, &[0x55, 0xAA]);
    medium
}

/// A new card of more than 32 GB.
fn exfat() -> Medium {
    let medium = partitioned(0x07);
    medium.patch(2_048, 0, b"\xEB\x76\x90EXFAT   ");
    medium.patch(2_048, 510, &[0x55, 0xAA]);
    medium
}

/// A FAT32 volume that begins with the card.
fn without_partitions() -> Medium {
    let whole = Medium::formatted(128 * MIB);
    let medium = Medium::new(128 * MIB);
    for (at, block) in whole.content().range(2_048..) {
        medium.set(at - 2_048, block);
    }
    medium
}

/// The layout of `mkfs.vfat` on a whole disk.
fn partition_of_everything() -> Medium {
    let medium = without_partitions();
    medium.patch(0, 446, &[0x80, 0, 1, 0, 0x0C, 0xFE, 0xFF, 0xFF, 0, 0, 0, 0, 0, 0, 4, 0]);
    medium
}

fn linux() -> Medium {
    let medium = Medium::new(128 * MIB);
    // The superblock's magic.
    medium.patch(2, 56, &[0x53, 0xEF]);
    medium
}

fn garbage() -> Medium {
    let medium = Medium::new(128 * MIB);
    let mut state = 7_u32;
    for at in 0..5_000 {
        let block = std::array::from_fn(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        });
        medium.set(at, &block);
    }
    medium
}

fn damaged() -> Medium {
    let medium = Medium::formatted(128 * MIB);
    medium.patch(2_048, 13, &[3]);
    medium
}

/// A FAT32 partition with a FAT16 volume in it, as some cameras leave them.
fn fat16_in_fat32() -> Medium {
    let medium = Medium::formatted(128 * MIB);
    medium.patch(2_048, 17, &[0, 2]);
    medium.patch(2_048, 22, &[0xF0, 0]);
    medium
}

fn all() -> Vec<(&'static str, Medium, CardState, &'static str)> {
    vec![
        ("exFAT", exfat(), CardState::ExFat, "exFAT, look at it on a PC"),
        ("FAT16", partitioned(0x06), CardState::Foreign, "not FAT32, look at it on a PC"),
        ("FAT16 in FAT32", fat16_in_fat32(), CardState::Damaged, "FAT32 is damaged"),
        ("GPT", partitioned(0xEE), CardState::Foreign, "not FAT32, look at it on a PC"),
        ("Linux", partitioned(0x83), CardState::Foreign, "not FAT32, look at it on a PC"),
        (
            "FAT32 without partitions",
            without_partitions(),
            CardState::Unpartitioned,
            "unpartitioned, look at it on a PC",
        ),
        (
            "FAT32 in a partition of everything",
            partition_of_everything(),
            CardState::Unpartitioned,
            "unpartitioned, look at it on a PC",
        ),
        ("ext4 without partitions", linux(), CardState::Unpartitioned, "unpartitioned, look at it on a PC"),
        ("empty", Medium::new(128 * MIB), CardState::Unpartitioned, "unpartitioned, look at it on a PC"),
        ("garbage", garbage(), CardState::Unpartitioned, "unpartitioned, look at it on a PC"),
        ("damaged", damaged(), CardState::Damaged, "FAT32 is damaged"),
    ]
}

fn sdhc(medium: &Medium) -> Model {
    Model::new(Kind::Sdhc, medium.clone())
}

#[test]
fn each_is_told_for_what_it_is_and_not_touched() {
    for (name, medium, state, told) in all() {
        let before = (medium.content(), medium.writes());
        let mut rig = Rig::new(sdhc(&medium));
        rig.run_to(12_000);
        assert_eq!(rig.state(), state, "{name}");
        rig.assert_told(told, 0);
        assert!(rig.findings.iter().any(|(_, check, _)| *check == "recording"), "{name}");
        assert_eq!((medium.content(), medium.writes()), before, "{name}");
        let other = Medium::formatted(64 * MIB);
        rig.slot.event(Event::Insert(Model { serial: 3, ..sdhc(&other) }));
        rig.run_to(20_000);
        rig.assert_state(CardState::Recording);
        rig.finish_whole(&other);
    }
}

#[test]
fn each_is_formatted_by_command_and_recorded_on() {
    for (name, medium, ..) in all() {
        let mut rig = Rig::new(sdhc(&medium));
        rig.run_to(3_000);
        assert_eq!(rig.command(FORMAT, [1.0, 1.0]), Some(ACCEPTED), "{name}");
        rig.run_to(20_000);
        rig.assert_state(CardState::Recording);
        rig.assert_told("card: recording", 3_000);
        let found = rig.finish_whole(&medium);
        assert_eq!((found.sessions, found.segments), (1, 1), "{name}");
    }
}

#[test]
fn cards_of_odd_sizes_are_formatted_whole() {
    let smallest = BLOCKS_MIN.next_multiple_of(512);
    for (kind, size) in [
        (Kind::Old, smallest),
        (Kind::Sdsc, 1_001_472),
        (Kind::Sdsc, 1_984_000),
        (Kind::Sdhc, 15_353_856),
        (Kind::Sdhc, 31_116_288),
        (Kind::Sdxc, 124_735_488),
    ] {
        let medium = Medium::new(size);
        let mut rig = Rig::new(Model::new(kind, medium.clone()));
        rig.run_to(2_000);
        assert_eq!(rig.command(FORMAT, [1.0, 1.0]), Some(ACCEPTED));
        let begun = rig.slot.now();
        while rig.state() != CardState::Recording && rig.slot.now().as_millis() < 120_000 {
            rig.run_to(rig.slot.now_ns() / MS + 100);
        }
        println!("{size} blocks: {} ms", rig.slot.now().since(begun).as_millis());
        rig.assert_state(CardState::Recording);
        let layout = Layout::read(&medium).expect("it is formatted");
        assert!(layout.end() <= size && size - layout.end() < layout.cluster_blocks + 128, "{layout:?}");
        rig.run_to(rig.slot.now_ns() / MS + 8_000);
        let (found, _) = rig.finish(&[&medium]);
        assert!(found[0].gaps.is_empty() && found[0].frames.len() > 150, "{size}");
    }
}

#[test]
fn a_card_too_small_for_fat32_is_told_and_not_touched() {
    let medium = Medium::new(16 * MIB);
    let mut rig = Rig::new(Model::new(Kind::Old, medium.clone()));
    rig.run_to(2_000);
    assert_eq!(rig.command(FORMAT, [1.0, 1.0]), Some(ACCEPTED), "nobody knows its size yet");
    rig.run_to(10_000);
    assert_ne!(rig.state(), CardState::Recording);
    rig.assert_told("card: unpartitioned", 0);
    assert_eq!(medium.writes(), 0);
}

#[test]
fn nobody_formats_a_card_by_mistake() {
    let medium = exfat();
    let before = medium.content();
    let mut rig = Rig::new(sdhc(&medium));
    rig.run_to(3_000);
    for params in [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [2.0, 1.0], [1.0, f32::NAN], [-1.0, -1.0], [1e30, 1.0]]
    {
        assert_eq!(rig.command(FORMAT, params), Some(DENIED), "{params:?}");
    }
    rig.armed = true;
    rig.run_to(20_000);
    assert_eq!(rig.command(FORMAT, [1.0, 1.0]), Some(TEMPORARILY_REJECTED), "not in flight");
    assert_eq!(medium.content(), before);

    let ours = Medium::formatted(64 * MIB);
    let mut rig = Rig::new(sdhc(&ours));
    rig.run_to(3_000);
    assert_eq!(rig.command(FORMAT, [1.0, 1.0]), Some(DENIED), "nobody at a radio destroys logs");
    rig.run_to(10_000);
    rig.assert_state(CardState::Recording);
    rig.finish_whole(&ours);
}

#[test]
fn a_card_that_was_put_in_after_the_one_that_was_told_is_not_formatted() {
    let (told, other) = (exfat(), Medium::formatted(64 * MIB));
    let before = Layout::read(&other).expect("it is formatted");
    let mut rig = Rig::new(sdhc(&told));
    rig.run_to(3_300);
    rig.slot.event(Event::Insert(Model { serial: 3, ..sdhc(&other) }));
    assert_eq!(rig.command(FORMAT, [1.0, 1.0]), Some(ACCEPTED));
    rig.run_to(12_000);
    rig.assert_state(CardState::Recording);
    assert_eq!(Layout::read(&other).expect("as before").volume_id, before.volume_id);
    rig.finish_whole(&other);
}

#[test]
fn there_must_be_a_card_to_format() {
    let mut rig = Rig::new(None);
    rig.run_to(3_000);
    assert_eq!(rig.command(FORMAT, [1.0, 1.0]), Some(FAILED));
}

/// The card is then unformatted, and is formatted on another request.
#[test]
fn a_card_that_is_pulled_while_it_is_formatted_can_be_formatted_again() {
    for step in 0..12 {
        let medium = exfat();
        let mut rig = Rig::new(sdhc(&medium));
        rig.run_to(3_000);
        rig.slot.at_byte(rig.slot.counts().bytes + 100 + step * 16_000, Event::Pull);
        assert_eq!(rig.command(FORMAT, [1.0, 1.0]), Some(ACCEPTED));
        rig.run_to(12_000);
        let was_done = rig.slot.has_card() || Layout::read(&medium).is_ok();
        rig.slot.event(Event::Insert(sdhc(&medium)));
        rig.run_to(20_000);
        if !was_done && rig.state() != CardState::Recording {
            assert!(rig.state().wants_format(), "{:?}", rig.state());
            assert_eq!(rig.command(FORMAT, [1.0, 1.0]), Some(ACCEPTED), "step {step}");
            rig.run_to(30_000);
        }
        rig.assert_state(CardState::Recording);
        let (found, lost) = rig.finish(&[&medium]);
        assert_eq!((lost, found[0].gaps.len()), (0, 0), "step {step}");
    }
}

#[test]
fn a_card_that_fails_while_it_is_formatted_is_told() {
    let medium = exfat();
    let plan = Plan::always(Fault::WriteError).skip(5);
    let mut rig = Rig::new(sdhc(&medium).with(plan));
    rig.run_to(3_000);
    assert_eq!(rig.command(FORMAT, [1.0, 1.0]), Some(ACCEPTED));
    rig.run_to(10_000);
    assert!(rig.state().wants_format(), "{:?}", rig.state());
    rig.assert_told("card: ", 3_000);
    assert!(rig.slot.now() < Instant::from_millis(11_000));
    assert!(Layout::read(&medium).is_err(), "half of a format is no volume");
}
