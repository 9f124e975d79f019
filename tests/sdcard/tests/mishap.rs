//! All frames go to the card at once: the next moment may be the last.

use crate::rig;

use hums_blackbox::record::MarkReason;
use hums_recorder::CardState;
use hums_sdcard::{Kind, MS, Medium, Model};
use rig::{Rig, read};

const MIB: u32 = 2_048;
/// The text.
const FOUND: &str = "HUMS: tumbling: ";
/// `ATTITUDE`, `GLOBAL_POSITION_INT`, `EXTENDED_SYS_STATE`
const ATTITUDE: u32 = 30;
const POSITION: u32 = 33;
const LANDED: u32 = 245;

/// `MAV_LANDED_STATE_ON_GROUND`, `MAV_LANDED_STATE_IN_AIR`
const ON_GROUND: u8 = 1;
const IN_AIR: u8 = 2;

/// A tenth of a second at 30 m, turning at `rate`.
fn say(rig: &mut Rig, rate: f32, landed: u8) {
    let mut attitude = vec![0; 16];
    attitude.extend(rate.to_le_bytes());
    attitude.extend([0; 8]);
    rig.say(ATTITUDE, &attitude);
    let mut position = vec![0; 4];
    for field in [473_977_420_i32, 85_455_940, 500_000, 30_000] {
        position.extend(field.to_le_bytes());
    }
    position.extend([0; 8]);
    rig.say(POSITION, &position);
    rig.say(LANDED, &[0, landed]);
    let now_ms = rig.slot.now_ns() / MS;
    rig.run_to(now_ms + 100);
}

#[test]
fn a_mishap_is_on_the_card_within_200_ms_with_its_place_and_told() {
    let medium = Medium::formatted(64 * MIB);
    let mut rig = Rig::new(Model::new(Kind::Sdhc, medium.clone()));
    rig.armed = true;
    rig.run_to(10_000);
    rig.assert_state(CardState::Recording);
    for _ in 0..50 {
        say(&mut rig, 0.1, IN_AIR);
    }
    assert!(!rig.was_told(FOUND, 0), "{:?}", rig.texts);
    while !rig.was_told(FOUND, 0) {
        say(&mut rig, 15.0, IN_AIR);
        assert!(rig.slot.now_ns() / MS < 17_000, "not told: {:?}", rig.texts);
    }
    let told = rig.texts.iter().find(|(_, text)| text.starts_with(FOUND)).expect("told").0;
    rig.run_to(told.as_millis() + 200);
    let found = read(&medium);
    let event = found.events.iter().find(|(number, _)| *number == 15);
    assert_eq!(event.map(|(_, text)| text.as_str()), Some("mishap at 47.397742,8.545594 30 m"));
    assert_eq!(found.marks, [MarkReason::Mishap]);
    rig.run_to(told.as_millis() + 1_000);
    for _ in 0..60 {
        say(&mut rig, 15.0, IN_AIR);
    }
    rig.finish_whole(&medium);
}

#[test]
fn what_is_seen_on_the_bench_is_an_event_of_the_log_and_is_not_told() {
    let medium = Medium::formatted(64 * MIB);
    let mut rig = Rig::new(Model::new(Kind::Sdhc, medium.clone()));
    for _ in 0..100 {
        say(&mut rig, 0.1, ON_GROUND);
    }
    rig.armed = true;
    for turned in [0.1, 15.0, 0.1, 15.0] {
        for _ in 0..25 {
            say(&mut rig, turned, ON_GROUND);
        }
    }
    assert!(rig.texts.iter().all(|(_, text)| !text.contains("mishap")), "{:?}", rig.texts);
    rig.finish_whole(&medium);
    let events: Vec<_> =
        read(&medium).events.into_iter().filter(|(number, _)| (15..=18).contains(number)).collect();
    assert_eq!(events, [(18, "tumbling".to_owned())], "once for an arming");
}
