//! The monitor over recorded flights: findings and usage.
#![allow(clippy::panic, clippy::unwrap_used)]

mod common;

use common::{Recording, flight};
use hums_core::Monitor;
use hums_core::health::{Finding, Level};
use hums_core::params::Params;
use hums_core::status::{RecorderStatus, Recording as Card};
use hums_core::time::{Instant, Span};
use hums_link::sequence::Sequences;
use hums_link::{Framer, observe};

/// What the monitor made of a recording.
struct Outcome {
    monitor: Monitor,
    findings: Vec<Finding>,
}

/// Feeds a recording frame by frame at its own times, with a tick every 50 ms.
fn watch(recording: &Recording) -> Outcome {
    let mut framer = Framer::new();
    let mut sequences = Sequences::new();
    let mut monitor = Monitor::new(Params::defaults());
    let mut findings = Vec::new();
    let recorder = RecorderStatus { recording: Card::Running, ..RecorderStatus::default() };
    let first_us = recording.frames.first().map_or(0, |frame| frame.2);
    let mut tick_at = Instant::ZERO;
    for &(start, len, micros) in &recording.frames {
        let at = Instant::from_micros(micros.saturating_sub(first_us));
        while tick_at < at {
            let link = sequences.reading(tick_at, monitor.vehicle().source);
            monitor.tick(tick_at, &link, &recorder, &mut |finding| findings.push(*finding));
            tick_at = tick_at + Span::from_millis(50);
        }
        framer.push(&recording.bytes[start..start + len], &mut |frame| {
            sequences.frame(at, &frame);
            if let Some((source, observation)) = observe(&frame) {
                monitor.observe(at, source, &observation);
            }
        });
    }
    Outcome { monitor, findings }
}

fn print(name: &str, outcome: &Outcome) {
    println!("== {name}");
    for finding in &outcome.findings {
        println!(
            "{:8.2} {:<10} {:<16} {} {:>8} (was {}) {:.3} limit {:.3} {}",
            finding.at.as_secs_f64(),
            finding.subsystem.name(),
            finding.check,
            finding.instance,
            finding.level.name(),
            finding.previous.name(),
            finding.value,
            finding.limit,
            finding.unit
        );
    }
    outcome.monitor.usage().for_each(|counter, value| {
        println!("  {:?} {value:.3}", hums_core::usage::counter_name(counter));
    });
}

#[test]
fn dump() {
    for name in [
        "ap_quad_guided.tlog",
        "ap_quad_faults.tlog",
        "px4_hil_quad_low.tlog",
        "dronekit_flight.tlog",
        "thayer_px4_rural.tlog",
        "clyde_rov_dive.tlog",
        "eagle_ac740ecf.tlog",
        "mavometer_px4.tlog",
    ] {
        if let Some(recording) = flight(name) {
            print(name, &watch(&recording));
        }
    }
    let _ = Level::Ok;
}
