//! Scripted faults in a simulated flight: silences, restarts, counters, hysteresis, and alarms that explain others.
#![expect(clippy::panic, clippy::unwrap_used, reason = "that is how a test fails")]

use core::ops::Range;

use crate::common::{Run, Script, params};
use hums_core::cause::{Alert, Cause};
use hums_core::health::{Finding, Level, Subsystem};
use hums_core::observation::{EstimatorScale, Observation, Sensors, SystemTime};
use hums_core::parameters::Params;
use hums_core::units::Celsius;
use hums_core::usage::UsageCounter;

const FAULT_MS: u64 = 20_000;
const END_MS: u64 = 100_000;

fn fly(script: &str) -> Run {
    fly_with(&[], script)
}

/// Words besides the quad's: `esc3` falls silent; `hot2`, `fail2`, `errors0` of ESCs, and `counts0`, errors that rise; `jam`; `bits` of sensors that are not well;
/// `ekf` with two figures, of PX4's scale where it is `ratio`; `refused` writes; an `alert` of GNSS.
fn fly_with(settings: &[(&str, f32)], script: &str) -> Run {
    let (mut run, script) = (Run::new(&params(settings)), Script::new(script));
    run.flies(0..120_000, |now_ms, quad, more| {
        script.play(now_ms as i64, |said| match said.name() {
            _ if quad.take(said) => {}
            "esc3" => quad.escs[3] = None,
            "hot2" => quad.escs[2].as_mut().unwrap().temperature = Some(Celsius(said.number())),
            "fail2" => quad.escs[2].as_mut().unwrap().failures = Some(said.number() as u16),
            "errors0" => quad.escs[0].as_mut().unwrap().errors = Some(said.number() as u32),
            "counts0" => {
                let errors = &mut quad.escs[0].as_mut().unwrap().errors;
                *errors = errors.map(|count| count.wrapping_add((said.since_ms / 500) as u32));
            }
            "jam" => quad.integrity.jamming = said.number() as u8,
            "bits" => quad.system.sensors = Some(Sensors::of(u32::MAX, u32::MAX, !(said.number() as u32))),
            "nodata" => quad.system.load = None,
            "ekf" => {
                let [velocity, compass] = said.list().map(Some);
                (quad.estimator.velocity, quad.estimator.compass) = (velocity, compass);
            }
            "drifts" => {
                let drift = Some(said.number());
                (quad.estimator.velocity, quad.estimator.position_horizontal) = (drift, drift);
            }
            "ratio" => quad.estimator.scale = EstimatorScale::TestRatio,
            "refused" => quad.recorder.write_errors = said.number() as u64,
            "falls" => quad.acceleration_down = -0.5 - (now_ms / 100 % 7) as f32 * 0.01,
            "alert" => more.push(Observation::Alert(Alert::warning(Cause::Gnss))),
            word => panic!("{word}: no word"),
        });
    });
    run
}

fn first(run: &Run, check: &str, level: Level) -> Finding {
    let found = run.of_check(check).find(|finding| finding.level == level).copied();
    found.unwrap_or_else(|| panic!("no {level:?} of {check}: {:?}", run.findings))
}

fn last(run: &Run, check: &str) -> Finding {
    *run.of_check(check).next_back().unwrap_or_else(|| panic!("no {check}: {:?}", run.findings))
}

fn told(run: &Run, check: &str) -> Vec<(u64, Level, &'static str)> {
    run.of_check(check).map(|one| (one.at.as_millis() / 1_000, one.level, one.because)).collect()
}

#[test]
fn a_healthy_vehicle_is_ok_as_a_whole_and_in_each_part_that_it_has() {
    let run = fly("");
    let health = run.monitor.health();
    assert_eq!((&run.findings[..], health.overall()), (&[][..], Level::Ok));
    for subsystem in Subsystem::ALL {
        let level = if subsystem == Subsystem::Engine { Level::Stale } else { Level::Ok };
        assert_eq!(health.subsystem(subsystem), level, "{subsystem:?}");
    }
}

#[test]
fn what_is_no_fault_has_no_finding() {
    for (what, script) in [
        ("jamming that the receiver mitigates", "20-100 jam=2"),
        ("a check before arming, and heights of the ground", "20-100 bits=272629760"),
        ("an error counter that wraps", "20-100 errors0=2"),
    ] {
        assert_eq!(fly(script).findings, [], "{what}");
    }
}

