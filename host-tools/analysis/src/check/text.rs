//! Output of `hums check`: a screen for one log, lines and a table for many.
//!
//! Writing to a `String` cannot fail: results of `write!` are dropped.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::fmt::Write as _;

use hums_core::clock::Span;
use hums_core::health::{Level, Side, Subsystem};

use super::checked::Checked;
use super::flights::{Flight, Mishap};
use super::grouped::{Group, grouped, is_critical};
use super::judged::{JudgedBy, Judgement};
use super::problem::{IMPACT, Problem, side};
use crate::colour::level as coloured;
use crate::counters::tells_flight;
use crate::names::{autopilot_name, check_name, type_name, vocabulary};
use crate::part;
use crate::plural::count;
use crate::printable::word;
use crate::soundness::Soundness;
use crate::source::item::{Cause, FactKind, Gap};
use crate::source::recording::Format;
use crate::states::{ShownValue, Values, meaning, quantity, shown};
use crate::summary::since_power_on;
use crate::table::{self, left, right};
use crate::utc::{clock, iso8601, moment};

/// Problems in words; the rest is one line.
const SHOWN_MAX: usize = 6;
/// `--json` has them all.
const LINES_MAX: usize = 8;

const HEADLINE_DETAILS_MAX: usize = 2;
const CRITICAL: &str = "CRITICAL";

/// Mention of the checks without data.
#[derive(Clone, Copy, Debug)]
pub enum UnjudgedList {
    /// Each, with its reason.
    Listed,
    /// Their number, and where the list is.
    Counted(&'static str),
}

/// A log's answer.
pub fn screen(checked: &Checked, mention: UnjudgedList) -> String {
    let judged = &checked.judged;
    let mut text = format!("{}: {}{}\n", word(&checked.name), word(&verdict(judged)), but(checked));
    let has_data = judged.worst().is_some() && judged.checks().judged > 0;
    if has_data || judged.facts.contains_key(&FactKind::Firmware) {
        let _ = writeln!(text, "  log      {}", checked.format.words());
        let _ = writeln!(text, "  vehicle  {}", word(&vehicle(judged)));
        let _ = writeln!(text, "  when     {}", when(checked));
        let _ = writeln!(text, "  in air   {}", in_air(checked));
        text.push('\n');
    }
    problems(&mut text, &judged.problems);
    if judged.by == JudgedBy::Board && judged.findings_count > 0 {
        text.push_str("  (found by the monitor on board)\n");
    }
    not_judged(&mut text, judged, mention);
    damage(&mut text, judged);
    if let Some(end) = &judged.ends_in_air {
        let _ = writeln!(text, "  the end  {:>9}  {}", moment(end.at), end);
    }
    for remark in &judged.remarks {
        let _ = writeln!(text, "  besides  {remark}");
    }
    text
}

/// A log's state in a word: its verdict, or the fault of a log without findings.
pub fn state(checked: &Checked) -> &'static str {
    match (checked.judged.verdict(), checked.soundness()) {
        ("too_little", _) => "little",
        ("ok", Soundness::Damaged) => "damaged",
        ("ok", Soundness::NotProved) => "unproved",
        (verdict, _) => verdict,
    }
}

/// One log of many, as a line.
pub fn line(checked: &Checked) -> String {
    let judged = &checked.judged;
    let mut names: Vec<String> = Vec::new();
    for group in grouped(&judged.problems) {
        for problem in group.members.iter().chain(group.effects.iter().flatten()) {
            let name = check_name(&problem.check, &[]);
            if !names.contains(&name) {
                names.push(name);
            }
        }
    }
    let found = names.join(", ");
    let ends = if judged.ends_in_air.is_some() { "ends in the air" } else { "" };
    let what: Vec<&str> = [found.as_str(), ends, checked.soundness().words()]
        .into_iter()
        .filter(|words| !words.is_empty())
        .collect();
    let air = clock(judged.flown());
    format!("{:<8}  {air:>8}  {}  {}", coloured(state(checked)), word(&checked.name), what.join("; "))
        .trim_end()
        .to_owned()
}

fn but(checked: &Checked) -> String {
    let ends = if checked.judged.ends_in_air.is_some() { "; the log ends in the air" } else { "" };
    match checked.soundness() {
        Soundness::Whole => ends.to_owned(),
        what @ Soundness::Damaged => format!("{ends}; {}, and was not judged", what.words()),
        what @ (Soundness::NotFrames | Soundness::Lossy) => format!("{ends}; {}", what.words()),
        what => format!("{ends}; the log is {}", what.words()),
    }
}

