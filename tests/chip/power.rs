//! Power cuts, a brown-out, a stalled card, a noisy line.

use hums_sdcard::{Fault, Plan};
use hums_tests::chip::BAUD;
use hums_tests::chip::rig::Rig;
use stm32f405_model::line::{Char, Flaw, chars};
use stm32f405_model::machine::Board;
use stm32f405_model::time::{MS, SECOND, US};

use super::{assert_all_recorded, assert_heard, bench, ready};

const IN_MEMORY_MAX: usize = 700;

const FIRST_BUSY_PERCENT_MAX: f64 = 47.0;

#[test]
fn power_that_goes_at_full_rate_costs_what_was_in_memory() {
    let mut rig = bench().settled(Board::default()).unwrap();
    let begin = rig.machine.now() + SECOND;
    let before = (rig.machine.core.cycles(), rig.machine.core.slept());
    rig.run(begin, true).unwrap();
    let slept = (rig.machine.core.slept() - before.1) as f64;
    let busy = 100.0 - 100.0 * slept / (rig.machine.core.cycles() - before.0) as f64;
    println!("{busy:.1} % busy in the second from power on, modelled");
    assert!(busy < FIRST_BUSY_PERCENT_MAX, "{busy:.1} % busy");
    for cut in 1..=3_u64 {
        let at = rig.machine.now() + (300 + 173 * cut) * MS + cut * 7_919 * US;
        rig.run(at, true).unwrap();
        rig.machine.power_off();
        rig.run(at + 20 * MS, false).unwrap();
        rig.machine.power_on();
    }
    let end = rig.machine.now() + SECOND;
    rig.run(end, true).unwrap();
    rig.run(end + SECOND, false).unwrap();
    let sessions = rig.sessions();
    assert!(sessions.iter().filter(|session| session.frames.len() > 200).count() == 4, "{}", sessions.len());
    let compared = rig.compared();
    assert!(compared.wrong == 0 && compared.missing < 3 * IN_MEMORY_MAX, "{compared:?}");
}

#[test]
fn power_that_goes_in_an_erase_of_the_store_leaves_a_board_that_records() {
    for part in [5, 245, 400] {
        let mut rig = bench().rig(Board::default());
        rig.run((20 + part) * MS, false).unwrap();
        rig.machine.power_off();
        rig.run((25 + part) * MS, false).unwrap();
        rig.machine.power_on();
        let begin = rig.machine.now() + 1_500 * MS;
        rig.run(begin, false).unwrap();
        rig.run(begin + 500 * MS, true).unwrap();
        rig.run(begin + 1_500 * MS, false).unwrap();
        assert_all_recorded(&rig);
    }
}

#[test]
fn a_card_that_stands_still_for_two_and_a_half_seconds_costs_nothing() {
    let busy = Plan::always(Fault::Busy(2_500_000_000)).from(4_000_000_000).times(1);
    let bench = bench();
    let mut rig = Rig::with(&bench.image, Board::default(), bench.frames, vec![busy]);
    rig.run(1_500 * MS, false).unwrap();
    rig.run(7_000 * MS, true).unwrap();
    rig.run(10_500 * MS, false).unwrap();
    assert_all_recorded(&rig);
    assert!(rig.slot.violations().is_empty(), "{:?}", rig.slot.violations());
    let session = rig.sessions().pop().unwrap();
    assert!(session.losses.is_empty(), "{:?}", session.losses);
}

#[test]
fn a_supply_that_sags_is_survived_recorded_and_told() {
    let (mut rig, begin) = ready(Board::default());
    rig.run(begin + 500 * MS, true).unwrap();
    rig.machine.take_sent(1);
    let resets = rig.machine.resets.len();
    rig.machine.set_supply(2_700);
    rig.run(begin + 1_500 * MS, true).unwrap();
    assert_eq!(rig.machine.resets.len(), resets, "a reset while it was low");
    rig.machine.set_supply(3_300);
    rig.run(begin + 2_000 * MS, true).unwrap();
    rig.run(begin + 3_500 * MS, false).unwrap();
    let session = rig.sessions().pop().unwrap();
    assert!(session.frames.len() > 500, "{} frames after it", session.frames.len());
    let texts = &session.texts;
    assert!(texts.iter().any(|text| text.starts_with("fault: below 2.7 V in ")), "{texts:#?}");
    assert_heard(&mut rig, "HUMS: restarted after: supply low");
    let compared = rig.compared();
    assert!(compared.wrong == 0 && compared.missing < 1_950 + IN_MEMORY_MAX, "{compared:?}");
}

#[test]
fn a_noisy_line_costs_the_frames_that_it_damaged() {
    let (mut rig, begin) = ready(Board::default());
    let frames = bench().frames;
    let (mut free, mut damaged) = (begin, 0);
    for (number, frame) in frames.iter().take(1_500).enumerate() {
        let (mut line, end) = chars(frame, free, BAUD);
        let middle = line.len() / 2;
        match number % 40 {
            5 => line[middle].byte ^= 0x10,
            15 => line[middle].flaw = Flaw::Noise,
            // The byte is still right.
            25 => line[middle].flaw = Flaw::Framing,
            35 => line.push(Char { start: end, byte: 0xFD, ..line[0] }),
            _ => {}
        }
        if number % 40 == 5 {
            damaged += 1;
        } else {
            rig.sent.push((end, frame.clone()));
        }
        // A slow sender: a pause in which the line may stay low.
        free = end + if number % 40 == 35 { 30 * MS } else { 20 * US };
        rig.machine.send_chars(0, line);
        if number % 100 == 99 {
            rig.run(free, false).unwrap();
        }
    }
    rig.run(free + 1_500 * MS, false).unwrap();
    assert!(damaged > 30);
    let compared = rig.compared();
    assert_eq!(compared.wrong, 0, "{compared:?}");
    let session = rig.sessions().pop().unwrap();
    let told: u64 =
        session.losses.iter().filter(|(what, ..)| *what == "damaged_frames").map(|loss| loss.1).sum();
    assert!(
        compared.missing == 0 && told >= damaged,
        "{compared:?}, {damaged} damaged, {:?}",
        session.losses
    );
}
