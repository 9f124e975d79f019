//! The judge, on recordings made for the purpose.

use hums_blackbox::Record;
use hums_blackbox::record::{FindingRecord, Moment, Parameter, Usage};
use hums_core::health::Level;
use hums_core::observation::{
    Attitude, Autopilot, Battery, Esc, EscGroup, Heartbeat, LandedState, Observation, Source, VtolState,
};
use hums_core::parameters::Param;
use hums_core::units::{Fraction, Rpm, Volts};
use hums_formats::trend_words::WORDS;
use hums_link::vocabulary::{VOCABULARY, Words};

use super::*;
use crate::check::flights::Flight;
use crate::source::item::hand_said;

const CHECKED: Record<'_> = Record::Usage(Usage::new(Moment::Start, &[]));

const AUTOPILOT: Source = Source { system: 1, component: 1 };

fn heartbeat(armed: bool) -> Observation {
    let autopilot = Autopilot::ArduPilot;
    Observation::Heartbeat(Heartbeat { autopilot, armed, state: 4, ..Heartbeat::default() })
}

fn battery(remaining: f32) -> Observation {
    let (voltage, remaining) = (Some(Volts(12.0)), Some(Fraction(remaining)));
    Observation::Battery(Battery { voltage, remaining, ..Battery::default() })
}

fn fly(judge: &mut Judge, from_s: u64, to_s: u64, per_s: u64, remaining: f32) {
    for tick in from_s * per_s..to_s * per_s {
        let at = Instant::from_micros(tick * 1_000_000 / per_s);
        judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(true)));
        judge.item(at, Item::Observation(AUTOPILOT, &battery(remaining)));
    }
}

fn finding(check: &'static str, at_ms: u64, level: Level, value: f32) -> FindingRecord<'static> {
    FindingRecord {
        at: Instant::from_millis(at_ms),
        subsystem: hums_core::health::Subsystem::Recorder,
        check,
        instance: 0,
        level,
        previous: Level::Ok,
        value,
        limit: value / 2.0,
        unit: "",
    }
}

/// A gap, which the judge receives at the gap's end.
fn miss(judge: &mut Judge, from_ms: u64, to_ms: u64, cause: Why) {
    let [from, to] = [from_ms, to_ms].map(|ms| Some(Instant::from_millis(ms)));
    let gap = Gap { from, to, cause, place: None, bytes: 0, words: String::new(), own: None };
    judge.item(Instant::from_millis(to_ms), Item::Gap(&gap));
}

fn found(judged: &Judgement) -> Vec<(String, Level, f64)> {
    let line = |finding: &Finding| (finding.check.clone(), finding.level, finding.at.as_secs_f64());
    judged.findings.iter().map(line).collect()
}

#[test]
fn debounce_follows_the_recordings_time_and_not_the_number_of_samples() {
    for per_s in [1, 10, 400] {
        let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
        fly(&mut judge, 100, 110, per_s, 0.5);
        fly(&mut judge, 110, 120, per_s, 0.1);
        let found = found(&judge.end());
        let [(check, Level::Warning, at)] = found.as_slice() else { panic!("{per_s}: {found:?}") };
        assert_eq!(check, "batt_remaining");
        assert!((at - 112.0).abs() < 0.11, "{per_s} samples a second: {at}");
    }
}

#[test]
fn a_gap_of_hours_is_not_stepped_through_and_what_was_known_is_stale_after_it() {
    let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
    fly(&mut judge, 0, 20, 10, 0.1);
    let years = 3 * 365 * 24 * 3_600;
    let wall = std::time::Instant::now();
    fly(&mut judge, years, years + 10, 10, 0.1);
    assert!(wall.elapsed().as_secs() < 5, "three years are not stepped through");
    let judged = judge.end();
    let levels: Vec<Level> = judged
        .findings
        .iter()
        .filter(|finding| finding.check == "batt_remaining")
        .map(|finding| finding.level)
        .collect();
    assert_eq!(levels, [Level::Warning, Level::Stale, Level::Warning]);
    let [problem] = judged.problems.as_slice() else { panic!("{:?}", judged.problems) };
    assert_eq!((problem.times, problem.lasting), (2, true));
    assert!(problem.lasted < Span::from_secs(50), "{:?}", problem.lasted);
}

#[test]
fn each_check_is_judged_or_says_why_not() {
    let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
    fly(&mut judge, 0, 20, 10, 0.9);
    let judged = judge.end();
    assert!(judged.judged.contains(&"batt_remaining"), "{:?}", judged.judged);
    let why = |check: &str| {
        let reason = judged.not_judged.iter().find(|(name, _)| *name == check);
        reason.map_or("", |(_, why)| why.as_str())
    };
    assert_eq!(why("esc_silent"), "no ESC telemetry");
    assert_eq!(
        why("ekf_variance"),
        "not known whether it was in the air",
        "nothing tells of height or speed"
    );
    assert_eq!(why("frames_lost"), "the autopilot recorded this itself, without a link");
    assert_eq!(why("record_lost"), "needs a log of the box");
    assert_eq!(why("rc_rssi"), "its limit is off");
    // PX4's are not meant for ArduPilot.
    assert_eq!(why("vibration_px4"), "");
    let named = judged.judged.len() + judged.not_judged.len();
    let meant = |words: &&Words| !matches!(words.scope, Scope::Px4 | Scope::Alerts);
    assert_eq!(named, VOCABULARY.iter().chain(&WORDS).filter(meant).count());
}

fn disarmed_high(falls: bool) -> Judgement {
    disarmed_high_with(falls, None)
}

fn disarmed_high_with(falls: bool, arming: Option<&str>) -> Judgement {
    use crate::source::item::Fact;
    use hums_core::observation::GlobalPosition;
    use hums_core::units::{Metres, MetresPerSecond};
    let mut judge = Judge::new(&Limits::default(), Format::Tlog);
    if let Some(words) = arming {
        judge.item(Instant::ZERO, Item::Fact(Fact { about: FactKind::Arming, words }));
    }
    for tick in 0..300_u64 {
        let (at, armed) = (Instant::from_millis(tick * 100), (20..200).contains(&tick));
        let fallen = if falls { tick.saturating_sub(200) as f32 } else { 0.0 };
        let height = if tick < 30 { 0.0 } else { (30.0 - fallen).max(0.0) };
        let position = Observation::GlobalPosition(GlobalPosition {
            position: None,
            altitude: Metres(height),
            relative_altitude: Metres(height),
            velocity: [MetresPerSecond(0.0); 3],
        });
        judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(armed)));
        judge.item(at, Item::Observation(AUTOPILOT, &position));
    }
    judge.end()
}