/// Logs, added up.
#[derive(Debug, Default)]
pub struct Table {
    levels: BTreeMap<&'static str, u64>,
    /// Logs by their findings.
    checks: BTreeMap<String, (u64, u64)>,
    logs: u64,
    unsound: BTreeMap<Soundness, u64>,
    /// Another log's session.
    copies: u64,
    little: u64,
    flown_us: u64,
}

impl Table {
    /// Adds a log.
    pub fn add(&mut self, checked: &Checked) {
        let judged = &checked.judged;
        if checked.ending.as_ref().is_some_and(|ending| !ending.is_counted()) {
            self.copies += 1;
            return;
        }
        self.logs += 1;
        if checked.soundness() > Soundness::Whole {
            *self.unsound.entry(checked.soundness()).or_default() += 1;
        }
        self.flown_us = self.flown_us.saturating_add(judged.flown().as_micros());
        let level = judged.worst().map_or("unknown", Level::name);
        self.little += u64::from(judged.worst() == Some(Level::Ok) && judged.is_little());
        *self.levels.entry(level).or_default() += 1;
        let mut worst: BTreeMap<&str, Level> = BTreeMap::new();
        for problem in judged.problems.iter().rev() {
            worst.insert(&problem.check, problem.level);
        }
        for (check, level) in worst {
            let count = self.checks.entry(check.to_owned()).or_default();
            let of = if level == Level::Critical { &mut count.0 } else { &mut count.1 };
            *of += 1;
        }
    }

    /// `failed`: unreadable logs.
    pub fn text(&self, failed: usize) -> String {
        let count = |level: &str| self.levels.get(level).copied().unwrap_or(0);
        let mut text = format!(
            "\n{} checked, {} in the air\n",
            logs(self.logs),
            clock(Span::from_micros(self.flown_us))
        );
        let levels = [
            (count("ok").saturating_sub(self.little), "nothing wrong".to_owned()),
            (self.little, "not enough in it to judge".to_owned()),
            (count("warning"), "warnings".to_owned()),
            (count("critical"), "critical".to_owned()),
            (count("unknown"), "no vehicle in it".to_owned()),
        ];
        let unsound = self.unsound.iter().rev();
        let unsound = unsound.map(|(what, count)| (*count, format!("{} (counted above too)", what.words())));
        let others = [
            (self.copies, "copy of another log (not counted above)".to_owned()),
            (failed as u64, "could not be read".to_owned()),
        ];
        for (count, what) in levels.into_iter().chain(unsound).chain(others) {
            if count > 0 {
                let _ = writeln!(text, "  {count:>6}  {what}");
            }
        }
        let mut table = table::Table::new(2, [left(9), right(8), right(7), left(0)]);
        table.heading(["logs with", "critical", "warning", ""]);
        let mut checks: Vec<_> = self.checks.iter().collect();
        checks.sort_by_key(|(_, (critical, warning))| Reverse((*critical, *warning)));
        for (check, (critical, warning)) in &checks {
            let name = format!("{} [{check}]", check_name(check, &[]));
            table.row([String::new(), critical.to_string(), warning.to_string(), name]);
        }
        if !checks.is_empty() {
            let _ = write!(text, "\n{table}");
        }
        text.trim_end().to_owned()
    }
}

fn logs(number: u64) -> String {
    count(number, "log")
}

fn vehicle(judged: &Judgement) -> String {
    let Some((source, heartbeat)) = judged.vehicle().source.zip(judged.vehicle().heartbeat.get()) else {
        let firmware = judged
            .facts
            .get(&FactKind::Firmware)
            .map(|firmware| format!("{firmware}, of which nothing was heard"));
        return firmware.or_else(|| judged.unheard()).unwrap_or_default();
    };
    let told = judged.facts.get(&FactKind::Firmware).cloned();
    let firmware = told.unwrap_or_else(|| {
        let version = judged.vehicle().identity.get().and_then(|identity| firmware(identity.firmware));
        format!("{} {}", autopilot_name(heartbeat.autopilot_number), version.unwrap_or_default())
    });
    let mut text = format!("{}, {}", type_name(heartbeat.type_number), firmware.trim_end());
    if let Some(hardware) = judged.facts.get(&FactKind::Hardware) {
        let _ = write!(text, ", {hardware}");
    }
    let _ = write!(text, ", system {}", source.system);
    text
}

