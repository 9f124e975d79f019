//! `hums check`: a flight's problems, from any log.
//!
//! [`judge`] runs the board's monitor over the stream; [`problem`] joins findings, [`flights`] the flights.
//! [`judged`](mod@judged) is printed by [`text`] and [`json`].

pub mod causes;
mod cells;
pub mod checked;
mod clock;
mod coverage;
mod details;
pub mod flights;
pub mod grouped;
pub mod json;
pub mod judge;
pub mod judged;
mod link_loss;
mod no_times;
mod overview;
pub mod past;
pub mod problem;
pub mod radio;
pub mod text;
pub mod trends;

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};

pub use clock::SETTLE;
pub use overview::{overview, overview_telling};

use crate::ending::Ending;
use crate::followed::{EndResolver, HasEnding};
use crate::logs::side_by_side::side_by_side;
use crate::outcome::{Outcome, Usage};
use crate::output;
use crate::params;
use crate::progress;
use crate::source::find::{find_each, sessions_of};
use crate::source::recording::{Format, LogPlace};
use checked::Checked;
use judge::{HeardAt, Limits};
use judged::Judgement;
use overview::Read;
use past::{EarlierFlights, Series};
use text::{Table, UnjudgedList};

/// The request of `hums check`.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Recordings, logs, cards, directories.
    pub inputs: &'a [PathBuf],
    /// Limits.
    pub params: Option<&'a Path>,
    /// Earlier flights.
    pub past: &'a [PathBuf],
    /// Only this session.
    pub session: Option<&'a str>,
    /// Only this vehicle.
    pub system: Option<u8>,
    /// Every block of an image.
    pub salvage: bool,
    /// Lists unjudged checks.
    pub verbose: bool,
    /// Print JSON.
    pub json: bool,
}

impl Request<'_> {
    const fn mention(&self) -> UnjudgedList {
        if self.verbose { UnjudgedList::Listed } else { UnjudgedList::Counted(" (-v lists them)") }
    }
}

/// Runs `hums check`.
pub fn run(args: &Request<'_>) -> Result<Outcome> {
    run_showing(args, |_| Ok(()))
}

/// `show` gets each log before it is printed.
pub fn run_showing(args: &Request<'_>, mut show: impl FnMut(&Checked) -> Result<()>) -> Result<Outcome> {
    let past = EarlierFlights::of(Limits::new(&params::read(args.params)?), args.past, args.system)?;
    let found = find_each(args.inputs, args.salvage)?.of_system(args.system)?;
    let wanted = found.name_of(args.session)?;
    found.tell();
    let mut failed = found.failed.len();
    let unread = |name: &str, error: &anyhow::Error| {
        if args.json {
            return output::json_line(&json::error(name, error));
        }
        note!("{error:#}");
        Ok(())
    };
    for (input, error) in &found.failed {
        unread(&input.display().to_string(), error)?;
    }
    let mut outcome = Outcome::lossy(found.is_lossy());
    let many = found.places.len() + failed > 1 && wanted.is_none();
    let (bar, mut table) = (progress::logs(found.places.len()), Table::default());
    let mut followed = EndResolver::new(sessions_of(&found.places));
    // The next log shows how this one ends.
    let is_beside = |of: &str| wanted.as_ref().is_some_and(|wanted| wanted != of);
    let mut series = Series::after(&past);
    let mut done = |Told { name, of, checked }: Told| match series.judge(checked) {
        _ if is_beside(&of) => Ok(()),
        Ok(checked) => {
            outcome = outcome.and(checked.outcome());
            show(&checked)?;
            let text = if args.json {
                json::line(&checked)?
            } else if many {
                table.add(&checked);
                text::line(&checked)
            } else {
                text::screen(&checked, args.mention())
            };
            bar.suspend(|| {
                checked.aside().iter().chain(&checked.faults()).for_each(|why| note!("{name}: {why}"));
                if args.json { output::json_line(&text) } else { output::line(text.trim_end()) }
            })
        }
        Err(error) if error.is::<Usage>() => Err(error),
        Err(error) => {
            failed += 1;
            if args.json || many { bar.suspend(|| unread(&name, &error)) } else { Err(error) }
        }
    };
    side_by_side(
        &found.places,
        |place| {
            let told_of = |place: &LogPlace| told(&past, place, !many);
            let told = told_of(place);
            let vehicles = told.vehicles(place);
            if vehicles.is_empty() { vec![told] } else { vehicles.iter().map(told_of).collect() }
        },
        |all| {
            bar.inc(1);
            all.into_iter().flat_map(|told| followed.push(told)).try_for_each(&mut done)
        },
    )?;
    followed.finish().try_for_each(&mut done)?;
    bar.finish_and_clear();
    if many && !args.json {
        output::line(&table.text(failed))?;
    }
    let all = args.inputs.len().max(found.places.len());
    match (failed, args.inputs) {
        (0, _) => Ok(outcome),
        (_, [input]) if !many => bail!("{}: could not be read", input.display()),
        (failed, _) => bail!("{failed} of {all} logs could not be read"),
    }
}

fn told(past: &EarlierFlights, place: &LogPlace, shows: bool) -> Told {
    let read = past.judge(place, HeardAt::Somewhere, shows).and_then(|read| {
        overview::is_heard(place, read.judged.vehicle().source.is_some())?;
        Ok(checked(place, read))
    });
    Told { name: place.title.clone(), of: place.name.clone(), checked: read }
}

/// A link's recording, once for each of several vehicles; empty for one. Of standard input, read once, one is judged.
fn vehicles(place: &LogPlace, format: Format, judged: &Judgement) -> Vec<LogPlace> {
    let is_of_several = place.system.is_none() && format.is_of_link() && judged.systems.len() > 1;
    let is_apart = is_of_several && place.path().is_some();
    if is_apart { judged.systems.iter().map(|system| place.of_system(*system)).collect() } else { Vec::new() }
}

/// A recording, once for each of its vehicles: those that `hums check` judges. An unreadable recording is returned as it is.
pub fn by_vehicle(place: &LogPlace) -> Vec<LogPlace> {
    let is_of_link = place.path().is_some() && place.open().is_ok_and(|open| open.format.is_of_link());
    let read = is_of_link.then(|| overview::judge(place, &Limits::default(), HeardAt::Somewhere, false));
    let read = read.and_then(Result::ok);
    let all = read.map(|read| vehicles(place, read.format, &read.judged)).unwrap_or_default();
    if all.is_empty() { vec![place.clone()] } else { all }
}

struct Told {
    name: String,
    of: String,
    checked: Result<Checked>,
}

impl Told {
    /// `place` is its recording.
    fn vehicles(&self, place: &LogPlace) -> Vec<LogPlace> {
        let checked = self.checked.as_ref().ok();
        checked.map_or_else(Vec::new, |checked| vehicles(place, checked.format, &checked.judged))
    }
}

impl HasEnding for Told {
    fn ending(&mut self) -> Option<&mut Ending> {
        self.checked.as_mut().ok()?.ending.as_mut()
    }
}

/// Judges one recording, as `hums check` does, and with the texts to the pilot: [`Judgement::told`].
pub fn recording(place: &LogPlace, limits: &Limits, heard: HeardAt) -> Result<Checked> {
    overview::judge_texts(place, limits, heard).map(|read| checked(place, read))
}

fn checked(place: &LogPlace, read: Read) -> Checked {
    let Read { format, judged, summary, .. } = read;
    let ending = summary.ending.map(|ending| Ending { name: place.name.clone(), ..ending });
    Checked { name: place.title.clone(), format, judged, ending }
}

#[cfg(test)]
mod tests;
