use hums_core::status::{LinkReading, RecorderStatus, Recording};

use super::*;
use crate::encode::{Encoder, FRAME_BYTES_MAX};
use crate::packet::Packet;

const VEHICLE: Source = Source { system: 1, component: 1 };

fn finding(level: Level) -> Finding {
    Finding {
        at: Instant::ZERO.into(),
        subsystem: Subsystem::Power,
        check: "batt_remaining",
        instance: 0,
        level,
        previous: Level::Ok,
        value: 14.9,
        limit: 15.0,
        unit: "%",
        feeds: Feeds::Vehicle,
        because: "",
        orders: Orders::Own,
    }
}

fn of(check: &'static str, level: Level) -> Finding {
    Finding { check, ..finding(level) }
}

fn params(budget: f32) -> Params {
    let mut params = Params::defaults();
    params.set("GS_BUDGET", budget).expect("in range");
    params
}

fn frame(id: u32, bytes: usize) -> Vec<u8> {
    let mut buffer = [0; FRAME_BYTES_MAX];
    let packet = Packet::new(id).bytes(0, &vec![1; bytes - 12]);
    let mut frame = Encoder::new().frame(&mut buffer, &packet).to_vec();
    frame[6] = 1;
    frame
}

fn run(budget: f32, seconds: u64, streams: &[(u32, usize, u64)]) -> Vec<(u64, u32, usize)> {
    run_with(Forwards::Budgeted, budget, seconds, streams)
}

fn run_with(
    forwards: Forwards,
    budget: f32,
    seconds: u64,
    streams: &[(u32, usize, u64)],
) -> Vec<(u64, u32, usize)> {
    let params = params(budget);
    let mut summary = Summary::new(&params);
    let monitor = Monitor::new(params);
    summary.vehicle = Some(VEHICLE);
    summary.forwards = forwards;
    let frames: Vec<Vec<u8>> = streams.iter().map(|(id, bytes, _)| frame(*id, *bytes)).collect();
    let mut sent = Vec::new();
    let mut random = 12_345_u64;
    let mut next: Vec<u64> = streams.iter().map(|(_, _, every)| every / 2).collect();
    for now_ms in 0..seconds * 1_000 {
        let now = Instant::from_millis(now_ms);
        let mut out = |bytes: &[u8]| {
            let id = u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]);
            sent.push((now_ms, id, bytes.len()));
        };
        for (index, (_, _, every)) in streams.iter().enumerate() {
            if now_ms == next[index] {
                random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let jitter = (random >> 33) % (every / 5 + 1);
                next[index] = (now_ms / every + 1) * every + every / 2 + jitter - every / 10;
                next[index] = next[index].max(now_ms + 1);
                let bytes = &frames[index];
                let frame = Frame::again(bytes, crate::Check::Verified).expect("a frame");
                summary.frame(now, &frame, &mut out);
            }
        }
        if now_ms % 50 == 0 {
            summary.tick(now, &monitor, &mut out);
        }
    }
    sent
}

const ALL: &[(u32, usize, u64)] = &[
    (0, 21, 1_000),
    (1, 43, 500),
    (2, 24, 1_000),
    (24, 64, 200),
    (30, 40, 20),
    (33, 40, 100),
    (65, 54, 200),
    (74, 32, 50),
    (147, 66, 1_000),
    (193, 34, 200),
    (241, 44, 200),
    (245, 14, 500),
    (291, 69, 100),
];

#[test]
fn a_finding_is_told_in_the_words_of_a_pilot_and_fits() {
    let told = |finding: Finding| text(&finding).as_str().to_owned();
    assert_eq!(told(finding(Level::Warning)), "HUMS: battery 1 low: 14.9 %");
    assert_eq!(
        told(Finding { value: 6.8, ..finding(Level::Critical) }),
        "HUMS: battery 1 low: 6.8 %, LAND NOW"
    );
    assert_eq!(told(finding(Level::Ok)), "HUMS: over: battery 1 low");
    assert_eq!(told(finding(Level::Stale)), "HUMS: no data: battery 1 remaining");
    let flag = |check| told(Finding { check, instance: 2, unit: "", value: 1.0, ..finding(Level::Warning) });
    assert_eq!(flag("gnss_alert"), "HUMS: autopilot warns: GPS");
    assert_eq!(flag("esc_failure"), "HUMS: ESC 3 failed");
    let motor = Finding { instance: 2, value: 44.07, ..of("motor_imbalance", Level::Critical) };
    assert_eq!(told(motor), "HUMS: motor 3 speed differs: 44.1 %, LAND");
    assert_eq!(told(Finding { check: "of_later", ..motor }), "HUMS: of_later");
}

