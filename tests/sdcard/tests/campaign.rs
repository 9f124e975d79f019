//! After any fault of the card the recorder records, or reports its state to the pilot, and records again with the
//! card. Every frame is on a card or counted as lost.

use crate::rig;

use hums_blackbox::{Header, NotASector};
use hums_core::clock::Span;
use hums_core::health::Level;
use hums_recorder::CardState;
use hums_recorder::spi::{BUSY_MAX, SERVICE_MAX};
use hums_sdcard::{Event, Fault, Kind, MS, Medium, Model, Plan};
use rig::{Rig, read};

const MIB: u32 = 2_048;
const S: u64 = 1_000 * MS;

fn medium() -> Medium {
    Medium::formatted(256 * MIB)
}

fn sdhc(medium: &Medium) -> Model {
    Model::new(Kind::Sdhc, medium.clone())
}

/// 10 s before an event.
fn recording(model: Model) -> Rig {
    let mut rig = Rig::new(model);
    rig.run_to(9_000);
    rig.assert_state(CardState::Recording);
    assert!(rig.texts.iter().all(|(_, text)| !text.contains("card: ")), "{:?}", rig.texts);
    rig
}

#[test]
fn every_kind_of_card_is_recorded_on() {
    for (kind, mib) in
        [(Kind::Old, 64), (Kind::Sdsc, 1_024), (Kind::Sdhc, 8 * 1_024), (Kind::Sdxc, 128 * 1_024)]
    {
        let medium = Medium::formatted(mib * MIB);
        let mut rig = recording(Model::new(kind, medium.clone()));
        rig.run_to(20_000);
        let found = rig.finish_whole(&medium);
        assert_eq!((found.sessions, found.segments), (1, 1), "{kind:?}");
    }
}

/// Its own records, every 10 s, and parity.
#[test]
fn a_silent_line_wears_no_card() {
    let medium = medium();
    let mut rig = recording(sdhc(&medium));
    rig.is_silent = true;
    rig.run_to(20_000);
    let before = medium.writes();
    rig.run_to(620_000);
    let writes = medium.writes() - before;
    assert!(writes < 600, "{writes} blocks in 10 minutes");
    rig.finish_whole(&medium);
}

/// On a slow line only copies of the sector in progress are written. The card stalls until full sectors wait, and is
/// pulled while they are written.
#[test]
fn a_card_that_erases_ahead_never_holds_less_than_was_on_it() {
    for step in 0..60 {
        let medium = medium();
        let stall_ns = 10 * S + step * 23 * MS;
        let stall = Plan::always(Fault::Busy(2_000 * MS)).from(stall_ns).times(1);
        let mut rig = recording(sdhc(&medium).with(stall));
        rig.run_to(stall_ns / MS + 1_000);
        let known = read(&medium).frames.len();
        rig.slot.at_byte(rig.slot.counts().bytes + 300 + step * 211, Event::Pull);
        while rig.slot.has_card() {
            rig.run_to(rig.slot.now_ns() / MS + 1);
        }
        let left = read(&medium).frames.len();
        assert!(left >= known, "{step}: {left} of {known} frames");
    }
}

#[test]
fn a_card_that_starts_slowly_misses_nothing() {
    let medium = medium();
    let rig = recording(Model { start_ns: S, ..sdhc(&medium) });
    rig.finish_whole(&medium);
}

#[test]
fn a_card_that_never_starts_is_told_and_tried_again() {
    let medium = medium();
    let mut rig = Rig::new(Model { start_ns: u64::MAX, ..sdhc(&medium) });
    rig.run_to(10_000);
    rig.assert_state(CardState::Failing);
    rig.assert_told("card: fails", 0);
    rig.slot.event(Event::Insert(sdhc(&medium)));
    rig.run_to(15_000);
    rig.assert_state(CardState::Recording);
    rig.assert_told("card: recording", 10_000);
    rig.finish_whole(&medium);
}

#[test]
fn a_card_that_stands_still_for_two_and_a_half_seconds_misses_nothing() {
    let medium = medium();
    let model = [10, 15, 20].into_iter().fold(sdhc(&medium), |model, second| {
        model.with(Plan::always(Fault::Busy(2_500 * MS)).from(second * S).times(1))
    });
    let mut rig = recording(model);
    rig.run_to(30_000);
    rig.assert_state(CardState::Recording);
    assert!(rig.longest >= Span::from_millis(2_500) && rig.longest < Span::from_secs(3), "{:?}", rig.longest);
    assert!(rig.findings.iter().any(|(_, check, level)| *check == "card_stall" && *level == Level::Warning));
    let found = rig.finish_whole(&medium);
    assert_eq!(found.segments, 1, "it was never given up");
}

