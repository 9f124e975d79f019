//! Scripted faults in a simulated flight: silences, restarts, counters, hysteresis, and alarms that explain others.

use crate::common::{Quad, Run};
use hums_core::Monitor;
use hums_core::cause::{Alert, Cause, Urgency};
use hums_core::health::{Finding, Level, Subsystem};
use hums_core::observation::{Autopilot, EstimatorScale, Observation, Sensors, SystemTime, VehicleKind};
use hums_core::params::Params;
use hums_core::units::{Amperes, Celsius, Fraction, Volts};
use hums_core::usage::UsageCounter;

const FAULT_MS: u64 = 20_000;
const END_MS: u64 = 100_000;

/// Flies for two minutes; `script` changes the quad between [`FAULT_MS`] and [`END_MS`].
fn fly(script: impl Fn(u64, &mut Quad)) -> Vec<Finding> {
    fly_with(&Params::defaults(), script).1
}

fn fly_with(params: &Params, script: impl Fn(u64, &mut Quad)) -> (Monitor, Vec<Finding>) {
    let mut run = Run::new(params);
    run.flies(0..120_000, |now_ms, quad, _| {
        if (FAULT_MS..END_MS).contains(&now_ms) {
            script(now_ms, quad);
        }
    });
    (run.monitor, run.findings)
}

#[test]
fn a_healthy_flight_has_no_finding() {
    assert_eq!(fly(|_, _| {}), []);
}

#[test]
fn a_healthy_vehicle_is_ok_as_a_whole_and_in_each_part_that_it_has() {
    let (monitor, _) = fly_with(&Params::defaults(), |_, _| {});
    let health = monitor.health();
    assert_eq!(health.overall(), Level::Ok);
    for subsystem in Subsystem::ALL {
        let level = if subsystem == Subsystem::Engine { Level::Stale } else { Level::Ok };
        assert_eq!(health.subsystem(subsystem), level, "{subsystem:?}");
    }
}

#[test]
fn jamming_that_the_receiver_mitigates_is_no_finding() {
    assert_eq!(fly(|_, quad| quad.integrity.jamming = 2), []);
}

#[test]
fn a_motor_is_lost_by_its_share_of_the_others_current_while_thrust_is_asked_for() {
    // Each ESC's amperes, the throttle, and the share of motor 1 that is too little, percent.
    let cases = [
        ([2.0, 0.25, 4.0, 6.0], 0.5, Some(6.25)),
        ([2.0, 0.41, 4.0, 6.0], 0.5, None),
        ([5.0, 0.0, 5.0, 5.0], 0.21, Some(0.0)),
        ([5.0, 0.0, 5.0, 5.0], 0.2, None),
        ([0.6, 0.0, 0.6, 0.6], 0.5, Some(0.0)),
        ([0.5, 0.0, 0.5, 0.5], 0.5, None),
    ];
    for (currents, throttle, share) in cases {
        let findings = fly(|_, quad| {
            quad.throttle = throttle;
            for (esc, current) in quad.escs.iter_mut().zip(currents) {
                esc.as_mut().unwrap().current = Some(Amperes(current));
            }
        });
        let lost = findings.iter().filter(|finding| finding.level == Level::Critical);
        let lost: Vec<_> = lost.map(|finding| (finding.check, finding.instance, finding.value)).collect();
        let expected: Vec<_> = share.into_iter().map(|share| ("motor_loss", 1, share)).collect();
        assert_eq!(lost, expected, "{currents:?} at {throttle}");
    }
}

#[test]
fn an_esc_that_fell_silent_says_nothing_of_the_others_current() {
    let findings = fly(|now_ms, quad| {
        quad.escs[3].as_mut().unwrap().current = Some(Amperes(30.0));
        if now_ms >= FAULT_MS + 2_000 {
            quad.escs[3] = None;
        }
        if now_ms >= FAULT_MS + 10_000 {
            quad.escs[1].as_mut().unwrap().current = Some(Amperes(0.6));
        }
    });
    assert!(findings.iter().all(|finding| finding.instance == 3), "{findings:?}");
}

