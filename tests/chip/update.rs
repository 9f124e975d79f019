//! An update from the card on the flashed files: resident program, application, trial.

use std::fs;

use ed25519_compact::{KeyPair, Seed};
use hums_sdcard::{Event, Kind, Model};
use hums_tests::chip::rig::{Rig, heartbeat};
use hums_tests::chip::{put, usart};
use hums_tests::program;
use hums_update::header::{BYTES, Header, Version};
use hums_update::state::{State, Status};
use hums_update::{PREVIOUS, UPDATE, map};
use stm32f405_model::machine::Board;
use stm32f405_model::rcc::Cause;
use stm32f405_model::time::{MS, SECOND};

use super::{bench, budget};

/// Vectors, then `movw r0, #0xED0C; movt r0, #0xE000; movs r1, #4; movt r1, #0x05FA; str r1, [r0]; b .`: a reset at once.
const RESETS: [u16; 9] = [0xF64E, 0x500C, 0xF2CE, 0x0000, 0x2104, 0xF2C0, 0x51FA, 0x6001, 0xE7FE];

/// Later than any release: 255.0.0.
const LATER: u32 = 0xFF00_0000;

/// The board's own image as a later version.
fn later(board: &str) -> Vec<u8> {
    let file = program::firmware().with_file_name(format!("hums-{board}.upd"));
    signed(board, &fs::read(file).unwrap()[BYTES..], LATER)
}

fn signed(board: &str, image: &[u8], version: u32) -> Vec<u8> {
    let text = include_str!("../../firmware/update/keys/test.key");
    let seed: Vec<u8> =
        (0..64).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).unwrap()).collect();
    let key = KeyPair::from_seed(Seed::from_slice(&seed).unwrap());
    let mut header = Header::new(board, "test", Version(version), Version(0), image);
    header.sign(image, &key.sk);
    [&header.bytes()[..], image].concat()
}

