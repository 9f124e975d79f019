//! `hums logbook`: the flights of aircraft, with their batteries, parts and defects.
//!
//! The fields are those of the UK CAA's AMC1 UAS.SPEC.050(1)(g), as far as a recording knows them. People fill in the
//! others in the CSV. A CSV that exists is continued: its flights and the cells of people stay.

mod csv;
mod gutma;
mod page;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Result, bail};
use hums_analysis::log_json::vehicle;
use hums_analysis::order::{self, LogTime};
use hums_core::clock::Instant;
use hums_core::health::{Level, Subsystem};
use hums_core::usage::UsageCounter;

use crate::args::Logbook;
use crate::check::problem::Problem;
use crate::check::text::sentence;
use crate::checked::problems_of;
use crate::files::says_directory;
use crate::identity::{Preview, RecordingContent, identity};
use crate::logs::side_by_side::side_by_side;
use crate::naming::LogFileName;
use crate::outcome::{Outcome, usage as usage_error};
use crate::output;
use crate::plural::count;
use crate::printable::word;
use crate::source::find::{find, sessions_of};
use crate::utc::iso8601;
use crate::wear::{PartLine, parts_of};
use crate::works::works;

pub(crate) const BY_HAND: [&str; 6] =
    ["aircraft_details", "pilot", "activity", "pre_flight_inspection", "rectification", "remarks"];

/// A place over ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spot {
    pub(crate) latitude_deg: f64,
    pub(crate) longitude_deg: f64,
}