#[test]
fn a_value_says_what_it_is_of_or_is_not_told() {
    let told = |check, value, level| {
        let check = health::check_named(check).expect("a check");
        text(&Finding { unit: check.unit.name(), value, ..of(check.name, level) }).as_str().to_owned()
    };
    let (warning, critical) = (Level::Warning, Level::Critical);
    for (check, value, level, text) in [
        ("batt_resistance", 160.0, critical, "battery 1 worn: +160 %, REPLACE IT"),
        ("motor_loss", 4.2, critical, "motor 1 lost: 4.2 % of normal amps, LAND NOW"),
        ("motor_output", 12.3, critical, "motor 1 weak: output +12.3 %, LAND NOW"),
        ("motor_off", 2.0, critical, "motor 1 off: no output, LAND NOW"),
        ("vibration_rise", 10.2, warning, "vibration up: 10.2 x usual"),
        ("gps_satellites", 5.0, warning, "GPS 1 few satellites: 5"),
        ("gps_hdop", 2.8, warning, "GPS 1 poor geometry: HDOP 2.8"),
        ("rc_rssi", 45.0, critical, "RC signal weak, FLY BACK"),
        ("ekf_variance", 0.85, warning, "EKF doubts position or speed"),
        ("clipping", 12.0, critical, "accelerometer clipping, LAND BY HAND"),
        ("compass_mismatch", 40.0, warning, "compass 1 and others differ: 40 %"),
        ("impact", 5.0, critical, "impact: 5 g, DISARM IF DOWN"),
        ("sinking", 12.3, critical, "sinking fast: 12.3 m/s, FLY FORWARD, CLIMB"),
        ("autopilot_state", 5.0, critical, "autopilot in failsafe, WATCH IT"),
    ] {
        assert_eq!(told(check, value, level), format!("HUMS: {text}"));
    }
    assert!(health::checks().filter(|check| check.unit.is_flag()).count() > 20, "a state is no quantity");
}

#[test]
fn no_text_is_cut_whatever_part_and_level() {
    for check in health::checks() {
        let advice = vocabulary::said(check.name).map_or("", |said| said.advice);
        for (level, feeds) in
            Level::ALL.into_iter().flat_map(|level| [(level, Feeds::Vehicle), (level, Feeds::Avionics)])
        {
            let feeds = if check.subsystem == Subsystem::Power { feeds } else { Feeds::Unsaid };
            let finding = Finding {
                instance: check.instances - 1,
                unit: check.unit.name(),
                value: -234.5,
                feeds,
                ..of(check.name, level)
            };
            let told = text(&finding);
            let told = told.as_str();
            let around = vocabulary::said(check.name).and_then(|said| said.around_value(check.unit.name()));
            let value =
                around.filter(|_| feeds != Feeds::Avionics).map_or_else(String::new, |(before, after)| {
                    format!(": {before}{}{after}", quantity(finding.value, check.unit.name()).as_str())
                });
            let end = match level {
                Level::Critical => advice,
                Level::Warning => &value,
                _ => "",
            };
            assert!(told.len() <= TEXT_BYTES_MAX && told.ends_with(end), "{told}");
            assert!(!told.contains(['|', '~', '#']), "{told}");
            let said = vocabulary::said(check.name).expect("its words");
            let whole = match level {
                Level::Ok => said.alarm_of(finding.instance, feeds).to_string(),
                Level::Stale => said.name_of(finding.instance).to_string(),
                _ => String::new(),
            };
            assert!(told.ends_with(&whole), "{told}");
        }
    }
}

#[test]
fn a_battery_that_does_not_keep_the_vehicle_up_is_called_what_it_is() {
    let told = |feeds, level| {
        let finding = Finding { instance: 1, feeds, ..finding(level) };
        text(&finding).as_str().to_owned()
    };
    assert_eq!(told(Feeds::Payload, Level::Warning), "HUMS: battery 2 (payload) low: 14.9 %");
    let warned = told(Feeds::Payload, Level::Warning);
    assert_eq!(told(Feeds::Payload, Level::Critical), warned, "nobody lands because of a camera's battery");
    let long = Finding { unit: "V", feeds: Feeds::Avionics, ..of("cell_deviation", Level::Critical) };
    assert_eq!(text(&long).as_str(), "HUMS: battery 1 (avionics) cells uneven, LAND");
    assert_eq!(told(Feeds::Avionics, Level::Ok), "HUMS: over: battery 2 (avionics) low");
}

