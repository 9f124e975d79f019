//! What can be played: a tlog or raw bytes (a file, or `-`, which is read to its end first), or a log of ours (a log
//! file, segments, a card's image or folder: one of its sessions).

use std::fs;
use std::io;
use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};
use hums_blackbox::{Entry, Gap};
use hums_core::time::Instant;
use hums_link::framer::Framer;
use hums_link::{Check, Frame};

use super::told::Told;
use crate::endpoint::Endpoint;
use crate::logs::reader::{Collect, Deliver, epoch, read};
use crate::logs::{self, Content, Log};
use crate::outcome::usage;
use crate::source::{self, Source, Timing};

/// Sessions that are named where one is to be chosen.
const LISTED_MAX: usize = 12;

/// An input, found good.
pub enum Opened {
    /// A recording, and its size in bytes where that is known.
    Stream(Box<dyn Source>, Option<u64>),
    /// A session of a log of ours.
    Log(Box<Log>),
}

/// Opens SRC, which is no live one; of several sessions the newest, or the one of this name.
pub fn open(endpoint: &Endpoint, session: Option<&str>) -> Result<Opened> {
    if let Endpoint::File(path) = endpoint
        && let Some(log) = chosen(path, session)?
    {
        return Ok(Opened::Log(Box::new(log)));
    }
    if session.is_some() {
        return Err(usage(format!("--session is for a log, a card or a folder, and {endpoint} is none")));
    }
    let bytes = match endpoint {
        Endpoint::File(path) => fs::metadata(path).ok().map(|metadata| metadata.len()),
        _ => None,
    };
    Ok(Opened::Stream(source::open(endpoint, Timing { line_rate: None })?, bytes))
}

/// The session to be played, where the path holds any.
fn chosen(path: &PathBuf, session: Option<&str>) -> Result<Option<Log>> {
    let metadata = fs::metadata(path).with_context(|| format!("{}: cannot be opened", path.display()))?;
    if metadata.is_file()
        && matches!(logs::find::look(path)?, Content::Mavlink | Content::Empty | Content::Other)
    {
        return Ok(None);
    }
    let mut logs = logs::find::find(std::slice::from_ref(path), false)?.logs;
    let names: Vec<String> = logs.iter().map(|log| log.name.clone()).collect();
    let Some(newest) = names.last() else { bail!("{}: there is no log in it", path.display()) };
    let wanted = session.unwrap_or(newest);
    let Some(index) = names.iter().position(|name| name == wanted) else {
        return Err(usage(format!("{} has no session {wanted}; it has {}", path.display(), listed(&names))));
    };
    if session.is_none() && names.len() > 1 {
        eprintln!("hums: {newest} is played, the newest; --session NAME plays another: {}", listed(&names));
    }
    Ok(Some(logs.swap_remove(index)))
}

/// Some names, the newest first.
fn listed(names: &[String]) -> String {
    let shown: Vec<&str> = names.iter().rev().take(LISTED_MAX).map(String::as_str).collect();
    let more = names.len() - shown.len();
    let more = if more > 0 { format!(" and {more} older ones (hums info)") } else { String::new() };
    shown.join(", ") + &more
}

/// What comes out of a recording.
#[derive(Clone, Copy, Debug)]
pub enum Heard<'a> {
    /// A frame.
    Frame(&'a Frame<'a>),
    /// What a log tells besides.
    Told(&'a Told),
}

/// What gets each of these: its time, UTC of time zero where that is known, how much has been read, 0 to 1, and what it
/// is. `false` ends the reading.
pub type Take<'a> = dyn FnMut(Instant, Option<u64>, f64, Heard<'_>) -> io::Result<bool> + 'a;

/// Reads it from its beginning to its end.
pub fn each(opened: &mut Opened, take: &mut Take<'_>) -> Result<()> {
    match opened {
        Opened::Stream(source, bytes) => stream(source.as_mut(), *bytes, take),
        Opened::Log(log) => session(log, take),
    }
}

