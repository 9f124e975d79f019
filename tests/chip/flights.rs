//! Flights, recorded by the image that is flashed.

use std::fs;
use std::path::Path;

use hums_tests::chip::{self, Feed};
use hums_tests::flights::{Manifest, own};
use hums_tests::frames;
use hums_tests::program::{Decoded, hums};
use stm32f405_model::image::Image;
use stm32f405_model::machine::Board;
use stm32f405_model::time::{MS, SECOND, US};

use crate::bench;

/// The flight of the demo.
const FLIGHT: &str = "ap_quad_faults.tlog";
/// As many of its frames as the time of a test allows: on the ground, take-off, and flying.
const FRAMES: usize = 20_000;
/// What the processor may be busy in the worst second, of 168 MHz, at 921,600 baud back to back (issue 22 wants 40).
const BUSY_PERCENT_MAX: f64 = 43.0;
/// Prefetch, both caches, five wait states.
const ACR: u32 = 0x705;
/// The watchdog stops in a debugger's halt.
const FREEZES_IWDG: u32 = 1 << 12;

/// All that `hums verify` checks holds; only the end of a record that power cut in the air cannot be proved (exit code 3).
#[track_caller]
fn assert_verifies(card: &Path) {
    let said = hums(["verify".as_ref(), card.as_os_str()]).expect_code(&[0, 3]).text();
    let checks: Vec<_> = said.lines().filter(|line| line.contains(" checked, ")).collect();
    assert!(checks.len() > 10, "{said}");
    for check in checks {
        assert!(check.contains(" 0 failed") || check.contains(" end  "), "{said}");
    }
}

#[test]
fn the_demos_flight_is_recorded_bit_for_bit() {
    let dir = tempfile::tempdir().unwrap();
    let card = dir.path().join("card.img");
    let (flight, manifest) = (own(FLIGHT), Manifest::own());
    let data = fs::read(&flight).unwrap();
    let mut input = manifest.frames_of(&flight, &data);
    input.truncate(FRAMES);
    let last = input.last().unwrap();
    let path = dir.path().join("beginning.tlog");
    fs::write(&path, &data[..last.bytes.as_ptr().addr() - data.as_ptr().addr() + last.bytes.len()]).unwrap();
    let us = last.time_us.unwrap() - input[0].time_us.unwrap();

    let image = Image::parse(&fs::read(chip::image_path()).unwrap()).unwrap();
    let (mut machine, slot, medium) = chip::board(image, Board::default());
    let start = 1_500 * MS;
    let mut feed = Feed::read(&path, start).unwrap();
    let end = start + us * US + SECOND;
    while machine.now() < end {
        let to = machine.now() + 100 * MS;
        feed.give(&mut machine, to);
        machine.run_until(to).unwrap();
    }
    assert!(slot.violations().is_empty(), "{:?}", slot.violations());
    assert_eq!(machine.resets.len(), 1);
    chip::save(&medium, &card).unwrap();

    let log = Decoded::of(&card, &[0, 3]);
    let recorded = log.frames(&manifest.seeds);
    frames::assert_same(&input, &recorded, &[]);
    assert_verifies(&card);
    let mut off = 0;
    for (sent, got) in input.iter().zip(&recorded) {
        let since = |frame: &frames::Frame<'_>, first: &frames::Frame<'_>| {
            frame.time_us.unwrap().saturating_sub(first.time_us.unwrap())
        };
        off = off.max(since(sent, &input[0]).abs_diff(since(got, &recorded[0])));
    }
    println!("times are off by {off} us at the most");
    // Frames of one time wait for each other on the line.
    assert!(off < 20_000, "{off} us");
}

#[test]
fn the_full_line_rate_is_recorded_without_loss() {
    let mut rig = bench().settled(Board::default()).unwrap();
    let begin = rig.machine.now() + SECOND;
    rig.run(begin, false).unwrap();
    let mut worst = 0.0_f64;
    for second in 1..=4 {
        let before = (rig.machine.core.cycles(), rig.machine.core.slept());
        rig.run(begin + second * SECOND, true).unwrap();
        let slept = (rig.machine.core.slept() - before.1) as f64;
        worst = worst.max(100.0 - 100.0 * slept / (rig.machine.core.cycles() - before.0) as f64);
    }
    rig.run(begin + 8 * SECOND, false).unwrap();
    println!("{worst:.1} % busy in the worst second, modelled");
    assert!(worst < BUSY_PERCENT_MAX, "{worst:.1} % busy");
    assert_eq!(rig.machine.chip.flash.acr(), ACR);
    assert_eq!(rig.machine.chip.dbgmcu[1] & FREEZES_IWDG, FREEZES_IWDG, "APB1_FZ");
    assert!(rig.slot.violations().is_empty(), "{:?}", rig.slot.violations());

    let session = rig.sessions().pop().unwrap();
    assert!(
        session.frames.len() > 7_000 && session.losses.is_empty() && session.gaps == 0,
        "{:?}",
        session.losses
    );
    assert!(session.frames.iter().map(|(_, frame)| frame).eq(rig.sent.iter().map(|(_, frame)| frame)));
    let dir = tempfile::tempdir().unwrap();
    let card = dir.path().join("card.img");
    chip::save(&rig.medium, &card).unwrap();
    assert_verifies(&card);
}
