//! `hums report`: one self-contained page for each session, without further files. Only a page with `--map` asks a
//! network. A folder of pages has a table of them ([`index`]); flights are compared on a page of their own
//! ([`compare`]).
//!
//! [`replay`] reads the log in order. The vehicle's reports become a history as in `hums live`
//! ([`crate::page`]), bounded, so that a page of hours stays below a few megabytes. [`flights`] finds flights
//! with the firmware's own rules, and [`trend`] compares with the earlier sessions of the same card. [`page`]
//! puts all of it, as JSON, beside the program that draws it.
//!
//! The page's own policy blocks other scripts and all loading except the map's tiles.

pub mod compare;
pub mod fleet;
pub mod flights;
pub mod index;
pub mod page;
pub mod replay;
pub mod tiles;
pub mod trend;

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};
use std::io::Write as _;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use serde::Serialize;

use crate::check;
use crate::files::{Inputs, Output, appended, make_parent, says_directory, settle};
use crate::followed::{EndResolver, HELD_MAX};
use crate::logs::sessions::copy_words;
use crate::logs::side_by_side::side_by_side;
use crate::logs::{Log, segment_name};
use crate::naming::{LogFileName, Names, Traits};
use crate::outcome::{Outcome, or_skipped, usage};
use crate::output::{self, Schema};
use crate::plural::count;
use crate::printable::{path as shown, word};
use crate::source::find::{FoundRecordings, find, sessions_of};
use crate::source::recording::LogPlace;
use crate::summary::Overview;

/// Output of `hums report --json`.
const SCHEMA: Schema = Schema::first("hums-report");

#[derive(Debug, Default, Serialize)]
struct PagesJson {
    /// Written pages.
    pages: Vec<PageJson>,
    /// Paths of pages that exist, and were not overwritten.
    skipped: Vec<PathBuf>,
}

#[derive(Debug, Serialize)]
struct PageJson {
    path: PathBuf,
    /// `null` for a table of a folder and for a comparison.
    session: Option<String>,
    bytes: u64,
}

/// The request of `hums report`.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Recordings, logs, cards, or directories with such.
    pub inputs: &'a [PathBuf],
    /// The page, or a directory for a page a session.
    pub output: Option<&'a Path>,
    /// Only this session.
    pub session: Option<&'a str>,
    /// Show the last flights side by side.
    pub compare: bool,
    /// Only this vehicle.
    pub system: Option<u8>,
    /// Server of map tiles; without it a page asks for nothing.
    pub map: Option<&'a tiles::Tiles>,
    /// Replace pages that exist.
    pub force: bool,
    /// Print JSON.
    pub json: bool,
}

/// Takes a page: its path, its kind, its text. The inputs are not to be overwritten.
pub type PageSink<'a> = dyn FnMut(&Path, &PageKind<'_>, &str, &Inputs) -> Result<()> + 'a;

/// Runs `hums report`.
pub fn run(args: &Request<'_>) -> Result<Outcome> {
    run_into(args, &mut |path, _, html, inputs| write(path, html, inputs))
}

/// Runs `hums report`, and hands the pages to `put` instead of writing files.
pub fn run_into(args: &Request<'_>, put: &mut PageSink<'_>) -> Result<Outcome> {
    let output = &args.output.map_or_else(|| beside(args.inputs), |output| Ok(output.to_owned()))?;
    let mut found = find(args.inputs, false)?.of_system(args.system)?;
    found.tell();
    if let Some(place) = found.places.iter().find(|place| place.is_standard()) {
        bail!("{}: is read twice for a page; give a file", place.title)
    }
    let sessions = sessions_of(&found.places);
    if says_directory(output) && args.session.is_none() {
        let mut all = Vec::new();
        side_by_side(&found.places, check::by_vehicle, |vehicles| {
            all.extend(vehicles);
            Ok(())
        })?;
        found.places = all;
    }
    let wanted = wanted(args, output, &found)?;
    for place in &mut found.places {
        if let Some(system) = place.system {
            place.name = format!("{}, system {system}", place.name);
        }
    }
    if output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("pdf")) {
        return Err(usage(format!(
            "-o {}: a page is HTML: give it that name, and print it from a browser",
            shown(output)
        )));
    }
    let inputs = found.with_inputs(args.inputs).forcing(args.force);
    inputs.refuse(output)?;
    if wanted.directory {
        // Before any page is written. That of a session is refused by itself, when its name is known.
        inputs.refuse(&output.join(index::FILE))?;
    }
    // The next start on the card records how a session ended.
    let end = found.places.len().min(*wanted.sessions.end() + 1 + HELD_MAX);
    let mut followed = EndResolver::new(sessions);
    let mut making = Making {
        places: &found.places,
        inputs: &inputs,
        wanted: &wanted,
        earlier: Vec::new(),
        pages: BTreeMap::new(),
        rows: Vec::new(),
        table: Some(output).filter(|_| wanted.directory).and_then(|folder| index::Pages::of(folder)),
        names: BTreeMap::new(),
        outcome: Outcome::lossy(found.is_lossy()),
        parameters: None,
        json: args.json,
        tiles: args.map,
        made: PagesJson::default(),
        put,
    };
    side_by_side(found.places.get(..end).unwrap_or_default(), check::overview, |overview| {
        followed.push(overview?).into_iter().try_for_each(|overview| making.session(&overview))
    })?;
    followed.finish().try_for_each(|overview| making.session(&overview))?;
    if *wanted.sessions.start() > 0 && args.session.is_none() && !args.compare {
        note!(
            "this is the last one of {}; -o DIR/ writes a page for each, --session NAME one of them, --compare the flights side by side",
            found.places.len()
        );
    }
    making.end(args.compare)
}

