//! Text output of `hums info`.
//!
//! Writing to a `String` cannot fail: results of `write!` are dropped.

use std::fmt::Write as _;
use std::path::Path;

use hums_blackbox::{Cause, Gap};
use hums_core::clock::Instant;
use hums_core::health::Level;

use super::{usage, wear};
use crate::check::causes::causes;
use crate::colour::{level, warning};
use crate::ending::{among_words, behind_words, copies_words, made_again_words, unprotected_words};
use crate::logs::naming::is_part;
use crate::loss;
use crate::names::check_name;
use crate::part;
use crate::plural::count;
use crate::printable::word;
use crate::source::item::{self, MessageCount};
use crate::source::told::Finding;
use crate::states::finding_words;
use crate::summary::{LISTED_MAX, Overview};
use crate::table::{Table, left, right};
use crate::utc::{clock, iso8601_ms, moment};
use hums_analysis::log_json::{duration_s, vehicle};

/// Shown findings and gaps; `--json` and `hums decode` have the rest.
const SHOWN_MAX: usize = 40;

pub(super) fn text(log: &Overview) -> String {
    let mut text = String::new();
    heading(&mut text, log);
    findings_text(&mut text, log);
    gaps_text(&mut text, log);
    usage::text(&mut text, log);
    wear::text(&mut text, log);
    messages_text(&mut text, log);
    text
}

