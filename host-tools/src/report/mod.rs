//! `hums report`: one page for each session, whole in itself: no network, no file beside it.
//!
//! [`replay`] reads the log in order: what the vehicle told becomes a history as `hums live` has it ([`crate::page`]),
//! bounded, so that a page of hours stays below a few megabytes; [`flights`] finds flights with the firmware's own rules; [`trend`] compares with
//! the sessions before on the same card; [`page`] puts all of it, as JSON, beside the program that draws it.
//!
//! Nothing that a vehicle sent becomes markup: text goes into the page as data, and only as text onto it. The page's
//! own policy lets no other script run and loads nothing.

pub mod causes;
pub mod flights;
pub mod page;
pub mod replay;
pub mod trend;

use std::io::Write as _;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use serde::Serialize;

use crate::check;
use crate::cli;
use crate::decode::naming::{Named, Names, Traits, without_made};
use crate::files::{Inputs, Output, appended, make_parent, says_directory, settle};
use crate::followed::{Followed, HELD_MAX};
use crate::logs::sessions::Sessions;
use crate::logs::side_by_side::side_by_side;
use crate::logs::{Log, segment_name};
use crate::outcome::{Kept, Outcome, usage};
use crate::output::{self, Schema};
use crate::plural::count;
use crate::printable::{path as shown, word};
use crate::source::find::{find, sessions_of};
use crate::source::recording::Place;
use crate::summary::Overview;

/// What `hums report --json` prints.
const SCHEMA: Schema = Schema::first("hums-report");

/// The pages that were written.
#[derive(Debug, Default, Serialize)]
struct PagesJson {
    pages: Vec<PageJson>,
}

#[derive(Debug, Serialize)]
struct PageJson {
    path: PathBuf,
    session: String,
    bytes: u64,
}

/// Runs `hums report`.
pub fn run(args: &cli::Report) -> Result<Outcome> {
    let (given, remarks) = without_made(&args.inputs);
    let found = find(&given, false)?.of_system(args.system)?;
    for remark in remarks.iter().chain(&found.remarks) {
        note!("{remark}");
    }
    for image in found.images.iter().filter(|image| !image.damage.is_empty()) {
        note!("{}: {}", image.path.display(), image.damage.join("; "));
    }
    let mut outcome = Outcome::lossy(found.is_lossy());
    if let Some(place) = found.places.iter().find(|place| place.is_standard()) {
        bail!("{}: is read twice for a page; give a file", place.title)
    }
    let sessions = sessions_of(&found.places);
    let wanted = wanted(args, &found.places, &sessions)?;
    let inputs = Inputs::of(given.iter().map(PathBuf::as_path).chain(found.paths())).replacing(args.replace);
    inputs.refuse(&args.output)?;
    // Of each session only what later ones are compared with is kept.
    let mut earlier: Vec<Option<trend::Session>> = Vec::new();
    let (mut kept, mut pages) = (Kept::default(), PagesJson::default());
    // The next start on the card tells how a session ended.
    let end = found.places.len().min(*wanted.sessions.end() + 1 + HELD_MAX);
    let mut followed = Followed::new(sessions);
    let mut names = Names::default();
    let mut done = |overview: Overview| {
        let (index, this) = (earlier.len(), trend::Session::of(&overview));
        if let Some(place) = found.places.get(index).filter(|_| wanted.sessions.contains(&index)) {
            let on_card =
                earlier.iter().zip(&found.places).filter(|(_, other)| are_of_one_card(place, other));
            let before: Vec<trend::Session> = on_card.filter_map(|(session, _)| session.clone()).collect();
            let traits = Traits::of(place)?;
            let original = overview.ending.again.as_deref();
            let original = original.and_then(|of| found.places.iter().position(|place| place.name == of));
            let named = match original.filter(|of| wanted.sessions.contains(of)) {
                Some(of) => Named::Copy(of),
                None => names.name(index, place, &traits),
            };
            match named {
                Named::Copy(of) => {
                    let of = found.places.get(of).map_or("another log", |place| &place.name);
                    note!("{}: is a copy of {of}, whose page is written once", place.name);
                }
                Named::As(name, _) => {
                    let trend = trend::of(&this, &before);
                    pages.add(
                        kept.pass(make(place, &overview, &trend, wanted.path(&name), &inputs))?,
                        args.json,
                    )?;
                }
            }
        }
        // Also of the sessions before, which the page compares with, and of those that were read for its end.
        for why in overview.ending.aside().into_iter().chain(overview.faults()) {
            note!("{}: {why}", overview.ending.name);
        }
        outcome = outcome.and(Outcome::lossy(!overview.is_sound()));
        // A session that is there twice counts once, and what a file held before is older than its name says.
        let counts = overview.ending.is_counted() && overview.ending.begun_anew.is_none();
        earlier.push(counts.then_some(this));
        Ok(())
    };
    side_by_side(found.places.get(..end).unwrap_or_default(), check::overview, |overview| {
        followed.push(overview?).into_iter().try_for_each(&mut done)
    })?;
    followed.finish().try_for_each(&mut done)?;
    if *wanted.sessions.start() > 0 && args.session.is_none() {
        note!(
            "this is the last one of {}; -o DIR/ writes a page for each, --session NAME one of them",
            found.places.len()
        );
    }
    pages.end(args.json)?;
    kept.end()?;
    Ok(outcome)
}

