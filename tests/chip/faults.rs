//! Faults of the devices round the processor, each with its expected result.

use hums_tests::chip::BAUD;
use hums_tests::chip::record::Session;
use hums_tests::chip::rig::{Rig, frame, heartbeat, set};
use stm32f405_model::flash::Speed;
use stm32f405_model::machine::Board;
use stm32f405_model::rcc::Cause;
use stm32f405_model::small::Randomness;
use stm32f405_model::time::{MS, SECOND};

use super::{assert_all_recorded, assert_heard, bench, ready};

/// The low-speed oscillator at its fastest (DS8626, table 36).
const LSI_FASTEST: u32 = 47_000;

#[track_caller]
fn assert_whole(rig: &Rig) {
    assert_all_recorded(rig);
    assert!(rig.sent.len() > 500, "{} frames", rig.sent.len());
}

#[track_caller]
fn assert_no_reset(rig: &Rig) {
    assert!(rig.machine.resets.iter().all(|(_, cause)| *cause == Cause::Power), "{:?}", rig.machine.resets);
}

fn last(rig: &Rig) -> Session {
    rig.sessions().pop().expect("a session")
}

#[track_caller]
fn assert_told(rig: &Rig, text: &str) {
    let texts = last(rig).texts;
    assert!(texts.iter().any(|told| told == text), "not «{text}» but {texts:#?}");
}

/// 1 and 2: a first start erases twice.
#[test]
fn the_slowest_erases_leave_the_clock_right_and_the_fastest_watchdog_quiet() {
    for (speed, lsi_hz) in [(Speed::Typical, 32_000), (Speed::Longest, LSI_FASTEST)] {
        let mut rig = bench().rig(Board { lsi_hz, ..Board::default() });
        rig.machine.chip.flash.speed = speed;
        rig.run(3 * SECOND, false).unwrap();
        rig.run(3_200 * MS, true).unwrap();
        rig.run(4_500 * MS, false).unwrap();
        let erased: u64 = rig.machine.chip.flash.erases.iter().map(|(_, _, long)| long / MS).sum();
        assert!(rig.machine.chip.flash.erases.len() == 2 && erased >= 500, "{erased} ms");
        let sent_ms = rig.sent[0].0 / MS;
        let recorded_ms = last(&rig).frames[0].0;
        // The clock starts after 26 or 27 ms.
        assert!(
            (24..30).contains(&(sent_ms - recorded_ms)),
            "{speed:?}: sent {sent_ms}, recorded {recorded_ms}"
        );
        assert_no_reset(&rig);
    }
}

#[test]
fn what_comes_in_an_erase_is_told_and_the_watchdog_does_not_bite() {
    let mut rig = bench().settled(Board { lsi_hz: LSI_FASTEST, ..Board::default() }).unwrap();
    rig.machine.chip.flash.speed = Speed::Longest;
    let begin = rig.machine.now() + SECOND;
    rig.run(begin, false).unwrap();
    rig.fill().unwrap();
    let end = rig.machine.now() + 20 * SECOND;
    while rig.machine.chip.flash.erases.is_empty() {
        assert!(rig.machine.now() < end, "nothing was erased");
        let next = rig.machine.now() + MS;
        rig.run(next, false).unwrap();
    }
    let now = rig.machine.now() + 60 * MS;
    rig.run(now, false).unwrap();
    rig.run(now + 1_500 * MS, true).unwrap();
    rig.run(now + 2_500 * MS, false).unwrap();
    assert_no_reset(&rig);
    let compared = rig.compared();
    let session = last(&rig);
    assert!(compared.wrong == 0 && (100..2_000).contains(&compared.missing), "{compared:?}");
    let overruns: Vec<_> = session.losses.iter().filter(|(what, ..)| *what == "uart_overrun").collect();
    let [(_, _, from, to)] = overruns[..] else { panic!("{:?}", session.losses) };
    let (_, _, erase) = rig.machine.chip.flash.erases[0];
    assert!(
        (erase / MS..erase / MS + 50).contains(&(to - from)),
        "{from} to {to}, erase of {} ms",
        erase / MS
    );
}

/// 4
#[test]
fn a_crystal_that_never_starts_does_not_keep_it_from_recording() {
    let mut rig = bench().rig(Board::default());
    rig.machine.set_crystal(false);
    rig.run(2 * SECOND, false).unwrap();
    rig.run(3 * SECOND, true).unwrap();
    rig.run(4 * SECOND, false).unwrap();
    assert_whole(&rig);
    assert_told(&rig, "HUMS: crystal failed, times may be off by 4 %");
    assert!(rig.machine.chip.iwdg.is_running());
    assert_no_reset(&rig);
}

/// 4
#[test]
fn a_crystal_that_dies_in_flight_costs_the_frames_of_that_moment() {
    let (mut rig, begin) = ready(Board::default());
    rig.run(begin + SECOND, true).unwrap();
    rig.machine.set_crystal(false);
    rig.run(begin + 2 * SECOND, true).unwrap();
    rig.run(begin + 3 * SECOND, false).unwrap();
    let compared = rig.compared();
    assert!(compared.wrong == 0 && compared.missing <= 3 && compared.ends == (0, 0), "{compared:?}");
    assert_told(&rig, "HUMS: crystal failed, times may be off by 4 %");
    assert_no_reset(&rig);
}

/// 4
#[test]
fn random_numbers_that_never_come_do_not_keep_it_from_recording() {
    let mut rig = bench().rig(Board::default());
    rig.machine.chip.rng.behaves = Randomness::Never;
    rig.run(2 * SECOND, false).unwrap();
    rig.run(3 * SECOND, true).unwrap();
    rig.run(4 * SECOND, false).unwrap();
    assert_whole(&rig);
    assert_told(&rig, "HUMS: no random numbers, starts are counted");
    assert_no_reset(&rig);
}