#[test]
fn a_motor_is_lost_by_its_share_of_the_others_current_while_thrust_is_asked_for() {
    // Each ESC's amperes, the throttle, and the share of motor 1 that is too little, percent.
    for (currents, throttle, share) in [
        ("2,0.25,4,6", 0.5, Some(6.25)),
        ("2,0.41,4,6", 0.5, None),
        ("5,0,5,5", 0.21, Some(0.0)),
        ("5,0,5,5", 0.2, None),
        ("0.6,0,0.6,0.6", 0.5, Some(0.0)),
        ("0.5,0,0.5,0.5", 0.5, None),
    ] {
        let run = fly(&format!("20-100 amps={currents} thr={throttle}"));
        let lost = run.findings.iter().filter(|finding| finding.level == Level::Critical);
        let lost: Vec<_> = lost.map(|finding| (finding.check, finding.instance, finding.value)).collect();
        let expected: Vec<_> = share.into_iter().map(|share| ("motor_loss", 1, share)).collect();
        assert_eq!(lost, expected, "{currents} at {throttle}");
    }
}

#[test]
fn an_esc_that_fell_silent_says_nothing_of_the_others_current() {
    let run = fly("20-100 amps=5,5,5,30; 30-100 amps=5,0.6,5,30; 22-100 esc3");
    assert!(run.findings.iter().all(|finding| finding.instance == 3), "{:?}", run.findings);
}

#[test]
fn an_autopilot_that_falls_silent_makes_everything_else_stale() {
    let run = fly("20-100 silent");
    let after_ms = first(&run, "heartbeat", Level::Critical).at.as_millis() - (FAULT_MS - 500);
    assert!((5_000..=5_150).contains(&after_ms), "{after_ms}");
    for check in ["heartbeat", "batt_remaining", "ekf_variance", "vibration", "load", "roll"] {
        let is_stale = run.of_check(check).any(|finding| finding.level == Level::Stale);
        assert!(is_stale || check == "heartbeat", "{check} stayed as it was without any data");
        let last = last(&run, check);
        assert_eq!(last.level, Level::Ok, "{last:?}");
        assert!((END_MS..=END_MS + 2_100).contains(&last.at.as_millis()), "{last:?}");
    }
}

#[test]
fn what_comes_back_by_less_than_the_hysteresis_stays_bad() {
    for (check, bad, back) in [
        ("cell_voltage", "volt=13.2", "volt=14.1"),
        ("batt_remaining", "rem=0.05", "rem=0.075"),
        ("esc_temperature", "hot2=120", "hot2=108"),
        ("motor_loss", "amps=5,0,5,5", "amps=5,0.7,5,5"),
        ("ekf_failsafe", "ekf=0.9,1.2", "ekf=0.77,1.2"),
        ("vibration", "vibe=5,5,70", "vibe=5,5,58"),
        ("roll", "roll=1.2", "roll=1"),
        ("load", "cpu=0.97", "cpu=0.94"),
    ] {
        let run = fly(&format!("20-60 {bad}; 60-100 {back}"));
        let critical = first(&run, check, Level::Critical);
        let next = run.of_check(check).find(|finding| finding.at.is_after(critical.at)).expect(check);
        assert!(next.at.as_millis() >= END_MS, "{check} fell to {:?} at {:?}", next.level, next.at);
    }
}

#[test]
fn a_warning_falls_with_its_value_and_a_latched_one_at_disarming() {
    use Level::{Critical, Ok, Stale, Warning};
    let script = "20-100 cpu=0.3; 20-30 cpu=0.88; 30-40 cpu=0.97; 40-50 cpu=0.88; 60-100 off";
    let stops = "20-100 cpu=0.3; 20-30 cpu=0.88; 30-45 nodata; 60-100 off";
    for (latch, falls, levels) in [
        (0.0, &[(42, Warning, ""), (52, Ok, "")][..], &[Warning, Stale, Ok][..]),
        (1.0, &[(60, Ok, "")], &[Warning, Stale, Warning, Ok]),
    ] {
        let run = fly_with(&[("HEALTH_LATCH", latch)], script);
        assert_eq!(told(&run, "load"), [&[(22, Warning, ""), (32, Critical, "")], falls].concat(), "{latch}");
        let run = fly_with(&[("HEALTH_LATCH", latch)], stops);
        assert_eq!(
            run.of_check("load").map(|one| one.level).collect::<Vec<_>>(),
            levels,
            "its message stops"
        );
    }
}

/// A script of a fault from 20 s to 100 s; its check and instance; the level, and when that was found, ms after the fault; when the check is
/// good again, ms after the end of the fault (negative: before).
type Course = (&'static str, &'static str, u8, Level, Range<i64>, Range<i64>);