#[test]
fn one_esc_that_falls_silent() {
    let findings = fly(|_, quad| quad.escs[3] = None);
    // Its last message came 100 ms before the fault; 2 s after that it is silent for good.
    let critical = findings.iter().find(|finding| finding.level == Level::Critical).expect("found");
    assert_eq!((critical.check, critical.instance), ("esc_silent", 3));
    assert!((21_900..=22_100).contains(&critical.at.as_millis()), "{critical:?}");
    let warning = findings.iter().find(|finding| finding.level == Level::Warning).expect("found");
    assert!((20_200..=20_400).contains(&warning.at.as_millis()), "{warning:?}");
    let last = findings.last().expect("there are some");
    assert_eq!((last.check, last.level), ("esc_silent", Level::Ok));
    assert!((END_MS + 2_000..=END_MS + 2_100).contains(&last.at.as_millis()), "{last:?}");
}

#[test]
fn an_autopilot_that_falls_silent_makes_everything_else_stale() {
    let findings = fly(|_, quad| quad.silent = true);
    let heartbeat =
        findings.iter().find(|finding| finding.level == Level::Critical && finding.check == "heartbeat");
    // Its last heartbeat came 500 ms before the silence.
    let after_ms = heartbeat.expect("found").at.as_millis() - (FAULT_MS - 500);
    assert!((5_000..=5_150).contains(&after_ms), "{after_ms}");
    for check in ["batt_remaining", "ekf_variance", "vibration", "load", "roll"] {
        let stale = findings.iter().any(|finding| finding.check == check && finding.level == Level::Stale);
        assert!(stale, "{check} stayed as it was without any data");
    }
    // It is received again with the first heartbeat, and its messages count at once.
    for check in ["heartbeat", "batt_remaining", "ekf_variance", "vibration", "load", "roll"] {
        let last = findings.iter().rfind(|finding| finding.check == check).expect("there");
        assert_eq!(last.level, Level::Ok, "{last:?}");
        assert!((END_MS..=END_MS + 2_100).contains(&last.at.as_millis()), "{last:?}");
    }
}

#[test]
fn an_autopilot_that_restarts() {
    let findings = fly(|now_ms, quad| quad.boot_offset_ms = -(FAULT_MS as i64) + i64::from(now_ms == 0));
    let reboot = findings.iter().find(|finding| finding.check == "autopilot_reboot").expect("found");
    assert_eq!(reboot.level, Level::Critical);
    assert!((FAULT_MS..=FAULT_MS + 100).contains(&reboot.at.as_millis()), "{reboot:?}");
    // The report lasts 30 s, and then two seconds of good values.
    let cleared = findings.iter().rfind(|finding| finding.check == "autopilot_reboot").expect("there");
    assert_eq!(cleared.level, Level::Ok);
    assert!((FAULT_MS + 32_000..=FAULT_MS + 32_200).contains(&cleared.at.as_millis()), "{cleared:?}");
}

#[test]
fn what_comes_back_by_less_than_the_hysteresis_stays_bad() {
    type Set = fn(&mut Quad, f32);
    // A value that is bad for the first half of the fault, and then another one.
    let cases: [(&str, f32, f32, Set); 8] = [
        ("cell_voltage", 13.2, 14.1, |quad, v| quad.battery.voltage = Some(Volts(v))),
        ("batt_remaining", 0.05, 0.075, |quad, part| quad.battery.remaining = Some(Fraction(part))),
        ("esc_temperature", 120.0, 108.0, |quad, c| {
            quad.escs[2].as_mut().unwrap().temperature = Some(Celsius(c));
        }),
        // Of the others' 5 A.
        ("motor_loss", 0.0, 0.7, |quad, a| quad.escs[1].as_mut().unwrap().current = Some(Amperes(a))),
        ("ekf_failsafe", 0.9, 0.77, |quad, velocity| {
            (quad.estimator.compass, quad.estimator.velocity) = (Some(1.2), Some(velocity));
        }),
        ("vibration", 70.0, 58.0, |quad, level| quad.vibration.levels[2] = Some(level)),
        ("roll", 1.2, 1.0, |quad, roll| quad.roll = roll),
        ("load", 0.97, 0.94, |quad, load| quad.system.load = Some(Fraction(load))),
    ];
    for (check, bad, back, set) in cases {
        let findings = fly(|now_ms, quad| set(quad, if now_ms < 60_000 { bad } else { back }));
        let mine = || findings.iter().filter(|finding| finding.check == check);
        let critical = mine().find(|finding| finding.level == Level::Critical).expect(check);
        let next = mine().find(|finding| finding.at.is_after(critical.at)).expect(check);
        assert!(next.at.as_millis() >= END_MS, "{check} fell to {:?} at {:?}", next.level, next.at);
    }
}