pub(super) fn firmware(version: u32) -> Option<String> {
    let [major, minor, patch, _] = version.to_be_bytes();
    (version != 0).then(|| format!("{major}.{minor}.{patch}"))
}

fn when(checked: &Checked) -> String {
    let (judged, format) = (&checked.judged, checked.format);
    // A HUMS log continues without the vehicle.
    let of_log = checked.ending.as_ref().and_then(|ending| ending.summary.first.zip(ending.summary.last));
    let Some((first, last)) = judged.span.map(|span| of_log.unwrap_or(span)) else {
        return "nothing of a vehicle is in it".to_owned();
    };
    let utc = judged.epochs.utc_us(first).map_or_else(
        || "time of day unknown".to_owned(),
        |utc_us| iso8601(utc_us / 1_000_000 * 1_000_000).replace(".000000", ""),
    );
    let restarts = match judged.restarts {
        0 => String::new(),
        1 => ", its clock began again once".to_owned(),
        count => format!(", its clock began again {count} times"),
    };
    let since = match format {
        Format::DataFlash | Format::Ulog => "; times count from the autopilot's power-on",
        Format::Hums if judged.by == JudgedBy::Board => "; times count from the box's power-on",
        Format::Hums | Format::Tlog | Format::Raw => "",
    };
    format!("{utc}, {} recorded{restarts}{since}", clock(last.since(first)))
}

fn in_air(checked: &Checked) -> String {
    let judged = &checked.judged;
    let told = judged.facts.get(&FactKind::Arming).map(String::as_str).filter(|words| !words.is_empty());
    let armed = clock(judged.armed);
    if judged.worst().is_none() {
        return "not known".to_owned();
    }
    let text = match judged.flights.as_slice() {
        [] if !tells_flight(judged.vehicle()) => {
            format!("not known: nothing in it tells of height, speed or landing; armed {armed}")
        }
        [] if judged.armed == Span::ZERO => return told.unwrap_or("never armed").to_owned(),
        [] => format!("never; armed {armed}"),
        flights => {
            let lacks = flights.iter().map(|flight| judged.holes.within(flight.from, flight.to));
            let lacks = lacks.fold(Span::ZERO, |sum, lack| sum + lack);
            let lacks = if lacks >= Span::from_secs(1) {
                format!(" (without {} that is not in the log)", clock(lacks))
            } else {
                String::new()
            };
            let time = format!("{}{lacks}", clock(judged.flown()));
            let counted = box_counted(checked).filter(|counted| *counted != clock(judged.flown()));
            let counted =
                counted.map_or_else(String::new, |counted| format!(", {counted} as the box counts"));
            format!(
                "{time} in {}{}{counted}; armed {armed}",
                count(flights.len(), "flight"),
                not_seen(flights)
            )
        }
    };
    told.map_or(text.clone(), |told| format!("{text} ({told})"))
}

fn box_counted(checked: &Checked) -> Option<String> {
    let (judged, ending) = (&checked.judged, checked.ending.as_ref()?);
    let landed = judged.flights.last().filter(|flight| flight.landed)?.to;
    let air = judged.box_air.filter(|air| air.at >= landed)?;
    let seconds = since_power_on(air.last_s, air.first_s, ending.summary.first_number);
    Some(clock(Span::from_micros((seconds * 1e6) as u64)))
}

fn not_seen(flights: &[Flight]) -> String {
    let last = flights.last();
    let ended = match last {
        Some(Flight { disarmed_at_m: Some(_), .. }) => Some("disarming in the air".to_owned()),
        Some(Flight { mishap: Some(Mishap { at, is_impact, unheard_from }), .. }) => {
            let what = if *is_impact { "an impact" } else { "a mishap" };
            Some(match unheard_from {
                Some(from) => {
                    format!("{what} that nobody heard, between {} and {}", moment(*from), moment(*at))
                }
                None => format!("{what}, {}", moment(*at)),
            })
        }
        _ => None,
    };
    let took_off = flights.first().is_none_or(|flight| flight.took_off);
    let landed = ended.is_some() || last.is_none_or(|flight| flight.landed);
    let of = |one, many| if flights.len() == 1 { one } else { many };
    let parts = [
        (took_off, of("whose take-off", "the take-off of the first one")),
        (landed, of("whose landing", "the landing of the last one")),
    ];
    let missing: Vec<&str> = parts.into_iter().filter(|(seen, _)| !seen).map(|(_, part)| part).collect();
    let mut text = match missing.as_slice() {
        [] => String::new(),
        [part] => format!(", {part} is not in the log"),
        parts => format!(", {} are not in the log", parts.join(" and ")),
    };
    if let Some(ended) = ended {
        let _ = write!(text, "{}{ended}", of(", which ended by ", ", the last of which ended by "));
    }
    text
}

