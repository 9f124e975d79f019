//! A value against its limits: when a level rises, falls, stays and is unknown.

use super::*;

const CHECK: Check = Check {
    told_after_s: 0,
    name: "tilt",
    subsystem: Subsystem::Attitude,
    unit: Unit::of("deg"),
    limits: Limits::above(Some(Param::TiltWarn), Some(Param::TiltCrit), 5.0),
    debounce_ms: [500, 200],
    when: CheckPhase::Always,
    stale_s: NonZeroU8::new(1),
    instances: 1,
    alarm_only: false,
    role: Role::NONE,
    of: InstanceKind::Vehicle,
    read: |_, _| None,
};

/// Steps every 50 ms through a script. Returns the changes of level and the last level: `500 warning, 3000 ok | ok`.
///
/// Each part of a script begins at a time in ms; the last time is the end.
///
/// - `10` is measured at each step from then on;
/// - `+10` after each step began;
/// - `=10` once, and then held;
/// - `-` stops the measurements;
/// - `off`: the check does not apply.
fn changes(check: &Check, script: &str, start_ms: u64) -> String {
    let (mut state, mut told) = (State::default(), Vec::new());
    let mut parts = script.split(", ").peekable();
    while let Some((from, what)) = parts.next().and_then(|part| part.split_once(' ')) {
        let ms = |text: &str| text.parse::<u64>().unwrap();
        let from_ms = ms(from);
        let until_ms = parts.peek().map_or(from_ms, |next| ms(next.split(' ').next().unwrap()));
        let value = what.trim_start_matches(['=', '+']).parse().ok();
        for now_ms in (from_ms..until_ms).step_by(50) {
            let measured_ms = match what.as_bytes()[0] {
                b'=' => from_ms,
                b'+' => now_ms + 20,
                _ => now_ms,
            };
            let [now, at] = [now_ms, measured_ms].map(|ms| BootMs::from_millis(start_ms + ms));
            let reading = value.map(|value| Reading { at, value });
            let change = state.step(check, now, reading, what != "off", &Params::defaults());
            told.extend(change.map(|change| format!("{now_ms} {}", change.level.name())));
        }
    }
    format!("{} | {}", told.join(", "), state.level().map_or("none", Level::name))
}

/// Limits, debounce, and seconds until stale; a script, and its changes of level.
const CASES: &str = "
above usual 1: 0 10, 1000 50, 3000 70, 4000 10, 10000: 1500 warning, 3200 critical, 6000 ok | ok
above usual 1: 0 10, 1000 50, 1450 10, 5000:  | ok
above usual 1: 0 45, 5000:  | ok
above usual 1: 0 45.1, 1000 40, 4000: 500 warning, 3000 ok | ok
above usual 1: 0 50, 1000 42, 20000 39, 30000: 500 warning, 22000 ok | ok
above usual 1: 0 =1, 1500 =1, 2000: 1050 stale, 1500 ok | ok
above usual 1: 0 NaN, 50 inf, 100 -inf, 150 -, 200:  | none
above usual 1: 0 10, 1000 -, 3000 70, 5000: 2000 stale, 3200 critical | critical
above usual 1: 0 10, 500 50, 2000 -, 5000: 1000 warning, 3000 stale | stale
above usual 1: 0 70, 50:  | none
above usual 1: 0 -, 50 +10, 100:  | ok
above usual 1: 0 10, 50 off, 100:  | none
above usual 1: 0 50, 1000 off, 1050: 500 warning, 1000 ok | none
cell usual 1: 0 3.8, 1000 3.55, 3000 3.4, 4000 3.9, 10000: 1500 warning, 3200 critical, 6000 ok | ok
battery usual 1: 0 15, 5000:  | ok
battery usual 1: 0 14.9, 1000 16, 4000: 500 warning, 3000 ok | ok
alone long 1: 0 10, 1000 70, 62000: 61000 critical | critical
alone usual 1: 0 70, 50:  | none
above usual 12: 0 =10, 2500 =170, 5000 =10, 10000:  | ok
above usual 12: 0 =10, 2500 =170, 14000:  | ok
above usual 12: 0 =10, 2500 =170, 5000 =170, 7500 =10, 12000: 5000 critical, 9500 ok | ok
above usual 12: 0 =50, 1000 =50, 2000 =70, 3000 =50, 4000 =70, 5000 =70, 6000: 1000 warning, 5000 critical | critical
above none 12: 0 =10, 2500 =170, 5000 =170, 7500: 5000 critical | critical
above usual 5: 0 =10, 20000 =170, 40000 =170, 42000: 5050 stale, 40200 critical | critical
";