fn stream(source: &mut dyn Source, bytes: Option<u64>, take: &mut Take<'_>) -> Result<()> {
    let mut framer = Framer::new();
    let (mut seen, mut last, mut result) = (0_u64, Instant::ZERO, Ok(true));
    while let Some(chunk) = source.next()? {
        last = Instant::from_micros(chunk.at_us);
        seen += chunk.bytes.len() as u64;
        // A tlog has eight bytes of time for each frame; it is no more than a guess.
        let progress = bytes.map_or(0.0, |bytes| (seen as f64 / bytes.max(1) as f64).min(1.0));
        let epoch_us = source.utc_start_us();
        framer.push(&chunk.bytes, &mut |frame| {
            if matches!(result, Ok(true)) {
                result = take(last, epoch_us, progress, Heard::Frame(&frame));
            }
        });
        if !matches!(result, Ok(true)) {
            return result.map(|_| ()).map_err(Into::into);
        }
    }
    framer.idle(&mut |frame| {
        if matches!(result, Ok(true)) {
            result = take(last, source.utc_start_us(), 1.0, Heard::Frame(&frame));
        }
    });
    result?;
    Ok(())
}

/// A group's frames, and what else is told in it.
#[derive(Default)]
struct Collected {
    /// Time, what is told, and the frame that it comes before.
    told: Vec<(Instant, Told, usize)>,
    /// Time, check, and where it ends in `bytes`.
    frames: Vec<(Instant, Check, usize)>,
    bytes: Vec<u8>,
}

impl Collect for Collected {
    fn entry(&mut self, entry: &Entry<'_>) {
        match *entry {
            Entry::Frame { at, bytes, verified } => {
                let check = if verified { Check::Verified } else { Check::Unverified };
                self.bytes.extend_from_slice(bytes);
                self.frames.push((at, check, self.bytes.len()));
            }
            Entry::Record { at, record } => {
                let told = Told::of(&record);
                let told = told.filter(|told| matches!(told, Told::Parameter { .. } | Told::Part { .. }));
                self.told.extend(told.map(|told| (at, told, self.frames.len())));
            }
        }
    }
}

/// Hands frames on.
struct Hand<'a, 'b> {
    take: &'a mut Take<'b>,
    epoch_us: Option<u64>,
    blocks: f64,
    done: std::cell::Cell<u64>,
    /// Ctrl-C: the rest is not wanted.
    ended: bool,
}

impl Deliver<Collected> for Hand<'_, '_> {
    fn gap(&mut self, _: &Gap) -> Result<()> {
        Ok(())
    }

    fn group(&mut self, group: Collected) -> Result<()> {
        let (mut start, mut told) = (0, group.told.iter().peekable());
        for (number, (at, check, end)) in group.frames.into_iter().enumerate() {
            while let Some((at, what, _)) = told.next_if(|(.., before)| *before <= number) {
                self.hand(*at, Heard::Told(what))?;
            }
            let bytes = group.bytes.get(start..end).unwrap_or_default();
            start = end;
            if let Some(frame) = Frame::again(bytes, check) {
                self.hand(at, Heard::Frame(&frame))?;
            }
        }
        told.try_for_each(|(at, what, _)| self.hand(*at, Heard::Told(what)))
    }
}

impl Hand<'_, '_> {
    fn hand(&mut self, at: Instant, heard: Heard<'_>) -> Result<()> {
        if !self.ended {
            let progress = (self.done.get() as f64 / self.blocks).min(1.0);
            self.ended = !(self.take)(at, self.epoch_us, progress, heard)?;
        }
        Ok(())
    }
}

fn session(log: &Log, take: &mut Take<'_>) -> Result<()> {
    let blocks = (log.bytes() / hums_blackbox::SECTOR_BYTES as u64).max(1) as f64;
    let mut hand = Hand { take, epoch_us: epoch(log)?, blocks, done: std::cell::Cell::new(0), ended: false };
    read(log, Collected::default, &mut hand, |_| ())?;
    Ok(())
}
