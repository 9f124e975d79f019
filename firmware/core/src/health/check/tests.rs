//! A value against its limits: when a level rises, falls, stays and is not known.

use super::*;

const CHECK: Check = Check {
    name: "tilt",
    subsystem: Subsystem::Attitude,
    unit: Unit::of("deg"),
    side: Side::Above,
    warn: Some(Param::TiltWarn),
    critical: Some(Param::TiltCrit),
    hysteresis: 5.0,
    debounce_warn: Debounce::millis(500),
    debounce_critical: Debounce::millis(200),
    when: When::Always,
    stale_s: NonZeroU8::new(1),
    instances: 1,
    alarm_only: false,
    is_flag: false,
    role: Role::NONE,
    of: InstanceOf::Vehicle,
    read: |_, _| None,
};

/// Steps every 50 ms through (milliseconds, value) and gives (milliseconds, level) of each change.
fn run(check: &Check, values: &[(u64, f32)]) -> Vec<(u64, Level)> {
    let params = Params::defaults();
    let mut state = State::new();
    let mut changes = Vec::new();
    let mut now_ms = 0;
    for (until_ms, value) in values {
        while now_ms < *until_ms {
            let now = Instant::from_millis(now_ms);
            let reading = Some(Reading { at: now, value: *value });
            changes
                .extend(state.step(check, now, reading, true, &params).map(|change| (now_ms, change.level)));
            now_ms += 50;
        }
    }
    changes
}

#[test]
fn a_level_rises_after_its_debounce_and_falls_after_the_clear_time() {
    let changes = run(&CHECK, &[(1_000, 10.0), (3_000, 50.0), (4_000, 70.0), (10_000, 10.0)]);
    let expected = [(1_500, Level::Warning), (3_200, Level::Critical), (6_000, Level::Ok)];
    assert_eq!(changes, expected);
}

#[test]
fn a_short_excursion_is_no_finding() {
    assert_eq!(run(&CHECK, &[(1_000, 10.0), (1_450, 50.0), (5_000, 10.0)]), []);
}

#[test]
fn a_value_at_its_limit_is_good_and_at_the_end_of_its_hysteresis_good_again() {
    let below = Check {
        side: Side::Below,
        warn: Some(Param::BatRemWarn),
        critical: Some(Param::BatRemCrit),
        hysteresis: 1.0,
        ..CHECK
    };
    for (check, limit, just_beyond, end) in [(&CHECK, 45.0, 45.1, 40.0), (&below, 15.0, 14.9, 16.0)] {
        assert_eq!(run(check, &[(5_000, limit)]), []);
        let changes = run(check, &[(1_000, just_beyond), (4_000, end)]);
        assert_eq!(changes, [(500, Level::Warning), (3_000, Level::Ok)]);
    }
}

#[test]
fn a_change_tells_its_value_and_the_limit_it_crossed() {
    let params = Params::defaults();
    let no_warning = Check { warn: None, ..CHECK };
    let cases = [
        (&CHECK, 50.0, Level::Warning, 45.0),
        (&CHECK, 70.0, Level::Critical, 60.0),
        (&no_warning, 70.0, Level::Critical, 60.0),
    ];
    for (check, value, level, limit) in cases {
        let (mut state, mut told) = (State::new(), Vec::new());
        for now_ms in (0..6_000).step_by(50) {
            let now = Instant::from_millis(now_ms);
            let value = if now_ms <= 2_000 { value } else { 10.0 };
            told.extend(state.step(check, now, Some(Reading { at: now, value }), true, &params));
        }
        let rises = Change { level, previous: Level::Ok, value, limit };
        let falls_below = if check.warn.is_some() { 45.0 } else { 60.0 };
        let falls = Change { level: Level::Ok, previous: level, value: 10.0, limit: falls_below };
        assert_eq!(told, [rises, falls]);
    }
}

#[test]
fn within_the_hysteresis_the_level_stays() {
    let changes = run(&CHECK, &[(1_000, 50.0), (20_000, 42.0), (30_000, 39.0)]);
    assert_eq!(changes, [(500, Level::Warning), (22_000, Level::Ok)]);
}

#[test]
fn a_side_below_mirrors_everything() {
    let below = Check {
        side: Side::Below,
        warn: Some(Param::CellVoltWarn),
        critical: Some(Param::CellVoltCrit),
        hysteresis: 0.05,
        ..CHECK
    };
    let changes = run(&below, &[(1_000, 3.8), (3_000, 3.55), (4_000, 3.4), (10_000, 3.9)]);
    assert_eq!(changes, [(1_500, Level::Warning), (3_200, Level::Critical), (6_000, Level::Ok)]);
}

