use super::*;
use crate::encode::{Encoder, FRAME_BYTES_MAX};
use crate::packet::Packet;

const VEHICLE: Source = Source { system: 1, component: 1 };

fn finding(level: Level) -> Finding {
    Finding {
        at: Instant::ZERO,
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
    }
}

fn params(budget: f32) -> Params {
    let mut params = Params::defaults();
    params.set("GS_BUDGET", budget).expect("in range");
    params
}

/// A frame of the vehicle, `bytes` long.
fn frame(id: u32, bytes: usize) -> Vec<u8> {
    let mut buffer = [0; FRAME_BYTES_MAX];
    let packet = Packet::new(id).bytes(0, &vec![1; bytes - 12]);
    let mut frame = Encoder::new().frame(&mut buffer, &packet).to_vec();
    frame[6] = 1;
    frame
}

/// What a summary sends when each of `streams` (id, bytes, every so many ms) comes with jitter.
fn run(budget: f32, seconds: u64, streams: &[(u32, usize, u64)]) -> Vec<(u64, u32, usize)> {
    let params = params(budget);
    let mut summary = Summary::new(&params);
    let monitor = Monitor::new(params);
    summary.vehicle = Some(VEHICLE);
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
                // Each comes up to a tenth of its interval early or late.
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
    assert_eq!(told(finding(Level::Ok)), "HUMS: ok: battery 1 remaining");
    assert_eq!(told(finding(Level::Stale)), "HUMS: no data: battery 1 remaining");
    let flag = |check| told(Finding { check, instance: 2, unit: "", value: 1.0, ..finding(Level::Warning) });
    assert_eq!(flag("gnss_alert"), "HUMS: autopilot warns: GPS");
    assert_eq!(flag("esc_failure"), "HUMS: ESC 3 failed");
    let motor = Finding { check: "motor_imbalance", instance: 2, value: 44.07, ..finding(Level::Critical) };
    assert_eq!(told(motor), "HUMS: motor 3 speed differs: 44.1 %, LAND");
    assert_eq!(told(Finding { check: "of_later", ..motor }), "HUMS: of_later");
}

#[test]
fn no_text_is_cut_whatever_part_and_level() {
    for check in health::checks() {
        let advice = health::said(check.name).map_or("", |said| said.advice);
        for (level, feeds) in
            Level::ALL.into_iter().flat_map(|level| [(level, Feeds::Vehicle), (level, Feeds::Avionics)])
        {
            let feeds = if check.subsystem == Subsystem::Power { feeds } else { Feeds::Unsaid };
            let finding = Finding {
                check: check.name,
                instance: check.instances - 1,
                unit: check.unit,
                value: -234.5,
                feeds,
                ..finding(level)
            };
            let told = text(&finding);
            let told = told.as_str();
            let quantity = quantity(finding.value, check.unit);
            let has_value = !check.is_flag && feeds != Feeds::Avionics;
            let end = match level {
                Level::Critical => advice,
                Level::Warning if has_value => quantity.as_str(),
                _ => "",
            };
            assert!(told.len() <= TEXT_BYTES_MAX && told.ends_with(end), "{told}");
            let whole = health::said(check.name).map(|said| said.name_of(finding.instance).to_string());
            let is_good = matches!(level, Level::Ok | Level::Stale);
            assert!(!is_good || told.ends_with(&whole.unwrap()), "{told}");
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
    let long =
        Finding { check: "cell_deviation", unit: "V", feeds: Feeds::Avionics, ..finding(Level::Critical) };
    assert_eq!(text(&long).as_str(), "HUMS: battery 1 (avionics) cells uneven, LAND");
    assert_eq!(told(Feeds::Avionics, Level::Ok), "HUMS: ok: battery 2 remaining");
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
            // At 100 B/s all intervals are about twelve times as long.
            assert!(longest < 90_000, "{id} at {budget} B/s: {longest} ms without one");
        }
        // The vehicle's heartbeats and ours, of 240 each: link loss is four in a row.
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
        Told::Level(part) => Some(*part),
        _ => None,
    });
    assert!(parts.eq(Subsystem::ALL));
    assert!(VALUES_TOLD.iter().all(|(name, _)| name.len() <= 10));
}

/// What is told of findings that come at these seconds: their instances, by second.
fn told(findings: &[(u64, u8, Level, Level, &'static str)]) -> Vec<(u64, u8)> {
    let mut summary = Summary::new(&Params::defaults());
    let monitor = Monitor::new(Params::defaults());
    let mut told = Vec::new();
    for now_s in 0..180 {
        let now = Instant::from_millis(now_s * 1_000);
        // The number after the word of a STATUSTEXT.
        let mut out = |bytes: &[u8]| {
            let word = b"battery ";
            let place = bytes.windows(word.len()).position(|found| found == word);
            let digit = place.and_then(|place| bytes.get(place + word.len()));
            if let (Some(digit), Some(253)) = (digit, bytes.get(7)) {
                told.push((now_s, digit - b'1'));
            }
        };
        for (_, instance, level, previous, because) in findings.iter().filter(|(at_s, ..)| *at_s == now_s) {
            let finding = Finding { instance: *instance, previous: *previous, because, ..finding(*level) };
            summary.finding(now, &finding, &mut out);
        }
        summary.tick(now, &monitor, &mut out);
    }
    told
}

#[test]
fn in_any_half_minute_at_most_five_are_told_and_the_worst_first() {
    let warnings = (0..6).map(|instance| (0, instance, Level::Warning, Level::Ok, ""));
    let critical = (6..9).map(|instance| (1, instance, Level::Critical, Level::Ok, ""));
    let told = told(&warnings.chain(critical).collect::<Vec<_>>());
    assert_eq!(told, [(0, 0), (0, 1), (0, 2), (1, 6), (1, 7), (30, 8), (31, 3), (31, 4), (60, 5)]);
}

#[test]
fn what_another_one_explains_is_not_told_nor_that_it_is_over() {
    let both = [
        (1, 0, Level::Critical, Level::Ok, ""),
        (1, 1, Level::Critical, Level::Ok, "gps_fix"),
        (5, 0, Level::Ok, Level::Critical, ""),
        (5, 1, Level::Ok, Level::Critical, ""),
    ];
    assert_eq!(told(&both), [(1, 0), (5, 0)]);
}

#[test]
fn what_is_over_before_it_was_told_is_not_told() {
    let mut findings: Vec<_> = (0..4).map(|instance| (0, instance, Level::Warning, Level::Ok, "")).collect();
    findings.push((2, 3, Level::Ok, Level::Warning, ""));
    assert_eq!(told(&findings), [(0, 0), (0, 1), (0, 2)]);
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
            assert_eq!(quantity(value, unit).as_str(), format!(": {value:.digits$}{shown}"), "{value:e}");
        }
    }
    assert_eq!(quantity(f32::MAX, "V").as_str(), ": 1099511627776.00 V", "no quantity");
}

#[test]
fn what_is_less_urgent_takes_no_place_of_what_waits() {
    let critical = (0..9).map(|instance| (0, instance, Level::Critical, Level::Ok, ""));
    // Of these the numbers are beyond the one digit that is looked at; all wait.
    let more = (9..21).map(|instance| (0, instance, Level::Critical, Level::Ok, ""));
    let warning = [(0, 1, Level::Warning, Level::Critical, "")];
    let all: Vec<_> = critical.chain(more).collect();
    let before = told(&all);
    let late: Vec<_> = all.into_iter().chain(warning).collect();
    assert_eq!(told(&late), before, "a warning is told after them, or not at all");
}