#[test]
fn forwarded_ids_are_sorted_for_the_search() {
    assert!(FORWARDED.is_sorted_by(|a, b| a.0 < b.0));
}

#[test]
fn the_budget_holds_in_every_window_of_a_second_and_is_used() {
    for budget in [100, 250, 400, 2_000, 5_000_u32] {
        let sent = run(budget as f32, 60, ALL);
        for (index, (start, ..)) in sent.iter().enumerate() {
            let window = sent[index..].iter().take_while(|(at, ..)| *at < start + 1_000);
            let bytes: usize = window.map(|(.., bytes)| bytes).sum();
            assert!(bytes <= budget as usize, "{bytes} of {budget} bytes in the second from {start} ms");
        }
        let total: usize = sent.iter().map(|(.., bytes)| bytes).sum();
        assert!(budget > 1_000 || total as u32 > budget * 60 / 2, "{total} bytes at {budget} B/s");
    }
}

#[test]
fn nothing_starves_from_the_smallest_budget_up() {
    for budget in [100.0, 150.0, 300.0, 1_000.0] {
        let sent = run(budget, 240, ALL);
        for (id, ..) in ALL.iter().chain(&[(251, 30, 0), (252, 30, 0)]) {
            let times: Vec<u64> = sent.iter().filter(|(_, sent, _)| sent == id).map(|(at, ..)| *at).collect();
            let longest = times.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(u64::MAX);
            assert!(longest < 90_000, "{id} at {budget} B/s: {longest} ms without one");
        }
        let beats: Vec<u64> = sent.iter().filter(|(_, id, _)| *id == 0).map(|(at, ..)| *at).collect();
        assert!(beats.len() > 300, "{} heartbeats at {budget} B/s", beats.len());
    }
}

#[test]
fn a_stream_of_one_a_second_is_not_halved_by_its_jitter() {
    let sent = run(2_000.0, 100, &[(0, 21, 1_000), (24, 64, 1_000), (245, 14, 250)]);
    let count = |id| sent.iter().filter(|(_, sent, _)| *sent == id).count();
    assert!(count(24) >= 97, "{} of 100 positions", count(24));
    assert!((97..=103).contains(&count(245)), "{} where one a second was wanted", count(245));
}

#[test]
fn a_critical_finding_overtakes_those_that_wait() {
    let mut summary = Summary::new(&Params::defaults());
    summary.outlet.set(Instant::ZERO, 0, 57_600);
    let levels = [Level::Warning, Level::Stale, Level::Critical, Level::Warning];
    for (instance, level) in (0..).zip(levels) {
        let finding = Finding { instance, ..finding(level) };
        summary.finding(Instant::ZERO, &finding, &mut |_| panic!("there is no budget"));
    }
    let order: Vec<_> = summary.waiting.iter().map(|finding| finding.level).collect();
    assert_eq!(order, [Level::Critical, Level::Warning, Level::Warning, Level::Stale]);
}

#[test]
fn the_state_holds_every_subsystem() {
    let monitor = Monitor::new(Params::defaults());
    for (index, subsystem) in Subsystem::ALL.into_iter().enumerate() {
        assert_eq!(state(&monitor) >> (3 * index) & 7, monitor.health().subsystem(subsystem) as i32);
    }
    let parts = VALUES_TOLD.iter().filter_map(|(_, told)| match told {
        ValueSource::Level(part) => Some(*part),
        _ => None,
    });
    assert!(parts.eq(Subsystem::ALL));
    assert!(VALUES_TOLD.iter().all(|(name, _)| name.len() <= 10));
}