/// A flight, or a session with defects alone.
#[derive(Clone, Debug, Default)]
pub(crate) struct LogbookEntry {
    /// The recording's name, and the flight's number in it from 1; 0 without a flight.
    pub(crate) key: String,
    pub(crate) aircraft: String,
    pub(crate) kind: String,
    pub(crate) firmware: String,
    pub(crate) take_off: Option<String>,
    pub(crate) landing: Option<String>,
    pub(crate) duration_s: f64,
    pub(crate) from: Option<Spot>,
    pub(crate) to: Option<Spot>,
    pub(crate) charge_ah: Option<f64>,
    pub(crate) voltage_min_v: Option<f64>,
    pub(crate) incident: String,
    pub(crate) defects: String,
    pub(crate) record: String,
    pub(crate) by_hand: BTreeMap<String, String>,
    /// Times of it in the recording; `None` from an earlier CSV.
    pub(crate) span: Option<(Instant, Instant)>,
    /// Take-off and landing, or the end of the record, in microseconds since 1970, if known.
    pub(crate) utc_us: Option<(u64, u64)>,
    /// The recording, if the output needs its tracks.
    pub(crate) known: Option<Arc<Preview>>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Life {
    pub(crate) flights: f64,
    pub(crate) flight_s: f64,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Aircraft {
    pub(crate) entries: Vec<LogbookEntry>,
    pub(crate) parts: Vec<PartLine>,
    pub(crate) life: Option<Life>,
}

impl Aircraft {
    pub(crate) fn totals(&self) -> Life {
        let flights = self.entries.iter().filter(|entry| entry.is_flight());
        flights.fold(Life { flights: 0.0, flight_s: 0.0 }, |sum, entry| Life {
            flights: sum.flights + 1.0,
            flight_s: sum.flight_s + entry.duration_s,
        })
    }
}

impl LogbookEntry {
    pub(crate) fn is_flight(&self) -> bool {
        !self.key.ends_with("-0")
    }

    fn recording(&self) -> &str {
        self.key.rsplit_once('-').map_or(&self.key, |(recording, _)| recording)
    }

    fn add_by_hand(&mut self, cells: BTreeMap<String, String>) {
        for (name, cell) in cells {
            let own = self.by_hand.entry(name).or_default();
            if own.is_empty() {
                *own = cell;
            } else if !cell.is_empty() && *own != cell {
                *own = format!("{own}; {cell}");
            }
        }
    }
}

pub(crate) type Book = BTreeMap<String, Aircraft>;

/// Runs `hums logbook`.
pub fn run(args: &Logbook) -> Result<Outcome> {
    let found = find(&args.inputs, false)?;
    let mut remarks = found.remarks.clone();
    let inputs = found.with_inputs(&args.inputs).forcing(args.force);
    args.output.iter().try_for_each(|path| inputs.refuse(path))?;
    let forms = args.output.iter().map(|path| Ok((Form::of(path)?, path.as_path())));
    let forms = forms.collect::<Result<Vec<_>>>()?;
    let sessions = sessions_of(&found.places);
    let works = works(&found.places, &sessions)?;
    let mut outcome = Outcome::lossy(found.is_lossy());
    let has_tracks = forms.iter().any(|(form, _)| *form == Form::Gutma);
    let (mut read, mut order) = (BTreeMap::<String, (usize, Session)>::new(), 0..);
    side_by_side(
        &works,
        |work| match &work.named {
            LogFileName::As(..) => {
                let known = identity(work.log, &work.traits, false, args.vehicle.as_deref())?;
                Ok(Some(Session::of(known, has_tracks)))
            }
            LogFileName::Copy(_) => Ok(None),
        },
        |session: Result<Option<Session>>| {
            let Some(session) = session? else { return Ok(()) };
            outcome = outcome.and(Outcome::lossy(!session.is_sound));
            let recording = session.recording.clone();
            let is_longer = read.get(&recording).is_none_or(|(_, other)| other.frames < session.frames);
            let place = order.next().unwrap_or_default();
            if is_longer {
                read.insert(recording, (place, session));
            } else {
                remarks.push(format!("{recording}: is there twice, and is counted once"));
            }
            Ok(())
        },
    )?;
    for remark in &remarks {
        note!("{remark}");
    }
    let mut sessions: Vec<(usize, Session)> = read.into_values().collect();
    sessions.sort_by_key(|(place, _)| *place);
    let mut book = book(sessions.into_iter().map(|(_, session)| session));
    for (_, path) in forms.iter().filter(|(form, _)| *form == Form::Csv) {
        csv::merge(&mut book, path)?;
    }
    // A system id is no proof that two flights at once are of one aircraft.
    for (_, aircraft) in book.iter_mut().filter(|(name, _)| name.starts_with("uid-")) {
        for (once, again) in count_once(&mut aircraft.entries) {
            note!("{again}: is the flight of {once}, by another recorder; it is counted once");
        }
    }
    let flights: u64 = book.values().map(|aircraft| aircraft.totals().flights as u64).sum();
    if book.is_empty() {
        bail!("no flight was found, so nothing was written; `hums check` says what is in each log");
    }
    for (form, path) in forms {
        match form {
            Form::Csv => csv::write(&book, path)?,
            Form::Page => page::write(&book, path, &inputs)?,
            Form::Gutma => gutma::write(&book, path, &inputs)?,
        }
        let flights = count(flights, "flight");
        output::line(&word(&format!("{}: {} aircraft, {flights}", path.display(), book.len())))?;
    }
    Ok(outcome)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Csv,
    Page,
    Gutma,
}

impl Form {
    fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        match ending.as_deref() {
            _ if says_directory(path) => Ok(Self::Gutma),
            Some("csv") => Ok(Self::Csv),
            Some("html") => Ok(Self::Page),
            Some("json") => Ok(Self::Gutma),
            _ => Err(usage_error(format!(
                "-o {}: the ending says what to write: .html, .csv, .json (one flight), or a folder (a JSON file for each flight)",
                path.display()
            ))),
        }
    }
}

struct Session {
    recording: String,
    vehicle: String,
    is_sound: bool,
    frames: u64,
    time: LogTime,
    entries: Vec<LogbookEntry>,
    parts: Vec<PartLine>,
    life: Option<Life>,
}

impl Session {
    /// Of a recording. Its entries keep it only if the output needs its tracks, which take most of the memory.
    fn of(known: Preview, has_tracks: bool) -> Self {
        let (identity, about) = (&known.identity, &known.about);
        let overview = &about.overview;
        let counter = |counter: UsageCounter| overview.contents.lifetime.get(counter.name()).copied();
        let life = counter(UsageCounter::Flights).zip(counter(UsageCounter::Flight));
        let record = overview.file_name().unwrap_or_default();
        let mut session = Self {
            recording: identity.recording.clone(),
            vehicle: identity.vehicle.clone(),
            is_sound: overview.is_sound(),
            frames: overview.contents.frames(),
            time: LogTime::of(overview),
            entries: entries(&record, &known),
            parts: parts_of(&about.overview.contents),
            life: life.map(|(flights, flight_s)| Life { flights, flight_s }),
        };
        if has_tracks {
            let known = Arc::new(known);
            session.entries.iter_mut().for_each(|entry| entry.known = Some(known.clone()));
        }
        session
    }
}

fn book(sessions: impl Iterator<Item = Session>) -> Book {
    let sessions = sessions.map(|session| (session.time.clone(), session)).collect();
    let mut book = Book::new();
    for (_, session) in order::sort(sessions) {
        if session.entries.is_empty() && session.parts.is_empty() {
            continue;
        }
        let aircraft = book.entry(session.vehicle).or_default();
        aircraft.entries.extend(session.entries);
        if !session.parts.is_empty() {
            aircraft.parts = session.parts;
        }
        aircraft.life = session.life.or(aircraft.life);
    }
    book
}

fn kind(about: &RecordingContent) -> String {
    vehicle(&about.overview).map_or_else(String::new, |of| format!("{}, {}", of.r#type, of.autopilot))
}

fn entries(record: &str, known: &Preview) -> Vec<LogbookEntry> {
    let (identity, about) = (&known.identity, &known.about);
    let contents = &about.overview.contents;
    let summary = &about.overview.ending.summary;
    let last = summary.last.unwrap_or(Instant::ZERO);
    let flights = contents.flights();
    let problems = problems_of(contents);
    let is_told = |problem: &&Problem| matches!(problem.level, Level::Warning | Level::Critical);
    let problems: Vec<&Problem> = problems.iter().filter(is_told).collect();
    let machine = vehicle(&about.overview);
    let firmware = machine.and_then(|of| of.firmware).unwrap_or_default();
    let utc = |at: Instant| identity.epochs.utc_us(at).map(iso8601);
    let whole =
        |counter: UsageCounter| contents.usage.get(counter.name()).copied().filter(|_| flights.len() <= 1);
    let of_session = LogbookEntry {
        aircraft: identity.vehicle.clone(),
        kind: kind(about),
        firmware,
        charge_ah: whole(UsageCounter::Charge),
        voltage_min_v: whole(UsageCounter::VoltageMin),
        record: record.to_owned(),
        ..LogbookEntry::default()
    };
    // A problem belongs to the flight before whose end it began; one after the last flight to that.
    let ends: Vec<Instant> = flights.iter().map(|flight| flight.to.unwrap_or(last)).collect();
    let flight_of = |problem: &Problem| {
        ends.iter().position(|end| problem.at <= *end).unwrap_or(ends.len().saturating_sub(1))
    };
    let told = |mut entry: LogbookEntry, mine: &[&&Problem]| {
        let (incidents, defects): (Vec<_>, Vec<_>) =
            mine.iter().partition(|problem| problem.subsystem == Subsystem::Mishap);
        let words = |problems: Vec<&&&Problem>| {
            let words = |of: &&&&Problem| format!("{}: {}", of.level.name(), sentence(&[of]));
            problems.iter().map(words).collect::<Vec<_>>().join("; ")
        };
        (entry.incident, entry.defects) = (words(incidents), words(defects));
        entry
    };
    if flights.is_empty() {
        let key = format!("{}-0", identity.recording);
        let all: Vec<&&Problem> = problems.iter().collect();
        let entry = LogbookEntry { key, take_off: summary.first.and_then(utc), ..of_session };
        return if all.is_empty() { Vec::new() } else { vec![told(entry, &all)] };
    }
    let entry = |(index, flight): (usize, &crate::summary::FlightLine)| {
        let to = flight.to.unwrap_or(last);
        let entry = LogbookEntry {
            key: format!("{}-{}", identity.recording, index + 1),
            take_off: utc(flight.from),
            landing: flight.to.and_then(utc),
            duration_s: to.since(flight.from).as_micros() as f64 / 1e6,
            from: spot(about, flight.from),
            to: flight.to.and_then(|to| spot(about, to)),
            span: Some((flight.from, to)),
            utc_us: identity.epochs.utc_us(flight.from).zip(identity.epochs.utc_us(to)),
            ..of_session.clone()
        };
        let mine: Vec<&&Problem> = problems.iter().filter(|problem| flight_of(problem) == index).collect();
        let mut entry = told(entry, &mine);
        if flight.to.is_none() {
            let open = "the record ends in the air";
            let parts = [entry.incident.as_str(), open];
            entry.incident = parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ");
        }
        entry
    };
    flights.iter().enumerate().map(entry).collect()
}

/// Removes flights at the time of another flight of the same aircraft: two recorders recorded it. The longer record stays,
/// with the cells of people of both. Returns the names of each pair.
fn count_once(entries: &mut Vec<LogbookEntry>) -> Vec<(String, String)> {
    let mut pairs = Vec::new();
    let mut kept: Vec<LogbookEntry> = Vec::new();
    for mut entry in std::mem::take(entries) {
        let is_same = |other: &LogbookEntry| {
            entry.recording() != other.recording()
                && entry
                    .utc_us
                    .zip(other.utc_us)
                    .is_some_and(|((from, to), (begin, end))| from < end && begin < to)
        };
        match kept.iter().position(is_same).and_then(|index| kept.get_mut(index)) {
            Some(other) => {
                if other.duration_s < entry.duration_s {
                    std::mem::swap(other, &mut entry);
                }
                other.add_by_hand(entry.by_hand);
                pairs.push((other.key.clone(), entry.key));
            }
            None => kept.push(entry),
        }
    }
    *entries = kept;
    pairs
}

fn spot(about: &RecordingContent, at: Instant) -> Option<Spot> {
    let points = about.track.points();
    let after = points.partition_point(|point| point.at <= at);
    let point = points.get(after.saturating_sub(1))?;
    Some(Spot { latitude_deg: point.latitude_deg, longitude_deg: point.longitude_deg })
}

fn hours(seconds: f64) -> String {
    let minutes = (seconds / 60.0).round() as u64;
    format!("{}:{:02}", minutes / 60, minutes % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_that_two_recorders_recorded_counts_once() {
        let entry = |session: usize, from_s: u64, to_s: u64| LogbookEntry {
            key: format!("s{session}-{from_s}"),
            duration_s: (to_s - from_s) as f64,
            utc_us: Some((from_s * 1_000_000, to_s * 1_000_000)),
            ..LogbookEntry::default()
        };
        let mut entries = vec![entry(1, 100, 200), entry(2, 90, 201), entry(2, 300, 400), entry(1, 400, 500)];
        // Without the time of day nothing is known of it.
        entries.push(LogbookEntry { utc_us: None, ..entry(3, 100, 200) });
        let pairs = count_once(&mut entries);
        assert_eq!(pairs, [("s2-90".to_owned(), "s1-100".to_owned())]);
        let kept: Vec<&str> = entries.iter().map(|entry| entry.key.as_str()).collect();
        assert_eq!(kept, ["s2-90", "s2-300", "s1-400", "s3-100"]);
    }
}
