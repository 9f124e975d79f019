//! Other boards' images, each with its own crystal, ports, card's bus and held pins.

use hums_boards::{Board, Level};
use hums_sdcard::{Event, Fault, Kind, Model, Plan};
use hums_tests::chip::pin;
use hums_tests::chip::rig::{Bench, Rig};
use hums_tests::program;
use stm32f405_model::machine::Board as Parts;
use stm32f405_model::rcc::Cause;
use stm32f405_model::time::{MS, SECOND, US};

use super::{assert_all_recorded, bench_of, update, usb};

const IN_MEMORY_MAX: usize = 700;
/// Of a card that is busy while frames come at full rate.
const STALL_NS: u64 = 1_000_000_000;

fn bench(board: &Board) -> (Bench, Parts) {
    let image = program::firmware().with_file_name(format!("hums-{}.elf", board.name));
    (bench_of(&image), Parts { hse_hz: board.crystal_hz, ..Parts::default() })
}

#[track_caller]
fn assert_held(rig: &Rig) {
    let (gpio, hold) = (&rig.machine.chip.gpio, &rig.wired.hold);
    for high in hold.high.keys() {
        assert!(gpio.is_high(pin(*high)), "{}: {high}", rig.wired.name);
    }
    for low in hold.low.keys() {
        assert!(gpio.pulls_low(pin(*low)), "{}: {low}", rig.wired.name);
    }
}

fn fly(board: &Board) {
    println!("{}", board.name);
    let (bench, parts) = bench(board);
    let mut rig = bench.rig(parts);
    while rig.slot.counts().bytes == 0 {
        assert!(rig.machine.now() < SECOND, "{}: no clock to the card", board.name);
        rig.run_for(20 * US, false).unwrap();
    }
    assert_held(&rig);
    rig.run(SECOND, false).unwrap();
    rig.run(2 * SECOND, true).unwrap();
    assert!(rig.machine.chip.rcc.pll_on_hse(), "{}: not on its crystal", board.name);
    let blinks = |rig: &Rig| rig.led.len();
    let before = blinks(&rig);
    rig.slot.event(Event::Pull);
    rig.run(3 * SECOND, true).unwrap();
    let blinks_without_a_card = blinks(&rig) - before;
    assert!(blinks_without_a_card > 5, "{}: {blinks_without_a_card} changes of the LED", board.name);
    let stall = Plan::always(Fault::Busy(STALL_NS)).from(rig.slot.now_ns() + 2 * STALL_NS).times(1);
    rig.slot.event(Event::Insert(Model::new(Kind::Sdhc, rig.medium.clone()).with(stall)));
    rig.run(5 * SECOND, false).unwrap();
    rig.run(7 * SECOND, true).unwrap();
    rig.machine.power_off();
    rig.run(7 * SECOND + 100 * MS, false).unwrap();
    rig.machine.power_on();
    rig.run(8 * SECOND, false).unwrap();
    rig.run(9 * SECOND, true).unwrap();
    rig.run(10 * SECOND, false).unwrap();
    assert_held(&rig);
    assert!(rig.machine.resets.iter().all(|(_, cause)| *cause == Cause::Power), "{:?}", rig.machine.resets);
    assert!(rig.slot.violations().is_empty(), "{}: {:?}", board.name, rig.slot.violations());
    let compared = rig.compared();
    println!("{compared:?} of {}", rig.sent.len());
    assert!(compared.wrong == 0 && compared.missing < IN_MEMORY_MAX, "{}: {compared:?}", board.name);
    assert!(rig.sessions().len() >= 2, "{}", board.name);
}

#[test]
#[ignore = "wants the images of all boards: `cargo xtask prove boards`"]
fn each_board_records_and_survives_a_stall_and_the_loss_of_card_and_power() {
    hums_boards::all().iter().for_each(fly);
}

#[test]
#[ignore = "wants the images of all boards: `cargo xtask prove boards`"]
fn each_board_serves_a_usb_host_and_installs_an_update() {
    for board in hums_boards::all() {
        println!("{}", board.name);
        let (bench, parts) = bench(board);
        let mut rig = bench.settled(parts).unwrap();
        rig.run_for(SECOND, false).unwrap();
        usb::serve(&mut rig);
        if let Some(button) = &board.button {
            let mut rig = bench.settled(parts).unwrap();
            rig.machine.drive(pin(button.pin), Some(button.pressed == Level::High));
            usb::read_card(&mut rig);
        }
        update::install(&mut bench.rig(parts));
    }
}

#[test]
fn a_wrong_crystal_or_chip_is_told_and_the_board_records() {
    const STM32F446: u32 = 0x1000_6421;
    let cases = [
        (12_000_000, None, "HUMS: wrong crystal, load this board's firmware"),
        (8_000_000, Some(STM32F446), "HUMS: wrong chip, it needs an STM32F405"),
    ];
    for (hse_hz, idcode, text) in cases {
        let mut rig = bench_of(&program::firmware()).rig(Parts { hse_hz, ..Parts::default() });
        rig.machine.chip.idcode = idcode.unwrap_or(rig.machine.chip.idcode);
        rig.run(2 * SECOND, false).unwrap();
        rig.run(3 * SECOND, true).unwrap();
        rig.run(5 * SECOND, false).unwrap();
        assert_eq!(rig.machine.chip.rcc.pll_on_hse(), idcode.is_some(), "{text}");
        let session = rig.sessions().pop().unwrap();
        assert_eq!(session.texts.iter().filter(|told| *told == text).count(), 1, "{:?}", session.texts);
        assert!(session.texts.iter().all(|told| !told.contains("crystal failed")), "{:?}", session.texts);
        assert_all_recorded(&rig);
        // Two brief blinks a second.
        let lit = rig.led.iter().filter(|(at, lit)| *at > 3 * SECOND && *lit).count();
        assert!((3..=5).contains(&lit), "{lit} in two seconds");
    }
}