fn heading(text: &mut String, log: &Overview) {
    let (summary, contents) = (&log.ending.summary, &log.contents);
    let _ = match log.format {
        Some(format) => writeln!(text, "{}: {}", word(&log.ending.files.join(", ")), format.words()),
        None => writeln!(text, "Session {} ({})", word(&log.ending.name), word(&log.ending.files.join(", "))),
    };
    match (summary.first, summary.last) {
        (Some(first), Some(last)) => {
            let utc = |at| log.utc_us(at).map_or_else(|| "UTC unknown".to_owned(), iso8601_ms);
            let _ = writeln!(text, "  from     {:>12}  {}", moment(first), utc(first));
            let _ = writeln!(text, "  to       {:>12}  {}", moment(last), utc(last));
            let _ = writeln!(text, "  length   {:>12}", clock(last.since(first)));
        }
        _ if messages(log) > 0 => {}
        _ => text.push_str("  nothing in it can be read\n"),
    }
    let lacks = log.soundness().words();
    if !lacks.is_empty() {
        let _ = writeln!(text, "  state    {}", warning(lacks));
    }
    if log.format.is_none() {
        ending(text, log);
    }
    if let Some(end) = &contents.ends_in_air {
        let _ = writeln!(text, "  the end  {:>12}  {end}", moment(end.at));
    }
    let flights = contents.flights();
    for (number, flight) in (1..).zip(&flights).take(SHOWN_MAX) {
        let to = flight.to.map_or_else(|| "the end of the log".to_owned(), moment);
        let _ = writeln!(text, "  flight {number:<2} {:>11}  to {to}", moment(flight.from));
    }
    more(text, flights.len() as u64, flights.len().min(SHOWN_MAX));
    if let Some(vehicle) = vehicle(log) {
        let firmware = vehicle.firmware.map_or_else(String::new, |version| format!(" {version}"));
        let uid = vehicle.uid.map_or_else(String::new, |uid| format!(", uid {uid}"));
        let (autopilot, kind) = (vehicle.autopilot, vehicle.r#type);
        let _ = writeln!(text, "  vehicle  system {}, {autopilot}{firmware}, {kind}{uid}", vehicle.system);
    } else if let Some(unheard) = &contents.unheard {
        let _ = writeln!(text, "  vehicle  {unheard}");
    }
    if let Some(boot) = &contents.boot {
        let _ = writeln!(
            text,
            "  monitor  {} {} on {}, started by {}",
            boot.version, boot.git, boot.board, boot.reset
        );
    }
    let (frames, records) = (contents.frames(), contents.records);
    if log.format.is_some() {
        for remark in &contents.remarks {
            let _ = writeln!(text, "  besides  {remark}");
        }
        let _ = writeln!(text, "  messages {} in {} bytes", messages(log), log.bytes_on_card);
        return;
    }
    let _ = write!(text, "  frames   {frames} in {} bytes, {records} records", log.log_bytes());
    if frames > 0 {
        let ratio = log.ratio().unwrap_or(f64::NAN);
        let _ = write!(text, "; as a tlog {} bytes: {ratio:.2} times smaller", contents.tlog_bytes());
    }
    text.push('\n');
}

fn messages(log: &Overview) -> u64 {
    let messages = log.contents.messages.iter().map(|message| message.amount.count).sum::<u64>();
    if log.format.is_some() { messages + log.contents.other_messages.count } else { 0 }
}

fn ending(text: &mut String, log: &Overview) {
    let (ending, summary) = (&log.ending, &log.ending.summary);
    let _ = writeln!(text, "  end      {}", ending.words());
    let behind = behind_words(&summary.behind);
    if !behind.is_empty() {
        let _ = writeln!(text, "  behind   {behind}");
    }
    let among = among_words(summary);
    if !among.is_empty() {
        let _ = writeln!(text, "  among    {among}");
    }
    if let Some(gone) = ending.before.gone() {
        let _ = writeln!(text, "  before   {gone}");
    }
    if let Some(words) = ending.aside() {
        let _ = writeln!(text, "  place    {words}");
    }
    for strange in ending.contradicted().into_iter().chain(ending.noise()).chain(ending.strange()) {
        let _ = writeln!(text, "  files    {strange}");
    }
    let weakened = [made_again_words(ending.made_again()), unprotected_words(ending.unprotected())];
    for words in weakened.into_iter().flatten() {
        let _ = writeln!(text, "  parity   {words}");
    }
    let copies = copies_words(&summary.blocks);
    if !copies.is_empty() {
        let _ = writeln!(text, "  copies   {copies}");
    }
}

fn findings_text(text: &mut String, log: &Overview) {
    let contents = &log.contents;
    // A recorder without checks has no findings: no proof of health.
    let by = match contents.checked_by() {
        "hums" if contents.is_little() => "",
        "hums" => " (checked here: what recorded this ran no checks)",
        "board" => "",
        _ => " (not checked)",
    };
    if contents.findings_count == 0 {
        let none = match contents.judged {
            Some(checks) if contents.is_little() => {
                format!("not enough to judge: {checks} had something to judge")
            }
            Some(checks) => format!("none in {checks}; the others had nothing to judge"),
            None => "none".to_owned(),
        };
        let _ = writeln!(text, "  findings {none}{by}");
        return;
    }
    let _ = writeln!(text, "  findings {}{by}", contents.findings_count);
    let causes = causes(&contents.findings);
    let found: Vec<_> = contents.findings.iter().zip(&causes).collect();
    let (mut lines, mut told) = (0, 0);
    for row in found.chunk_by(|(one, _), (next, _)| silence(one).is_some() && silence(one) == silence(next)) {
        let silence = row.first().filter(|_| row.len() >= ROW_MIN).and_then(|(first, _)| silence(first));
        // One line for the row, or one for each.
        let (each, size) =
            if silence.is_some() { (row.get(..1).unwrap_or(row), row.len()) } else { (row, 1) };
        for (finding, cause) in each.iter().take(SHOWN_MAX - lines) {
            let words = match silence {
                Some(words) => format!("{} checks {words}", row.len()),
                None => sentence(finding, contents.due(finding).as_ref(), cause.as_deref()),
            };
            let level = level(if finding.is_unjudged() { "ended" } else { finding.level.name() });
            let _ = writeln!(text, "    {:>11}  {level:<8}  {}", moment(finding.at), word(&words));
            (lines, told) = (lines + 1, told + size);
        }
    }
    more(text, contents.findings_count, told);
}

/// Changes in a row between data and no data that become one line.
const ROW_MIN: usize = 4;

/// Data stopped or came again.
fn silence(finding: &Finding) -> Option<&'static str> {
    match (finding.previous, finding.level) {
        (Level::Ok, Level::Stale) => Some("that were ok have no data"),
        (Level::Stale, Level::Ok) if !finding.is_unjudged() => Some("have data again, and are ok"),
        _ => None,
    }
}

fn sentence(finding: &Finding, due: Option<&(String, Option<String>)>, cause: Option<&str>) -> String {
    let due = due.map_or_else(String::new, |due| format!("; {}", part::due_words(due)));
    let cause = cause.map_or_else(String::new, |cause| format!("; because of {}", check_name(cause, &[])));
    let Finding { subsystem, check, previous, .. } = finding;
    let (subsystem, previous) = (subsystem.name(), previous.name());
    format!("{subsystem}: {}{due}{cause}; was {previous} [{check}]", finding_words(finding))
}

