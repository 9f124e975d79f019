//! Arming times.

use std::fmt::Write as _;

use hums_core::observation::{LandedState, Observation};

use super::writer::Writer;
use super::{Seen, seen};
use crate::source::item::Cause;

fn changes(seen: &Seen) -> Vec<(u64, bool)> {
    let mut changes: Vec<(u64, bool)> = Vec::new();
    for (ms, observation) in &seen.observations {
        if let Observation::Heartbeat(heartbeat) = observation
            && changes.last().is_none_or(|(_, armed)| *armed != heartbeat.armed)
        {
            changes.push((ms / 1_000, heartbeat.armed));
        }
    }
    changes
}

fn is_said(seen: &Seen, words: &str) -> bool {
    seen.said.iter().any(|said| said.contains(words))
}

/// EV (161) and PARM (162).
fn copter(logs_disarmed: f32) -> Writer {
    let mut log = Writer::new();
    log.format(160, "MSG", "QZ", "TimeUS,Message");
    log.format(161, "EV", "QB", "TimeUS,Id");
    log.format(162, "PARM", "QNf", "TimeUS,Name,Value");
    log.message(1.0, "ArduCopter V4.6.3 (92b0cd78)");
    let mut name = [0; 16];
    name[..12].copy_from_slice(b"LOG_DISARMED");
    log.raw(162, &[&1_000_000_u64.to_le_bytes(), &name, &logs_disarmed.to_le_bytes()]);
    log
}

fn event(log: &mut Writer, second: u64, number: u8) {
    log.raw(161, &[&(second * 1_000_000).to_le_bytes(), &[number]]);
}

#[test]
fn arming_right_after_a_pause_of_the_logger_does_not_count_as_of_before_it() {
    let mut log = copter(0.0);
    event(&mut log, 2, 10);
    log.attitudes(2..20);
    event(&mut log, 20, 11);
    event(&mut log, 200, 10);
    log.attitudes(200..210);
    assert_eq!(changes(&seen(&log.bytes)), [(1, false), (2, true), (20, false), (200, true)]);
}

#[test]
fn a_second_arming_after_a_pause_means_that_it_was_disarmed_in_between() {
    let mut log = copter(0.0);
    event(&mut log, 2, 10);
    log.attitudes(2..20);
    // Nobody logged the disarming.
    event(&mut log, 200, 10);
    log.attitudes(200..210);
    let seen = seen(&log.bytes);
    assert_eq!(changes(&seen), [(1, false), (2, true), (200, false), (202, true)]);
    let causes: Vec<Cause> = seen.gaps.iter().map(|gap| gap.0).collect();
    assert_eq!(causes, [Cause::NotKept], "nothing was lost");
}

#[test]
fn arming_without_a_time_counts_from_the_next_time_on() {
    let log = "ArduCopter V3.1.1 (681dafcf)\n\
        FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
        FMT, 13, 4, EV, B, Id\n\
        FMT, 1, 9, ATT, Iccc, TimeMS,Roll,Pitch,Yaw\n\
        EV, 11\nATT, 1000, 0, 0, 0\nATT, 2000, 0, 0, 0\n\
        EV, 10\nATT, 20000, 0, 0, 0\nATT, 21000, 0, 0, 0\n\
        EV, 11\nATT, 40000, 0, 0, 0\n";
    assert_eq!(changes(&seen(log.as_bytes())), [(1, false), (20, true), (21, false)]);
}

#[test]
fn a_log_that_opens_before_arming_begins_disarmed() {
    let mut log = copter(0.0);
    log.attitudes(2..6);
    event(&mut log, 6, 10);
    log.attitudes(6..9);
    assert_eq!(changes(&seen(&log.bytes)), [(1, false), (6, true)]);

    // Arming failed, the logger ran.
    let mut log = copter(0.0);
    log.attitudes(2..30);
    let refused = seen(&log.bytes);
    assert_eq!(changes(&refused), [(1, false)]);
    assert!(is_said(&refused, "does not tell whether it was armed"), "{:?}", refused.said);

    let mut log = copter(0.0);
    log.attitudes(2..6);
    event(&mut log, 6, 11);
    log.attitudes(6..9);
    assert_eq!(changes(&seen(&log.bytes)), [(1, true), (6, false)]);
}

#[test]
fn a_plane_whose_log_has_no_word_about_arming_is_armed_while_it_flies() {
    let mut log = "ArduPlane V3.1.2beta1 (834f90e8)\n\
        FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
        FMT, 130, 38, GPS, IBBcLLeeE, TimeMS,Status,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd\n"
        .to_owned();
    for second in 0..70 {
        let speed = match second {
            10..20 => 20.0,
            20..40 => 4.0,
            _ => 0.3,
        };
        let ms = second * 1_000;
        let _ = writeln!(log, "GPS, {ms}, 3, 9, 1.20, 44.0290459, -77.7367640, 30.0, 91.5, {speed}");
    }
    let seen = seen(log.as_bytes());
    assert_eq!(changes(&seen), [(0, false), (13, true), (50, false)]);
    assert!(is_said(&seen, "taken from throttle and speed"), "{:?}", seen.said);
}

#[test]
fn a_throttle_that_is_touched_arms_nothing() {
    let mut log = "ArduPlane V3.1.2beta1 (834f90e8)\n\
        FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
        FMT, 4, 9, CTUN, Ih, TimeMS,ThrOut\n"
        .to_owned();
    for tenth in 0..300 {
        let throttle = if (100..115).contains(&tenth) { 40 } else { 0 };
        let _ = writeln!(log, "CTUN, {}, {throttle}", tenth * 100);
    }
    assert_eq!(changes(&seen(log.as_bytes())), [(0, false)]);
}

#[test]
fn a_copter_of_before_3_1_whose_events_do_not_tell_that_it_flies_does_not_stand_for_ever() {
    let log = |version: &str| {
        format!(
            "ArduCopter {version}\n\
            FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
            FMT, 13, 4, EV, B, Id\n\
            FMT, 1, 9, ATT, Iccc, TimeMS,Roll,Pitch,Yaw\n\
            ATT, 1000, 0, 0, 0\nEV, 10\nEV, 15\nEV, 18\nATT, 2000, 0, 0, 0\nATT, 3000, 0, 0, 0\n"
        )
    };
    let stands = |seen: &Seen| {
        seen.find(|seen| matches!(seen, Observation::Landed(LandedState::OnGround, _)).then_some(())).len()
    };
    assert_eq!(stands(&seen(log("V3.0.1").as_bytes())), 0);
    assert!(stands(&seen(log("V3.1").as_bytes())) > 0);
}
