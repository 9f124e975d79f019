//! What can be played: a tlog or raw bytes (a file, or `-`, which is read to its end first), or a log of ours (a log
//! file, segments, a card's image or folder: its newest session).

use std::fs;
use std::io;
use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};
use hums_blackbox::{Entry, Gap};
use hums_core::time::Instant;
use hums_link::framer::Framer;
use hums_link::{Check, Frame};

use crate::endpoint::Endpoint;
use crate::logs::reader::{Collect, Deliver, epoch, read};
use crate::logs::{self, Content, Log};
use crate::source::{self, Source, Timing};

/// An input, found good.
pub enum Opened {
    /// A recording, and its size in bytes where that is known.
    Stream(Box<dyn Source>, Option<u64>),
    /// A session of a log of ours.
    Log(Box<Log>),
}

/// Opens SRC, which is no live one.
pub fn open(endpoint: &Endpoint) -> Result<Opened> {
    if let Endpoint::File(path) = endpoint
        && let Some(log) = newest(path)?
    {
        return Ok(Opened::Log(Box::new(log)));
    }
    let bytes = match endpoint {
        Endpoint::File(path) => fs::metadata(path).ok().map(|metadata| metadata.len()),
        _ => None,
    };
    Ok(Opened::Stream(source::open(endpoint, Timing { line_rate: None })?, bytes))
}

/// The newest session, where the path holds any.
fn newest(path: &PathBuf) -> Result<Option<Log>> {
    let metadata = fs::metadata(path).with_context(|| format!("{}: cannot be opened", path.display()))?;
    if metadata.is_file()
        && matches!(logs::find::look(path)?, Content::Mavlink | Content::Empty | Content::Other)
    {
        return Ok(None);
    }
    let found = logs::find::find(std::slice::from_ref(path), false)?;
    match found.logs.into_iter().next_back() {
        Some(log) => Ok(Some(log)),
        None => bail!("{}: there is no log in it", path.display()),
    }
}

/// What gets each frame: its time, UTC of time zero where that is known, how much has been read, 0 to 1, and the frame.
/// `false` ends the reading.
pub type Take<'a> = dyn FnMut(Instant, Option<u64>, f64, &Frame<'_>) -> io::Result<bool> + 'a;

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
                result = take(last, epoch_us, progress, &frame);
            }
        });
        if !matches!(result, Ok(true)) {
            return result.map(|_| ()).map_err(Into::into);
        }
    }
    framer.idle(&mut |frame| {
        if matches!(result, Ok(true)) {
            result = take(last, source.utc_start_us(), 1.0, &frame);
        }
    });
    result?;
    Ok(())
}

/// A group's frames.
#[derive(Default)]
struct Frames {
    /// Time, check, and where it ends in `bytes`.
    frames: Vec<(Instant, Check, usize)>,
    bytes: Vec<u8>,
}

impl Collect for Frames {
    fn entry(&mut self, entry: &Entry<'_>) {
        if let Entry::Frame { at, bytes, verified } = *entry {
            let check = if verified { Check::Verified } else { Check::Unverified };
            self.bytes.extend_from_slice(bytes);
            self.frames.push((at, check, self.bytes.len()));
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

impl Deliver<Frames> for Hand<'_, '_> {
    fn gap(&mut self, _: &Gap) -> Result<()> {
        Ok(())
    }

    fn group(&mut self, group: Frames) -> Result<()> {
        let mut start = 0;
        for (at, check, end) in group.frames {
            let bytes = group.bytes.get(start..end).unwrap_or_default();
            start = end;
            let Some(frame) = Frame::again(bytes, check).filter(|_| !self.ended) else { continue };
            let progress = (self.done.get() as f64 / self.blocks).min(1.0);
            self.ended = !(self.take)(at, self.epoch_us, progress, &frame)?;
        }
        Ok(())
    }
}

fn session(log: &Log, take: &mut Take<'_>) -> Result<()> {
    let blocks = (log.bytes() / hums_blackbox::SECTOR_BYTES as u64).max(1) as f64;
    let mut hand = Hand { take, epoch_us: epoch(log)?, blocks, done: std::cell::Cell::new(0), ended: false };
    read(log, Frames::default, &mut hand, |_| ())?;
    Ok(())
}