const COURSES: [Course; 4] = [
    ("20-100 esc3", "esc_silent", 3, Level::Warning, 200..401, 2_000..2_101),
    ("20-100 esc3", "esc_silent", 3, Level::Critical, 1_900..2_101, 2_000..2_101),
    ("20-100 boot=-20000", "autopilot_reboot", 0, Level::Critical, 0..101, -48_000..-47_799),
    // Two ticks, and ten seconds without one.
    ("20-100 refused=3", "card_errors", 0, Level::Warning, 50..51, -70_000..0),
];

#[test]
fn a_fault_is_found_in_its_time_and_over_in_its_time() {
    for (script, check, instance, level, found_ms, over_ms) in COURSES {
        let run = fly(script);
        let (found, last) = (first(&run, check, level), last(&run, check));
        let after = |of: Finding, ms: u64| of.at.as_millis() as i64 - ms as i64;
        assert!(found.instance == instance && found_ms.contains(&after(found, FAULT_MS)), "{found:?}");
        assert!(last.level == Level::Ok && over_ms.contains(&after(last, END_MS)), "{last:?}");
    }
}

#[test]
fn errors_that_rise_are_counted_a_minute_across_the_end_of_their_counter() {
    let run = fly("20-100 counts0");
    let errors = first(&run, "esc_errors", Level::Warning);
    let after_ms = errors.at.as_millis() - FAULT_MS;
    assert!(errors.instance == 0 && (6_500..=6_600).contains(&after_ms), "{errors:?}");
    assert_eq!(run.findings.len(), 1, "{:?}", run.findings);
}

#[test]
fn a_clock_that_jumps_is_no_fault_and_counts_no_time() {
    let mut run = Run::new(&Params::defaults());
    run.flies(0..30_000, |now_ms, quad, more| {
        quad.boot_offset_ms = if now_ms < 20_000 { 100_000 } else { 3_700_000 };
        let utc_micros = Some(if now_ms < 15_000 { 1_700_000_000_000_000 } else { 1_400_000_000_000_000 });
        let boot_ms = (now_ms as i64 + quad.boot_offset_ms) as u32;
        more.push(Observation::SystemTime(SystemTime { boot_ms, utc_micros }));
    });
    assert_eq!(run.findings, []);
    let usage = run.monitor.usage();
    for counter in [UsageCounter::Armed, UsageCounter::Flight] {
        let counted_s = usage.value(counter).unwrap();
        assert!((25.0..=30.0).contains(&counted_s), "{}: {counted_s}", counter.name());
    }
}

#[test]
fn an_alarm_that_outlives_the_one_that_explained_it_is_told_by_itself_once() {
    let of_estimator = |gnss_until_s: f32| {
        let run = fly(&format!("20-100 vel=0.1; 22-100 vel=1.5; 20-{gnss_until_s} fix=1"));
        let end_ms = first(&run, "gps_fix", Level::Ok).at.as_millis();
        let mine = run.of_check("ekf_variance").filter(|one| one.level != Level::Ok);
        (end_ms, mine.map(|one| (one.at.as_millis(), one.because, one.previous)).collect::<Vec<_>>())
    };
    for phase in 0..14_u8 {
        let (end_ms, told) = of_estimator(40.0 + 0.15 * f32::from(phase));
        let [(_, "gps_fix", Level::Ok), (at_ms, "", Level::Warning)] = told[..] else { panic!("{told:?}") };
        assert_eq!(at_ms - end_ms, 8_000, "{phase}");
    }
    let (_, told) = of_estimator(100.0);
    assert_eq!(told.len(), 1, "{told:?}");
}

#[test]
fn a_cause_that_is_found_later_explains_its_effect_from_then_on() {
    let run = fly("20-100 vel=1.5; 22-40 fix=1");
    let end_ms = first(&run, "gps_fix", Level::Ok).at.as_millis();
    let mine = run.of_check("ekf_variance").filter(|one| one.level != Level::Ok);
    let told: Vec<_> = mine.map(|one| (one.at.as_millis(), one.because, one.previous)).collect();
    let [(first_ms, "", Level::Ok), (last_ms, "", Level::Warning)] = told[..] else { panic!("{told:?}") };
    assert!(first_ms < 22_000 && last_ms - end_ms == 8_000, "it outlives its cause: {told:?}");
}

#[test]
fn an_esc_of_a_plane_that_glides_may_fall_silent() {
    for (throttle, is_told) in [(0.5, true), (0.0, false)] {
        let run = fly(&format!("20-100 plane thr={throttle} esc3"));
        assert_eq!(run.of_check("esc_silent").any(|one| one.level != Level::Ok), is_told, "{throttle}");
    }
}