impl PagesJson {
    /// A page was written, or was kept as it is.
    fn add(&mut self, page: Option<PageJson>, json: bool) -> Result<()> {
        if !json {
            page.iter().try_for_each(PageJson::tell)?;
        }
        self.pages.extend(page);
        Ok(())
    }

    fn end(&self, json: bool) -> Result<()> {
        if json { output::json(SCHEMA, self) } else { Ok(()) }
    }
}

impl PageJson {
    fn tell(&self) -> Result<()> {
        let bytes = count(self.bytes, "byte");
        output::line(&format!("{}: session {}, {bytes}", shown(&self.path), word(&self.session)))
    }
}

/// Whether two sessions are of one card: in one image, or segments in one folder. Then one box recorded them. What lies
/// beside a recording or a packed log may be anybody's.
fn are_of_one_card(one: &Place, other: &Place) -> bool {
    let Some((one, other)) = one.own().zip(other.own()) else { return false };
    let image = |log: &Log| log.pieces.first().map(|piece| piece.path.clone());
    let folder = |log: &Log| {
        let first = log.pieces.first().map(|piece| piece.path.as_path())?;
        Some((segment_name(first)?.recorder().to_owned(), first.parent()?.to_owned()))
    };
    image(one) == image(other) || folder(one).is_some() && folder(one) == folder(other)
}

/// Makes the page of a session.
fn make(
    place: &Place,
    overview: &Overview,
    trend: &trend::Trend,
    path: PathBuf,
    inputs: &Inputs,
) -> Result<PageJson> {
    let html = page::html(overview, &replay::Replay::of(place, overview)?, trend)?;
    write(&path, &html, inputs)?;
    Ok(PageJson { path, session: place.name.clone(), bytes: html.len() as u64 })
}

fn write(path: &Path, html: &str, inputs: &Inputs) -> Result<()> {
    inputs.refuse(path)?;
    make_parent(path)?;
    let mut file = Output::create(path, inputs)?;
    settle(file.write_all(html.as_bytes()), path)?;
    file.finish()
}

/// Which sessions get a page, and where.
struct Wanted {
    sessions: RangeInclusive<usize>,
    output: PathBuf,
    directory: bool,
}

fn wanted(args: &cli::Report, logs: &[Place], sessions: &Sessions) -> Result<Wanted> {
    let Some(last) = logs.len().checked_sub(1) else {
        bail!("no log is in there, so there is nothing to report")
    };
    let directory = says_directory(&args.output);
    let sessions = match &args.session {
        Some(name) => {
            let Some(index) = logs.iter().position(|log| log.name == *name) else {
                let names: Vec<&str> = logs.iter().map(|log| log.name.as_str()).collect();
                return Err(usage(format!(
                    "--session {name}: there is no such session; there is {}",
                    names.join(", ")
                )));
            };
            index..=index
        }
        None if directory => 0..=last,
        None => {
            // What a file held that was to be written anew is not the last one, whatever its name says.
            let is_own = |log: &Place| sessions.begun_anew(&log.name).is_none();
            let last = logs.iter().rposition(is_own).unwrap_or(last);
            last..=last
        }
    };
    Ok(Wanted { sessions, output: args.output.clone(), directory })
}

impl Wanted {
    /// A page in a directory has the name that `hums decode` gives the session's files.
    fn path(&self, name: &str) -> PathBuf {
        if self.directory { appended(&self.output.join(name), "html") } else { self.output.clone() }
    }
}