#[test]
fn a_card_that_stands_still_for_longer_is_given_up_and_taken_again() {
    let medium = medium();
    let mut rig = recording(sdhc(&medium).with(Plan::always(Fault::Busy(7 * S)).from(10 * S).times(1)));
    rig.run_to(30_000);
    rig.assert_told("card: fails", 10_000);
    rig.assert_state(CardState::Recording);
    rig.assert_told("card: recording", 13_000);
    let found = rig.finish_whole(&medium);
    assert_eq!((found.sessions, found.segments), (1, 2), "the same session goes on");
}

#[test]
fn a_card_that_stands_still_for_ever_is_told_within_its_time_and_recorded_on_after_it_was_pulled() {
    let medium = medium();
    let mut rig = recording(sdhc(&medium).with(Plan::always(Fault::Busy(u64::MAX)).from(10 * S)));
    rig.run_to(10_500 + BUSY_MAX.as_millis());
    rig.assert_told("card: fails", 10_000);
    rig.run_to(20_000);
    rig.assert_state(CardState::Failing);
    assert!(rig.longest < SERVICE_MAX + Span::from_secs(1), "{:?}", rig.longest);
    assert!(rig.findings.iter().any(|(_, check, _)| *check == "recording"));
    rig.slot.event(Event::Insert(sdhc(&medium)));
    rig.run_to(30_000);
    rig.assert_state(CardState::Recording);
    rig.assert_told("card: recording", 20_000);
    rig.finish_whole(&medium);
}

#[test]
fn blocks_that_are_damaged_on_their_way_now_and_then_cost_nothing_but_a_second_try() {
    for fault in [Fault::DamagedWrite, Fault::DamagedRead, Fault::DamagedCommand, Fault::Silent] {
        let medium = medium();
        let model = (1..40).fold(sdhc(&medium), |model, second| {
            model.with(Plan::always(fault).from(10 * S + second * S / 2).times(1))
        });
        let mut rig = recording(model);
        rig.run_to(30_000);
        rig.assert_state(CardState::Recording);
        let errors = rig.status.read().write_errors;
        assert!(fault == Fault::DamagedRead || errors >= 30, "{fault:?}: {errors} are counted");
        let found = rig.finish_whole(&medium);
        assert_eq!(found.segments, 1, "{fault:?}");
    }
}

#[test]
fn a_bad_line_is_told_and_recorded_over_again_once_it_is_good() {
    for (fault, told) in [
        (Fault::DamagedWrite, "card: fails"),
        (Fault::DamagedCommand, "card: fails"),
        (Fault::WriteError, "card: fails"),
        (Fault::NotProgrammed, "card: fails"),
        (Fault::Silent, "card: none found"),
    ] {
        let medium = medium();
        let mut rig = recording(sdhc(&medium).with(Plan::always(fault).from(10 * S).until(20 * S)));
        rig.run_to(19_000);
        rig.assert_told(told, 10_000);
        assert_ne!(rig.state(), CardState::Recording, "{fault:?}");
        rig.run_to(30_000);
        rig.assert_state(CardState::Recording);
        rig.assert_told("card: recording", 20_000);
        assert!(rig.status.read().write_errors > 0);
        rig.finish_whole(&medium);
    }
}

#[test]
fn noise_on_the_line_is_told_and_recorded_over_again_once_it_is_gone() {
    let medium = medium();
    let mut rig = recording(sdhc(&medium).with(Plan::always(Fault::Noise).from(10 * S).until(18 * S)));
    rig.run_to(17_000);
    assert_ne!(rig.state(), CardState::Recording);
    rig.assert_told("card:", 10_000);
    rig.run_to(35_000);
    rig.assert_state(CardState::Recording);
    assert!(rig.longest < SERVICE_MAX + Span::from_secs(1), "{:?}", rig.longest);
    // That traffic is not the driver's fault.
    let (found, lost) = rig.finish(&[&medium]);
    assert_eq!((lost, found[0].gaps.len()), (0, 0));
}

/// Reported on request only.
#[test]
fn a_block_that_was_taken_but_not_programmed_is_written_again() {
    for skip in [0, 1, 5] {
        let medium = medium();
        let plan = Plan::always(Fault::NotProgrammed).from(10 * S).skip(skip).times(1);
        let mut rig = recording(sdhc(&medium).with(plan));
        rig.run_to(20_000);
        assert_eq!(rig.status.read().write_errors, 1);
        rig.finish_whole(&medium);
    }
}