/// A sentence: the worst finding, its time, its meaning for the next flight.
pub fn verdict(judged: &Judgement) -> String {
    let counted = |level, one: &str| {
        let count = judged.problems.iter().filter(|problem| problem.level == level).count();
        (count > 0).then(|| self::count(count as u64, one))
    };
    let counts = [counted(Level::Critical, "critical finding"), counted(Level::Warning, "warning")];
    let counts = counts.into_iter().flatten().collect::<Vec<_>>().join(", ");
    let checks = judged.checks();
    let what = match judged.worst() {
        None if judged.is_timeless || judged.gaps.iter().any(|gap| gap.cause == Cause::NoTimes) => {
            return "unknown: the log has no times, and nothing was judged".to_owned();
        }
        None if judged.vehicle().source.is_some() => {
            return "unknown: no heartbeat of the vehicle was heard, and nothing was judged".to_owned();
        }
        None => return "unknown: no autopilot was heard, and nothing was judged".to_owned(),
        Some(_) if judged.problems.is_empty() && checks.judged == 0 => {
            return "nothing in it to judge: no check had data".to_owned();
        }
        Some(_) if judged.problems.is_empty() && judged.is_little() => {
            return format!("not enough to judge: {checks} had data, and nothing was wrong there");
        }
        Some(_) if judged.problems.is_empty() => return format!("nothing wrong in {checks}"),
        Some(_) if judged.problems.iter().all(|problem| part::is_due(&problem.check)) => "maintenance is due",
        Some(Level::Critical) => "do not fly before this is cleared up",
        Some(_) => "look at this before the next flight",
    };
    format!("{}; {what} ({counts})", headline(judged))
}

/// A crash first: it is what the flight is known for.
fn headline(judged: &Judgement) -> String {
    let groups = grouped(&judged.problems);
    let found = found(&groups);
    let mishap = judged.flights.iter().find_map(|flight| flight.mishap);
    let Some(Mishap { at, is_impact, .. }) = mishap else { return found };
    let is_mishap = |problem: &&Problem| problem.subsystem == Subsystem::Mishap;
    let what = if is_impact { "crashed" } else { "ended by a mishap" };
    let mut mishaps = judged.problems.iter().filter(is_mishap);
    let how =
        mishaps.find(|problem| !is_impact || problem.check == IMPACT).map_or_else(String::new, |problem| {
            let worst = match shown(&problem.check, problem.value, problem.limit) {
                ShownValue::Quantity(Some(worst), _) => format!(" {}", quantity(worst, &problem.unit)),
                _ => String::new(),
            };
            format!(" ({}{worst})", alarm(&[problem]))
        });
    let crash = format!("{what} at {}{how}", moment(at));
    match groups.first().and_then(Group::first).filter(|first| !is_mishap(first)) {
        Some(_) => format!("{crash}; first {found}"),
        None => crash,
    }
}