#[test]
fn a_vehicle_that_falls_after_it_is_disarmed_did_not_land() {
    let flights = disarmed_high(true).flights;
    let [flight] = flights.as_slice() else { panic!("{flights:?}") };
    assert_eq!((flight.landed, flight.disarmed_at_m), (false, Some(30.0)));
    let flights = disarmed_high(false).flights;
    let [flight] = flights.as_slice() else { panic!("{flights:?}") };
    assert_eq!((flight.landed, flight.disarmed_at_m), (true, None), "it stands on a hill");
}

fn half_seconds(judge: &mut Judge, from_ms: u64, to_ms: u64, armed: bool, landed: LandedState) {
    for at_ms in (from_ms..to_ms).step_by(500) {
        let at = Instant::from_millis(at_ms);
        judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(armed)));
        judge.item(at, Item::Observation(AUTOPILOT, &Observation::Landed(landed, VtolState::Unknown)));
    }
}

fn air_ms(flights: &[Flight]) -> Vec<(u64, bool)> {
    flights.iter().map(|flight| (flight.air.as_micros() / 1_000, flight.landed)).collect()
}

#[test]
fn a_recording_that_ends_on_the_ground_shortly_after_the_landing_has_the_whole_flight() {
    for ground_ms in [500, 3_000, 30_000] {
        let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
        half_seconds(&mut judge, 0, 5_000, true, LandedState::OnGround);
        half_seconds(&mut judge, 5_000, 65_000, true, LandedState::InAir);
        half_seconds(&mut judge, 65_000, 65_000 + ground_ms, true, LandedState::OnGround);
        judge.item(Instant::from_millis(65_000 + ground_ms), Item::Observation(AUTOPILOT, &heartbeat(false)));
        let flights = judge.end().flights;
        let [(air, true)] = air_ms(&flights)[..] else { panic!("{ground_ms}: {flights:?}") };
        assert!((59_000..=60_100).contains(&air), "{ground_ms}: {flights:?}");
        assert!(flights[0].to <= Instant::from_millis(65_100), "{ground_ms}: {flights:?}");
    }
}

#[test]
fn a_vehicle_that_is_in_the_air_when_it_is_heard_first_did_not_take_off() {
    let took_off = |ground_ms: u64| {
        let mut judge = Judge::new(&Limits::default(), Format::Tlog);
        half_seconds(&mut judge, 0, ground_ms, true, LandedState::OnGround);
        half_seconds(&mut judge, ground_ms, 60_000, true, LandedState::InAir);
        let flights = judge.end().flights;
        let [flight] = flights.as_slice() else { panic!("{flights:?}") };
        flight.took_off
    };
    assert!(took_off(10_000));
    assert!(!took_off(0));
}