/// 7
#[test]
fn transmitters_that_stand_still_are_told_and_cost_nothing() {
    let (mut rig, begin) = ready(Board::default());
    rig.run(begin + 300 * MS, true).unwrap();
    for port in [0, 1] {
        rig.machine.chip.usarts[port].is_stuck = true;
    }
    rig.run(begin + SECOND, true).unwrap();
    rig.run(begin + 6 * SECOND, false).unwrap();
    assert_whole(&rig);
    assert_told(&rig, "HUMS: sending to the autopilot stands still");
    assert_told(&rig, "HUMS: sending to the radio stands still");
    assert_no_reset(&rig);
}

#[test]
fn flash_that_refuses_a_word_is_told_and_saving_goes_on() {
    const FAILED: &str = "HUMS: saving failed, have the board replaced";
    let (mut rig, _) = ready(Board::default());
    let set = |rig: &mut Rig, value: f32| {
        let now = rig.machine.now();
        let end = rig.machine.send(0, &heartbeat(1), now, BAUD);
        rig.sent.push((end, heartbeat(1)));
        rig.machine.send(1, &set("BAT_TEMP_WARN", value, 1), now + 100 * MS, 57_600.0);
        rig.run(now + 3 * SECOND, false).unwrap();
        rig.machine.chip.flash.counts.1
    };
    rig.machine.chip.flash.refuses = 1;
    set(&mut rig, 40.0);
    assert_eq!(rig.machine.chip.flash.refuses, 0, "nothing was refused: this has tried nothing");
    assert!(
        !last(&rig).texts.iter().any(|text| text == FAILED),
        "what is saved at another place has not failed"
    );
    rig.machine.chip.flash.refuses = 2;
    let refused = set(&mut rig, 41.0);
    assert_eq!(rig.machine.chip.flash.refuses, 0, "less was refused than it was to refuse");
    assert_told(&rig, FAILED);
    let saved = set(&mut rig, 42.0);
    assert!(saved > refused, "{refused} words, and then {saved}");
    assert_no_reset(&rig);
    assert_heard(&mut rig, "HUMS: saving failed");
}

#[test]
fn a_change_of_a_ports_rate_cuts_no_byte() {
    let (mut rig, _) = ready(Board::default());
    let mut baud = 57_600.0;
    for next in [38_400.0, 115_200.0, 19_200.0, 57_600.0] {
        let now = rig.machine.now();
        rig.machine.send(1, &set("GS_BAUD", next as f32, 1), now, baud);
        let has_changed = |rig: &Rig| (rig.machine.chip.usarts[1].baud() / next - 1.0).abs() < 0.01;
        while !has_changed(&rig) {
            assert!(rig.machine.now() < now + 2 * SECOND, "still {baud}, not {next}");
            rig.run_for(10 * MS, true).unwrap();
        }
        rig.run_for(200 * MS, true).unwrap();
        let port = &rig.machine.chip.usarts[1];
        assert_eq!(port.counts.cut, 0, "from {baud} to {next}");
        baud = next;
    }
    assert_no_reset(&rig);
}

#[test]
fn beginnings_without_a_frame_at_full_rate_starve_nobody() {
    let (mut rig, _) = ready(Board::default());
    for pattern in [[0xFE; 5], [0xFD, 0xFF, 0, 0, 0]] {
        let now = rig.machine.now();
        let end = rig.machine.send(0, &pattern.repeat(28_000), now, BAUD);
        rig.run(end + 50 * MS, false).unwrap();
    }
    assert_no_reset(&rig);
    let now = rig.machine.now();
    rig.run(now + SECOND, true).unwrap();
    rig.run(now + 3 * SECOND, false).unwrap();
    assert_whole(&rig);
    assert_no_reset(&rig);
}

#[test]
fn more_frames_than_the_processor_can_take_are_lost_and_counted() {
    const ESC_STATUS: (u32, u8) = (291, 10);
    let (mut rig, begin) = ready(Board::default());
    let art = &mut rig.machine.chip.art;
    let (latency, prefetch) = (art.latency, art.prefetch);
    art.set_caches(false, false);
    (art.latency, art.prefetch) = (12, false);
    let mut free = begin;
    for number in 0..21_000_u32 {
        let frame = frame(ESC_STATUS.0, &[1 + (number % 255) as u8], ESC_STATUS.1, number as u8);
        free = rig.machine.send(0, &frame, free, BAUD);
        rig.sent.push((free, frame));
    }
    let slept = rig.machine.core.slept();
    rig.run(free, false).unwrap();
    assert_no_reset(&rig);
    let idle = (rig.machine.core.slept() - slept) as f64 / 168e6 / ((free - begin) as f64 / SECOND as f64);
    assert!(idle < 0.1, "{idle}: the processor was not too slow, this has tried nothing");
    let art = &mut rig.machine.chip.art;
    art.set_caches(true, true);
    (art.latency, art.prefetch) = (latency, prefetch);
    rig.run(free + 4 * SECOND, false).unwrap();
    assert_no_reset(&rig);
    let (compared, losses) = (rig.compared(), last(&rig).losses);
    let told: u64 = losses.iter().map(|(_, count, ..)| count).sum();
    assert!(compared.wrong == 0 && compared.missing > 1_000, "{compared:?}");
    assert_eq!(told, compared.missing as u64, "{losses:?}");
}