#[test]
fn a_critical_outlives_a_cause_that_falls_to_a_warning() {
    let run = fly("20-30 vibe=80; 30-100 vibe=45; 22-100 drifts=1.2");
    let mut warnings = run.of_check("vibration").filter(|finding| finding.level == Level::Warning);
    let fell_s = warnings.next_back().expect("it falls").at.as_millis() / 1_000;
    let mut critical = told(&run, "ekf_failsafe");
    critical.retain(|(_, level, _)| *level == Level::Critical);
    let expected = [(23, Level::Critical, "vibration"), (fell_s + 8, Level::Critical, "")];
    assert_eq!(critical, expected);
}

#[test]
fn an_alarm_that_rises_long_after_its_cause_began_is_not_explained_by_it() {
    let run = fly("20-100 px4 mode=posctl ratio vibe=0.01,0.7,20 vel=0.1; 22-70 vel=0.8; 70-100 vel=5");
    let warned = run.of_check("ekf_test_ratio").next().expect("it warns");
    assert_eq!((warned.level, warned.because), (Level::Warning, "vibration_px4"));
    assert_eq!(
        run.of_check("gyro_noise").next().map(|one| one.because),
        Some("vibration_px4"),
        "one message"
    );
    let mut critical = told(&run, "ekf_test_ratio");
    critical.retain(|(_, level, _)| *level == Level::Critical);
    assert!(!critical.is_empty() && critical.iter().all(|(at_s, _, cause)| *at_s >= 70 && cause.is_empty()));
}

#[test]
fn a_mishap_that_is_over_explains_nothing_where_levels_are_latched() {
    let run = fly_with(&[("HEALTH_LATCH", 1.0)], "20-20.7 falls; 50-100 fail2=32");
    assert!(run.of_check("free_fall").next().is_some(), "{:?}", run.findings);
    assert_eq!(run.of_check("esc_failure").next().map(|one| one.because), Some(""));
}

#[test]
fn a_value_of_power_on_is_stale_for_ever() {
    let mut run = Run::new(&Params::defaults());
    for day in [0, 24, 25, 48] {
        let day_ms = day * 86_400_000;
        run.flies(day_ms..day_ms + 20_000, |now_ms, quad, _| {
            quad.battery_silent = now_ms >= 6_000;
            quad.battery.temperature = Some(Celsius(95.0));
        });
    }
    let last = last(&run, "batt_temperature");
    assert!(last.level == Level::Stale && last.at.as_millis() < 20_000, "{last:?}");
}

#[test]
fn what_has_no_data_when_a_silence_is_over_is_told_then() {
    let run = fly("20-50 silent; 19 mute");
    let of_battery = told(&run, "batt_remaining");
    let [(first_s, Level::Stale, "heartbeat"), (again_s, Level::Stale, "")] = of_battery[..] else {
        panic!("{of_battery:?}")
    };
    assert!(first_s < 50 && (58..=62).contains(&again_s), "{of_battery:?}");
    let late = run.findings.iter().filter(|one| one.level == Level::Stale && one.at.as_millis() > 50_000);
    let of_battery = ["batt_remaining", "cell_voltage", "batt_fault", "batt_temperature"];
    assert!(late.clone().all(|one| of_battery.contains(&one.check)), "{:?}", late.collect::<Vec<_>>());
}

#[test]
fn a_failsafe_counts_if_it_began_after_the_arming_or_if_the_arming_was_not_received() {
    // The `MAV_STATE` while disarmed, armed, and armed from 30 s on.
    for (case, script, told_ms) in [
        ("it stood at the arming", "* state=5; 0-10 off", None),
        ("it begins", "0-10 off state=3; 10-30 state=4; 30 state=5", Some(30_000..34_000)),
        ("it ended between", "0-10 off state=5; 10-30 state=4; 30 state=5", Some(30_000..34_000)),
        ("first received in the air", "* state=5", Some(0..5_000)),
        ("armed in a gap", "0-10 off state=3; 10 state=5; 10-22 silent", Some(22_000..26_000)),
    ] {
        let run = fly(script);
        let mut critical = run.of_check("autopilot_state").filter(|one| one.level == Level::Critical);
        let critical_ms = critical.next().map(|one| one.at.as_millis());
        let is_so =
            told_ms.map_or(critical_ms.is_none(), |told| critical_ms.is_some_and(|ms| told.contains(&ms)));
        assert!(is_so, "{case}: {critical_ms:?}");
    }
}

#[test]
fn what_the_autopilot_says_of_gnss_counts_from_the_first_fix_on() {
    for (script, is_told) in [("20 fix=1; @25 alert", true), ("* fix=1; @25 alert", false)] {
        let run = fly(script);
        assert_eq!(run.of_check("gnss_alert").any(|one| one.level == Level::Warning), is_told, "{script}");
    }
}