/// Nine or ten volts: two cells or three.
#[test]
fn cells_that_nothing_tells_in_the_air_are_said_and_no_check_of_their_voltage_counts_as_judged() {
    let judged = |named: bool, on_board: bool| {
        let mut judge = Judge::new(&Limits::default(), if on_board { Format::Hums } else { Format::Tlog });
        if on_board {
            judge.item(Instant::ZERO, Item::Record(&CHECKED));
        }
        for second in 0..60 {
            let from_ms = second * 1_000;
            half_seconds(&mut judge, from_ms, from_ms + 1_000, true, LandedState::InAir);
            judge.item(Instant::from_millis(from_ms + 600), Item::Observation(AUTOPILOT, &battery(0.5)));
            if named && second == 1 {
                let place = hums_core::battery_cells::known("BATT_LOW_VOLT").expect("it is");
                let told = Observation::Parameter(place, 10.8);
                judge.item(Instant::from_millis(from_ms + 700), Item::Observation(AUTOPILOT, &told));
            }
        }
        let judged = judge.end();
        let why = judged.not_judged.iter().find(|(check, _)| *check == "cell_voltage");
        (judged.cells_unknown.is_some(), why.map(|(_, why)| why.clone()), judged.remarks.join("; "))
    };
    let (unknown, why, remarks) = judged(false, false);
    assert!(unknown && remarks.starts_with("cells not known from 0:00."), "{remarks}");
    assert_eq!(why.as_deref(), Some("how many cells the battery has is not known"));
    assert_eq!(judged(true, false), (false, None, String::new()), "the parameter came within two seconds");
    let (unknown, why, remarks) = judged(false, true);
    assert!(
        !unknown && why.is_none() && remarks.contains("took the number of cells from its last flight"),
        "{remarks}"
    );
}

#[test]
fn the_worst_value_of_a_check_of_the_box_is_that_of_its_record() {
    use hums_blackbox::record::Exceedance;
    use hums_core::health::exceedance::Crossings;
    let mut judge = Judge::new(&Limits::default(), Format::Hums);
    let at = Instant::from_millis(1_000);
    let finding = finding("record_lost", 1_000, Level::Warning, 19.0);
    let session = Crossings { warnings: 1, peak: 3_591.0, ..Crossings::default() };
    let exceeded = Exceedance { check: "record_lost", unit: "frames", session, ..Exceedance::default() };
    judge.item(at, Item::Record(&CHECKED));
    judge.item(at, Item::Record(&Record::Finding(finding)));
    judge.item(at, Item::Record(&Record::Exceedance(exceeded)));
    fly(&mut judge, 2, 4, 10, 0.9);
    judge.item(Instant::from_millis(60_000), Item::Record(&CHECKED));
    let [problem] = &judge.end().problems[..] else { panic!("one") };
    assert_eq!(
        (problem.value, problem.lasted),
        (3_591.0, Span::from_secs(59)),
        "it goes on to the end of the log"
    );
}

#[test]
fn a_gap_is_no_time_in_the_air_and_a_landing_right_before_it_ends_the_flight() {
    for landed in [false, true] {
        let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
        half_seconds(&mut judge, 0, 5_000, true, LandedState::OnGround);
        half_seconds(&mut judge, 5_000, 30_000, true, LandedState::InAir);
        let at = Instant::from_millis(30_000);
        if landed {
            judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(false)));
        }
        miss(&mut judge, 30_000, 930_000, Why::NotKept);
        half_seconds(&mut judge, 930_000, 950_000, true, LandedState::InAir);
        let flights = judge.end().flights;
        let air: u64 = air_ms(&flights).iter().map(|(air, _)| air).sum();
        assert_eq!(flights.len(), 1 + usize::from(landed), "{flights:?}");
        assert!((40_000..=46_000).contains(&air), "{flights:?}");
    }
}

#[test]
fn what_follows_a_gap_and_is_not_judged_is_time_in_the_air() {
    let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
    half_seconds(&mut judge, 0, 5_000, true, LandedState::OnGround);
    for from_ms in (5_000..65_000).step_by(6_000) {
        half_seconds(&mut judge, from_ms, from_ms + 4_000, true, LandedState::InAir);
        miss(&mut judge, from_ms + 4_000, from_ms + 6_000, Why::Lost);
    }
    half_seconds(&mut judge, 65_000, 70_000, true, LandedState::InAir);
    let judged = judge.end();
    let [(air, false)] = air_ms(&judged.flights)[..] else { panic!("{:?}", judged.flights) };
    assert!((44_000..=45_500).contains(&air), "ten times 4 s and 5 s: {air}");
    assert!(judged.armed.as_millis().abs_diff(air) <= 6_500, "{:?}", judged.armed);
}