#[test]
fn silence_is_stale_and_not_healthy() {
    let params = Params::defaults();
    let mut state = State::new();
    let reading = Some(Reading { at: Instant::ZERO, value: 1.0 });
    assert_eq!(state.step(&CHECK, Instant::ZERO, reading, true, &params), None);
    assert_eq!(state.level(), Some(Level::Ok));
    let late = Instant::from_millis(1_050);
    let change = state.step(&CHECK, late, reading, true, &params).expect("it is stale");
    assert_eq!((change.level, change.previous), (Level::Stale, Level::Ok));
    assert_eq!(state.step(&CHECK, late, reading, true, &params), None, "said once");
    let fresh = Some(Reading { at: late, value: 1.0 });
    let change = state.step(&CHECK, late, fresh, true, &params).expect("it is back");
    assert_eq!((change.level, change.previous), (Level::Ok, Level::Stale));
}

#[test]
fn what_was_never_seen_or_is_no_number_is_not_ok() {
    let params = Params::defaults();
    let mut state = State::new();
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let reading = Some(Reading { at: Instant::ZERO, value });
        assert_eq!(state.step(&CHECK, Instant::ZERO, reading, true, &params), None);
    }
    assert_eq!(state.step(&CHECK, Instant::ZERO, None, true, &params), None);
    assert_eq!(state.level(), None);
}

#[test]
fn a_value_that_is_no_longer_given_grows_stale_and_bad_news_after_that_is_never_ok() {
    let params = Params::defaults();
    let mut state = State::new();
    let mut levels = Vec::new();
    for now_ms in (0..5_000).step_by(50) {
        let now = Instant::from_millis(now_ms);
        let value = if now_ms < 1_000 { Some(10.0) } else { (now_ms >= 3_000).then_some(70.0) };
        let reading = value.map(|value| Reading { at: now, value });
        let change = state.step(&CHECK, now, reading, true, &params);
        levels.extend(change.map(|change| (now_ms, change.level)));
    }
    assert_eq!(levels, [(2_000, Level::Stale), (3_200, Level::Critical)]);
}

#[test]
fn a_first_value_that_is_bad_is_not_ok_while_it_is_debounced() {
    let params = Params::defaults();
    for check in [CHECK, Check { warn: None, ..CHECK }] {
        let mut state = State::new();
        let reading = Some(Reading { at: Instant::ZERO, value: 70.0 });
        assert_eq!(state.step(&check, Instant::ZERO, reading, true, &params), None);
        assert_eq!(state.level(), None);
    }
}

#[test]
fn debounce_and_staleness_hold_across_the_end_of_the_counter_of_milliseconds() {
    let params = Params::defaults();
    let mut state = State::new();
    let mut levels = Vec::new();
    let start_ms = u64::from(u32::MAX) - 1_050;
    for after_ms in (0..5_000).step_by(50) {
        let now = Instant::from_millis(start_ms + after_ms);
        let value = if after_ms < 500 { 10.0 } else { 50.0 };
        let reading = (after_ms < 2_000).then_some(Reading { at: now, value });
        let change = state.step(&CHECK, now, reading, true, &params);
        levels.extend(change.map(|change| (after_ms, change.level)));
    }
    assert_eq!(levels, [(1_000, Level::Warning), (3_000, Level::Stale)]);
}

#[test]
fn a_value_that_came_after_the_step_began_is_fresh() {
    let params = Params::defaults();
    let mut state = State::new();
    let reading = Some(Reading { at: Instant::from_millis(70), value: 10.0 });
    assert_eq!(state.step(&CHECK, Instant::from_millis(50), reading, true, &params), None);
    assert_eq!(state.level(), Some(Level::Ok));
}

#[test]
fn a_check_without_a_warning_limit_never_warns() {
    let check = Check { warn: None, debounce_critical: Debounce::secs(60), ..CHECK };
    let changes = run(&check, &[(1_000, 10.0), (62_000, 70.0)]);
    assert_eq!(changes, [(61_000, Level::Critical)]);
}

#[test]
fn what_does_not_apply_has_no_level() {
    let params = Params::defaults();
    let mut state = State::new();
    let reading = Some(Reading { at: Instant::ZERO, value: 10.0 });
    state.step(&CHECK, Instant::ZERO, reading, true, &params);
    assert_eq!(state.level(), Some(Level::Ok));
    assert_eq!(state.step(&CHECK, Instant::ZERO, reading, false, &params), None);
    assert_eq!(state.level(), None);
}

#[test]
fn what_no_longer_applies_is_no_longer_bad() {
    let params = Params::defaults();
    let mut state = State::new();
    for now_ms in (0..1_000).step_by(50) {
        let now = Instant::from_millis(now_ms);
        state.step(&CHECK, now, Some(Reading { at: now, value: 50.0 }), true, &params);
    }
    assert_eq!(state.level(), Some(Level::Warning));
    let change = state.step(&CHECK, Instant::from_millis(1_000), None, false, &params).expect("it clears");
    assert_eq!(change.level, Level::Ok);
}

/// Steps every 50 ms through measurements (milliseconds, value), each of which is held until the next.
fn hold(check: &Check, samples: &[(u64, f32)], until_ms: u64) -> Vec<(u64, Level)> {
    let params = Params::defaults();
    let mut state = State::new();
    let mut changes = Vec::new();
    for now_ms in (0..until_ms).step_by(50) {
        let now = Instant::from_millis(now_ms);
        let last = samples.iter().rev().find(|(at_ms, _)| *at_ms <= now_ms);
        let reading = last.map(|(at_ms, value)| Reading { at: Instant::from_millis(*at_ms), value: *value });
        let change = state.step(check, now, reading, true, &params);
        changes.extend(change.map(|change| (now_ms, change.level)));
    }
    changes
}