type Comes = (u64, &'static str, u8, Level, Level);

fn told(findings: &[Comes]) -> Vec<(u64, String)> {
    told_because(findings, "")
}

fn told_because(findings: &[Comes], because: &'static str) -> Vec<(u64, String)> {
    told_where(findings, because, |_| Orders::Own)
}

fn sent_text(bytes: &[u8]) -> Option<String> {
    let text = bytes.get(11..bytes.len().saturating_sub(2)).filter(|_| bytes.get(7) == Some(&253))?;
    let text = text.strip_prefix(b"HUMS: ")?;
    Some(String::from_utf8_lossy(text).trim_end_matches('\0').to_owned())
}

fn told_where(findings: &[Comes], because: &'static str, orders: fn(&str) -> Orders) -> Vec<(u64, String)> {
    let mut summary = Summary::new(&Params::defaults());
    let monitor = Monitor::new(Params::defaults());
    let mut told = Vec::new();
    for tenths in 0..1_800 {
        let now = Instant::from_millis(tenths * 100);
        let mut out = |bytes: &[u8]| told.extend(sent_text(bytes).map(|text| (tenths, text)));
        for (_, check, instance, level, previous) in findings.iter().filter(|(at, ..)| *at == tenths) {
            let check = health::check_named(check).expect("a check");
            let finding = Finding {
                at: now.into(),
                subsystem: check.subsystem,
                check: check.name,
                instance: *instance,
                previous: *previous,
                unit: "",
                value: if *level == Level::Ok { 0.0 } else { f32::NAN },
                because,
                orders: orders(check.name),
                ..finding(*level)
            };
            summary.finding(now, &finding, &mut out);
        }
        summary.tick(now, &monitor, &mut out);
    }
    told
}

fn texts(told: &[(u64, String)]) -> Vec<(u64, &str)> {
    told.iter().map(|(at, text)| (*at, text.as_str())).collect()
}

const WARNING: (Level, Level) = (Level::Warning, Level::Ok);
const CRITICAL: (Level, Level) = (Level::Critical, Level::Warning);

fn comes(at: u64, check: &'static str, instance: u8, (level, previous): (Level, Level)) -> Comes {
    (at, check, instance, level, previous)
}

#[test]
fn a_warning_that_becomes_critical_is_one_text_and_so_is_what_asks_for_the_same() {
    let told = told(&[
        comes(20, "roll_rate", 0, WARNING),
        comes(22, "roll_rate", 0, CRITICAL),
        comes(23, "pitch_rate", 0, CRITICAL),
        comes(24, "motor_imbalance", 1, CRITICAL),
        comes(30, "motor_output", 1, CRITICAL),
        // Another family.
        comes(31, "batt_remaining", 0, CRITICAL),
    ]);
    let expected = [
        (22, "roll does not follow, LAND NOW"),
        (24, "motor 2 speed differs, LAND"),
        (31, "battery 1 low, LAND NOW"),
    ];
    assert_eq!(texts(&told), expected);
}

#[test]
fn a_critical_finding_is_told_at_once_whatever_was_told_before() {
    let checks =
        ["batt_remaining", "gps_fix", "ekf_test_ratio", "motor_loss", "vibration", "heartbeat", "load"];
    let before = ["cell_deviation", "gps_hdop", "esc_errors"].map(|check| comes(0, check, 0, WARNING));
    let all: Vec<_> = before.into_iter().chain(checks.map(|check| comes(40, check, 0, CRITICAL))).collect();
    let told = told(&all);
    let at_once = told.iter().filter(|(at, _)| *at == 40).count();
    assert_eq!(at_once, checks.len(), "{told:?}");
}

#[test]
fn warnings_wait_for_their_events_end_and_three_are_told_in_half_a_minute() {
    let warnings = ["gps_hdop", "gps_satellites", "baro_noise", "vibration_rise", "esc_errors", "batt_fault"];
    let told = told(&warnings.map(|check| comes(0, check, 0, WARNING)));
    let expected = [
        (10, "GPS 1 poor geometry"),
        (10, "vibration up"),
        (10, "ESC 1 errors"),
        // When the first ones are half a minute ago.
        (310, "GPS 1 few satellites"),
        (310, "battery 1 fault"),
        (410, "barometer noisy"),
    ];
    assert_eq!(texts(&told), expected);
}

#[test]
fn an_estimator_waits_for_its_cause_and_gives_its_order_in_the_words_of_one_that_waits() {
    let doubts = [comes(0, "ekf_test_ratio", 0, WARNING)];
    assert_eq!(texts(&told(&doubts)), [(30, "EKF rejects position or speed")]);
    let fails = [
        doubts[0],
        comes(5, "gps_stuck", 0, WARNING),
        comes(8, "ekf_test_ratio", 0, CRITICAL),
        comes(200, "ekf_test_ratio", 0, (Level::Ok, Level::Critical)),
        comes(300, "gps_stuck", 0, (Level::Ok, Level::Warning)),
    ];
    let expected = [(8, "GPS 1 frozen, LAND, MANUAL"), (300, "over: GPS 1 frozen")];
    assert_eq!(texts(&told(&fails)), expected);
    let long = [comes(5, "accel_mismatch", 0, WARNING), comes(8, "ekf_test_ratio", 0, CRITICAL)];
    let expected =
        [(8, "EKF rejects position or speed, LAND, MANUAL"), (108, "accelerometer 1 and others differ")];
    assert_eq!(texts(&told(&long)), expected, "the order would be cut");
}

#[test]
fn a_critical_finding_that_outlives_its_cause_is_sent_though_it_was_sent_as_a_warning() {
    let outlives = |level| [comes(0, "ekf_test_ratio", 0, WARNING), comes(300, "ekf_test_ratio", 0, level)];
    let mut expected = vec![(30, "EKF rejects position or speed")];
    assert_eq!(texts(&told(&outlives((Level::Warning, Level::Warning)))), expected);
    expected.push((300, "EKF rejects position or speed, LAND, MANUAL"));
    assert_eq!(texts(&told(&outlives((Level::Critical, Level::Critical)))), expected);
}

#[test]
fn the_words_of_a_cause_are_of_a_warning_that_waits_and_of_no_critical_finding() {
    let cause = |level| telling::cause(&of("roll", Level::Critical), &[of("motor_loss", level)]);
    assert!(cause(Level::Warning).is_some() && cause(Level::Critical).is_none());
}

#[test]
fn what_is_not_critical_waits_for_the_end_of_what_is() {
    let told = told(&[comes(0, "gps_fix", 0, CRITICAL), comes(5, "vibration_rise", 0, WARNING)]);
    assert_eq!(texts(&told), [(0, "GPS 1 position lost, FLY MANUALLY"), (100, "vibration up")]);
}

#[test]
fn a_mishap_is_told_once_and_what_waits_is_its_consequence() {
    let mishap = [
        comes(0, "compass_stuck", 0, WARNING),
        comes(15, "roll_rate", 0, CRITICAL),
        comes(19, "baro_noise", 0, WARNING),
        comes(20, "sinking", 0, CRITICAL),
        comes(25, "impact", 0, CRITICAL),
        comes(30, "overturned", 0, CRITICAL),
        comes(35, "tumbling", 0, CRITICAL),
        comes(400, "roll_rate", 0, (Level::Ok, Level::Critical)),
    ];
    let led_to = [
        (10, "compass 1 frozen"),
        (15, "roll does not follow, LAND NOW"),
        (20, "sinking fast, FLY FORWARD, CLIMB"),
    ];
    assert_eq!(texts(&told(&mishap)), led_to, "one kind, where something led to it");
    let alone = &mishap[3..7];
    let expected = [(20, "sinking fast, FLY FORWARD, CLIMB"), (25, "impact, DISARM IF DOWN")];
    assert_eq!(texts(&told(alone)), expected, "and one that asks for something else");
    let again = [
        comes(0, "sinking", 0, CRITICAL),
        comes(300, "sinking", 0, (Level::Ok, Level::Critical)),
        comes(400, "sinking", 0, CRITICAL),
    ];
    let expected = [(0, "sinking fast, FLY FORWARD, CLIMB"), (400, "sinking fast, FLY FORWARD, CLIMB")];
    assert_eq!(texts(&told(&again)), expected, "and the next one as the first");
}

#[test]
fn a_warning_that_came_before_a_mishap_is_no_consequence_of_it() {
    let told = told(&[comes(6, "airspeed_alert", 0, WARNING), comes(10, "sinking", 0, CRITICAL)]);
    let expected = [(10, "sinking fast, FLY FORWARD, CLIMB"), (110, "autopilot warns: airspeed")];
    assert_eq!(texts(&told), expected, "it may be its cause");
}

#[test]
fn an_order_that_does_not_fit_the_vehicle_is_given_as_the_one_that_does_and_not_again() {
    let mishap = [
        comes(10, "roll_rate", 0, CRITICAL),
        comes(20, "sinking", 0, CRITICAL),
        comes(40, "impact", 0, CRITICAL),
        comes(60, "overturned", 0, CRITICAL),
    ];
    let told = told_where(&mishap, "", |check| if check == "sinking" { Orders::Disarm } else { Orders::Own });
    let expected = [(10, "roll does not follow, LAND NOW"), (20, "sinking fast, DISARM IF DOWN")];
    assert_eq!(texts(&told), expected);
}

#[test]
fn telemetry_of_all_escs_that_is_silent_at_once_is_one_text_and_no_order_to_land() {
    let silent = [0, 1, 2, 3].map(|motor| comes(10, "esc_silent", motor, CRITICAL));
    let all = told_where(&silent, "", |_| Orders::Watch);
    assert_eq!(texts(&all), [(10, "ESC 1 and all others silent, WATCH IT")]);
    assert_eq!(texts(&told(&silent[2..3])), [(10, "ESC 3 silent, LAND")], "one alone");
}

#[test]
fn what_a_dead_sensor_says_is_not_over_while_it_is_dead() {
    let findings = [
        comes(0, "compass_stuck", 0, WARNING),
        comes(200, "compass_mismatch", 0, WARNING),
        comes(400, "compass_mismatch", 0, (Level::Ok, Level::Warning)),
        comes(600, "compass_stuck", 0, (Level::Ok, Level::Warning)),
    ];
    let expected =
        [(10, "compass 1 frozen"), (210, "compass 1 and others differ"), (600, "over: compass 1 frozen")];
    assert_eq!(texts(&told(&findings)), expected);
}

/// A box that does not record from 10 to 20 s, and whose queue is full from 12 s to `full_until`, tenths of a second.
fn told_of_recorder(full_until: u64) -> Vec<(u64, String)> {
    let mut summary = Summary::new(&Params::defaults());
    let mut monitor = Monitor::new(Params::defaults());
    let mut told = Vec::new();
    for tenths in 0..1_000 {
        let now = Instant::from_millis(tenths * 100);
        let stops = (100..200).contains(&tenths);
        let recorder = RecorderStatus {
            recording: if stops { Recording::Stopped } else { Recording::Running },
            queue: if (120..full_until).contains(&tenths) { 0.95 } else { 0.0 },
            ..RecorderStatus::default()
        };
        let mut findings = Vec::new();
        let mut out = |bytes: &[u8]| told.extend(sent_text(bytes).map(|text| (tenths, text)));
        monitor.tick(now.into(), &LinkReading::default(), &recorder, &mut |finding| findings.push(*finding));
        for finding in &findings {
            summary.finding(now, finding, &mut out);
        }
        summary.tick(now, &monitor, &mut out);
    }
    told
}

#[test]
fn the_end_of_a_cause_is_told_once_its_critical_effect_is_over() {
    let over = |full_until| {
        let told = told_of_recorder(full_until);
        let begins = ["not recording", "card slow: buffer 95 % full, CHANGE CARD"];
        assert!(begins.iter().zip(&told).all(|(begins, (_, text))| begins == text), "{told:?}");
        told.iter().find(|(_, text)| text == "over: not recording").map(|(at, _)| *at)
    };
    // The record works again from 22 s on, and the event of the critical text ends in the same second.
    assert!(over(150).is_some_and(|at| (220..240).contains(&at)), "{:?}", over(150));
    assert!(over(600).is_some_and(|at| (620..640).contains(&at)), "{:?}", over(600));
}

#[test]
fn what_another_one_explains_is_not_told_nor_that_it_is_over() {
    let explained =
        [comes(10, "gps_fix", 0, CRITICAL), comes(50, "gps_fix", 0, (Level::Ok, Level::Critical))];
    assert_eq!(told_because(&explained, "heartbeat"), []);
    let expected = [(10, "GPS 1 position lost, FLY MANUALLY"), (110, "over: GPS 1 position lost")];
    assert_eq!(texts(&told(&explained)), expected, "where nothing explains it, both");
}

#[test]
fn that_a_check_no_longer_applies_is_not_told_as_good() {
    let mut telling = SentFindings::new();
    let critical = Finding { previous: Level::Warning, ..finding(Level::Critical) };
    let good = Finding { previous: Level::Critical, value: 40.0, ..finding(Level::Ok) };
    let landed = Finding { value: f32::NAN, ..good };
    let now = Instant::from_millis(100_000);
    for (over, is_told) in [(good, true), (landed, false)] {
        telling.told(now, &critical);
        assert_eq!(telling.is_news(&over), is_told);
    }
    assert!(!telling.is_news(&good), "the alarm is over");
}

#[test]
fn what_is_over_before_it_was_told_is_not_told() {
    let over = [comes(0, "gps_hdop", 0, WARNING), comes(8, "gps_hdop", 0, (Level::Ok, Level::Warning))];
    assert_eq!(told(&over), []);
}

#[test]
fn that_there_are_no_data_is_told_while_nothing_is_wrong() {
    let stale = (Level::Stale, Level::Ok);
    let told = told(&[
        comes(0, "gps_hdop", 0, stale),
        comes(200, "gps_fix", 0, CRITICAL),
        comes(250, "gps_accuracy", 0, stale),
        comes(260, "batt_remaining", 0, stale),
    ]);
    let expected = [(0, "no data: GPS 1 HDOP"), (200, "GPS 1 position lost, FLY MANUALLY")];
    assert_eq!(texts(&told), expected);
}

#[test]
fn quantities_are_printed_as_the_formatting_of_numbers_does() {
    let mut state = 1_u32;
    let random = std::iter::repeat_with(|| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from_bits(state)
    });
    let halves = (-2_000..2_000).map(|number| number as f32 / 8.0);
    let odd = [0.0, -0.0, f32::MIN_POSITIVE, 1e-45, 0.05, 99.95, 99.96, 100.0, 1e12, 1_099_511_627_776.0];
    let values = random.take(100_000).filter(|value| value.is_finite() && value.abs() <= 1e12);
    for value in values.chain(halves).chain(odd) {
        for (unit, digits, shown) in
            [("V", 2, " V"), ("degC", 0, " C"), ("%", usize::from(value.abs() < 100.0), " %"), ("", 0, "")]
        {
            let digits = if unit.is_empty() { usize::from(value.abs() < 100.0) } else { digits };
            let number = format!("{value:.digits$}");
            let number = if digits == 1 { number.trim_end_matches(".0") } else { &number };
            assert_eq!(quantity(value, unit).as_str(), format!("{number}{shown}"), "{value:e}");
        }
    }
    assert_eq!(quantity(f32::MAX, "V").as_str(), "1099511627776.00 V", "no quantity");
}

