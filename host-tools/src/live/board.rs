//! The health board: each subsystem's level with its reason in words.
//!
//! The level of a HUMS on board counts, because it receives every frame; the reason comes from the checks
//! here. Its recorder's state comes from the HUMS alone.

use hums_core::clock::{Instant, Span};
use hums_core::health::{self, CheckPhase, EXPECTED, Finding, Level, Subsystem};
use hums_link::summary;
use serde::Serialize;

use super::craft::{Craft, is_of_wire};
use crate::counters::tells_flight;
use crate::names::{check_name, vocabulary};
use crate::page::note::CELLS_UNKNOWN;
use crate::part;

/// A heartbeat may be missed this long.
const SILENT: Span = Span::from_secs(5);

/// Prefix of a HUMS's findings on the radio.
const OURS: &str = "HUMS: ";

fn words(finding: &Finding) -> String {
    summary::text(finding).as_str().trim_start_matches(OURS).to_owned()
}

fn without_advice(finding: &Finding) -> String {
    words(&Finding { level: Level::Warning, ..*finding })
}

/// One subsystem.
#[derive(Debug, Serialize)]
pub struct SubsystemState {
    subsystem: &'static str,
    level: &'static str,
    /// The judge: `on board`, `here`, or `nobody`.
    by: &'static str,
    /// A stale level without cause for worry: `idle`: its checks are for an armed or flying vehicle; `none`:
    /// the vehicle seems to lack the part.
    calm: Option<&'static str>,
    reason: String,
    /// The recommended action for the reason, as a sentence; empty without a finding.
    action: &'static str,
}

/// The health board.
#[derive(Debug)]
pub struct HealthBoard {
    /// The whole vehicle's level, from the best source.
    pub overall: &'static str,
    /// Text for an unknown level: `was critical`, or why the vehicle is silent.
    pub said: Option<String>,
    /// The last level before it became unknown.
    pub was: Option<&'static str>,
    /// All subsystems, in the order of [`Subsystem::ALL`].
    pub parts: Vec<SubsystemState>,
}

#[derive(Clone, Copy)]
struct Known {
    level: Level,
    /// Whether any of them has a report.
    is_heard: bool,
    /// Each good check once, for all its parts.
    good: usize,
    last: &'static str,
}

impl HealthBoard {
    /// The board of a vehicle. One pass over some hundred checks: it runs for every update.
    pub fn of(craft: &Craft, now: Instant) -> Self {
        let none = Known { level: Level::Stale, is_heard: false, good: 0, last: "" };
        let mut known = [none; Subsystem::ALL.len()];
        for (check, _, level) in craft.monitor.health().levels() {
            let Some(known) = known.get_mut(check.subsystem as usize) else { continue };
            // Another link than the autopilot's wire has faults of its own.
            if level != Level::Ok && !craft.on_the_wire && is_of_wire(check.name) {
                continue;
            }
            if level == Level::Ok && known.last != check.name {
                (known.good, known.last) = (known.good + 1, check.name);
            }
            // An alarm's `ok` has no meaning.
            if !check.alarm_only || level != Level::Ok {
                if !known.is_heard || rank(level) > rank(known.level) {
                    known.level = level;
                }
                known.is_heard = true;
            }
        }
        // The recording box's findings are not among these levels.
        for worry in craft.worries.values().filter(|worry| !craft.judges(worry.check, worry.instance)) {
            if let Some(known) = known.get_mut(worry.subsystem as usize)
                && (!known.is_heard || rank(worry.level) > rank(known.level))
            {
                (known.level, known.is_heard) = (worry.level, true);
            }
        }
        let overall = craft.companion.overall(now).unwrap_or_else(|| overall(craft, now, &known));
        let all = Subsystem::ALL.into_iter().zip(&known);
        let silent = is_silent(craft, now);
        let worst = was(craft, silent).filter(|_| overall == Level::Stale);
        let said = match worst {
            Some(worst) if silent => Some(format!(
                "silent for {}; {}: {}",
                seconds(craft, now),
                was_level(worst),
                without_advice(worst)
            )),
            None if silent => Some(format!("silent for {}", seconds(craft, now))),
            worst => worst.map(|worst| was_level(worst).to_owned()),
        };
        Self {
            overall: overall.name(),
            said,
            was: worst.map(|worst| worst.level.name()),
            parts: all.map(|(subsystem, known)| part(craft, now, subsystem, known)).collect(),
        }
    }
}