#[test]
fn what_is_checked_before_arming_and_heights_of_the_ground_are_no_sensors() {
    assert_eq!(
        fly(|_, quad| quad.system.sensors = Some(Sensors::of(u32::MAX, u32::MAX, !(1 << 28 | 1 << 22)))),
        []
    );
}

#[test]
fn a_warning_falls_with_its_value_or_where_it_is_latched_at_disarming() {
    let mut latched = Params::defaults();
    latched.set("HEALTH_LATCH", 1.0).unwrap();
    let falls = [(42_000, Level::Warning), (52_000, Level::Ok)];
    for (params, falls) in [(&Params::defaults(), &falls[..]), (&latched, &[(60_000, Level::Ok)])] {
        let (_, findings) = fly_with(params, |now_ms, quad| {
            quad.armed = now_ms < 60_000;
            let load = match now_ms {
                ..30_000 | 40_000..50_000 => 0.88,
                30_000..40_000 => 0.97,
                _ => 0.3,
            };
            quad.system.load = Some(Fraction(load));
        });
        let load = findings.iter().filter(|finding| finding.check == "load");
        let load: Vec<_> = load.map(|finding| (finding.at.as_millis(), finding.level)).collect();
        assert_eq!(load, [&[(22_000, Level::Warning), (32_000, Level::Critical)], falls].concat());
    }
}

#[test]
fn a_latched_warning_whose_message_stops_comes_back_with_it_until_disarming() {
    let mut latched = Params::defaults();
    latched.set("HEALTH_LATCH", 1.0).unwrap();
    let come_back = [Level::Warning, Level::Stale, Level::Warning, Level::Ok];
    let fall = [Level::Warning, Level::Stale, Level::Ok];
    for (params, expected) in [(&Params::defaults(), &fall[..]), (&latched, &come_back)] {
        let (_, findings) = fly_with(params, |now_ms, quad| {
            quad.armed = now_ms < 60_000;
            quad.system.load = match now_ms {
                ..30_000 => Some(Fraction(0.88)),
                30_000..45_000 => None,
                _ => Some(Fraction(0.3)),
            };
        });
        let load = findings.iter().filter(|finding| finding.check == "load");
        let load: Vec<_> = load.map(|finding| finding.level).collect();
        assert_eq!(load, expected);
    }
}

#[test]
fn a_card_that_refuses_writes() {
    let findings = fly(|_, quad| quad.recorder.write_errors = 3);
    let errors = findings.iter().find(|finding| finding.check == "card_errors").expect("found");
    assert_eq!((errors.level, errors.at.as_millis()), (Level::Warning, FAULT_MS + 50), "two ticks");
    let cleared = findings.iter().rfind(|finding| finding.check == "card_errors").expect("there");
    assert_eq!(cleared.level, Level::Ok, "ten seconds without one");
}

#[test]
fn an_error_counter_that_wraps_is_no_flood_of_errors() {
    let findings = fly(|_, quad| quad.escs[0].as_mut().unwrap().errors = Some(2));
    assert_eq!(findings, []);
}

#[test]
fn errors_that_rise_are_counted_a_minute_across_the_end_of_their_counter() {
    let findings = fly(|now_ms, quad| {
        // Two a second, through the counter's end: more than the limit of ten a minute in the sixth second.
        quad.escs[0].as_mut().unwrap().errors =
            Some((u32::MAX - 3).wrapping_add(((now_ms - FAULT_MS) / 500) as u32));
    });
    let errors = findings.iter().find(|finding| finding.check == "esc_errors").expect("found");
    assert_eq!((errors.level, errors.instance), (Level::Warning, 0));
    let after_ms = errors.at.as_millis() - FAULT_MS;
    // Eleven after 5.5 s, and a second of debounce.
    assert!((6_500..=6_600).contains(&after_ms), "{after_ms}");
    assert_eq!(findings.iter().filter(|finding| finding.level == Level::Warning).count(), 1, "{findings:?}");
}