fn more(text: &mut String, count: u64, shown: usize) {
    let shown = shown as u64;
    if count > shown {
        let _ = writeln!(
            text,
            "    … and {} more (see --json, up to {LISTED_MAX}, or hums decode)",
            count - shown
        );
    }
}

fn gaps_text(text: &mut String, log: &Overview) {
    let (summary, contents) = (&log.ending.summary, &log.contents);
    let own = log.format.is_none();
    if summary.gaps + summary.losses + summary.blocks.damaged == 0 {
        text.push_str("  gaps     none\n");
    } else if !own {
        let _ = writeln!(
            text,
            "  gaps     {} damaged or cut, {} of loss or noise (hums check tells where and why)",
            count(summary.gaps, "place"),
            count(summary.losses, "place")
        );
    } else {
        let _ = writeln!(
            text,
            "  gaps     {}, {} missing, {}",
            summary.gaps,
            summary.missing_words(),
            count(summary.blocks.damaged, "damaged sector")
        );
    }
    let gaps = if own { own_gaps } else { foreign_gaps };
    gaps(text, log);
    more(
        text,
        (summary.gaps + summary.losses).max(contents.gaps.len() as u64),
        contents.gaps.len().min(SHOWN_MAX),
    );
    for loss in contents.losses.values() {
        let _ = writeln!(text, "  lost     {}", loss::told(loss));
    }
}

fn own_gaps(text: &mut String, log: &Overview) {
    let is_part = log.ending.files.iter().any(|file| is_part(Path::new(file)));
    for gap in log.contents.gaps.iter().take(SHOWN_MAX) {
        let time = |at: Option<Instant>, none: &str| at.map_or_else(|| none.to_owned(), moment);
        let frames = gap
            .frames
            .map_or_else(|| "an unknown number of frames".to_owned(), |frames| count(frames, "frame"));
        let lost = loss::sectors_lost(gap)
            .map_or_else(|| "an unknown number of sectors".to_owned(), |lost| count(lost, "sector"));
        let _ = writeln!(
            text,
            "    from {} to {}: {}, {lost} lost, {} more of no use, {frames} missing",
            time(gap.from, "the beginning"),
            time(gap.to, "the end"),
            if is_part && gap.cause == Cause::Missing { "not brought yet" } else { why(log, gap) },
            gap.sectors_skipped
        );
    }
}

fn foreign_gaps(text: &mut String, log: &Overview) {
    let contents = &log.contents;
    for (gap, (cause, place, found)) in contents.gaps.iter().zip(&contents.gap_words).take(SHOWN_MAX) {
        let when = match (gap.from, gap.to) {
            (Some(from), Some(to)) => format!("from {} to {}", moment(from), moment(to)),
            (Some(from), None) => format!("at {}", moment(from)),
            (None, _) => "at the beginning".to_owned(),
        };
        let place = place.map_or_else(String::new, |place| format!("byte {place}: "));
        let what = match cause {
            item::Cause::Lost | item::Cause::Silent => "lost: ",
            item::Cause::NotKept | item::Cause::NoTimes => "",
            item::Cause::Cut => "cut off by the end of the log: ",
            item::Cause::Damaged => "damaged: ",
        };
        let _ = writeln!(text, "    {when}: {what}{place}{}", word(found));
    }
}

fn why(log: &Overview, gap: &Gap) -> &'static str {
    if gap.cause == Cause::Missing && log.contents.did_not_record(gap) {
        return "not written: the box did not record then; most likely its card was out";
    }
    loss::why(gap)
}

