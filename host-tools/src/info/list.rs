//! `hums info --list`: a line for each flight.

use std::fmt::Write as _;

use anyhow::Result;
use hums_core::clock::{Instant, Span};
use hums_core::health::Level;
use serde::Serialize;

use super::each::each;
use crate::check::grouped::grouped;
use crate::check::problem::problems;
use crate::cli;
use crate::colour::{level, warning};
use crate::names::check_name;
use crate::outcome::Outcome;
use crate::output::{self, JsonList, Schema};
use crate::printable::word;
use crate::source::find::find_each;
use crate::source::recording::Format;
use crate::summary::{BOX_COUNTS, Overview};
use crate::table::{Table, left, right};
use crate::utc::{clock, date_and_time, iso8601};
use hums_analysis::log_json::{duration_s, image_text, images_json};
use hums_analysis::order::{self, LogTime};

const SCHEMA: Schema = Schema::first("hums-info-list");

pub(super) fn run(args: &cli::Info) -> Result<Outcome> {
    let found = find_each(&args.inputs, args.salvage)?.of_system(args.system)?;
    let wanted = args.session.as_deref().map(|name| found.session(name)).transpose()?;
    let mut list =
        args.json.then(|| JsonList::begin(SCHEMA, &images_json(&found.images), "logs")).transpose()?;
    if list.is_none() {
        for image in found.images.iter().filter(|image| !image.damage.is_empty()) {
            output::line(&image_text(image, &image.path))?;
        }
    }
    let (mut lines, mut elements, mut box_counts) = (Vec::new(), Vec::new(), false);
    let read = each(&found, wanted, |overview| {
        if args.json {
            elements.push((LogTime::of(overview), LogJson::of(overview)));
        } else {
            lines.push((LogTime::of(overview), row(overview)));
            box_counts |= overview.contents.boot.is_some() && overview.flight_s() > Some(0.0);
        }
        Ok(())
    })?;
    if !lines.is_empty() {
        output::line(&table(order::sort(lines).into_iter().map(|(_, row)| row)).text())?;
    }
    for (_, element) in order::sort(elements) {
        list.as_mut().map_or(Ok(()), |list| list.element(&element))?;
    }
    if let Some(list) = list {
        list.end()?;
    } else if found.places.is_empty() && found.failed.is_empty() {
        output::line("no log is on it")?;
    } else if box_counts {
        output::line(BOX_COUNTS)?;
    }
    read.end()
}

/// A log; names carry their units.
#[derive(Debug, Serialize)]
#[expect(clippy::struct_excessive_bools, reason = "facts that have nothing to do with each other")]
struct LogJson {
    /// Name for `--session`.
    name: String,
    /// `hums`, `tlog`, `raw`, `dataflash`, `ulog`.
    format: &'static str,
    files: Vec<String>,
    /// UTC of the first entry.
    start_utc: Option<String>,
    /// First to last entry.
    duration_s: f64,
    /// In the air, by the usage counters.
    flight_s: Option<f64>,
    /// `board`, `hums` (this program), `nobody`.
    checked_by: &'static str,
    /// Changes of level.
    findings_count: u64,
    /// First finding of `hums check`; `null` without a warning or critical finding.
    worst: Option<WorstJson>,
    /// Checks with data, or `null` for most logs that a box checked. Below a tenth of all: too little to judge.
    checks_judged: Option<usize>,
    /// All checks.
    checks_all: Option<usize>,
    /// The log begins in the air.
    begins_in_air: bool,
    /// The log ends in the air; false for a log that a box checked.
    ends_in_air: bool,
    /// Part of the time was not recorded (recordings of other programs).
    lossy: bool,
    /// Recorded bytes, without reserved room on the card.
    bytes: u64,
    /// `whole`, `repaired` (nothing is lost), `not_proved`, or `lacks` for a log with losses or damage.
    state: &'static str,
    /// No loss, no damage, and a proved end.
    whole: bool,
}

#[derive(Debug, Serialize)]
struct WorstJson {
    level: &'static str,
    check: String,
    /// From 0.
    instance: u8,
    time_s: f64,
}

impl LogJson {
    fn of(log: &Overview) -> Self {
        Self {
            name: log.ending.name.clone(),
            format: log.format.map_or("hums", Format::name),
            files: log.ending.files.clone(),
            start_utc: start_utc_us(log).map(iso8601),
            duration_s: duration_s(log),
            flight_s: log.flight_s(),
            checked_by: log.contents.checked_by(),
            findings_count: log.contents.findings_count,
            worst: worst(log),
            checks_judged: log.contents.judged.map(|checks| checks.judged),
            checks_all: log.contents.judged.map(|checks| checks.all),
            begins_in_air: log.contents.begins_in_air,
            ends_in_air: log.contents.ends_in_air.is_some(),
            lossy: log.contents.is_lossy,
            bytes: bytes(log),
            state: log.soundness().name(),
            whole: log.is_sound(),
        }
    }
}