fn beside(inputs: &[PathBuf]) -> Result<PathBuf> {
    let name =
        |input: &PathBuf| Some(PathBuf::from(input.file_name()?)).filter(|name| name != Path::new("-"));
    let Some((input, name)) =
        inputs.first().filter(|_| inputs.len() == 1).and_then(|input| Some((input, name(input)?)))
    else {
        return Err(usage(
            "-o is missing, and several inputs, or one without a name, name no page: say -o flight.html, or -o pages/ for a page of each flight",
        ));
    };
    if input.is_dir() {
        return Ok(appended(&input.with_file_name(name), "html"));
    }
    let is_packed = name.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
    let name = if is_packed { name.with_extension("") } else { name };
    Ok(input.with_file_name(name.with_extension("html")))
}

struct Making<'a> {
    places: &'a [LogPlace],
    inputs: &'a Inputs,
    wanted: &'a Wanted,
    earlier: Vec<Option<trend::Session>>,
    pages: BTreeMap<usize, String>,
    rows: Vec<index::Row>,
    /// The folder's table of earlier runs.
    table: Option<index::Pages>,
    /// By the system id of the vehicle, if a recording has several.
    names: BTreeMap<Option<u8>, Names>,
    outcome: Outcome,
    parameters: Option<(usize, Vec<(String, f64)>)>,
    json: bool,
    tiles: Option<&'a tiles::Tiles>,
    made: PagesJson,
    put: &'a mut PageSink<'a>,
}