#[test]
fn arming_that_is_guessed_from_the_throttle_is_no_disarming_in_the_air() {
    let judged = disarmed_high_with(true, Some("taken from the throttle"));
    assert!(judged.problems.iter().all(|problem| problem.check != DISARMED), "{:?}", judged.problems);
    assert!(judged.flights.iter().all(|flight| flight.disarmed_at_m.is_none()), "{:?}", judged.flights);
    let told = disarmed_high_with(true, None);
    assert!(told.problems.iter().any(|problem| problem.check == DISARMED), "{:?}", told.problems);
}

#[test]
fn a_second_power_on_in_raw_frames_is_a_restart_only_where_the_vehicle_was_armed_before_and_a_log_is_joined()
{
    for (format, armed, restarts) in [
        (Format::Raw, false, false),
        (Format::Raw, true, true),
        (Format::DataFlash, true, false),
        (Format::Ulog, true, false),
    ] {
        let mut judge = Judge::new(&Limits::default(), format);
        let boot = |judge: &mut Judge, at_ms: u64, boot_ms: u32, armed: bool| {
            let at = Instant::from_millis(at_ms);
            judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(armed)));
            let attitude = Attitude { boot_ms: Some(boot_ms), ..Attitude::default() };
            judge.item(at, Item::Observation(AUTOPILOT, &Observation::Attitude(attitude)));
        };
        for second in 0..60_u32 {
            boot(&mut judge, u64::from(second) * 1_000, 100_000 + second * 1_000, armed || second < 55);
        }
        judge.item(Instant::from_millis(60_000), Item::Restart);
        for second in 0..60_u32 {
            boot(&mut judge, 60_000 + u64::from(second) * 1_000, 5_000 + second * 1_000, true);
        }
        let judged = judge.end();
        let told = judged.problems.iter().any(|problem| problem.check == "autopilot_reboot");
        assert_eq!(told, restarts, "{format:?}: {:?}", judged.problems);
    }
}

#[test]
fn another_power_on_in_an_autopilots_own_log_ends_the_flight_of_before_and_a_ground_stations_clock_does_not()
{
    for (format, flights) in
        [(Format::DataFlash, 2), (Format::Ulog, 2), (Format::Raw, 2), (Format::Tlog, 1), (Format::Hums, 1)]
    {
        let mut judge = Judge::new(&Limits::default(), format);
        half_seconds(&mut judge, 0, 5_000, true, LandedState::OnGround);
        half_seconds(&mut judge, 5_000, 40_000, true, LandedState::InAir);
        judge.item(Instant::from_millis(40_000), Item::Restart);
        half_seconds(&mut judge, 40_000, 80_000, true, LandedState::InAir);
        let judged = judge.end();
        assert_eq!(judged.flights.len(), flights, "{format:?}: {:?}", judged.flights);
        assert!(judged.flights.iter().all(|flight| !flight.landed), "{format:?}: {:?}", judged.flights);
    }
}

#[test]
fn a_flight_does_not_go_on_as_another_vehicles() {
    let mut judge = Judge::new(&Limits::default(), Format::Tlog);
    let other = Source { system: 2, component: 1 };
    half_seconds(&mut judge, 0, 5_000, true, LandedState::OnGround);
    half_seconds(&mut judge, 5_000, 40_000, true, LandedState::InAir);
    for at_ms in (40_000..120_000).step_by(500) {
        let at = Instant::from_millis(at_ms);
        judge.item(at, Item::Observation(other, &heartbeat(true)));
        let landed = Observation::Landed(LandedState::InAir, VtolState::Unknown);
        judge.item(at, Item::Observation(other, &landed));
    }
    let flights = judge.end().flights;
    let [first, second] = &flights[..] else { panic!("{flights:?}") };
    assert!(!first.landed && first.to <= Instant::from_millis(40_500), "{flights:?}");
    assert!(second.from >= first.to, "{flights:?}");
}

