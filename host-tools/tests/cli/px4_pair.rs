//! The same flight from its autopilot's log and from a telemetry port: the monitor finds the same in both.
//!
//! PX4 in its simulator, a motor dies (`tests/labelled/px4`).

use std::path::Path;

use hums::source::item::{Item, Needs, Rows};
use hums::source::recording::LogPlace;
use hums_core::Monitor;
use hums_core::clock::Instant;
use hums_core::health::Level;
use hums_core::observation::Observation;
use hums_core::parameters::Params;
use hums_core::status::{LinkReading, RecorderStatus, Recording};
use hums_onboard::monitoring::TICK;

/// Findings: check, instance, level, seconds since the autopilot's boot.
type Found = Vec<(&'static str, u8, Level, f64)>;

fn found(name: &str) -> Found {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/labelled/px4").join(name);
    let recording = LogPlace::file(&path).open().expect("a recording");
    let mut monitor = Monitor::new(Params::default());
    let (mut next, mut boot_s, mut found) = (None::<Instant>, None, Vec::new());
    let want = Needs { frames: false, observations: true, rows: Rows::None, system: None };
    let summary = recording.read(want, &mut |at, item| {
        let mut now = *next.get_or_insert(at);
        while now <= at {
            let link = LinkReading { frames_lost: Some(0.0), at: now.into() };
            let recorder = RecorderStatus { recording: Recording::Running, ..RecorderStatus::default() };
            monitor.tick(now.into(), &link, &recorder, &mut |finding| {
                if !matches!(finding.level, Level::Stale) {
                    found.push((finding.check, finding.instance, finding.level, now.as_secs_f64()));
                }
            });
            now = now + TICK;
        }
        next = Some(now);
        if let Item::Observation(source, observation) = item {
            if let Observation::Attitude(attitude) = observation
                && let Some(boot_ms) = attitude.boot_ms
            {
                boot_s.get_or_insert(f64::from(boot_ms) / 1e3 - at.as_secs_f64());
            }
            monitor.observe(at.into(), source, observation);
        }
        assert!(!matches!(item, Item::Gap(_)), "{name}: {item:?}");
        Ok(())
    });
    summary.expect("it is read to its end");
    let boot_s = boot_s.expect("an attitude");
    found.into_iter().map(|(check, instance, level, at)| (check, instance, level, at + boot_s)).collect()
}

#[test]
fn a_log_and_a_recording_of_the_same_flight_have_the_same_findings_within_a_second() {
    let log = found("p23_motor_dead_quad.cut.ulg.gz");
    let recording = found("p23_motor_dead_quad.tlog.gz");
    assert_eq!(recording.len(), 7, "{recording:?}");
    // The shock is shorter than the interval of samples in the recording. Its rate setpoints (5 Hz) are too old for
    // every other rate.
    let only_in_log = |&&(check, ..): &&(&str, u8, Level, f64)| check == "impact" || check == "pitch_rate";
    assert_eq!(log.iter().filter(only_in_log).count(), 2, "{log:?}");
    let log: Found = log.iter().filter(|finding| !only_in_log(finding)).copied().collect();
    assert_eq!(log.len(), recording.len(), "{log:?}\n{recording:?}");
    for (check, instance, level, at) in recording {
        let same = |other: &&(&str, u8, Level, f64)| (other.0, other.1, other.2) == (check, instance, level);
        let (.., other) = log.iter().find(same).expect(check);
        assert!((other - at).abs() < 1.0, "{check} {level:?}: {at} s in the recording, {other} s in the log");
    }
}