impl Making<'_> {
    fn session(&mut self, overview: &Overview) -> Result<()> {
        let (index, this) = (self.earlier.len(), trend::Session::of(overview));
        let mut copy = None;
        let is_wanted = self.wanted.pages && self.wanted.sessions.contains(&index);
        if let Some(place) = self.places.get(index).filter(|_| is_wanted) {
            let traits = Traits::of(place)?;
            let original = overview.ending.again.as_deref();
            let original = original.and_then(|of| self.places.iter().position(|place| place.name == of));
            let named = match original.filter(|of| self.wanted.sessions.contains(of)) {
                Some(of) => LogFileName::Copy(of),
                None => self.names.entry(place.system).or_default().name(index, place, &traits),
            };
            match named {
                LogFileName::Copy(of) => copy = self.places.get(of).map(|place| copy_words(&place.name)),
                LogFileName::As(name, _) => {
                    let path = self.wanted.path(&of_vehicle(name, place.system));
                    let free = Output::check(&path, self.inputs);
                    // A single page that cannot be written is an error, as any output.
                    if self.wanted.sessions.end() <= self.wanted.sessions.start() {
                        free?;
                        self.page(index, place, overview, &this, &path)?;
                    } else if let Err(why) = or_skipped(free)? {
                        note!("{}: skipped: {why}", place.name);
                        let file = file_name(&path);
                        // An interrupted run writes pages and no table.
                        if !self.table.as_ref().is_some_and(|table| table.has(&file)) {
                            let overview = &without_folders(overview);
                            let replay = replay::Replay::of(place, overview)?;
                            self.rows.push(index::Row::new(file.clone(), overview, &replay));
                        }
                        self.pages.insert(index, file);
                        self.made.skipped.push(path);
                    } else {
                        self.page(index, place, overview, &this, &path)?;
                    }
                }
            }
        }
        // Also of the sessions before, which the page compares with, and of those that were read for its end.
        for why in copy.or_else(|| overview.ending.aside()).into_iter().chain(overview.faults()) {
            note!("{}: {why}", overview.ending.name);
        }
        self.outcome = self.outcome.and(Outcome::lossy(!overview.is_sound()));
        // A session that is there twice counts once.
        self.earlier.push(overview.ending.is_counted().then_some(this));
        Ok(())
    }

    fn page(
        &mut self,
        index: usize,
        place: &LogPlace,
        overview: &Overview,
        this: &trend::Session,
        path: &Path,
    ) -> Result<()> {
        let overview = &without_folders(overview);
        let on_card = self.earlier.iter().zip(self.places).filter(|(_, other)| are_of_one_card(place, other));
        let before: Vec<trend::Session> = on_card.filter_map(|(session, _)| session.clone()).collect();
        let trend = trend::of(this, &before);
        let last = self.last_flight(this)?;
        let replay = replay::Replay::of(place, overview)?;
        let html = page::html(overview, &replay, &trend, last.as_ref(), self.tiles);
        let file = file_name(path);
        self.parameters = Some((
            index,
            replay.history.last_parameters().map(|(name, value)| (name.to_owned(), value)).collect(),
        ));
        self.write(path, &html, &PageKind::Session(place), self.inputs)?;
        self.rows.push(index::Row::new(file.clone(), overview, &replay));
        self.pages.insert(index, file);
        Ok(())
    }

    fn last_flight(&mut self, this: &trend::Session) -> Result<Option<page::PreviousRecording>> {
        let is_before = |other: &trend::Session| {
            let is_later = this.start_utc().zip(other.start_utc()).is_some_and(|(this, other)| other > this);
            other.airframe.is_some() && other.airframe == this.airframe && !is_later
        };
        let earlier = self.earlier.iter().enumerate();
        let earlier = earlier.filter_map(|(index, other)| Some((index, other.as_ref()?)));
        let last = earlier
            .filter(|(_, other)| is_before(other))
            .max_by_key(|(index, other)| (other.start_utc(), *index));
        let Some((index, place)) = last.and_then(|(index, _)| Some((index, self.places.get(index)?))) else {
            return Ok(None);
        };
        let values = match self.parameters.take() {
            Some((known, values)) if known == index => values,
            _ => replay::parameters(place)?,
        };
        Ok((!values.is_empty()).then(|| page::PreviousRecording { name: place.name.clone(), values }))
    }

    fn write(&mut self, path: &Path, html: &str, what: &PageKind<'_>, inputs: &Inputs) -> Result<()> {
        (self.put)(path, what, html, inputs)?;
        let made = PageJson { path: path.to_owned(), session: what.session(), bytes: html.len() as u64 };
        if !self.json {
            output::line(&format!("{}: {what}, {}", shown(path), count(made.bytes, "byte")))?;
        }
        self.made.pages.push(made);
        Ok(())
    }

    fn end(mut self, compare: bool) -> Result<Outcome> {
        let comparisons = if compare { self.compare()? } else { Vec::new() };
        if self.wanted.directory {
            let folder = &self.wanted.output;
            let inputs = self.inputs_of_table();
            let pages =
                index::Pages { pages: std::mem::take(&mut self.rows), comparisons, ..Default::default() };
            let pages = pages.with(self.table.take().unwrap_or_default(), folder);
            let what = PageKind::Table(pages.pages.len());
            let path = folder.join(index::FILE);
            self.write(&path, &pages.html(), &what, &inputs)?;
        }
        if self.json {
            output::json(SCHEMA, &self.made)?;
        }
        Ok(self.outcome)
    }

    /// The program's own table and comparisons are replaced without a question.
    fn inputs_of_table(&self) -> Inputs {
        let inputs = self.inputs.clone();
        if self.table.is_some() { inputs.forcing(true) } else { inputs }
    }

    /// Compares the last flights: of each airframe in a folder, or of all in a file. Returns airframes and
    /// files.
    fn compare(&mut self) -> Result<Vec<(String, String)>> {
        let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        let known = self.earlier.iter().enumerate().take(*self.wanted.sessions.end() + 1);
        for (index, session) in known.filter_map(|(index, session)| Some((index, session.as_ref()?))) {
            let airframe = if self.wanted.directory { session.airframe.clone() } else { Some(String::new()) };
            if let Some(airframe) = airframe {
                groups.entry(airframe).or_default().push(index);
            }
        }
        let mut comparisons = Vec::new();
        for (airframe, mut sessions) in groups {
            // By their times; sessions without a time come first.
            let start = |index: &usize| {
                let session = self.earlier.get(*index).and_then(Option::as_ref);
                session.and_then(trend::Session::start_utc).map(str::to_owned)
            };
            sessions.sort_by_key(|index| (start(index), *index));
            let candidate = |index: &usize| {
                let page = self.pages.get(index).map(String::as_str);
                Some(compare::Candidate { place: self.places.get(*index)?, page })
            };
            let candidates: Vec<_> = sessions.iter().filter_map(candidate).collect();
            let Some(html) = compare::html(&candidates, self.tiles)? else { continue };
            let file = format!("compare-{airframe}.html");
            let path = if self.wanted.directory {
                self.wanted.output.join(&file)
            } else {
                self.wanted.output.clone()
            };
            self.write(&path, &html, &PageKind::Comparison, &self.inputs_of_table())?;
            comparisons.push((airframe, file));
        }
        if comparisons.is_empty() && !self.wanted.directory {
            bail!("fewer than two flights were found, so there is nothing to compare; name more logs");
        }
        Ok(comparisons)
    }
}

