//! One flight, two recordings: the autopilot's and a ground station's; the monitor finds the same in both.
//!
//! `tests/labelled/bin` lacks messages that are unused for observations, and has every tenth ESC message (100
//! a second of each).

use std::path::Path;

use hums_core::Monitor;
use hums_core::clock::Instant;
use hums_core::health::Level;
use hums_core::observation::Observation;
use hums_core::parameters::Params;
use hums_core::status::{LinkReading, RecorderStatus};
use hums_onboard::monitoring::TICK;

use crate::source::item::{Item, Needs};
use crate::source::recording::LogPlace;

/// Check, instance, level, seconds since the autopilot's power-on.
type Change = (&'static str, u8, Level, f64);

/// Findings, and the recording's beginning, seconds since power-on.
fn findings(name: &str) -> (Vec<Change>, f64) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/labelled").join(name);
    let recording = LogPlace::file(&path).open().expect("a recording");
    let mut monitor = Monitor::new(Params::default());
    let (link, recorder) = (LinkReading::default(), RecorderStatus::default());
    let (mut next, mut boot_s, mut begins_s): (Option<Instant>, f64, f64) = (None, 0.0, f64::INFINITY);
    let mut changes = Vec::new();
    let mut take = |at: Instant, item: Item<'_>| {
        let Item::Observation(source, observation) = item else { return Ok(()) };
        let step = next.get_or_insert(at);
        while *step <= at {
            monitor.tick((*step).into(), &link, &recorder, &mut |finding| {
                // Reported again, and no change.
                if finding.level != finding.previous {
                    changes.push((
                        finding.check,
                        finding.instance,
                        finding.level,
                        step.as_secs_f64() + boot_s,
                    ));
                }
            });
            *step = *step + TICK;
        }
        if let Observation::Attitude(attitude) = observation {
            // Compared since the autopilot's power-on.
            boot_s = f64::from(attitude.boot_ms.expect("ArduPilot")) / 1e3 - at.as_secs_f64();
            begins_s = begins_s.min(at.as_secs_f64() + boot_s);
        }
        monitor.observe(at.into(), source, observation);
        Ok(())
    };
    recording.read(Needs { observations: true, ..Needs::default() }, &mut take).expect("readable");
    (changes, begins_s)
}

/// Findings not of the link, nor of the recording's end.
fn is_of_vehicle((check, _, level, _): &Change) -> bool {
    *level != Level::Stale && !matches!(*check, "heartbeat" | "frames_lost")
}

fn assert_equal(flight: &str, at_least: usize) {
    let (own, begins_s) = findings(&format!("bin/{flight}.bin.gz"));
    let (told, _) = findings(&format!("{flight}.tlog.gz"));
    let told: Vec<Change> =
        told.into_iter().filter(|change| is_of_vehicle(change) && change.3 >= begins_s).collect();
    let mut own: Vec<Change> = own.into_iter().filter(is_of_vehicle).collect();
    assert!(told.len() >= at_least, "{told:?}");
    for change in &told {
        let same = |other: &Change| {
            (other.0, other.1, other.2) == (change.0, change.1, change.2) && (other.3 - change.3).abs() <= 1.0
        };
        let place = own.iter().position(same);
        let place = place.unwrap_or_else(|| panic!("{change:?} is not in the autopilot's own log: {own:?}"));
        own.remove(place);
    }
    assert!(own.is_empty(), "only in the autopilot's own log: {own:?}");
}

#[test]
fn a_flight_whose_position_jumps_is_judged_alike_in_both_recordings() {
    assert_equal("f12_gps_jump", 2);
}

#[test]
fn a_flight_in_gusts_is_judged_alike_in_both_recordings() {
    assert_equal("n03_wind9_gusty", 0);
}