#[test]
fn a_place_that_fails_is_left_for_a_new_segment() {
    let medium = medium();
    let mut rig = recording(sdhc(&medium).with(Plan::always(Fault::WriteError).from(10 * S).times(8)));
    rig.run_to(20_000);
    rig.assert_state(CardState::Recording);
    assert_eq!(rig.status.read().write_errors, 8);
    let found = rig.finish_whole(&medium);
    assert_eq!((found.sessions, found.segments), (1, 2));
}

#[test]
fn wrong_tokens_at_power_on_are_told_and_tried_again() {
    for fault in [Fault::Token(0x08), Fault::Token(0x55), Fault::NoBlock, Fault::DamagedRead] {
        let medium = medium();
        let mut rig = Rig::new(sdhc(&medium).with(Plan::always(fault).until(8 * S)));
        rig.run_to(7_000);
        rig.assert_state(CardState::Failing);
        rig.assert_told("card: fails", 0);
        rig.run_to(18_000);
        rig.assert_state(CardState::Recording);
        rig.assert_told("card: recording", 7_000);
        rig.finish_whole(&medium);
    }
}

#[test]
fn a_card_that_is_pulled_and_put_back_misses_nothing() {
    let medium = medium();
    let mut rig = recording(sdhc(&medium));
    rig.slot.at(10 * S, Event::Pull);
    rig.slot.at(16 * S, Event::Insert(sdhc(&medium)));
    rig.run_to(15_000);
    rig.assert_state(CardState::Absent);
    rig.assert_told("card: none found", 10_000);
    rig.run_to(30_000);
    rig.assert_state(CardState::Recording);
    rig.assert_told("card: recording", 16_000);
    let found = rig.finish_whole(&medium);
    assert_eq!((found.sessions, found.segments), (1, 2), "the same session, in a new file");
}

#[test]
fn a_card_that_is_out_for_longer_than_the_queue_lasts_loses_counted_frames() {
    let medium = medium();
    let mut rig = recording(sdhc(&medium));
    rig.slot.at(10 * S, Event::Pull);
    rig.slot.at(90 * S, Event::Insert(sdhc(&medium)));
    rig.run_to(110_000);
    rig.assert_state(CardState::Recording);
    let (found, lost) = rig.finish(&[&medium]);
    assert!(lost > 0);
    let found = &found[0];
    assert!(found.gaps.is_empty(), "what is lost was refused before it was encoded: {:?}", found.gaps);
    assert!(found.frames.last().is_some_and(|last| *last > 2_600), "it went on");
}

/// Pulled at bytes spread over all commands, and put back two seconds later.
#[test]
fn a_card_that_is_pulled_at_any_byte_misses_nothing() {
    const PULLS: u64 = 60;
    let mut clean = Rig::new(sdhc(&medium()));
    clean.run_to(20_000);
    let bytes = clean.slot.counts().bytes;
    let mut torn = 0;
    for step in 0..PULLS {
        let medium = medium();
        let mut rig = Rig::new(sdhc(&medium));
        // Not at the same place of each command.
        rig.slot.at_byte(bytes * step / PULLS + step * 37 % 512, Event::Pull);
        while rig.slot.has_card() {
            rig.run_to(rig.slot.now_ns() / MS + 10);
        }
        torn += u64::from(damaged(&medium) > 0);
        rig.slot.at(rig.slot.now_ns() + 2 * S, Event::Insert(sdhc(&medium)));
        rig.run_to(rig.slot.now_ns() / MS + 8_000);
        rig.assert_state(CardState::Recording);
        let (found, lost) = rig.finish(&[&medium]);
        assert_eq!((lost, found[0].gaps.len()), (0, 0), "step {step}");
    }
    assert!((3..PULLS).contains(&torn), "{torn} of {PULLS} pulls tore a sector");
}

/// Torn sectors.
fn damaged(medium: &Medium) -> usize {
    let is_damaged = |block: &&[u8; 512]| matches!(Header::read(block), Err(NotASector::Damaged));
    medium.content().values().filter(is_damaged).count()
}

#[test]
fn contact_that_is_lost_for_a_moment_again_and_again_costs_nothing() {
    let medium = medium();
    let mut rig = recording(sdhc(&medium));
    for bounce in 0..40 {
        rig.slot.at(10 * S + bounce * 313 * MS, Event::Bounce);
    }
    rig.run_to(25_000);
    rig.assert_state(CardState::Recording);
    assert!(!rig.was_told("card: ", 0), "{:?}", rig.texts);
    let (found, lost) = rig.finish(&[&medium]);
    assert_eq!((lost, found[0].gaps.len(), found[0].segments), (0, 0, 1));
}