fn of_vehicle(name: String, system: Option<u8>) -> String {
    if let Some(system) = system { format!("{name}-system{system}") } else { name }
}

fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |file| file.to_string_lossy().into_owned())
}

/// The same with the names of files alone: a page is given to others, and this computer's folders are not.
fn without_folders(overview: &Overview) -> Overview {
    let mut overview = overview.clone();
    for file in &mut overview.ending.files {
        *file = file_name(Path::new(file));
    }
    overview
}

/// The kind of a page.
#[derive(Clone, Copy, Debug)]
pub enum PageKind<'a> {
    /// Of this recording.
    Session(&'a LogPlace),
    /// The table of this many pages.
    Table(usize),
    /// Of flights side by side.
    Comparison,
}

impl PageKind<'_> {
    fn session(&self) -> Option<String> {
        if let Self::Session(place) = self { Some(place.name.clone()) } else { None }
    }
}

impl Display for PageKind<'_> {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Session(place) => write!(formatter, "session {}", word(&place.name)),
            Self::Table(pages) => write!(formatter, "table of {}", count(*pages as u64, "page")),
            Self::Comparison => formatter.write_str("flights side by side"),
        }
    }
}

/// Whether two sessions are of one card, and so of one box: in one image, or segments in one folder. A
/// recording or a packed log may have any neighbours.
fn are_of_one_card(one: &LogPlace, other: &LogPlace) -> bool {
    let Some((one, other)) = one.own().zip(other.own()) else { return false };
    let image = |log: &Log| log.pieces.first().map(|piece| piece.path.clone());
    let folder = |log: &Log| {
        let first = log.pieces.first().map(|piece| piece.path.as_path())?;
        Some((segment_name(first)?.recorder().to_owned(), first.parent()?.to_owned()))
    };
    image(one) == image(other) || folder(one).is_some() && folder(one) == folder(other)
}

fn write(path: &Path, html: &str, inputs: &Inputs) -> Result<()> {
    inputs.refuse(path)?;
    make_parent(path)?;
    let mut file = Output::create(path, inputs)?;
    settle(file.write_all(html.as_bytes()), path)?;
    file.finish()
}

struct Wanted {
    sessions: RangeInclusive<usize>,
    output: PathBuf,
    directory: bool,
    /// A page a session, and not the comparison alone.
    pages: bool,
}

fn wanted(args: &Request<'_>, output: &Path, found: &FoundRecordings) -> Result<Wanted> {
    let logs = &found.places;
    let Some(last) = logs.len().checked_sub(1) else {
        bail!("no log was found, so there is nothing to report; name a log, a card or a folder")
    };
    let directory = says_directory(output);
    let sessions = match args.session {
        Some(name) => {
            let index = found.session(name)?;
            index..=index
        }
        None if directory => 0..=last,
        None => last..=last,
    };
    let pages = directory || !args.compare;
    Ok(Wanted { sessions, output: output.to_owned(), directory, pages })
}

impl Wanted {
    fn path(&self, name: &str) -> PathBuf {
        if self.directory { appended(&self.output.join(name), "html") } else { self.output.clone() }
    }
}