#[test]
fn a_level_is_what_its_values_of_some_time_say() {
    let above = Limits::above(Some(Param::TiltWarn), Some(Param::TiltCrit), 5.0);
    for case in CASES.trim().lines() {
        let [kind, script, expected] = case.split(": ").collect::<Vec<_>>()[..] else { panic!("{case}") };
        let [limits, debounce, stale_s] = kind.split(' ').collect::<Vec<_>>()[..] else { panic!("{case}") };
        let limits = match limits {
            "alone" => Limits { warn: None, ..above },
            "battery" => Limits::below(Some(Param::BatRemWarn), Some(Param::BatRemCrit), 1.0),
            "cell" => Limits::below(Some(Param::CellVoltWarn), Some(Param::CellVoltCrit), 0.05),
            _ => above,
        };
        let debounce_ms = match debounce {
            "none" => [0; 2],
            "long" => [60_000; 2],
            _ => CHECK.debounce_ms,
        };
        let check = Check { limits, debounce_ms, stale_s: stale_s.parse().ok(), ..CHECK };
        for start_ms in [0, u64::from(u32::MAX) - 1_050] {
            assert_eq!(changes(&check, script, start_ms), expected, "{case}");
        }
    }
}

#[test]
fn a_change_tells_its_value_and_the_limit_it_crossed() {
    let no_warning = Check { limits: Limits { warn: None, ..CHECK.limits }, ..CHECK };
    for (check, value, level, limit, falls_below) in [
        (&CHECK, 50.0, Level::Warning, 45.0, 45.0),
        (&CHECK, 70.0, Level::Critical, 60.0, 45.0),
        (&no_warning, 70.0, Level::Critical, 60.0, 60.0),
    ] {
        let (mut state, mut told) = (State::default(), Vec::new());
        for now_ms in (0..6_000).step_by(50) {
            let at = BootMs::from_millis(now_ms);
            let value = if now_ms <= 2_000 { value } else { 10.0 };
            told.extend(state.step(check, at, Some(Reading { at, value }), true, &Params::defaults()));
        }
        let rises = LevelChange { level, previous: Level::Ok, value, limit };
        let falls = LevelChange { level: Level::Ok, previous: level, value: 10.0, limit: falls_below };
        assert_eq!(told, [rises, falls]);
    }
}

/// Times of the changes are relative to their period.
fn again(when: CheckPhase, times: u64, period_ms: u64, after: impl Fn(u64) -> String) -> Vec<(u64, Level)> {
    let script: Vec<String> =
        (0..times).map(|time| format!("{} 50, {}", time * period_ms, after(time * period_ms))).collect();
    let script = format!("{}, {}", script.join(", "), times * period_ms);
    let changes = changes(&Check { when, ..CHECK }, &script, 0);
    let changes = changes.split(" | ").next().unwrap().split(", ");
    let parsed = changes.map(|change| change.split_once(' ').unwrap());
    parsed
        .map(|(ms, level)| {
            let level = Level::ALL.into_iter().find(|known| known.name() == level).unwrap();
            (ms.parse::<u64>().unwrap() % period_ms, level)
        })
        .collect()
}

#[test]
fn a_value_that_goes_up_and_down_is_told_a_few_times_and_not_each_time() {
    let good = |from_ms: u64| format!("{} 10", from_ms + 2_000);
    for when in [CheckPhase::InFlight, CheckPhase::Always] {
        let warnings = again(when, 30, 10_000, good);
        assert_eq!(warnings.iter().filter(|(_, level)| *level == Level::Warning).count(), 2);
    }
    let falls = |changes: Vec<(u64, Level)>| -> Vec<u64> {
        changes.into_iter().filter(|(_, level)| *level == Level::Ok).map(|(ms, _)| ms).collect()
    };
    let times = falls(again(CheckPhase::InFlight, 4, 150_000, good));
    assert_eq!(times, [4_000, 18_000, 130_000, 130_000], "2 s, 16 s, and then 128 s");
    let landed = |from_ms: u64| format!("{} 10, {} off", from_ms + 2_000, from_ms + 19_000);
    assert_eq!(falls(again(CheckPhase::InFlight, 4, 20_000, landed)), [4_000; 4]);
}

#[test]
fn a_bad_value_of_a_slow_stream_is_told_twice_and_then_stays() {
    let script: Vec<String> = (0..20).map(|message| format!("{} =50", message * 3_000)).collect();
    let script = script.join(", ") + ", 60000";
    let told = changes(&Check { when: CheckPhase::InFlight, ..CHECK }, &script, 0);
    assert_eq!(told, "1050 stale, 3500 warning, 4050 stale, 6500 warning | warning");
}

#[test]
fn a_text_waits_until_the_value_was_bad_for_so_long_and_a_shorter_rise_has_none() {
    let check = Check { limits: Limits::above(Some(Param::TiltWarn), None, 5.0), ..CHECK };
    for (good_again_ms, told_ms) in
        [(60_000, Some(11_000)), (9_000, None), (10_950, None), (11_050, Some(11_000))]
    {
        let (mut state, mut alarmed) = (State::default(), false);
        let told = (0..30_000).step_by(50).find(|now_ms| {
            let value = if (1_000..good_again_ms).contains(now_ms) { 50.0 } else { 10.0 };
            let now = BootMs::from_millis(*now_ms);
            state.step(&check, now, Some(Reading { at: now, value }), true, &Params::defaults());
            alarmed |= state.has_alarm();
            state.has_alarm() && state.lasts(now, Millis::from_millis(10_000))
        });
        assert!(alarmed);
        assert_eq!(told, told_ms, "good again at {good_again_ms} ms");
    }
}
