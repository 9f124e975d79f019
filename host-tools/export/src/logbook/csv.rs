//! The logbook as CSV, which people continue.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{self, Write as _};
use std::path::Path;

use anyhow::{Context as _, Result, bail};

use super::{BY_HAND, Book, Life, LogbookEntry, Spot};
use crate::files::{Inputs, Output, make_parent, settle};
use crate::text::push_csv_text;
use crate::utc::TimePoint;

/// The columns of the recordings. The first one names a flight.
const COLUMNS: [&str; 18] = [
    "flight",
    "aircraft",
    "type",
    "firmware",
    "take_off_utc",
    "landing_utc",
    "duration_s",
    "take_off_latitude_deg",
    "take_off_longitude_deg",
    "landing_latitude_deg",
    "landing_longitude_deg",
    "charge_ah",
    "voltage_min_v",
    "total_flights",
    "total_hours",
    "incident",
    "defects",
    "record",
];

pub(super) fn merge(book: &mut Book, path: &Path) -> Result<()> {
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error).with_context(|| format!("{}: cannot be read", path.display())),
    };
    let rows = rows(text.trim_start_matches('\u{feff}'));
    let mut rows = rows.into_iter();
    let heading = rows.next().unwrap_or_default();
    if heading.first().map(String::as_str) != Some("flight") || !heading.iter().any(|name| name == "aircraft")
    {
        bail!("{}: exists and is no logbook of this command; name another output", path.display());
    }
    let mut names = BTreeSet::new();
    if let Some(name) = heading.iter().find(|name| !names.insert(name.as_str())) {
        bail!("{}: line 1 has two columns of the name `{name}`; rename or delete one", path.display());
    }
    let mut keys = BTreeSet::new();
    for (line, row) in (2..).zip(rows) {
        let cells: BTreeMap<&str, &str> =
            heading.iter().map(String::as_str).zip(row.iter().map(|cell| plain(cell))).collect();
        let cell = |name: &str| cells.get(name).copied().unwrap_or_default();
        if row.iter().all(String::is_empty) {
            continue;
        }
        if row.len() > heading.len() || cell("flight").is_empty() || cell("aircraft").is_empty() {
            bail!(
                "{}: line {line} has not the cells of a flight; mend it, or name another output",
                path.display()
            );
        }
        if !keys.insert(cell("flight").to_owned()) {
            let key = cell("flight");
            bail!(
                "{}: line {line}: the flight {key} is there twice; delete one of its lines",
                path.display()
            );
        }
        let is_of_people = |name: &&&str| !COLUMNS.contains(*name);
        let by_hand =
            cells.keys().filter(is_of_people).map(|name| ((*name).to_owned(), cell(name).to_owned()));
        let by_hand: BTreeMap<String, String> = by_hand.collect();
        let known = book.values_mut().flat_map(|aircraft| &mut aircraft.entries);
        if let Some(entry) = known.into_iter().find(|entry| entry.key == cell("flight")) {
            entry.add_by_hand(by_hand);
            continue;
        }
        let aircraft = book.entry(cell("aircraft").to_owned()).or_default();
        let entry = entry(&cell, by_hand).with_context(|| format!("{}: line {line}", path.display()))?;
        aircraft.entries.push(entry);
    }
    for aircraft in book.values_mut() {
        aircraft.entries.sort_by(|one, other| one.take_off.cmp(&other.take_off));
    }
    Ok(())
}