fn table(rows: impl Iterator<Item = [String; 6]>) -> Table<6> {
    let mut table = Table::new(0, [left(0), left(19), right(8), right(8), right(10), left(0)]);
    table.heading(["log", "date (UTC)", "length", "in air", "size", "worst finding"]);
    rows.for_each(|row| table.row(row));
    table
}

fn row(log: &Overview) -> [String; 6] {
    let date = start_utc_us(log).map_or_else(|| "unknown".to_owned(), date_and_time);
    let length = clock(span(duration_s(log)));
    // The last stored count is a lower bound.
    let is_least = log.counted_until().is_some() && !log.contents.is_recounted;
    let least = if is_least { ">" } else { "" };
    let air =
        log.flight_s().map_or_else(|| "-".to_owned(), |seconds| format!("{least}{}", clock(span(seconds))));
    let mut text = found(log);
    if let Some(aside) = log.ending.aside() {
        // Writing to a `String` cannot fail.
        let _ = write!(text, "; {}", word(&aside));
    }
    if log.contents.begins_in_air {
        let _ = write!(text, "; {}", warning("begins in the air"));
    }
    if log.contents.ends_in_air.is_some() {
        let _ = write!(text, "; {}", warning("ends in the air"));
    } else if log.ending.summary.marks.moved.is_some() && !log.is_sound() {
        // The box marks arming, take-off and landing.
        let _ = write!(text, "; {}", warning("ends armed or in the air"));
    }
    let lacks = log.soundness().words();
    if !lacks.is_empty() {
        // Another command judges other formats.
        let teller = if log.format.is_some() { "check says where" } else { "info --verify says why" };
        let _ = write!(text, "; {} (hums {teller})", warning(lacks));
    }
    [word(&log.ending.name).into_owned(), date, length, air, binary(bytes(log)), text]
}

fn found(log: &Overview) -> String {
    let Some(worst) = worst(log) else {
        let checked = log.contents.checked_by() != "nobody";
        return match log.contents.judged.filter(|_| log.contents.is_little()) {
            Some(checks) => format!("not enough to judge ({checks})"),
            None if checked => format!("{}", level("ok")),
            None => "not checked".to_owned(),
        };
    };
    format!("{}: {}", level(worst.level), word(&check_name(&worst.check, &[worst.instance])))
}

/// `None` if all is well.
fn worst(log: &Overview) -> Option<WorstJson> {
    let contents = &log.contents;
    let problems = problems(&contents.findings, contents.checked_by() == "board", []);
    let groups = grouped(&problems);
    let group = groups.first()?;
    let first = group.first()?;
    Some(WorstJson {
        level: if group.is_critical() { Level::Critical } else { Level::Warning }.name(),
        check: first.check.clone(),
        instance: first.instance,
        time_s: first.at.as_secs_f64(),
    })
}

fn start_utc_us(log: &Overview) -> Option<u64> {
    log.ending.summary.first.and_then(|first: Instant| log.utc_us(first))
}

fn bytes(log: &Overview) -> u64 {
    if log.format.is_some() { log.bytes_on_card } else { log.log_bytes() }
}

fn binary(bytes: u64) -> String {
    let (mut size, mut units) = (bytes as f64, ["KiB", "MiB", "GiB", "TiB"].iter());
    let mut unit = "B";
    while size >= 1024.0
        && let Some(next) = units.next()
    {
        (size, unit) = (size / 1024.0, next);
    }
    if unit == "B" { format!("{bytes} B") } else { format!("{size:.2} {unit}") }
}

/// Saturates: a log may have any number.
fn span(seconds: f64) -> Span {
    Span::from_micros((seconds * 1e6) as u64)
}

#[cfg(test)]
mod tests {
    use hums_core::health::Subsystem;
    use hums_core::usage::UsageCounter;

    use super::*;
    use crate::source::told::Finding;

    fn line(log: &Overview) -> String {
        table([row(log)].into_iter()).text()
    }

    fn finding(check: &str, level: &str, at_s: u64) -> Finding {
        Finding {
            at: Instant::from_millis(at_s * 1000),
            subsystem: Subsystem::Power,
            check: check.to_owned(),
            instance: 0,
            level: Level::ALL.into_iter().find(|known| known.name() == level).expect("a level"),
            previous: Level::Ok,
            value: 1.0,
            worst: None,
            limit: 2.0,
            unit: String::new(),
        }
    }