fn messages_text(text: &mut String, log: &Overview) {
    let contents = &log.contents;
    let seconds = duration_s(log);
    let mut table = Table::new(2, [left(37), right(10), right(8), right(9)]);
    table.heading(["messages", "frames", "per s", "bytes"]);
    let mut line = |name: &str, frames: u64, bytes: u64, rate: String| {
        table.row([format!("  {}", word(name)), frames.to_string(), rate, bytes.to_string()]);
    };
    for MessageCount { id, name, amount } in &contents.messages {
        let is_other = id.is_some_and(|(id, verified)| !verified && hums_dialect::message(id).is_some());
        let other = if is_other { " (unverified)" } else { "" };
        let rate =
            if seconds > 0.0 { format!("{:.2}", amount.count as f64 / seconds) } else { String::new() };
        line(&format!("{name}{other}"), amount.count, amount.bytes, rate);
    }
    let other = contents.other_messages;
    if other.count > 0 {
        line("ids beyond these", other.count, other.bytes, String::new());
    }
    let _ = write!(text, "{table}");
}

#[cfg(test)]
mod tests {
    use hums_core::clock::Instant;
    use hums_core::health::Subsystem;

    use super::*;

    #[test]
    fn a_state_has_its_name_and_a_quantity_its_limit() {
        let finding = |check: &str, value, limit, unit: &str| Finding {
            at: Instant::ZERO,
            subsystem: Subsystem::Computer,
            check: check.to_owned(),
            instance: 0,
            level: Level::Critical,
            previous: Level::Ok,
            value,
            worst: None,
            limit,
            unit: unit.to_owned(),
        };
        let sentence = |finding: Finding| sentence(&finding, None, None);
        let state = sentence(finding("autopilot_state", 6.0, 4.5, ""));
        assert_eq!(state, "computer: autopilot in failsafe, emergency; was ok [autopilot_state]");
        let charge = sentence(finding("batt_state", 1.0, 0.5, ""));
        assert_eq!(charge, "computer: autopilot: battery 1 low, low or unhealthy; was ok [batt_state]");
        let load = sentence(finding("load", 97.0, 95.0, "%"));
        assert!(load.contains(", 97 % (limit 95 %); was ok"), "{load}");
    }

    #[test]
    fn a_silence_of_many_checks_is_a_line_and_what_was_wrong_then_another_one() {
        let finding = |at_s: u64, check: &str, previous, level, value| Finding {
            at: Instant::from_millis(at_s * 1_000),
            subsystem: Subsystem::Structure,
            check: check.to_owned(),
            instance: 0,
            level,
            previous,
            value,
            worst: None,
            limit: 1.0,
            unit: String::new(),
        };
        let checks = ["vibration", "clipping", "load_factor", "roll", "pitch"];
        let mut log = Overview::default();
        let silent = checks.map(|check| finding(84, check, Level::Ok, Level::Stale, f32::NAN));
        let heard = checks.map(|check| finding(95, check, Level::Stale, Level::Ok, 0.5));
        log.contents.findings.extend(silent);
        log.contents.findings.push(finding(90, "cell_voltage", Level::Critical, Level::Stale, f32::NAN));
        log.contents.findings.extend(heard);
        log.contents.findings_count = log.contents.findings.len() as u64;
        let mut text = String::new();
        findings_text(&mut text, &log);
        let text = crate::colour::shown(&text, false);
        let lines: Vec<&str> = text.lines().map(str::trim).collect();
        let [_, silent, wrong, heard] = lines.as_slice() else { panic!("{text}") };
        assert_eq!(*silent, "1:24.0  stale     5 checks that were ok have no data");
        assert!(
            wrong.starts_with("1:30.0  stale     structure: no data: battery 1 cell voltage; was"),
            "{wrong}"
        );
        assert_eq!(*heard, "1:35.0  ok        5 checks have data again, and are ok");
        // Three in a row are printed one by one.
        log.contents.findings.truncate(3);
        let mut text = String::new();
        findings_text(&mut text, &log);
        assert!(text.contains("structure: no data: vibration") && text.contains("… and 8 more"), "{text}");
    }

    #[test]
    fn what_no_longer_applies_is_not_called_good() {
        let finding = |value| Finding {
            at: Instant::ZERO,
            subsystem: Subsystem::Power,
            check: "cell_voltage".to_owned(),
            instance: 0,
            level: Level::Ok,
            previous: Level::Critical,
            value,
            worst: None,
            limit: f32::NAN,
            unit: "V".to_owned(),
        };
        let ended = finding(f32::NAN);
        assert!(ended.is_unjudged() && !finding(4.0).is_unjudged());
        let words = "power: no longer judged: battery 1 cell low; was critical [cell_voltage]";
        assert_eq!(sentence(&ended, None, None), words);
    }
}