/// A flight of an earlier CSV. An error for a cell that would be lost.
fn entry<'a>(cell: &impl Fn(&str) -> &'a str, by_hand: BTreeMap<String, String>) -> Result<LogbookEntry> {
    let text = |name: &str| cell(name).to_owned();
    let some = |name: &str| Some(text(name)).filter(|text| !text.is_empty());
    let number = |name: &str| match cell(name) {
        "" => Ok(None),
        text => match text.replace(',', ".").parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Some(number)),
            _ => bail!("`{text}` in the column {name} is no number; mend it"),
        },
    };
    let spot = |name: &str| {
        let part = |axis: &str| number(&format!("{name}_{axis}_deg"));
        match (part("latitude")?, part("longitude")?) {
            (Some(latitude_deg), Some(longitude_deg)) => Ok(Some(Spot { latitude_deg, longitude_deg })),
            (None, None) => Ok(None),
            _ => bail!("the columns {name}_latitude_deg and {name}_longitude_deg need both numbers or none"),
        }
    };
    let duration_s = number("duration_s")?.unwrap_or(0.0);
    let end_us =
        |from: u64| utc_us(cell("landing_utc")).unwrap_or(from.saturating_add((duration_s * 1e6) as u64));
    Ok(LogbookEntry {
        key: text("flight"),
        aircraft: text("aircraft"),
        kind: text("type"),
        firmware: text("firmware"),
        take_off: some("take_off_utc"),
        landing: some("landing_utc"),
        duration_s,
        from: spot("take_off")?,
        to: spot("landing")?,
        charge_ah: number("charge_ah")?,
        voltage_min_v: number("voltage_min_v")?,
        incident: text("incident"),
        defects: text("defects"),
        record: text("record"),
        by_hand,
        span: None,
        utc_us: utc_us(cell("take_off_utc")).map(|from| (from, end_us(from))),
        known: None,
    })
}

/// Microseconds since 1970. A spreadsheet may write a time without its zone.
fn utc_us(text: &str) -> Option<u64> {
    match text.parse().or_else(|_| format!("{text}Z").parse()) {
        Ok(TimePoint::Utc(utc_us)) => Some(utc_us),
        _ => None,
    }
}

pub(super) fn write(book: &Book, path: &Path) -> Result<()> {
    let entries = || book.values().flat_map(|aircraft| &aircraft.entries);
    let mut by_hand: Vec<&str> = BY_HAND.to_vec();
    for name in entries().flat_map(|entry| entry.by_hand.keys()) {
        if !by_hand.contains(&name.as_str()) {
            by_hand.push(name);
        }
    }
    let mut text = Vec::new();
    line(&mut text, COLUMNS.iter().chain(&by_hand).map(|name| (*name).to_owned()));
    for aircraft in book.values() {
        let mut sum = Life { flights: 0.0, flight_s: 0.0 };
        for entry in &aircraft.entries {
            if entry.is_flight() {
                sum = Life { flights: sum.flights + 1.0, flight_s: sum.flight_s + entry.duration_s };
            }
            let cell = |name: &&str| entry.by_hand.get(*name).cloned().unwrap_or_default();
            line(&mut text, cells(entry, sum).into_iter().chain(by_hand.iter().map(cell)));
        }
    }
    make_parent(path)?;
    // The rows of the existing file are in the new one.
    let mut output = Output::create(path, &Inputs::none().forcing(true))?;
    settle(output.write_all(&text), path)?;
    output.finish()
}

fn cells(entry: &LogbookEntry, sum: Life) -> [String; COLUMNS.len()] {
    let number = |value: Option<f64>, decimals: usize| {
        value.map_or_else(String::new, |value| format!("{value:.decimals$}"))
    };
    let text = |text: &Option<String>| text.clone().unwrap_or_default();
    [
        entry.key.clone(),
        entry.aircraft.clone(),
        entry.kind.clone(),
        entry.firmware.clone(),
        text(&entry.take_off),
        text(&entry.landing),
        number(Some(entry.duration_s), 3),
        number(entry.from.map(|spot| spot.latitude_deg), 7),
        number(entry.from.map(|spot| spot.longitude_deg), 7),
        number(entry.to.map(|spot| spot.latitude_deg), 7),
        number(entry.to.map(|spot| spot.longitude_deg), 7),
        number(entry.charge_ah, 3),
        number(entry.voltage_min_v, 2),
        number(Some(sum.flights), 0),
        number(Some(sum.flight_s / 3600.0), 4),
        entry.incident.clone(),
        entry.defects.clone(),
        entry.record.clone(),
    ]
}