    #[test]
    fn the_first_of_the_worst_level_counts_and_that_all_is_well_again_does_not() {
        let mut log = Overview::default();
        assert_eq!(found(&log), "not checked");
        log.contents.usage.insert(UsageCounter::Flight.name().to_owned(), 61.0);
        assert_eq!(found(&log), format!("{}", level("ok")));
        log.contents.findings = vec![
            finding("gps_satellites", "warning", 1),
            finding("cell_voltage", "critical", 2),
            finding("motor_loss", "critical", 3),
            finding("motor_loss", "ok", 4),
        ];
        assert_eq!(worst(&log).map(|worst| worst.time_s), Some(2.0));
        log.contents.findings.truncate(1);
        assert_eq!(worst(&log).map(|worst| worst.level), Some("warning"));
        log.contents.findings = vec![finding("cell_voltage", "ok", 2)];
        assert!(worst(&log).is_none());
    }

    #[test]
    fn a_mishap_comes_before_what_was_found_earlier_and_a_part_that_is_due_behind_all() {
        let mut log = Overview::default();
        let mishap = Finding { subsystem: Subsystem::Mishap, ..finding("tumbling", "critical", 9) };
        log.contents.findings = vec![
            finding("airframe_due", "critical", 1),
            finding("cell_voltage", "critical", 2),
            mishap,
            finding("gps_satellites", "warning", 1),
        ];
        let first = |log: &Overview| worst(log).map(|worst| worst.check);
        assert_eq!(first(&log).as_deref(), Some("tumbling"));
        log.contents.findings.remove(2);
        assert_eq!(first(&log).as_deref(), Some("cell_voltage"));
        log.contents.findings.remove(1);
        assert_eq!(first(&log).as_deref(), Some("airframe_due"));
    }

    #[test]
    fn a_later_log_of_a_power_on_was_in_the_air_for_what_was_counted_since_it_began() {
        let mut log = Overview::default();
        log.contents.usage.insert(UsageCounter::Flight.name().to_owned(), 526.0);
        log.contents.flight_before_s = Some(308.0);
        for (first, expected) in [(None, 526.0), (Some(0), 526.0), (Some(700), 218.0)] {
            log.ending.summary.first_number = first;
            assert_eq!(log.flight_s(), Some(expected), "{first:?}");
        }
    }

    #[test]
    fn why_a_log_is_not_whole_the_command_says_that_reads_it() {
        let told = |format| {
            let mut log = Overview { format, ..Overview::default() };
            (log.ending.summary.gaps, log.ending.summary.session) = (1, Some(7));
            line(&log)
        };
        assert!(told(Some(Format::DataFlash)).contains("(hums check says where)"));
        assert!(told(None).contains("(hums info --verify says why)"));
    }

    #[test]
    fn a_time_in_the_air_that_was_stored_before_the_records_end_says_so() {
        let mut log = Overview::default();
        log.contents.usage.insert(UsageCounter::Flight.name().to_owned(), 192.0);
        log.contents.usage_at = Some(Instant::from_millis(240_000));
        log.ending.summary.last = Some(Instant::from_millis(244_700));
        assert!(line(&log).contains("   3:12 "), "on the ground nothing is counted after that");
        log.ending.summary.marks.moved = Some(Instant::from_millis(40_000));
        assert!(line(&log).contains("  >3:12 "), "{}", line(&log));
        // Its log ended before the landing was known.
        (log.ending.summary.marks.moved, log.ending.summary.marks.took_off) = (None, Some(true));
        assert!(line(&log).contains("  >3:12 "), "{}", line(&log));
        log.ending.summary.marks.took_off = Some(false);
        assert!(line(&log).contains("   3:12 "), "its landing is there");
    }

    #[test]
    fn what_is_missing_at_its_beginning_or_within_it_stands_in_its_line() {
        let mut log = Overview { format: Some(Format::Tlog), ..Overview::default() };
        (log.contents.begins_in_air, log.contents.is_lossy) = (true, true);
        let line = crate::colour::shown(&line(&log), false).into_owned();
        assert!(
            line.ends_with("; begins in the air; part of it was not recorded (hums check says where)"),
            "{line}"
        );
    }

    #[test]
    fn columns_stand_under_their_heading() {
        let text = line(&Overview::default());
        let (heading, line) = text.split_once('\n').expect("two lines");
        let end = |text: &str, of: &str| text.find(of).map(|at| at + of.len());
        assert_eq!(end(heading, "length"), end(line, "0:00"));
        assert_eq!(heading.find("worst"), line.find("not checked"));
    }
}