fn program_of(code: &[u16], version: u32) -> Vec<u8> {
    let mut image = vec![0; 512];
    image[..4].copy_from_slice(&0x1000_4000_u32.to_le_bytes());
    image[4..8].copy_from_slice(&(map::VECTORS + 0x101).to_le_bytes());
    for (at, half) in code.iter().enumerate() {
        image[0x100 + 2 * at..][..2].copy_from_slice(&half.to_le_bytes());
    }
    signed(hums_boards::DEFAULT, &image, version)
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

/// Up to its trial.
pub(super) fn install(rig: &mut Rig) {
    let new = later(&rig.wired.name);
    put(&rig.medium, &[(UPDATE, &new)]);
    run(rig, 9);
    let release = Version::parse(env!("CARGO_PKG_VERSION")).unwrap();
    assert_eq!((flash(rig).0.version, resets(rig)), (release, 0), "too early");
    run(rig, 20);
    let (header, status) = flash(rig);
    assert_eq!((header.version, resets(rig)), (Version(LATER), 2));
    assert!(matches!(status, Status::Trial { starts: 1, crashes: 0 }), "{status:?}");
    assert_eq!(rig.machine.memory(map::APPLICATION, new.len() as u32), new);
    assert!(rig.slot.violations().is_empty(), "{:?}", rig.slot.violations());
}

#[test]
fn a_new_version_is_installed_records_for_a_minute_and_is_confirmed() {
    let mut rig = bench().rig(Board::default());
    install(&mut rig);
    run(&mut rig, 64);
    assert_eq!((flash(&rig).1, resets(&rig)), (Status::Confirmed, 2));
    assert!(rig.slot.violations().is_empty(), "{:?}", rig.slot.violations());
    assert_told(&rig, &["update begins", "update installed"]);
}

#[test]
fn without_an_application_the_one_of_the_card_is_installed() {
    let mut bench = bench();
    let header = bench.image.pieces.iter_mut().find(|(at, _)| *at == map::APPLICATION);
    header.unwrap().1[0] = 0;
    let mut rig = bench.rig(Board::default());
    let new = later(hums_boards::DEFAULT);
    put(&rig.medium, &[(UPDATE, &new)]);
    while resets(&rig) == 0 {
        assert!(rig.machine.now() < 20 * SECOND, "it does not begin");
        rig.run_for(MS, false).unwrap();
    }
    // Nothing else ran so far.
    let (depth, limit) = (rig.machine.core.stack_depth(0), budget("memory", "resident_stack"));
    println!("{depth} bytes of stack, installed after {} ms", rig.machine.ms());
    assert!((1..=limit).contains(&depth), "{depth} of {limit} bytes of stack");
    run(&mut rig, 2);
    let (header, status) = flash(&rig);
    assert_eq!((header.version, resets(&rig)), (Version(LATER), 1), "{:?}", rig.machine.resets);
    assert!(matches!(status, Status::Trial { starts: 1, crashes: 0 }), "{status:?}");
    assert_eq!(rig.machine.memory(map::APPLICATION, new.len() as u32), new);
}

#[test]
#[ignore = "half a minute: `cargo xtask prove chip`"]
fn a_card_that_was_pulled_while_it_is_programmed_goes_on_when_it_is_back() {
    let mut rig = bench().rig(Board::default());
    let new = later(hums_boards::DEFAULT);
    put(&rig.medium, &[(UPDATE, &new)]);
    run(&mut rig, 10);
    let half = new.len() / 1_024 * 512;
    // Erased, then programmed.
    for wanted in [&[0xFF; 512][..], &new[half..half + 512]] {
        while rig.machine.memory(map::APPLICATION + half as u32, 512) != wanted {
            assert!(rig.machine.now() < 30 * SECOND, "it does not begin");
            rig.run_for(MS, false).unwrap();
        }
    }
    rig.slot.event(Event::Pull);
    run(&mut rig, 10);
    assert!(Header::read(rig.machine.memory(map::APPLICATION, BYTES as u32)).is_none());
    let blinks = rig.led.iter().filter(|(at, lit)| *lit && *at + 3 * SECOND > rig.machine.now()).count();
    assert!((2..=4).contains(&blinks), "{blinks} blinks in 3 s");
    rig.slot.event(Event::Insert(Model::new(Kind::Sdhc, rig.medium.clone())));
    run(&mut rig, 14);
    let (header, status) = flash(&rig);
    assert_eq!((header.version, resets(&rig)), (Version(LATER), 2), "{:?}", rig.machine.resets);
    assert!(matches!(status, Status::Trial { starts: 1, crashes: 0 }), "{status:?}");
    assert_eq!(rig.machine.memory(map::APPLICATION, new.len() as u32), new);
    assert_told(&rig, &["update installed"]);
}

#[test]
fn a_wrong_image_is_refused_by_text_record_and_led_and_nothing_is_erased() {
    let mut forged = later(hums_boards::DEFAULT);
    forged[100_000] ^= 1;
    let foreign = signed("matek-f405-std", &[0; 512], 0x0900_0000);
    for (file, text, restarts) in [
        (foreign, "HUMS: update refused: it is for another board", 0),
        (forged, "HUMS: update refused: its signature is wrong", 2),
    ] {
        let mut rig = bench().rig(Board::default());
        put(&rig.medium, &[(UPDATE, &file)]);
        let before = rig.machine.memory(map::APPLICATION, map::APPLICATION_BYTES as u32).to_vec();
        run(&mut rig, 18);
        assert_eq!(resets(&rig), restarts, "{text}");
        assert!(rig.machine.memory(map::APPLICATION, before.len() as u32) == before, "{text}");
        assert_told(&rig, &[text]);
        // Three brief blinks a second.
        let lit = rig.led.iter().filter(|(at, lit)| *lit && *at > 16 * SECOND).count();
        assert!((5..=7).contains(&lit), "{lit} blinks in two seconds: {text}");
    }
}

#[test]
fn an_image_that_crashes_at_once_gives_way_to_the_one_before() {
    let mut rig = bench().rig(Board::default());
    let (old, new) = (program_of(&[0xE7FE], 0x0001_0000), program_of(&RESETS, 0x0900_0000));
    put(&rig.medium, &[(UPDATE, &new), (PREVIOUS, &old)]);
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