/// The worst known level. Unknown without data of a part that every vehicle has, for a silent vehicle, or
/// after a bad check's silence.
fn overall(craft: &Craft, now: Instant, known: &[Known]) -> Level {
    let unknown = is_silent(craft, now)
        || EXPECTED.into_iter().any(|part| known.get(part as usize).is_none_or(|known| !known.is_heard))
        || !craft.unjudged.is_empty();
    let heard =
        known.iter().filter(|known| known.is_heard && !is_silent(craft, now)).map(|known| known.level);
    heard.chain(unknown.then_some(Level::Stale)).max_by_key(|level| rank(*level)).unwrap_or(Level::Stale)
}

fn was(craft: &Craft, silent: bool) -> Option<&Finding> {
    let all = craft.unjudged.values().chain(craft.worries.values().filter(|_| silent));
    all.filter(|finding| is_bad(finding)).max_by_key(|finding| (rank(finding.level), finding.at.as_millis()))
}

fn is_bad(finding: &Finding) -> bool {
    matches!(finding.level, Level::Warning | Level::Critical)
}

fn was_level(finding: &Finding) -> &'static str {
    if finding.level == Level::Critical { "was critical" } else { "was warning" }
}

fn seconds(craft: &Craft, now: Instant) -> String {
    format!("{} s", now.since(craft.heard).as_millis() / 1000)
}

fn part(craft: &Craft, now: Instant, subsystem: Subsystem, known: &Known) -> SubsystemState {
    let onboard = craft.companion.level(now, subsystem);
    let recorder = subsystem == Subsystem::Recorder;
    let silent = is_silent(craft, now);
    // A silent vehicle's silence is all that is known.
    let unknown = recorder || (silent && (subsystem != Subsystem::Link || !craft.on_the_wire));
    let here = if unknown { Level::Stale } else { known.level };
    let before = craft.worries.values().filter(|finding| silent && is_bad(finding));
    let ended = craft.unjudged.values().chain(before).filter(|finding| finding.subsystem == subsystem);
    let ended = ended.max_by_key(|finding| rank(finding.level));
    let ended = ended.filter(|_| !matches!(here, Level::Warning | Level::Critical));
    let doubt = subsystem == Subsystem::Power && craft.cells_unknown;
    let here = match here {
        _ if ended.is_some() => Level::Stale,
        Level::Ok if doubt => Level::Advisory,
        here => here,
    };
    let level = onboard.unwrap_or(here);
    let by = match onboard {
        Some(_) => "on board",
        None if recorder => "nobody",
        None => "here",
    };
    let is_link = silent && subsystem == Subsystem::Link;
    let unknown = level == Level::Stale && !recorder && !known.is_heard && !is_link;
    let absent = subsystem == Subsystem::Engine && craft.monitor.vehicle().engine.get().is_none();
    let no_action = |calm, reason| (calm, reason, "");
    let (calm, reason, action) = if let Some(finding) = ended.filter(|_| level == Level::Stale && !is_link) {
        let why = if silent {
            format!("silent for {}", seconds(craft, now))
        } else if subsystem == Subsystem::Mishap {
            "over; inspect the vehicle".to_owned()
        } else {
            "not judged on the ground or disarmed".to_owned()
        };
        no_action(Some(was_level(finding)), format!("{}; {why}", without_advice(finding)))
    } else if unknown && !absent && !silent && waits(craft, subsystem) {
        no_action(Some("idle"), waits_for(craft, subsystem).to_owned())
    } else if recorder && level == Level::Stale && craft.on_the_wire {
        no_action(Some("recorded"), "it recorded this; hums info --verify says how well".to_owned())
    } else if unknown && !EXPECTED.contains(&subsystem) {
        no_action(Some("none"), "nothing is heard of any".to_owned())
    } else if silent && level == Level::Stale && !recorder {
        no_action(None, format!("silent for {}", seconds(craft, now)))
    } else if recorder && level == Level::Stale && craft.companion.known() {
        no_action(None, "it was heard before, and is silent now".to_owned())
    } else {
        let (reason, action) = reason(craft, subsystem, level, here, known.good);
        (None, reason, action)
    };
    let reason = if doubt && !silent { format!("{reason}; {CELLS_UNKNOWN}") } else { reason };
    SubsystemState { subsystem: subsystem.name(), level: level.name(), by, calm, reason, action }
}