#[test]
fn a_clock_that_jumps_is_no_fault_and_counts_no_time() {
    let mut run = Run::new(&Params::defaults());
    run.flies(0..30_000, |now_ms, quad, more| {
        // The autopilot's own clock jumps as well: forward, which no restart does.
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
    let script = |gnss_until_ms: u64| {
        move |now_ms: u64, quad: &mut Quad| {
            quad.gnss.fix = if now_ms < gnss_until_ms { 1 } else { 3 };
            quad.estimator.velocity = Some(if now_ms < 22_000 { 0.1 } else { 1.5 });
        }
    };
    let of_estimator = |gnss_until_ms| {
        let findings = fly(script(gnss_until_ms));
        let end = findings.iter().find(|one| one.check == "gps_fix" && one.level == Level::Ok);
        let end_ms = end.expect("it comes back").at.as_millis();
        let mine = findings.iter().filter(|one| one.check == "ekf_variance" && one.level != Level::Ok);
        (end_ms, mine.map(|one| (one.at.as_millis(), one.because, one.previous)).collect::<Vec<_>>())
    };
    // With the end of its cause at any step.
    for phase_ms in (0..2_000).step_by(150) {
        let (end_ms, told) = of_estimator(40_000 + phase_ms);
        let [(_, "gps_fix", Level::Ok), (at_ms, "", Level::Warning)] = told[..] else { panic!("{told:?}") };
        assert_eq!(at_ms - end_ms, 8_000, "{phase_ms}");
    }
    let (_, told) = of_estimator(END_MS);
    assert_eq!(told.len(), 1, "{told:?}");
}

#[test]
fn an_esc_of_a_plane_that_glides_may_fall_silent() {
    let told = |throttle: f32| {
        let findings = fly(|_, quad| {
            (quad.kind, quad.type_number, quad.throttle) = (VehicleKind::Plane, 1, throttle);
            quad.escs[3] = None;
        });
        findings.iter().any(|finding| finding.check == "esc_silent" && finding.level != Level::Ok)
    };
    assert!(told(0.5));
    assert!(!told(0.0));
}

fn critical_of(check: &str, findings: &[Finding]) -> Vec<(u64, &'static str)> {
    let mine = findings.iter().filter(|finding| finding.check == check && finding.level == Level::Critical);
    mine.map(|finding| (finding.at.as_millis() / 1_000, finding.because)).collect()
}

#[test]
fn a_critical_outlives_a_cause_that_falls_to_a_warning() {
    let findings = fly(|now_ms, quad| {
        quad.vibration.levels = [Some(if now_ms < FAULT_MS + 10_000 { 80.0 } else { 45.0 }); 3];
        if now_ms >= FAULT_MS + 2_000 {
            (quad.estimator.velocity, quad.estimator.position_horizontal) = (Some(1.2), Some(1.2));
        }
    });
    let fell =
        findings.iter().rfind(|finding| finding.check == "vibration" && finding.level == Level::Warning);
    let fell_s = fell.expect("it falls").at.as_millis() / 1_000;
    assert_eq!(critical_of("ekf_failsafe", &findings), [(23, "vibration"), (fell_s + 8, "")]);
}

#[test]
fn an_alarm_that_rises_long_after_its_cause_began_is_not_explained_by_it() {
    let findings = fly(|now_ms, quad| {
        quad.autopilot = Autopilot::Px4;
        quad.mode = 3 << 16;
        quad.estimator.scale = EstimatorScale::TestRatio;
        quad.vibration.levels = [Some(0.01), Some(0.7), Some(20.0)];
        let velocity = if now_ms < FAULT_MS + 2_000 {
            0.1
        } else if now_ms < 70_000 {
            0.8
        } else {
            5.0
        };
        quad.estimator.velocity = Some(velocity);
    });
    let warned = findings.iter().find(|finding| finding.check == "ekf_test_ratio").expect("it warns");
    assert_eq!((warned.level, warned.because), (Level::Warning, "vibration_px4"));
    let noise = findings.iter().find(|finding| finding.check == "gyro_noise").expect("of the same message");
    assert_eq!(noise.because, "vibration_px4");
    let critical = critical_of("ekf_test_ratio", &findings);
    assert!(critical.iter().all(|(at_s, because)| *at_s >= 70 && because.is_empty()), "{critical:?}");
    assert!(!critical.is_empty());
}

#[test]
fn a_mishap_that_is_over_explains_nothing_where_levels_are_latched() {
    let mut latched = Params::defaults();
    latched.set("HEALTH_LATCH", 1.0).unwrap();
    let (_, findings) = fly_with(&latched, |now_ms, quad| {
        if now_ms < FAULT_MS + 700 {
            quad.acceleration_down = -0.5 - (now_ms / 100 % 7) as f32 * 0.01;
        }
        if now_ms >= FAULT_MS + 30_000 {
            quad.escs[2].as_mut().unwrap().failures = Some(0x20);
        }
    });
    assert!(findings.iter().any(|finding| finding.check == "free_fall"), "{findings:?}");
    let failure = findings.iter().find(|finding| finding.check == "esc_failure").expect("found");
    assert_eq!(failure.because, "");
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
    let last = run.of_check("batt_temperature").next_back().expect("it was hot");
    assert!(last.level == Level::Stale && last.at.as_millis() < 20_000, "{last:?}");
}

#[test]
fn what_has_no_data_when_a_silence_is_over_is_told_then() {
    let mut run = Run::new(&Params::defaults());
    run.flies(0..100_000, |now_ms, quad, _| {
        (quad.silent, quad.battery_silent) = ((20_000..50_000).contains(&now_ms), now_ms >= 19_000);
    });
    let is_late = |one: &&Finding| one.check == "batt_remaining" || one.at.as_millis() > 50_000;
    let stale = run.findings.iter().filter(|one| one.level == Level::Stale).filter(is_late);
    let stale: Vec<_> = stale.map(|one| (one.check, one.at.as_millis() / 1_000, one.because)).collect();
    let of_battery: Vec<_> = stale.iter().filter(|(check, ..)| *check == "batt_remaining").collect();
    let [(_, first_s, "heartbeat"), (_, again_s, "")] = of_battery[..] else { panic!("{stale:?}") };
    assert!(*first_s < 50 && (58..=62).contains(again_s), "{stale:?}");
    let of_battery = ["batt_remaining", "cell_voltage", "batt_fault", "batt_temperature"];
    assert!(stale.iter().all(|(check, ..)| of_battery.contains(check)), "{stale:?}");
}

#[test]
fn a_failsafe_counts_if_it_began_after_the_arming_or_if_the_arming_was_not_received() {
    // The `MAV_STATE` while disarmed, armed, and armed from 30 s on.
    let critical_ms = |gap_ms: u64, disarmed: Option<u8>, [first, then]: [u8; 2]| {
        let mut run = Run::new(&Params::defaults());
        run.flies(0..60_000, |now_ms, quad, _| {
            quad.silent = (10_000..10_000 + gap_ms).contains(&now_ms);
            quad.armed = disarmed.is_none() || now_ms >= 10_000;
            let armed_state = if now_ms < 30_000 { first } else { then };
            quad.state = disarmed.filter(|_| !quad.armed).unwrap_or(armed_state);
        });
        let mut critical = run.of_check("autopilot_state").filter(|one| one.level == Level::Critical);
        critical.next().map(|one| one.at.as_millis())
    };
    for (case, gap_ms, disarmed, states, told_ms) in [
        ("it stood at the arming", 0, Some(5), [5, 5], None),
        ("it begins", 0, Some(3), [4, 5], Some(30_000..34_000)),
        ("it ended between", 0, Some(5), [4, 5], Some(30_000..34_000)),
        ("first received in the air", 0, None, [5, 5], Some(0..5_000)),
        ("armed in a gap", 12_000, Some(3), [5, 5], Some(22_000..26_000)),
    ] {
        let critical_ms = critical_ms(gap_ms, disarmed, states);
        let is_so =
            told_ms.map_or(critical_ms.is_none(), |told| critical_ms.is_some_and(|ms| told.contains(&ms)));
        assert!(is_so, "{case}: {critical_ms:?}");
    }
}

#[test]
fn what_the_autopilot_says_of_gnss_counts_from_the_first_fix_on() {
    let told = |had_fix: bool| {
        let mut run = Run::new(&Params::defaults());
        run.flies(0..60_000, |now_ms, quad, more| {
            quad.gnss.fix = if had_fix && now_ms < FAULT_MS { 3 } else { 1 };
            let says = now_ms == FAULT_MS + 5_000;
            more.extend(
                says.then_some(Observation::Alert(Alert { cause: Cause::Gnss, urgency: Urgency::Warning })),
            );
        });
        run.of_check("gnss_alert").any(|one| one.level == Level::Warning)
    };
    assert!(told(true));
    assert!(!told(false), "it flies indoors");
}