fn found(groups: &[Group<'_>]) -> String {
    let Some((group, first)) = groups.first().and_then(|group| Some((group, group.first()?))) else {
        return String::new();
    };
    let worst = worst_of(&group.members);
    let event = worst.and_then(|worst| worst.event.as_ref());
    let max = if event.is_some() { 0 } else { HEADLINE_DETAILS_MAX };
    let details = worst.map_or_else(String::new, |worst| details(worst, max));
    let (onset, worst) =
        worst.and_then(values).map(|(values, _)| (values.onset, values.worst)).unwrap_or_default();
    let after_comma = |words: String| if words.is_empty() { words } else { format!(", {words}") };
    let (onset, worst) = (after_comma(onset), after_comma(worst));
    let found = format!("{}{onset}{details} at {}{worst}", alarm(&group.members), moment(first.at));
    event.map_or(found.clone(), |event| format!("{event} ({found})"))
}

fn problems(text: &mut String, problems: &[Problem]) {
    let groups = grouped(problems);
    for (place, group) in groups.iter().enumerate() {
        let Some(first) = group.first() else { continue };
        let itself = if group.is_raised { " (itself a warning)" } else { "" };
        let sentence_of_it = sentence(&group.members);
        let line = word(&sentence_of_it);
        let level = level_of(group.is_critical());
        let _ = writeln!(text, "  {:<8} {:>9}  {line}{itself}", coloured(level), moment(first.at));
        if place < SHOWN_MAX {
            let _ = writeln!(text, "                      {}", meaning(&first.check));
            let _ = writeln!(text, "                      {}", action(first));
        }
        for effect in &group.effects {
            let Some(of_it) = effect.first() else { continue };
            let (at, level) = (moment(of_it.at), level_of(is_critical(effect)));
            // A consequence may come first.
            let when = if of_it.at < first.at { "seen earlier," } else { "then" };
            let _ = writeln!(text, "                      {when} {at}  {level}: {}", word(&sentence(effect)));
            // Side effects of a missing card mean nothing.
            if place < SHOWN_MAX && first.subsystem != Subsystem::Recorder {
                let _ = writeln!(text, "                              {}", meaning(&of_it.check));
                if group.is_raised && is_critical(effect) {
                    let _ = writeln!(text, "                              {}", action(of_it));
                }
            }
        }
        if place < SHOWN_MAX {
            text.push('\n');
        }
    }
    if groups.len() > SHOWN_MAX {
        text.push('\n');
    }
}

const fn level_of(is_critical: bool) -> &'static str {
    if is_critical { CRITICAL } else { "warning" }
}

/// A sentence.
fn action(problem: &Problem) -> &'static str {
    vocabulary(&problem.check).map_or("", |words| words.action)
}

fn worst_of<'a>(group: &[&'a Problem]) -> Option<&'a Problem> {
    let is_worse = |one: &Problem, than: &Problem| match side(&one.check) {
        _ if than.value.is_nan() => !one.value.is_nan(),
        Side::Above => one.value > than.value,
        Side::Below => one.value < than.value,
    };
    group.iter().copied().reduce(|worst, one| if is_worse(one, worst) { one } else { worst })
}

fn alarm(group: &[&Problem]) -> String {
    let instances: Vec<u8> = group.iter().map(|problem| problem.instance).collect();
    group.first().map_or_else(String::new, |first| check_name(&first.check, &instances))
}

fn details(problem: &Problem, max: usize) -> String {
    let details: Vec<&str> = problem.details.iter().take(max).map(String::as_str).collect();
    if details.is_empty() { String::new() } else { format!(" ({})", details.join(", ")) }
}

fn values(problem: &Problem) -> Option<(Values, Option<String>)> {
    let Problem { check, onset, value, limit, unit, .. } = problem;
    let ShownValue::Quantity(worst, limit) = shown(check, *value, *limit) else { return None };
    Some((Values::new(*onset, worst, unit), limit.map(|limit| quantity(limit, unit))))
}

/// Problems of one check, as a sentence.
pub fn sentence(group: &[&Problem]) -> String {
    let Some(first) = worst_of(group) else { return String::new() };
    let mut text = alarm(group);
    let (values, limit) = values(first).unzip();
    if let Some(values) = values.map(|values| values.to_string()).filter(|values| !values.is_empty()) {
        let _ = write!(text, ": {values}");
    }
    text.push_str(&details(first, usize::MAX));
    if let Some(limit) = limit.flatten().filter(|_| first.details.is_empty()) {
        let _ = write!(text, " (limit {limit})");
    }
    // A mishap is a moment, though its level stays.
    let is_moment = first.subsystem == Subsystem::Mishap;
    if (first.lasted > Span::ZERO || first.lasting) && !is_moment {
        let _ = write!(text, ", for {}", clock(first.lasted));
    }
    if first.times > 1 {
        let _ = write!(text, " in {} times", first.times);
    }
    if first.lasting && !is_moment {
        text.push_str(", to the end");
    }
    let _ = write!(text, " [{}]", first.check);
    text
}