#[test]
fn a_flight_ends_where_the_vehicle_was_heard_last_before_another_power_on_or_recording() {
    for (format, item) in [
        (Format::DataFlash, Item::Restart),
        (Format::Ulog, Item::Restart),
        (Format::DataFlash, Item::Joint),
        (Format::Tlog, Item::Joint),
    ] {
        let mut judge = Judge::new(&Limits::default(), format);
        half_seconds(&mut judge, 0, 5_000, true, LandedState::OnGround);
        half_seconds(&mut judge, 5_000, 40_000, true, LandedState::InAir);
        judge.item(Instant::from_millis(7_240_000), item);
        half_seconds(&mut judge, 7_240_500, 7_260_000, false, LandedState::OnGround);
        let judged = judge.end();
        let flights: Vec<_> = judged.flights.iter().map(|flight| flight.to.as_millis()).collect();
        assert!(matches!(flights[..], [to] if (39_400..=39_600).contains(&to)), "{format:?}: {flights:?}");
        assert!((34_000..=34_600).contains(&air_ms(&judged.flights)[0].0), "{:?}", judged.flights);
        assert!(judged.armed < Span::from_secs(40), "{:?}", judged.armed);
    }
}

#[test]
fn silence_is_flight_where_the_vehicle_flies_when_it_is_heard_again() {
    for (armed, landed, length_s, air_s) in [
        (true, LandedState::InAir, 30, 75),
        (true, LandedState::OnGround, 30, 35),
        (false, LandedState::OnGround, 30, 35),
        (false, LandedState::OnGround, 600, 35),
        // Longer than stepped.
        (true, LandedState::InAir, 600, 120),
    ] {
        let mut judge = Judge::new(&Limits::default(), Format::Tlog);
        half_seconds(&mut judge, 0, 5_000, true, LandedState::OnGround);
        half_seconds(&mut judge, 5_000, 40_000, true, LandedState::InAir);
        let again = 40_000 + length_s * 1_000;
        half_seconds(&mut judge, again, again + 10_000, armed, landed);
        let judged = judge.end();
        let [(air_ms, _)] = air_ms(&judged.flights)[..] else { panic!("{:?}", judged.flights) };
        assert!(
            air_ms.abs_diff(air_s * 1_000) < 1_100,
            "{armed} {landed:?} {length_s}: {air_ms} {:?}",
            judged.flights
        );
        let armed_s = judged.armed.as_micros() / 1_000_000;
        assert!(armed || (40..46).contains(&armed_s), "{length_s}: {armed_s}");
    }
}

#[test]
fn a_recording_that_was_joined_on_is_judged_by_itself() {
    for (joint, findings) in [(Item::Joint, 0), (Item::Restart, 1)] {
        let mut judge = Judge::new(&Limits::default(), Format::Tlog);
        let flight = |judge: &mut Judge, from_ms: u32| {
            for second in 0..60_u32 {
                let at = Instant::from_millis(u64::from(from_ms + second * 1_000));
                judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(second > 5)));
                let landed = if second > 10 { LandedState::InAir } else { LandedState::OnGround };
                judge
                    .item(at, Item::Observation(AUTOPILOT, &Observation::Landed(landed, VtolState::Unknown)));
                let attitude = Attitude { boot_ms: Some(100_000 + second * 1_000), ..Attitude::default() };
                judge.item(at, Item::Observation(AUTOPILOT, &Observation::Attitude(attitude)));
            }
        };
        flight(&mut judge, 0);
        // Another vehicle's ESCs would be missing.
        escs(&mut judge, if findings == 0 { 50_000 } else { 60_000 }, 60_000);
        judge.item(Instant::from_millis(60_000), joint);
        flight(&mut judge, 60_000);
        let judged = judge.end();
        let told = judged.problems.iter().filter(|problem| problem.check == "autopilot_reboot").count();
        assert_eq!(told, findings, "{:?}", judged.problems);
        assert_eq!(judged.remarks.len(), 1 - findings, "{:?}", judged.remarks);
        assert_eq!(judged.restarts, 1);
        if findings == 0 {
            assert!(judged.problems.is_empty(), "{:?}", judged.problems);
            assert_eq!(judged.flights.len(), 2);
            assert!(judged.remarks[0].contains("joined at 60.0 s"), "{:?}", judged.remarks);
        }
    }
}

#[test]
fn trends_over_flights_are_not_judged_from_one_recording() {
    for format in [Format::DataFlash, Format::Tlog, Format::Hums] {
        let stored = VOCABULARY.iter().filter(|words| words.scope == Scope::Stored);
        assert!(stored.clone().count() > 3);
        for words in stored {
            assert!(!is_of(words.said.check, format, false), "{}", words.said.check);
        }
    }
    let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
    fly(&mut judge, 0, 20, 10, 0.9);
    let judged = judge.end();
    let why = judged.not_judged.iter().find(|(check, _)| *check == "weight_trend");
    assert!(why.is_some_and(|(_, why)| why.contains("earlier flights")), "{why:?}");
}