fn line(text: &mut Vec<u8>, cells: impl Iterator<Item = String>) {
    for (index, cell) in cells.enumerate() {
        if index > 0 {
            text.push(b',');
        }
        // A number is no formula.
        if cell.parse::<f64>().is_ok() {
            text.extend_from_slice(cell.as_bytes());
        } else {
            push_csv_text(text, cell.as_bytes());
        }
    }
    text.push(b'\n');
}

fn plain(cell: &str) -> &str {
    cell.strip_prefix('\'').unwrap_or(cell)
}

/// A table's cells, with the separator of its first line: a spreadsheet of another language writes `;`.
fn rows(text: &str) -> Vec<Vec<String>> {
    let heading = text.lines().next().unwrap_or_default();
    let separator =
        [',', ';', '\t'].into_iter().max_by_key(|sign| heading.matches(*sign).count()).unwrap_or(',');
    let (mut rows, mut row, mut cell, mut is_quoted) = (Vec::new(), Vec::new(), String::new(), false);
    let mut signs = text.chars().peekable();
    while let Some(sign) = signs.next() {
        match sign {
            '"' if is_quoted && signs.peek() == Some(&'"') => {
                signs.next();
                cell.push('"');
            }
            '"' if is_quoted || cell.is_empty() => is_quoted = !is_quoted,
            _ if is_quoted => cell.push(sign),
            '\r' => {}
            '\n' => {
                row.push(std::mem::take(&mut cell));
                rows.push(std::mem::take(&mut row));
            }
            _ if sign == separator => row.push(std::mem::take(&mut cell)),
            _ => cell.push(sign),
        }
    }
    if !cell.is_empty() || !row.is_empty() {
        row.push(cell);
        rows.push(row);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::super::Aircraft;
    use super::*;

    fn flight(key: &str, take_off: &str) -> LogbookEntry {
        LogbookEntry {
            key: key.to_owned(),
            aircraft: "uid-1".to_owned(),
            take_off: Some(take_off.to_owned()),
            duration_s: 1800.0,
            from: Some(Spot { latitude_deg: 51.5, longitude_deg: -0.25 }),
            defects: "critical: battery 1 cell low: 3.4 V; more, \"and\" so on".to_owned(),
            ..LogbookEntry::default()
        }
    }

    fn book(entries: Vec<LogbookEntry>) -> Book {
        Book::from([("uid-1".to_owned(), Aircraft { entries, ..Aircraft::default() })])
    }

    #[test]
    fn cells_of_people_and_earlier_flights_stay() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("logbook.csv");
        let mut first = flight("s1-1", "2026-05-01T10:00:00Z");
        let said = ["A. Pilot", "=not a formula", "two\nlines, \"quoted\"; and 'more'", "-5", "'apostrophe"];
        for (name, said) in BY_HAND[1..].iter().zip(said) {
            first.by_hand.insert((*name).to_owned(), said.to_owned());
        }
        first.by_hand.insert("own column".to_owned(), "7,5".to_owned());
        write(&book(vec![first.clone()]), &path).expect("written");
        for separator in [",", ";"] {
            if separator == ";" {
                let quoted = |row: Vec<String>| {
                    let cells: Vec<String> =
                        row.iter().map(|cell| format!("\"{}\"", cell.replace('"', "\"\""))).collect();
                    cells.join(";") + "\r\n"
                };
                let text = fs::read_to_string(&path).expect("text");
                let text: String = rows(&text).into_iter().map(quoted).collect();
                fs::write(&path, format!("\u{feff}{text}")).expect("written");
            }
            let mut next = book(vec![flight("s2-1", "2026-05-02T10:00:00Z")]);
            merge(&mut next, &path).expect("merged");
            let entries = &next["uid-1"].entries;
            assert_eq!(entries.iter().map(|entry| entry.key.as_str()).collect::<Vec<_>>(), ["s1-1", "s2-1"]);
            for (name, said) in &first.by_hand {
                assert_eq!(entries[0].by_hand.get(name), Some(said), "{name} {separator}");
            }
            assert_eq!((entries[0].from, &entries[0].defects), (first.from, &first.defects));
            // Made again from the first card: the same once.
            let mut again = book(vec![flight("s1-1", "2026-05-01T10:00:00Z")]);
            merge(&mut again, &path).expect("merged");
            assert_eq!(again["uid-1"].entries.len(), 1);
            assert_eq!(again["uid-1"].entries[0].by_hand.get("pilot").map(String::as_str), Some("A. Pilot"));
        }
    }

    #[test]
    fn a_flight_of_an_earlier_call_counts_once() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("logbook.csv");
        let live = |key: &str, second: u64, duration_s: f64, by_hand: &[(&str, &str)]| {
            let from_us = 1_795_256_000_000_000 + second * 1_000_000;
            let to_us = from_us + (duration_s * 1e6) as u64;
            LogbookEntry {
                take_off: Some(crate::utc::iso8601(from_us)),
                landing: Some(crate::utc::iso8601(to_us)),
                duration_s,
                utc_us: Some((from_us, to_us)),
                by_hand: by_hand
                    .iter()
                    .map(|(name, cell)| ((*name).to_owned(), (*cell).to_owned()))
                    .collect(),
                ..flight(key, "")
            }
        };
        // Also a record that ends in the air, and times that a spreadsheet wrote.
        for (open, zone) in [(false, "Z"), (true, "Z"), (false, "")] {
            for longer in [100.0, 300.0] {
                let mut ground = live("r1-1", 10, 200.0, &[("pilot", "A. Pilot"), ("remarks", "one")]);
                if open {
                    ground.landing = None;
                }
                let next = live("r1-2", 5000, 60.0, &[]);
                write(&book(vec![ground, next]), &path).expect("written");
                let text = fs::read_to_string(&path).expect("text").replace("Z,", &format!("{zone},"));
                fs::write(&path, text).expect("written");
                for _ in 0..2 {
                    let mut card = book(vec![live("s2-1", 0, longer, &[])]);
                    merge(&mut card, &path).expect("merged");
                    let entries = &mut card.get_mut("uid-1").expect("there").entries;
                    super::super::count_once(entries);
                    let keys: Vec<&str> = entries.iter().map(|entry| entry.key.as_str()).collect();
                    assert_eq!(
                        keys,
                        [if longer > 200.0 { "s2-1" } else { "r1-1" }, "r1-2"],
                        "{open} {zone:?}"
                    );
                    assert_eq!(entries[0].by_hand["pilot"], "A. Pilot");
                    assert_eq!(entries[0].by_hand["remarks"], "one");
                    write(&card, &path).expect("written");
                }
            }
        }
    }

    #[test]
    fn cells_that_would_be_lost_are_refused_with_their_line() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("logbook.csv");
        for (text, said) in [
            ("flight,aircraft,,\ns1-1,uid-1,a,b\n", "line 1"),
            ("flight,aircraft,own,own\ns1-1,uid-1,a,b\n", "line 1"),
            ("flight,aircraft,own\ns1-1,uid-1,a\ns2-1,uid-1,b\ns1-1,uid-1,c\n", "line 4"),
            ("flight,aircraft,duration_s\ns1-1,uid-1,\"1.234,5\"\n", "line 2"),
            ("flight,aircraft,charge_ah\ns1-1,uid-1,nan\n", "line 2"),
            ("flight,aircraft,landing_latitude_deg\ns1-1,uid-1,north\n", "line 2"),
            ("flight,aircraft,landing_latitude_deg\ns1-1,uid-1,51.5\n", "line 2"),
        ] {
            fs::write(&path, text).expect("written");
            let error = format!("{:#}", merge(&mut Book::new(), &path).expect_err(text));
            assert!(error.contains(said), "{text}: {error}");
        }
    }

    #[test]
    fn a_file_that_is_no_logbook_is_refused() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("mine.csv");
        for text in ["a,b\n1,2\n", "", "flight,aircraft\n,uid-1\n", "flight,aircraft\ns1-1,uid-1,3\n"] {
            fs::write(&path, text).expect("written");
            merge(&mut Book::new(), &path).expect_err(text);
        }
    }
}