#[test]
fn one_message_of_nonsense_is_never_an_alarm_however_long_it_is_held() {
    // BATTERY_STATUS comes every 2.5 s over a radio.
    let slow = Check { stale_s: NonZeroU8::new(12), ..CHECK };
    assert_eq!(hold(&slow, &[(0, 10.0), (2_500, 170.0), (5_000, 10.0)], 10_000), []);
    assert_eq!(hold(&slow, &[(0, 10.0), (2_500, 170.0)], 14_000), [], "nor is the last one");
    let twice = [(0, 10.0), (2_500, 170.0), (5_000, 170.0), (7_500, 10.0)];
    assert_eq!(hold(&slow, &twice, 12_000), [(5_000, Level::Critical), (9_500, Level::Ok)]);
    let no_debounce = Check { debounce_critical: Debounce::NONE, debounce_warn: Debounce::NONE, ..slow };
    assert_eq!(hold(&no_debounce, &twice, 7_500), [(5_000, Level::Critical)]);
}

#[test]
fn a_critical_value_needs_two_samples_of_its_own() {
    let slow = Check { stale_s: NonZeroU8::new(12), ..CHECK };
    let samples = [(0, 50.0), (1_000, 50.0), (2_000, 70.0), (3_000, 50.0), (4_000, 70.0), (5_000, 70.0)];
    assert_eq!(hold(&slow, &samples, 6_000), [(1_000, Level::Warning), (5_000, Level::Critical)]);
}

#[test]
fn two_bad_measurements_in_a_row_count_although_the_value_grew_stale_between_them() {
    let sparse = Check { stale_s: NonZeroU8::new(5), ..CHECK };
    let levels = hold(&sparse, &[(0, 10.0), (20_000, 170.0), (40_000, 170.0)], 42_000);
    assert_eq!(levels.last(), Some(&(40_200, Level::Critical)), "{levels:?}");
}

#[test]
fn a_value_that_goes_up_and_down_is_told_a_few_times_and_not_each_time() {
    // Five minutes of two seconds beyond the limit, and eight below.
    let values: Vec<_> =
        (0..30).flat_map(|time| [(time * 10_000 + 2_000, 50.0), (time * 10_000 + 10_000, 10.0)]).collect();
    let warnings = |when| {
        let changes = run(&Check { when, ..CHECK }, &values);
        changes.iter().filter(|(_, level)| *level == Level::Warning).count()
    };
    assert_eq!((warnings(When::InFlight), warnings(When::Always)), (2, 2));
    // Good for longer than ever asked for, it is news again.
    let good: Vec<_> =
        (0..4).flat_map(|time| [(time * 150_000 + 2_000, 50.0), (time * 150_000 + 150_000, 10.0)]).collect();
    let changes = run(&Check { when: When::InFlight, ..CHECK }, &good);
    let at: Vec<u64> =
        changes.iter().filter(|(_, level)| *level == Level::Ok).map(|(at_ms, _)| at_ms % 150_000).collect();
    assert_eq!(at, [4_000, 18_000, 130_000, 130_000], "2 s, 16 s, and then 128 s");
}

#[test]
fn what_no_longer_applies_forgets_how_often_it_was_bad() {
    let (mut state, params) = (State::new(), Params::defaults());
    let check = Check { when: When::InFlight, ..CHECK };
    let mut cleared = Vec::new();
    for now_ms in (0..80_000).step_by(50) {
        let now = Instant::from_millis(now_ms);
        // Landed for a second every 20 s.
        let (value, applies) = (if now_ms % 20_000 < 2_000 { 50.0 } else { 10.0 }, now_ms % 20_000 < 19_000);
        let reading = Some(Reading { at: now, value });
        let change = state.step(&check, now, reading, applies, &params);
        cleared.extend(change.filter(|change| change.level == Level::Ok).map(|_| now_ms % 20_000));
    }
    assert_eq!(cleared, [4_000; 4]);
}

#[test]
fn a_bad_value_of_a_slow_stream_is_told_twice_and_then_stays() {
    let (mut state, params) = (State::new(), Params::defaults());
    let check = Check { when: When::InFlight, ..CHECK };
    let mut told = 0;
    for now_ms in (0..60_000_u64).step_by(50) {
        // A message each three seconds; it is stale after one.
        let at = Instant::from_millis(now_ms / 3_000 * 3_000);
        let change = state.step(
            &check,
            Instant::from_millis(now_ms),
            Some(Reading { at, value: 50.0 }),
            true,
            &params,
        );
        told += u32::from(change.is_some_and(|change| change.level == Level::Warning));
    }
    assert_eq!((told, state.level()), (2, Some(Level::Warning)));
}
