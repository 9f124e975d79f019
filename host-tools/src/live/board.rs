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

/// The health board.
#[derive(Debug)]
pub struct Board {
    /// The whole vehicle's level, by whoever knows best.
    pub overall: &'static str,
    /// All subsystems, in the order of [`Subsystem::ALL`].
    pub parts: Vec<Part>,
}

/// What the checks here say of a subsystem.
#[derive(Clone, Copy)]
struct Known {
    level: Level,
    /// Whether any has something to say.
    is_heard: bool,
    /// Checks that are good.
    good: usize,
}

impl Board {
    /// Of a vehicle. The checks, which are some hundred, are gone through once: this is done as often as pages are told.
    pub fn of(craft: &Craft, now: Instant) -> Self {
        let mut known = [Known { level: Level::Stale, is_heard: false, good: 0 }; Subsystem::ALL.len()];
        for (check, _, level) in craft.monitor.health().levels() {
            let Some(known) = known.get_mut(check.subsystem as usize) else { continue };
            known.good += usize::from(level == Level::Ok);
            // Silence of a check that only raises an alarm is no news.
            if !check.alarm_only || level != Level::Ok {
                if !known.is_heard || rank(level) > rank(known.level) {
                    known.level = level;
                }
                known.is_heard = true;
            }
        }
        let here = || {
            if is_silent(craft, now) { Level::Stale } else { craft.monitor.health().overall() }
        };
        let overall = craft.companion.overall(now).unwrap_or_else(here).name();
        let all = Subsystem::ALL.into_iter().zip(&known);
        Self { overall, parts: all.map(|(subsystem, known)| part(craft, now, subsystem, known)).collect() }
    }
}

fn part(craft: &Craft, now: Instant, subsystem: Subsystem, known: &Known) -> Part {
    let onboard = craft.companion.level(now, subsystem);
    let recorder = subsystem == Subsystem::Recorder;
    let silent = is_silent(craft, now);
    // Of a vehicle that is silent one thing is known: that it is.
    let unknown = recorder || (silent && subsystem != Subsystem::Link);
    let here = if unknown { Level::Stale } else { known.level };
    let level = onboard.unwrap_or(here);
    let by = match onboard {
        Some(_) => "on board",
        None if recorder => "nobody",
        None => "here",
    };
    let unknown = level == Level::Stale && !recorder && !known.is_heard;
    let absent = subsystem == Subsystem::Engine && craft.monitor.vehicle().engine.get().is_none();
    let (calm, reason) = if unknown && !absent && waits(craft, subsystem) {
        (Some("idle"), waits_for(subsystem).to_owned())
    } else if unknown && !EXPECTED.contains(&subsystem) {
        (Some("none"), "nothing is heard of any".to_owned())
    } else if silent && level == Level::Stale && !recorder {
        (None, format!("silent for {} s", now.since(craft.heard).as_millis() / 1000))
    } else {
        (None, reason(craft, subsystem, level, here, known.good))
    };
    Part { subsystem: subsystem.name(), level: level.name(), by, calm, reason }
}

/// Whether nothing at all has been heard of the vehicle for a while.
fn is_silent(craft: &Craft, now: Instant) -> bool {
    now.since(craft.heard) > SILENT
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
fn reason(craft: &Craft, subsystem: Subsystem, level: Level, here: Level, good: usize) -> String {
    let findings = craft.worries.values().filter(|finding| finding.subsystem == subsystem);
    let worst = findings.max_by_key(|finding| (rank(finding.level), finding.at));
    if let Some(finding) = worst.filter(|_| level != Level::Ok) {
        return words(finding);
    }
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