#[test]
fn a_recording_that_does_not_tell_arming_says_so_and_not_never() {
    use crate::source::item::Fact;
    let words = "the log does not tell whether it was armed";
    let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
    judge.item(Instant::ZERO, Item::Fact(Fact { about: FactKind::Arming, words }));
    for second in 0..20 {
        let at = Instant::from_millis(second * 1_000);
        judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(false)));
    }
    let judged = judge.end();
    assert!(!judged.not_judged.is_empty());
    for (check, why) in judged.not_judged {
        assert!(!why.contains("never"), "{check}: {why}");
    }
}

#[test]
fn nothing_of_a_vehicle_is_no_good_news() {
    let mut judge = Judge::new(&Limits::default(), Format::Tlog);
    let gap = Gap {
        from: None,
        to: None,
        cause: Why::Damaged,
        place: Some(7),
        bytes: 3,
        words: "cut".to_owned(),
        own: None,
    };
    judge.item(Instant::ZERO, Item::Gap(&gap));
    let judged = judge.end();
    assert_eq!((judged.worst(), judged.damages), (None, 1));
    assert!(judged.judged.is_empty(), "{:?}", judged.judged);
}

/// 10 Hz; after 20 s lost percents, and all from 40 to 48 s.
fn link_faults(heard: HeardAt) -> Judgement {
    use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
    use hums_link::{Frame, messages};
    let mut judge = Judge::new(&Limits::default(), Format::Tlog).heard(heard);
    let mut encoder = Encoder::of(AUTOPILOT.system, AUTOPILOT.component);
    for tick in 0..600_u64 {
        encoder.set_sequence(tick as u8);
        let mut buffer = [0; FRAME_BYTES_MAX];
        let frame = Frame::parse(encoder.frame(&mut buffer, &messages::heartbeat(4))).expect("ours");
        if (200..400).contains(&tick) && tick % 5 == 0 || (400..480).contains(&tick) {
            continue;
        }
        let at = Instant::from_millis(tick * 100);
        judge.item(at, Item::Frame(&frame));
        judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(true)));
    }
    judge.end()
}

#[test]
fn the_wire_is_judged_where_the_recording_was_heard_at_the_monitors_own_place() {
    let judged = link_faults(HeardAt::OnTheWire);
    let first = |check: &str| {
        let finding = judged.findings.iter().find(|finding| finding.check == check);
        finding.map(|finding| (finding.level, finding.at.as_secs_f64()))
    };
    let Some((Level::Warning | Level::Critical, at)) = first("frames_lost") else {
        panic!("{:?}", judged.findings)
    };
    assert!((20.0..26.0).contains(&at), "{at}");
    let Some((Level::Warning, at)) = first("heartbeat") else { panic!("{:?}", judged.findings) };
    assert!((43.4..43.6).contains(&at), "{at}");
    assert!(judged.judged.contains(&"frames_lost"), "{:?}", judged.judged);
    let judged = link_faults(HeardAt::Somewhere);
    assert!(judged.findings.iter().all(|finding| finding.check != "frames_lost"), "{:?}", judged.findings);
}

#[test]
fn silence_of_a_link_is_no_finding_where_nobody_knows_which_link_it_was() {
    for (checked, heartbeats) in [(false, 0), (true, 1)] {
        let given = [(Param::BatRemWarn.spec(), 15.0)];
        let mut judge = Judge::new(&Limits::new(&given), Format::Hums);
        if checked {
            judge.item(Instant::ZERO, Item::Record(&CHECKED));
        }
        fly(&mut judge, 0, 10, 10, 0.9);
        fly(&mut judge, 30, 40, 10, 0.9);
        let problems = judge.end().problems;
        let of_link = problems.iter().filter(|problem| problem.check == "heartbeat").count();
        assert_eq!(of_link, heartbeats, "{problems:?}");
    }
}

fn escs(judge: &mut Judge, from_ms: u64, to_ms: u64) {
    let esc = Some(Esc { rpm: Some(Rpm(5_000.0)), ..Esc::default() });
    let told = Observation::Escs(EscGroup { first: 0, escs: [esc, None, None, None] });
    for tick in from_ms / 100..to_ms / 100 {
        let at = Instant::from_millis(tick * 100);
        judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(true)));
        judge.item(at, Item::Observation(AUTOPILOT, &told));
    }
}