fn not_judged(text: &mut String, judged: &Judgement, mention: UnjudgedList) {
    let checks = judged.checks();
    if judged.worst().is_none() || judged.not_judged.is_empty() {
        return;
    }
    let count = format!("  not judged: {} of {} checks", checks.all - checks.judged, checks.all);
    let _ = match mention {
        UnjudgedList::Counted(_) if checks.judged == 0 => Ok(()),
        UnjudgedList::Counted(list) => writeln!(text, "{count}, which lack data in this log{list}"),
        UnjudgedList::Listed => {
            writeln!(text, "{count}, and those that need a box or earlier flights\n{}", reasons(judged))
        }
    };
}

/// Checks without data, by reason: a line each.
pub fn reasons(judged: &Judgement) -> String {
    let mut reasons: Vec<(&str, Vec<String>)> = Vec::new();
    for (check, why) in &judged.not_judged {
        let check = check_name(check, &[]);
        match reasons.iter_mut().find(|(reason, _)| reason == why) {
            // Two checks may find one fault.
            Some((_, checks)) if checks.contains(&check) => {}
            Some((_, checks)) => checks.push(check),
            None => reasons.push((why, vec![check])),
        }
    }
    reasons.sort_by_key(|(_, checks)| Reverse(checks.len()));
    let lines = reasons.iter().map(|(reason, checks)| format!("    {reason}: {}", checks.join("; ")));
    lines.collect::<Vec<_>>().join("\n")
}

fn damage(text: &mut String, judged: &Judgement) {
    let mut shown: Vec<&Gap> = judged.gaps.iter().filter(|gap| gap.cause != Cause::NotKept).collect();
    if shown.len() > LINES_MAX {
        shown.sort_by_key(|gap| how_bad(gap));
    }
    for gap in shown.into_iter().take(LINES_MAX) {
        let what = match gap.cause {
            Cause::NoTimes => "no times",
            Cause::Cut => "cut",
            Cause::Silent => "silent",
            cause if cause.is_damage() => "damaged",
            _ => "lost",
        };
        let place = gap.place.map_or_else(String::new, |place| format!("byte {place}: "));
        let at = gap.from.map_or_else(String::new, |from| format!(" {}", moment(from)));
        let _ = writeln!(text, "  {what:<8} {at:>9}  {place}{}", word(&gap.words));
    }
    let more = (judged.damages + judged.losses).saturating_sub(LINES_MAX as u64);
    if more > 0 {
        let _ = writeln!(text, "  and {more} more such places");
    }
}

/// Worst first: damage before losses, then counts over the recording, without bytes (wrong checksums, wrong
/// times, a stopped clock), then single places, the longest first.
fn how_bad(gap: &Gap) -> (bool, bool, Reverse<u64>, Reverse<Span>) {
    let lasts = gap.from.zip(gap.to).map_or(Span::ZERO, |(from, to)| to.since(from));
    (!gap.cause.is_damage(), gap.bytes > 0, Reverse(gap.bytes), Reverse(lasts))
}

#[cfg(test)]
mod tests {
    use hums_core::clock::Instant;

    use super::*;
    use crate::summary::EndsInAir;

    fn problem(check: &str, instance: u8, value: f32) -> Problem {
        Problem {
            subsystem: hums_core::health::Subsystem::Propulsion,
            check: check.to_owned(),
            instance,
            level: Level::Warning,
            at: Instant::ZERO,
            times: 1,
            lasted: Span::ZERO,
            lasting: false,
            onset: value,
            value,
            limit: 10.0,
            unit: String::new(),
            details: Vec::new(),
            event: None,
            unheard_from: None,
            because: None,
        }
    }

    #[test]
    fn a_warning_that_explains_what_became_critical_stands_as_critical_with_both_their_words() {
        let ratio = Problem {
            level: Level::Critical,
            because: Some("gps_stuck".to_owned()),
            ..problem("ekf_test_ratio", 0, 2.0)
        };
        let tilt = Problem { because: Some("gps_stuck".to_owned()), ..problem("ahrs2_tilt", 0, 12.0) };
        let mut text = String::new();
        problems(&mut text, &[ratio, problem("vibration", 0, 40.0), problem("gps_stuck", 0, 3.0), tilt]);
        let lines: Vec<&str> = text.lines().map(str::trim_start).collect();
        assert!(lines[0].contains("CRITICAL"), "{text}");
        assert!(lines[0].ends_with("[gps_stuck] (itself a warning)"), "{text}");
        let has = |words: &str| lines.iter().any(|line| line.starts_with(words));
        assert!(has("then 0:00.0  CRITICAL: EKF rejects position or speed"), "{text}");
        assert!(has("then 0:00.0  warning: EKF and AHRS2"), "{text}");
        let advice = vocabulary("ekf_test_ratio").map_or("", |words| words.action);
        assert!(has(advice), "{text}");
        let place = |words: &str| lines.iter().position(|line| line.contains(words));
        assert!(place("[gps_stuck]") < place("[vibration]"), "{text}");
    }

