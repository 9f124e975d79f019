//! An update from the card on the flashed files: resident program, application, trial.

use std::fs;

use ed25519_compact::{KeyPair, Seed};
use hums_recorder::layout::Layout;
use hums_tests::chip::rig::{Rig, heartbeat};
use hums_tests::chip::usart;
use hums_tests::program;
use hums_update::header::{BYTES, Header, Version};
use hums_update::state::{State, Status};
use hums_update::{PREVIOUS, UPDATE, files, map};
use stm32f405_model::machine::Board;
use stm32f405_model::rcc::Cause;
use stm32f405_model::time::SECOND;

use super::bench;

/// Vectors, then `movw r0, #0xED0C; movt r0, #0xE000; movs r1, #4; movt r1, #0x05FA; str r1, [r0]; b .`: a reset at once.
const RESETS: [u16; 9] = [0xF64E, 0x500C, 0xF2CE, 0x0000, 0x2104, 0xF2C0, 0x51FA, 0x6001, 0xE7FE];

fn release() -> Vec<u8> {
    fs::read(program::firmware().with_extension("upd")).unwrap()
}

/// Signed by the test key.
fn signed(image: &[u8], version: u32) -> Vec<u8> {
    let text = include_str!("../../firmware/update/keys/test.key");
    let seed: Vec<u8> =
        (0..64).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).unwrap()).collect();
    let key = KeyPair::from_seed(Seed::from_slice(&seed).unwrap());
    let mut header = Header::new(hums_boards::DEFAULT, "test", Version(version), Version(0), image);
    header.sign(image, &key.sk);
    [&header.bytes()[..], image].concat()
}

/// A program of these instructions.
fn program_of(code: &[u16], version: u32) -> Vec<u8> {
    let mut image = vec![0; 512];
    image[..4].copy_from_slice(&0x1000_4000_u32.to_le_bytes());
    image[4..8].copy_from_slice(&(map::VECTORS + 0x101).to_le_bytes());
    for (at, half) in code.iter().enumerate() {
        image[0x100 + 2 * at..][..2].copy_from_slice(&half.to_le_bytes());
    }
    signed(&image, version)
}

/// Puts files on an empty card, each in a row of clusters.
fn put(rig: &Rig, all: &[(&files::Name, &[u8])]) {
    let medium = &rig.medium;
    let Layout { fat_start, fat_stride, fat_copies, data_start, cluster_blocks, root, .. } =
        Layout::read(medium).unwrap();
    let block_of = |cluster: u32| data_start + (cluster - 2) * cluster_blocks;
    let mut cluster = 1_000;
    for (number, (name, file)) in all.iter().enumerate() {
        let count = (file.len() as u32).div_ceil(512 * cluster_blocks);
        let mut entry = [0; 32];
        entry[..11].copy_from_slice(*name);
        entry[11] = 0x20;
        entry[26..28].copy_from_slice(&(cluster as u16).to_le_bytes());
        entry[28..].copy_from_slice(&(file.len() as u32).to_le_bytes());
        medium.patch(block_of(root), 32 * number, &entry);
        for (at, block) in file.chunks(512).enumerate() {
            medium.patch(block_of(cluster) + at as u32, 0, block);
        }
        for at in cluster..cluster + count {
            let next = if at + 1 < cluster + count { at + 1 } else { 0x0FFF_FFFF };
            for copy in 0..fat_copies {
                let block = fat_start + copy * fat_stride + at / 128;
                medium.patch(block, (at % 128 * 4) as usize, &next.to_le_bytes());
            }
        }
        cluster += count;
    }
}

fn run(rig: &mut Rig, seconds: u8) {
    for second in 0..seconds {
        let now = rig.machine.now();
        rig.machine.send(usart(&rig.wired.autopilot), &heartbeat(second), now, 921_600.0);
        rig.run(now + SECOND, false).unwrap();
    }
}

fn flash(rig: &Rig) -> (Header, Status) {
    let header = Header::read(rig.machine.memory(map::APPLICATION, BYTES as u32)).unwrap();
    let state = State::read(rig.machine.memory(map::STATE, map::STATE_BYTES as u32));
    (header.clone(), state.status(header.id()))
}

fn resets(rig: &Rig) -> usize {
    rig.machine.resets.iter().filter(|(_, cause)| *cause == Cause::Software).count()
}

#[track_caller]
fn assert_told(rig: &Rig, wanted: &[&str]) {
    let texts: Vec<String> = rig.sessions().into_iter().flat_map(|session| session.texts).collect();
    for text in wanted {
        assert!(texts.iter().any(|told| told.contains(text)), "not «{text}» but {texts:#?}");
    }
}

#[test]
fn a_new_version_is_installed_records_for_a_minute_and_is_confirmed() {
    let mut rig = bench().rig(Board::default());
    let new = signed(&release()[BYTES..], 0x0001_0001);
    put(&rig, &[(UPDATE, &new)]);
    run(&mut rig, 9);
    assert_eq!((flash(&rig).0.version, resets(&rig)), (Version(0x0001_0000), 0), "too early");
    run(&mut rig, 20);
    let (header, status) = flash(&rig);
    assert_eq!((header.version, resets(&rig)), (Version(0x0001_0001), 2));
    assert!(matches!(status, Status::Trial { starts: 1, crashes: 0 }), "{status:?}");
    assert_eq!(rig.machine.memory(map::APPLICATION, new.len() as u32), new);
    run(&mut rig, 64);
    assert_eq!((flash(&rig).1, resets(&rig)), (Status::Confirmed, 2));
    assert!(rig.slot.violations().is_empty(), "{:?}", rig.slot.violations());
    assert_told(&rig, &["update begins", "update installed"]);
}

#[test]
fn an_image_that_crashes_at_once_gives_way_to_the_one_before() {
    let mut rig = bench().rig(Board::default());
    let (old, new) = (program_of(&[0xE7FE], 0x0001_0000), program_of(&RESETS, 0x0900_0000));
    put(&rig, &[(UPDATE, &new), (PREVIOUS, &old)]);
    run(&mut rig, 10);
    while rig.machine.memory(map::APPLICATION, old.len() as u32) != old {
        assert!(rig.machine.now() < 25 * SECOND, "{:?}", rig.machine.resets);
        run(&mut rig, 1);
    }
    run(&mut rig, 1);
    let (_, status) = flash(&rig);
    assert!(matches!(status, Status::Trial { starts: 1, .. }), "{status:?}");
    assert_eq!(resets(&rig), 6, "{:?}", rig.machine.resets);
    assert_told(&rig, &["update begins"]);
}