fn is_silent(craft: &Craft, now: Instant) -> bool {
    now.since(craft.heard) > SILENT
}

/// Whether a subsystem waits: some checks begin with arming or flight.
fn waits(craft: &Craft, subsystem: Subsystem) -> bool {
    let later = |when: CheckPhase| match when {
        CheckPhase::Always => false,
        CheckPhase::Armed => !craft.monitor.vehicle().armed(),
        CheckPhase::InFlight => !craft.monitor.flight().airborne(),
    };
    health::checks().any(|check| check.subsystem == subsystem && later(check.when))
}

fn waits_for(craft: &Craft, subsystem: Subsystem) -> &'static str {
    let mut checks = health::checks().filter(|check| check.subsystem == subsystem);
    let vehicle = craft.monitor.vehicle();
    if !vehicle.armed() && checks.any(|check| check.when == CheckPhase::Armed) {
        "is checked once it is armed"
    } else if !tells_flight(vehicle) {
        "is checked in the air, and nothing tells whether it is there"
    } else {
        "is checked in the air"
    }
}

/// The worst finding with the action for its cause, or the reason for its absence.
fn reason(
    craft: &Craft,
    subsystem: Subsystem,
    level: Level,
    here: Level,
    good: usize,
) -> (String, &'static str) {
    let findings = craft.worries.values().filter(|finding| finding.subsystem == subsystem);
    let worst = findings.max_by_key(|finding| (rank(finding.level), finding.at.as_millis()));
    if let Some(finding) = worst.filter(|_| level != Level::Ok) {
        let alarm = |worry: &Finding| health::Alarm::of(worry.check, worry.instance, worry.level, worry.at);
        let alarms = craft.worries.values().filter_map(alarm);
        // One cause has its own order.
        return if let Some(cause) = alarm(finding).and_then(|effect| health::root_cause(&effect, alarms)) {
            let words = format!(
                "{}, because of: {}",
                without_advice(finding),
                check_name(cause.check.name, &[cause.instance])
            );
            (words, action(cause.check.name))
        } else {
            let words = match craft.due(finding) {
                Some(due) => format!("{}: {}", part::due_words(&due), words(finding)),
                None => words(finding),
            };
            (words, action(finding.check))
        };
    }
    let reason = match (subsystem, level) {
        (Subsystem::Recorder, Level::Ok) => "it records".to_owned(),
        (Subsystem::Recorder, Level::Stale) => "no recorder is heard".to_owned(),
        (Subsystem::Power, Level::Advisory) if here == level => format!("{good} checks good"),
        (Subsystem::Recorder, _) => "see what the box says below".to_owned(),
        (_, Level::Stale) => "nothing is heard of it".to_owned(),
        (_, Level::Ok) if good == 1 => "its check is good".to_owned(),
        (_, Level::Ok) if good > 0 => format!("all {good} checks good"),
        (_, Level::Ok) => "within its limits".to_owned(),
        // The box receives more than this PC does.
        _ if here == Level::Ok => "seen on board; within limits by what this link carries".to_owned(),
        _ => "seen on board".to_owned(),
    };
    (reason, "")
}

fn action(check: &str) -> &'static str {
    vocabulary(check).map_or("", |words| words.action)
}

/// Unknown is between a warning and a known danger ([`hums_core::health`]).
fn rank(level: Level) -> Option<usize> {
    [Level::Ok, Level::Advisory, Level::Warning, Level::Stale, Level::Critical]
        .iter()
        .position(|one| *one == level)
}

#[cfg(test)]
mod tests {
    use hums_core::health::Orders;
    use hums_core::observation::{Feeds, Heartbeat, Observation, Source};
    use hums_core::parameters::Params;
    use hums_core::status::{LinkReading, RecorderStatus};

    use super::*;