#[test]
fn on_another_card_a_new_session_begins() {
    for gap_ms in [0, 1, 300, 3_000] {
        let (first, second) = (medium(), Medium::formatted(100 * MIB));
        let other = Model { serial: 5, ..Model::new(Kind::Sdsc, second.clone()) };
        let mut rig = recording(sdhc(&first));
        rig.slot.at(10 * S, Event::Pull);
        rig.slot.at(10 * S + gap_ms * MS, Event::Insert(other));
        rig.run_to(25_000);
        rig.assert_state(CardState::Recording);
        let (found, lost) = rig.finish(&[&first, &second]);
        assert!(lost < 30, "{gap_ms} ms: {lost} lost: what was under way belonged to the first card");
        assert!(found.iter().all(|found| found.sessions == 1 && found.gaps.is_empty()), "{found:?}");
        assert!(found[1].frames.len() > 250);
    }
}

#[test]
fn a_write_protected_card_is_told_and_not_touched() {
    for locked in [(true, false), (false, true)] {
        let (first, second) = (medium(), medium());
        let before = first.content();
        let mut rig = Rig::new(Model { locked, ..sdhc(&first) });
        rig.run_to(8_000);
        rig.assert_state(CardState::Locked);
        rig.assert_told("card: write protected", 0);
        assert_eq!(rig.command(526, [1.0, 1.0]), Some(4), "failed");
        assert_eq!(first.content(), before);
        rig.slot.event(Event::Insert(Model { serial: 2, ..sdhc(&second) }));
        rig.run_to(18_000);
        rig.assert_state(CardState::Recording);
        rig.finish_whole(&second);
    }
}

#[test]
fn a_card_full_of_other_files_is_told_and_not_touched() {
    let medium = Medium::formatted(40 * MIB);
    fill(&medium);
    let before = medium.content();
    let mut rig = Rig::new(Model::new(Kind::Sdsc, medium.clone()));
    rig.run_to(8_000);
    rig.assert_state(CardState::Full);
    rig.assert_told("card: full of other files", 0);
    assert_eq!(rig.command(526, [1.0, 1.0]), Some(2), "denied: these are somebody's files");
    assert_eq!(medium.content(), before);
}

fn fill(medium: &Medium) {
    let layout = hums_recorder::layout::Layout::read(medium).expect("it is formatted");
    for fat_block in 0..layout.fat_blocks {
        for entry in 0..128 {
            if fat_block * 128 + entry > 2 {
                medium.patch(layout.fat_start + fat_block, entry as usize * 4, &[0xF8, 0xFF, 0xFF, 0x0F]);
            }
        }
    }
}

#[test]
fn a_card_that_comes_and_goes_does_not_fill_the_line() {
    let medium = medium();
    let mut rig = recording(sdhc(&medium));
    for time in 0..30 {
        rig.slot.at(10 * S + time * 2 * S, Event::Pull);
        rig.slot.at(11 * S + time * 2 * S, Event::Insert(sdhc(&medium)));
    }
    rig.run_to(85_000);
    rig.assert_state(CardState::Recording);
    let texts = rig.texts.iter().filter(|(_, text)| text.contains("card: ")).count();
    assert!((2..=16).contains(&texts), "{texts}");
    let last = rig.texts.iter().rev().find(|(_, text)| text.contains("card: "));
    assert!(
        last.is_some_and(|(_, text)| text.contains("recording")),
        "the last word is how it is: {:?}",
        rig.texts
    );
    let (found, lost) = rig.finish(&[&medium]);
    assert_eq!((lost, found[0].gaps.len(), found[0].sessions), (0, 0, 1));
}

#[test]
fn an_empty_slot_is_told_and_the_card_that_comes_is_recorded_on() {
    let medium = medium();
    let mut rig = Rig::new(None);
    rig.run_to(8_000);
    rig.assert_state(CardState::Absent);
    rig.assert_told("card: none found", 0);
    rig.slot.event(Event::Insert(sdhc(&medium)));
    rig.run_to(18_000);
    rig.assert_state(CardState::Recording);
    rig.assert_told("card: recording", 8_000);
    let found = rig.finish_whole(&medium);
    assert_eq!(found.frames.first(), Some(&0), "what came before it waited");
    assert_eq!(read(&medium).sessions, 1);
}