#[test]
fn what_is_less_urgent_takes_no_place_of_what_waits() {
    let mut summary = Summary::new(&Params::defaults());
    summary.outlet.set(Instant::ZERO, 0, 57_600);
    for instance in 0..WAITING_MAX as u8 + 4 {
        let critical = Finding { instance, ..finding(Level::Critical) };
        summary.finding(Instant::ZERO, &critical, &mut |_| panic!("there is no budget"));
    }
    let before: Vec<_> = summary.waiting.iter().map(|finding| finding.instance).collect();
    let warning = Finding { instance: 99, ..finding(Level::Warning) };
    summary.finding(Instant::ZERO, &warning, &mut |_| panic!("there is no budget"));
    let after: Vec<_> = summary.waiting.iter().map(|finding| finding.instance).collect();
    assert_eq!(after.len(), WAITING_MAX);
    assert_eq!(before, after);
}

#[test]
fn frames_for_a_port_with_a_budget_of_its_own_take_nothing_from_ours() {
    let streams = [ALL, &[(253, 62, 100)]].concat();
    let apart = run_with(Forwards::Apart, 200.0, 60, &streams);
    let alone = run_with(Forwards::Nothing, 200.0, 60, &streams);
    let count = |sent: &[(u64, u32, usize)], id| sent.iter().filter(|one| one.1 == id).count();
    let is_ours = |id: u32| [251, 252, 390].contains(&id);
    let ours: Vec<_> = apart.iter().filter(|one| is_ours(one.1)).collect();
    assert_eq!(ours, alone.iter().filter(|one| is_ours(one.1)).collect::<Vec<_>>());
    assert!(ours.len() > 100, "{}", ours.len());
    // Each at its interval, and all texts.
    for (id, wanted) in [(30, 240), (33, 120), (74, 120), (1, 30), (253, 590)] {
        assert!(count(&apart, id) * 20 >= wanted * 19, "{id}: {} of {wanted}", count(&apart, id));
    }
}