    #[test]
    fn of_several_parts_the_worst_value_is_shown() {
        let shown = |check: &str, values: [f32; 3]| {
            let all: Vec<Problem> =
                (0..).zip(values).map(|(instance, value)| problem(check, instance, value)).collect();
            sentence(&all.iter().collect::<Vec<_>>())
        };
        let motors = shown("motor_imbalance", [f32::NAN, 12.0, 31.0]);
        assert!(motors.contains("motor 1, 2, 3 speed differs: 31 "), "{motors}");
        let cells = shown("cell_voltage", [3.5, 3.2, 3.4]);
        assert!(cells.contains(": 3.2 "), "{cells}");
    }

    #[test]
    fn a_number_that_no_sensor_can_have_is_not_shown_as_one() {
        let (height_m, climb_mps) = (Some(-3e38), Some(1.0));
        let speed_mps = Some(f32::INFINITY);
        let place_deg = Some((47.397_742, -8.545_594));
        let end = EndsInAir { at: Instant::ZERO, height_m, climb_mps, speed_mps, place_deg };
        let words = "the recording ends in the air: climbing at 1.0 m/s, at 47.3977420, -8.5455940; what became of the vehicle is not in it";
        assert_eq!(end.to_string(), words);
    }

    #[test]
    fn of_many_places_the_worst_come_first() {
        let gap = |cause, bytes, lasts| Gap {
            from: Some(Instant::ZERO),
            to: Some(Instant::from_millis(lasts)),
            cause,
            place: None,
            bytes,
            words: String::new(),
            own: None,
        };
        let (count, large, small) =
            (gap(Cause::Damaged, 0, 0), gap(Cause::Damaged, 900, 0), gap(Cause::Cut, 20, 0));
        let (long, short) = (gap(Cause::Lost, 0, 9), gap(Cause::Lost, 0, 1));
        let mut all = [&short, &small, &long, &large, &count];
        all.sort_by_key(|gap| how_bad(gap));
        assert_eq!(all, [&count, &large, &long, &short, &small]);
    }

    #[test]
    fn a_flight_of_which_a_part_is_not_in_the_log_says_which() {
        let flight = |took_off, landed| Flight {
            from: Instant::ZERO,
            to: Instant::ZERO,
            air: Span::ZERO,
            took_off,
            landed,
            disarmed_at_m: None,
            mishap: None,
        };
        assert_eq!(not_seen(&[flight(true, true)]), "");
        assert_eq!(not_seen(&[flight(true, false)]), ", whose landing is not in the log");
        let both = ", whose take-off and whose landing are not in the log";
        assert_eq!(not_seen(&[flight(false, false)]), both);
        let first = ", the take-off of the first one is not in the log";
        assert_eq!(not_seen(&[flight(false, true), flight(true, true)]), first);
        let crashed = Flight { disarmed_at_m: Some(9.0), ..flight(true, false) };
        assert_eq!(not_seen(&[crashed]), ", which ended by disarming in the air");
        let hit = Some(Mishap { at: Instant::from_millis(91_500), is_impact: true, unheard_from: None });
        let hit = Flight { mishap: hit, ..flight(true, false) };
        assert_eq!(not_seen(&[hit]), ", which ended by an impact, 1:31.5");
        let two = [
            flight(true, true),
            Flight { mishap: hit.mishap.map(|it| Mishap { is_impact: false, ..it }), ..hit },
        ];
        assert_eq!(not_seen(&two), ", the last of which ended by a mishap, 1:31.5");
        let unheard_from = Some(Instant::from_millis(85_000));
        let unheard = Flight { mishap: hit.mishap.map(|it| Mishap { unheard_from, ..it }), ..hit };
        let words = ", which ended by an impact that nobody heard, between 1:25.0 and 1:31.5";
        assert_eq!(not_seen(&[unheard]), words);
    }
}
