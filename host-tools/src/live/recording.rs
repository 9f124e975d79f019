//! Sources of playback: any recording, or a HUMS log's session.

use std::io;
use std::path::Path;

use anyhow::{Result, bail};
use hums_core::clock::Instant;
use hums_link::Frame;

use super::native::{self, Entry, Native};
use super::told::MonitorRecord;
use crate::ending::Ending;
use crate::endpoint::Endpoint;
use crate::logs::groups::has_start;
use crate::outcome::usage;
use crate::source::find::find;
use crate::source::item::{Item, Needs, Stop};
use crate::source::recording::{LogPlace, Recording};

const LISTED_MAX: usize = 12;

/// An input, found good.
pub struct OpenedInput {
    /// Its name.
    pub name: String,
    recording: Option<Recording>,
    /// Its place, if it has no frames.
    native: Option<LogPlace>,
    is_of_box: bool,
}

impl OpenedInput {
    /// Recorded by a box, on the autopilot's own wire.
    pub fn is_of_box(&self) -> bool {
        self.is_of_box
    }

    /// Read again to be played.
    pub fn native(&self) -> Option<Native> {
        self.native.clone().map(Native::new)
    }
}

/// The newest session, or the one of this name.
pub fn open(endpoint: &Endpoint, session: Option<&str>) -> Result<OpenedInput> {
    let place = match endpoint {
        Endpoint::File(path) => chosen(path, session)?,
        _ => LogPlace::standard(),
    };
    if session.is_some() && place.own().is_none() {
        return Err(usage(format!("--session is for a log, a card or a folder, and {endpoint} is none")));
    }
    let recording = place.open()?;
    let native = (!recording.format.is_of_link()).then(|| place.clone());
    if native.is_some() && place.is_standard() {
        bail!(
            "{endpoint}: is an {}, which is read several times to be played; give a file",
            recording.format.words()
        );
    }
    let name = match place.own() {
        Some(log) => format!("{endpoint}, session {}", log.name),
        None => endpoint.to_string(),
    };
    // A packed recording may be of any link.
    let is_of_box = place.own().is_some_and(has_start);
    Ok(OpenedInput { name, recording: Some(recording), native, is_of_box })
}

fn chosen(path: &Path, session: Option<&str>) -> Result<LogPlace> {
    let mut found = find(&[path.to_owned()], false)?;
    let names: Vec<String> = found.places.iter().map(|place| place.name.clone()).collect();
    let Some(newest) = names.last() else {
        bail!("{}: there is no log in it; name a log, a card or a recording", path.display())
    };
    let index = session.map(|name| found.session(name)).transpose()?.unwrap_or(names.len() - 1);
    if session.is_none() && names.len() > 1 {
        note!("{newest} is played, the newest; --session NAME plays another: {}", listed(&names));
    }
    Ok(found.places.swap_remove(index))
}

fn listed(names: &[String]) -> String {
    let shown: Vec<&str> = names.iter().rev().take(LISTED_MAX).map(String::as_str).collect();
    let more = names.len() - shown.len();
    let more = if more > 0 { format!(" and {more} older ones (hums info)") } else { String::new() };
    shown.join(", ") + &more
}

/// An item of a recording.
#[derive(Clone, Copy, Debug)]
pub enum Content<'a> {
    /// A frame.
    Frame(&'a Frame<'a>),
    /// An entry of an autopilot's own log.
    Entry(&'a Entry),
    /// Another report.
    Told(&'a MonitorRecord),
}

/// Time, UTC of time zero if known, part read (0 to 1), item. `false` ends the reading.
pub type ItemSink<'a> = dyn FnMut(Instant, Option<u64>, f64, Content<'_>) -> io::Result<bool> + 'a;

/// Reads once; returns the evidence of a log's end.
pub fn each(opened: &mut OpenedInput, take: &mut ItemSink<'_>) -> Result<Option<Ending>> {
    let Some(recording) = opened.recording.take() else { return Ok(None) };
    let progress = recording.progress.clone();
    let mut epoch_us = None;
    let want =
        if opened.native.is_some() { native::want() } else { Needs { frames: true, ..Needs::default() } };
    let native = opened.native.is_some();
    let summary = recording.read(want, &mut |at, item| {
        let entry = if native { Entry::of(at, &item) } else { None };
        let told = match item {
            Item::Record(record) => MonitorRecord::of(record),
            Item::Gap(gap) if !native => MonitorRecord::missing(gap),
            _ => None,
        };
        let content = match item {
            Item::Epoch(epoch) => {
                epoch_us = Some(epoch);
                return Ok(());
            }
            Item::Frame(frame) => Content::Frame(frame),
            Item::Record(_) | Item::Gap(_) if !native => match &told {
                Some(MonitorRecord::Checked | MonitorRecord::Peak { .. }) | None => return Ok(()),
                Some(told) => Content::Told(told),
            },
            // As the player counts them.
            _ => match &entry {
                Some(entry) => Content::Entry(entry),
                None => return Ok(()),
            },
        };
        if take(at, epoch_us, progress.part(), content)? { Ok(()) } else { Err(Stop.into()) }
    })?;
    Ok(summary.ending)
}