#[test]
fn a_pause_of_the_recording_is_no_silence_of_an_esc_and_one_that_falls_silent_is_found() {
    for (told, others, cause, silent) in [
        (true, false, Why::NotKept, 0),
        (true, false, Why::Lost, 0),
        (true, false, Why::Damaged, 0),
        (false, false, Why::Lost, 0),
        (false, true, Why::Lost, 1),
    ] {
        let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
        escs(&mut judge, 0, 10_000);
        if told {
            miss(&mut judge, 9_900, 30_000, cause);
        }
        for tick in if others { 100..300 } else { 0..0 } {
            let at = Instant::from_millis(tick * 100);
            judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(true)));
        }
        escs(&mut judge, 30_000, 40_000);
        miss(&mut judge, 0, 39_900, cause);
        let judged = judge.end();
        let found = judged.problems.iter().filter(|problem| problem.check == "esc_silent").count();
        assert_eq!(found, silent, "{cause:?}: {:?}", judged.findings);
        assert_eq!(judged.span.map(|(_, last)| last.as_millis()), Some(39_900));
    }
}

#[test]
fn findings_after_a_pause_have_the_recordings_time() {
    let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
    fly(&mut judge, 0, 10, 10, 0.9);
    miss(&mut judge, 9_900, 30_000, Why::NotKept);
    fly(&mut judge, 30, 40, 10, 0.1);
    let found = found(&judge.end());
    let [(check, Level::Warning, at)] = found.as_slice() else { panic!("{found:?}") };
    assert_eq!(check, "batt_remaining");
    assert!((32.0..33.2).contains(at), "{at}");
}

#[test]
fn what_the_board_found_counts_unless_other_limits_are_asked_for() {
    let finding = finding("card_stall", 7_000, Level::Critical, 3000.0);
    let spec = Param::BatRemWarn.spec();
    for (given, by, check) in
        [(vec![], JudgedBy::Board, "card_stall"), (vec![(spec, 95.0)], JudgedBy::Here, "batt_remaining")]
    {
        let mut judge = Judge::new(&Limits::new(&given), Format::Hums);
        judge.item(Instant::ZERO, Item::Record(&CHECKED));
        let other = Parameter { name: spec.name, value: 1.0, changed: false, by: (0, 0) };
        judge.item(Instant::ZERO, Item::Record(&Record::Parameter(other)));
        fly(&mut judge, 0, 10, 10, 0.9);
        judge.item(Instant::from_millis(7_000), Item::Record(&Record::Finding(finding)));
        let judged = judge.end();
        assert_eq!(judged.by, by);
        assert_eq!(judged.problems.iter().map(|problem| problem.check.as_str()).collect::<Vec<_>>(), [check]);
    }
}

fn armed_and_told(format: Format, item: Item<'_>) -> Judgement {
    let mut judge = Judge::new(&Limits::default(), format);
    for tick in 0..200_u64 {
        let at = Instant::from_millis(tick * 100);
        judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(true)));
        if tick == 100 {
            let mut take = |at: Instant, item: Item<'_>| {
                judge.item(at, item);
                Ok(())
            };
            hand_said(at, item, true, &mut take).expect("no error");
        }
    }
    judge.end()
}

#[test]
fn a_finding_names_the_text_or_the_event_that_raised_it_whatever_the_words_of_it_mean_by_themselves() {
    use hums_core::cause::Urgency;
    let alert = Some(Alert { cause: Cause::Power, urgency: Urgency::Warning });
    let stranger = Source { system: 255, component: 190 };
    let text = |source| Item::Text(Text { source, severity: 6, words: "it hums no more", alert });
    let event = |words| Item::Event(Event { source: AUTOPILOT, number: 4711, severity: 7, words, alert });
    for (item, named) in [
        (text(AUTOPILOT), Some("\"it hums no more\"")),
        (event("a name"), Some("a name")),
        (event(""), Some("event 4711")),
        (text(stranger), None),
    ] {
        let judged = armed_and_told(Format::Ulog, item);
        let names: Vec<_> = judged.problems.iter().flat_map(|problem| &problem.details).collect();
        assert_eq!(names, Vec::from_iter(named), "{:?}", judged.problems);
        assert_eq!(judged.problems.len(), usize::from(named.is_some()), "{:?}", judged.problems);
        // Without an alert not judged.
        let alerts = judged.judged.iter().filter(|check| check.ends_with("_alert"));
        assert_eq!(alerts.copied().collect::<Vec<_>>(), Vec::from_iter(named.map(|_| "battery_alert")));
    }
    // At any severity.
    let silent = Text { source: AUTOPILOT, severity: 0, words: "Battery failsafe", alert: None };
    assert!(armed_and_told(Format::Tlog, Item::Text(silent)).problems.is_empty());
}

