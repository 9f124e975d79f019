//! The health board: each subsystem's level with its reason in words.
//!
//! A HUMS on board of the vehicle hears every frame; where one speaks, its level counts, and the reason is what these
//! checks see of the same. Its recorder is its own to judge.

use hums_core::health::{self, EXPECTED, Finding, Level, Subsystem, When};
use hums_core::time::{Instant, Span};
use hums_link::summary;
use serde::Serialize;

use super::craft::Craft;

/// As long as a heartbeat may be missed.
const SILENT: Span = Span::from_secs(5);

/// What a finding of a HUMS begins with on the radio.
const OURS: &str = "HUMS: ";

/// A finding in words.
fn words(finding: &Finding) -> String {
    summary::text(finding).as_str().trim_start_matches(OURS).to_owned()
}

/// One subsystem.
#[derive(Debug, Serialize)]
pub struct Part {
    subsystem: &'static str,
    level: &'static str,
    /// By whom: `on board`, `here`, or `nobody`.
    by: &'static str,
    /// What a level that is stale means where that is no cause for worry: `idle` where its checks are for a vehicle that
    /// is armed or flies, `none` where the vehicle seems to have no such part.
    calm: Option<&'static str>,
    reason: String,
}

/// The whole vehicle's level, by whoever knows best.
pub fn overall(craft: &Craft, now: Instant) -> &'static str {
    let here = || {
        if is_silent(craft, now) { Level::Stale } else { craft.monitor.health().overall() }
    };
    craft.companion.overall(now).unwrap_or_else(here).name()
}

/// All subsystems, in the order of [`Subsystem::ALL`].
pub fn of(craft: &Craft, now: Instant) -> Vec<Part> {
    Subsystem::ALL.into_iter().map(|subsystem| part(craft, now, subsystem)).collect()
}

fn part(craft: &Craft, now: Instant, subsystem: Subsystem) -> Part {
    let onboard = craft.companion.level(now, subsystem);
    let recorder = subsystem == Subsystem::Recorder;
    let silent = is_silent(craft, now);
    // Of a vehicle that is silent one thing is known: that it is.
    let unknown = recorder || (silent && subsystem != Subsystem::Link);
    let here = if unknown { Level::Stale } else { craft.monitor.health().subsystem(subsystem) };
    let level = onboard.unwrap_or(here);
    let by = match onboard {
        Some(_) => "on board",
        None if recorder => "nobody",
        None => "here",
    };
    let unknown = level == Level::Stale && !recorder && is_unheard(craft, subsystem);
    let absent = subsystem == Subsystem::Engine && craft.monitor.vehicle().engine.get().is_none();
    let (calm, reason) = if unknown && !absent && waits(craft, subsystem) {
        (Some("idle"), waits_for(subsystem).to_owned())
    } else if unknown && !EXPECTED.contains(&subsystem) {
        (Some("none"), "nothing is heard of any".to_owned())
    } else if silent && level == Level::Stale && !recorder {
        (None, format!("silent for {} s", now.since(craft.heard).as_millis() / 1000))
    } else {
        (None, reason(craft, subsystem, level, here))
    };
    Part { subsystem: subsystem.name(), level: level.name(), by, calm, reason }
}

/// Whether nothing at all has been heard of the vehicle for a while.
fn is_silent(craft: &Craft, now: Instant) -> bool {
    now.since(craft.heard) > SILENT
}

/// Whether none of its checks has anything to say.
fn is_unheard(craft: &Craft, subsystem: Subsystem) -> bool {
    !craft
        .monitor
        .health()
        .levels()
        .any(|(check, _, level)| check.subsystem == subsystem && !(check.alarm_only && level == Level::Ok))
}

/// Whether some of its checks begin when it is armed, or flies.
fn waits(craft: &Craft, subsystem: Subsystem) -> bool {
    let later = |when: When| match when {
        When::Always => false,
        When::Armed => !craft.monitor.vehicle().armed(),
        When::InFlight => !craft.monitor.flight().airborne(),
    };
    health::checks().any(|check| check.subsystem == subsystem && later(check.when))
}

fn waits_for(subsystem: Subsystem) -> &'static str {
    let mut checks = health::checks().filter(|check| check.subsystem == subsystem);
    if checks.any(|check| check.when == When::Armed) {
        "is checked once it is armed"
    } else {
        "is checked in the air"
    }
}

/// The worst finding, or why there is none.
fn reason(craft: &Craft, subsystem: Subsystem, level: Level, here: Level) -> String {
    let findings = craft.worries.values().filter(|finding| finding.subsystem == subsystem);
    let worst = findings.max_by_key(|finding| (rank(finding.level), finding.at));
    if let Some(finding) = worst.filter(|_| level != Level::Ok) {
        return words(finding);
    }
    let checks = craft.monitor.health().levels().filter(|(check, ..)| check.subsystem == subsystem);
    let good = checks.filter(|(.., level)| *level == Level::Ok).count();
    match (subsystem, level) {
        (Subsystem::Recorder, Level::Ok) => "it records".to_owned(),
        (Subsystem::Recorder, Level::Stale) => "no recorder is heard on this link".to_owned(),
        (Subsystem::Recorder, _) => "see what the box says below".to_owned(),
        (_, Level::Stale) => "nothing is heard of it".to_owned(),
        (_, Level::Ok) if good == 1 => "its check is good".to_owned(),
        (_, Level::Ok) if good > 0 => format!("all {good} checks good"),
        (_, Level::Ok) => "within its limits".to_owned(),
        // The box hears more than this PC does.
        _ if here == Level::Ok => "seen on board; within limits by what this link carries".to_owned(),
        _ => "seen on board".to_owned(),
    }
}

/// Not knowing is worse than a warning and better than a known danger, as [`hums_core::health`] has it.
fn rank(level: Level) -> u8 {
    match level {
        Level::Ok => 0,
        Level::Advisory => 1,
        Level::Warning => 2,
        Level::Stale => 3,
        Level::Critical => 4,
    }
}