    fn finding(check: &'static str, subsystem: Subsystem, level: Level) -> Finding {
        Finding {
            at: Instant::from_millis(900).into(),
            subsystem,
            check,
            instance: 0,
            level,
            previous: Level::Ok,
            value: 3.4,
            limit: 3.5,
            unit: "V",
            feeds: Feeds::Vehicle,
            because: "",
            orders: Orders::Own,
        }
    }

    fn craft(worries: &[Finding]) -> Craft {
        let at = Instant::from_millis(1_000);
        let mut craft = Craft::new(at, &Params::defaults(), false);
        let beat =
            Observation::Heartbeat(Heartbeat { autopilot_number: 3, type_number: 2, ..Heartbeat::default() });
        craft.observe(at, Source { system: 1, component: 1 }, &beat, &mut None);
        craft.worries = worries.iter().map(|finding| ((finding.check, 0), *finding)).collect();
        craft
    }

    fn parts(craft: &Craft, now_ms: u64) -> (HealthBoard, impl Fn(&HealthBoard, Subsystem) -> String) {
        let board = HealthBoard::of(craft, Instant::from_millis(now_ms));
        (board, |board, part| {
            let part = &board.parts[part as usize];
            format!("{}: {}", part.calm.unwrap_or(part.level), part.reason)
        })
    }

    #[test]
    fn one_cause_has_one_order() {
        let battery = finding("cell_voltage", Subsystem::Power, Level::Critical);
        let failsafe =
            Finding { unit: "", ..finding("autopilot_state", Subsystem::Computer, Level::Critical) };
        let mut craft = craft(&[battery, failsafe]);
        let reason =
            |craft: &Craft, of: Subsystem| self::reason(craft, of, Level::Critical, Level::Critical, 0);
        let land = action("cell_voltage");
        let words = "battery 1 cell low: 3.40 V, LAND NOW".to_owned();
        assert_eq!(reason(&craft, Subsystem::Power), (words, land));
        let words = "autopilot in failsafe, because of: battery 1 cell low".to_owned();
        assert_eq!(reason(&craft, Subsystem::Computer), (words, land));
        craft.worries.remove(&("cell_voltage", 0));
        let words = "autopilot in failsafe, WATCH IT".to_owned();
        assert_eq!(reason(&craft, Subsystem::Computer), (words, action("autopilot_state")));
        assert!(!land.is_empty() && land != action("autopilot_state"));
        assert_eq!(reason(&craft, Subsystem::Propulsion).1, "");
    }

    #[test]
    fn what_was_bad_and_is_judged_no_more_is_not_called_good() {
        let mut craft = craft(&[]);
        let battery = finding("cell_voltage", Subsystem::Power, Level::Critical);
        craft.unjudged.insert(("cell_voltage", 0), battery);
        let (board, part) = parts(&craft, 1_100);
        assert_eq!((board.overall, board.said.as_deref()), ("stale", Some("was critical")));
        let words = "was critical: battery 1 cell low: 3.40 V; not judged on the ground or disarmed";
        assert_eq!(part(&board, Subsystem::Power), words);
    }

    #[test]
    fn what_was_bad_when_the_link_fell_silent_is_still_said() {
        let mut craft = craft(&[finding("cell_voltage", Subsystem::Power, Level::Critical)]);
        craft.monitor.tick(
            Instant::from_millis(1_050).into(),
            &LinkReading::default(),
            &RecorderStatus::default(),
            &mut |_| {},
        );
        let (board, part) = parts(&craft, 14_100);
        let words = "silent for 13 s; was critical: battery 1 cell low: 3.40 V";
        assert_eq!((board.said.as_deref(), board.was), (Some(words), Some("critical")));
        let words = "was critical: battery 1 cell low: 3.40 V; silent for 13 s";
        assert_eq!(part(&board, Subsystem::Power), words);
    }

    #[test]
    fn the_silence_of_a_link_is_no_finding_of_the_wire_and_nothing_is_called_well() {
        let mut craft = craft(&[]);
        for tick in 0..200 {
            craft.tick(Instant::from_millis(1_000 + tick * 50), &mut None, &mut |_| {});
        }
        assert!(craft.worries.is_empty(), "{:?}", craft.worries);
        let (board, part) = parts(&craft, 11_000);
        assert_eq!(board.overall, "stale");
        assert_eq!(part(&board, Subsystem::Link), "stale: silent for 10 s");
    }
}