#[test]
fn what_the_board_found_is_named_too() {
    use hums_core::cause::Urgency;
    let mut judge = Judge::new(&Limits::default(), Format::Hums);
    let finding = FindingRecord {
        subsystem: hums_core::health::Subsystem::Power,
        ..finding("battery_alert", 5_100, Level::Warning, 1.0)
    };
    fly(&mut judge, 0, 5, 10, 0.9);
    let alert = Some(Alert { cause: Cause::Power, urgency: Urgency::Warning });
    let text = Text { source: AUTOPILOT, severity: 4, words: "Battery 1 is low", alert };
    judge.item(Instant::from_millis(5_050), Item::Text(text));
    judge.item(finding.at, Item::Record(&Record::Finding(finding)));
    let judged = judge.end();
    assert_eq!(
        (judged.by, judged.problems[0].details.clone()),
        (JudgedBy::Board, vec!["\"Battery 1 is low\"".to_owned()])
    );
}

/// Vehicle state after it: landed flights, causes of gaps, damages.
fn silent_in_air(
    format: Format,
    silence_ms: u64,
    armed: bool,
    landed: LandedState,
) -> (Vec<bool>, Vec<Why>, u64) {
    let mut judge = Judge::new(&Limits::default(), format);
    half_seconds(&mut judge, 0, 5_000, true, LandedState::OnGround);
    half_seconds(&mut judge, 5_000, 40_000, true, LandedState::InAir);
    let again = 39_500 + silence_ms;
    half_seconds(&mut judge, again, again + 20_000, armed, landed);
    let judged = judge.end();
    let landed = judged.flights.iter().map(|flight| flight.landed).collect();
    (landed, judged.gaps.iter().map(|gap| gap.cause).collect(), judged.damages)
}

#[test]
fn silence_in_the_air_is_told_and_hides_no_crash() {
    for format in [Format::Tlog, Format::Raw, Format::Ulog] {
        let of = |silence_ms, armed, landed| silent_in_air(format, silence_ms, armed, landed);
        assert_eq!(of(1_000, false, LandedState::OnGround), (vec![true], vec![], 0));
        for silence_ms in [4_000, 6_000, 20_000] {
            let flies_on = of(silence_ms, true, LandedState::InAir);
            assert_eq!(flies_on, (vec![false], vec![Why::Lost], 0), "{format:?} {silence_ms}");
            for armed in [false, true] {
                let ends = of(silence_ms, armed, LandedState::OnGround);
                assert_eq!(ends, (vec![false], vec![Why::Silent], 1), "{format:?} {silence_ms} {armed}");
            }
        }
    }
}

#[test]
fn a_recording_that_ends_in_the_air_says_so_and_what_comes_last_is_a_landing() {
    let ends = |last: Option<LandedState>| {
        let mut judge = Judge::new(&Limits::default(), Format::DataFlash);
        half_seconds(&mut judge, 0, 5_000, true, LandedState::OnGround);
        half_seconds(&mut judge, 5_000, 40_020, true, LandedState::InAir);
        let at = Instant::from_millis(40_020);
        if let Some(landed) = last {
            judge.item(at, Item::Observation(AUTOPILOT, &Observation::Landed(landed, VtolState::Unknown)));
            judge.item(at, Item::Observation(AUTOPILOT, &heartbeat(false)));
        }
        let judged = judge.end();
        (judged.ends_in_air.is_some(), judged.flights.last().map(|flight| flight.landed))
    };
    assert_eq!(ends(None), (true, Some(false)));
    assert_eq!(ends(Some(LandedState::OnGround)), (false, Some(true)));
}

#[test]
fn what_comes_where_the_recording_has_no_times_is_left_out() {
    let judged = |from_s: u64| {
        let mut judge = Judge::new(&Limits::default(), Format::Tlog);
        fly(&mut judge, 0, 20, 10, 0.9);
        fly(&mut judge, 20, 40, 10, 0.1);
        let from = Some(Instant::from_millis(from_s * 1_000));
        let gap = Gap {
            from,
            to: None,
            cause: Why::NoTimes,
            place: Some(1),
            bytes: 0,
            words: String::new(),
            own: None,
        };
        judge.item(Instant::from_millis(40_000), Item::Gap(&gap));
        judge.end()
    };
    let late = judged(30);
    assert_eq!((late.verdict(), late.armed, late.is_timeless), ("warning", Span::from_secs(30), false));
    let early = judged(10);
    assert_eq!((early.problems.len(), early.armed), (0, Span::from_secs(10)), "{:?}", early.problems);
    assert_eq!(early.span.map(|(_, last)| last), Some(Instant::from_millis(10_000)));
    let never = judged(0);
    assert_eq!((never.verdict(), never.judged.len(), never.findings_count), ("unknown", 0, 0));
    assert_eq!(never.not_judged.first().map(|(_, why)| why.as_str()), Some("the recording has no times"));
}
