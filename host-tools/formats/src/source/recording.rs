//! A recording's place and reader.

use std::fs;
use std::io;
use std::mem;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use anyhow::{Context as _, Result, bail};
use hums_core::clock::Instant;

use super::format::{Detected, KNOWN, LOOK_BYTES, detect, hint};
use super::input::{Input, Progress};
use super::item::{Cause, Gap, Item, ItemSink, Needs, Reader, RecordingSummary, Stop};
use super::mavlink::{RawReader, TlogReader};
use super::own::OwnReader;
use super::parts::{ItemCollector, PART_BYTES, PART_ITEMS, PartReceiver};
use super::{dataflash, ulog};
use crate::files::digest_of;
use crate::logs::Log;
use crate::logs::fingerprint::Fingerprint;
use crate::outcome::usage;
use crate::progress;

pub use super::format::{Format, format_of};

/// Baud of bytes without recorded times: a telemetry port's.
pub const RAW_BAUD: u32 = 115_200;

/// A found recording, not yet open.
#[derive(Clone, Debug)]
pub struct LogPlace {
    /// Place for people: path, or path and session.
    pub title: String,
    /// Name for files made of it, unique within one call: the file's, or a session's as in `hums info`.
    pub name: String,
    /// System id of the only wanted vehicle ([`Needs::system`]).
    pub system: Option<u8>,
    source: From,
}

#[derive(Clone, Debug)]
enum From {
    /// Read once.
    Standard,
    File(PathBuf, Facts),
    Log(Box<Log>),
}

/// Cached after first reading.
#[derive(Clone, Debug, Default)]
struct Facts {
    format: OnceLock<Detected>,
    fingerprint: OnceLock<Fingerprint>,
}

fn once<T: Copy>(known: &OnceLock<T>, find: impl FnOnce() -> Result<T>) -> Result<T> {
    match known.get() {
        Some(known) => Ok(*known),
        None => find().map(|found| *known.get_or_init(|| found)),
    }
}

impl LogPlace {
    /// The place with only this system id.
    pub fn of_system(&self, system: u8) -> Self {
        Self { system: Some(system), ..self.clone() }
    }

    /// Standard input.
    pub fn standard() -> Self {
        Self {
            title: "standard input".to_owned(),
            name: "standard_input".to_owned(),
            system: None,
            source: From::Standard,
        }
    }

    /// A file other than a HUMS log.
    pub fn file(path: &Path) -> Self {
        let name = path.file_name().map_or_else(|| "recording".into(), |name| name.to_string_lossy());
        Self {
            title: path.display().to_string(),
            name: name.into_owned(),
            system: None,
            source: From::File(path.to_owned(), Facts::default()),
        }
    }

    pub(super) fn detected(path: &Path, format: Detected) -> Self {
        let facts = Facts { format: format.into(), ..Facts::default() };
        Self { source: From::File(path.to_owned(), facts), ..Self::file(path) }
    }

    /// A session of a HUMS log.
    pub fn log(title: String, log: Log) -> Self {
        Self { title, name: log.name.clone(), system: None, source: From::Log(Box::new(log)) }
    }

    /// The HUMS log, if any.
    pub fn own(&self) -> Option<&Log> {
        match &self.source {
            From::Log(log) => Some(log),
            _ => None,
        }
    }

    /// A single file.
    pub fn path(&self) -> Option<&Path> {
        match &self.source {
            From::File(path, _) => Some(path),
            From::Standard | From::Log(_) => None,
        }
    }

    /// Its folder, with all parents.
    pub fn folder(&self) -> Option<PathBuf> {
        let piece = || Some(self.own()?.pieces.first()?.path.as_path());
        Some(self.path().or_else(piece)?.canonicalize().ok()?.parent()?.to_owned())
    }

    /// Whether it can be read but once.
    pub const fn is_standard(&self) -> bool {
        matches!(self.source, From::Standard)
    }

    /// Bytes, as far as known.
    pub fn bytes(&self) -> u64 {
        match &self.source {
            From::Standard => 0,
            From::File(path, _) => fs::metadata(path).map_or(0, |about| about.len()),
            From::Log(log) => log.bytes(),
        }
    }

    /// Hash of all bytes of a file, unpacked: a compressed copy is the same recording.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn fingerprint(&self) -> Result<Fingerprint> {
        let From::File(path, facts) = &self.source else { return Ok(Fingerprint::default()) };
        once(&facts.fingerprint, || {
            let digest = digest_of(Input::open(path)?);
            let digest = digest.with_context(|| format!("{}: cannot be read", path.display()))?;
            Ok(digest.first_chunk().copied().unwrap_or_default())
        })
    }

    /// Opens it.
    pub fn open(&self) -> Result<Recording> {
        let recording = match &self.source {
            From::Standard => Recording::new(Input::new(io::stdin())?, &self.title)?,
            From::File(path, facts) => {
                let mut input = Input::open(path)?;
                let format = once(&facts.format, || detected(&mut input, &self.title))?;
                Recording::of(format, input, &self.title)?
            }
            From::Log(log) => {
                let reader = OwnReader::new(log.as_ref().clone());
                let progress = reader.progress();
                Recording {
                    format: Format::Hums,
                    progress,
                    name: self.title.clone(),
                    system: None,
                    reader: Box::new(reader),
                }
            }
        };
        if self.system.is_some() && !recording.format.is_of_link() {
            return Err(of_one_vehicle(&self.title));
        }
        Ok(Recording { system: self.system, ..recording })
    }

    /// Parts as [`Self::in_parts`], and items in order: one reading for both.
    pub fn in_parts_and_order<C: ItemCollector>(
        &self,
        log: &Log,
        want: Needs<'_>,
        new: impl Fn() -> C + Sync,
        deliver: &mut impl PartReceiver<C>,
        take: &mut ItemSink<'_>,
    ) -> Result<RecordingSummary> {
        let bar = progress::bytes(Some(log.bytes()), &self.title);
        let want = Needs { system: self.system, ..want };
        let reader = OwnReader::new(log.clone());
        let summary = reader.in_parts_and_order(want, new, deliver, take, |bytes| bar.set_position(bytes));
        bar.finish_and_clear();
        summary
    }

    /// `new` makes a part's collector, `deliver` gets them in order.
    pub fn in_parts<C: ItemCollector>(
        &self,
        want: Needs<'_>,
        new: impl Fn() -> C + Sync,
        deliver: &mut impl PartReceiver<C>,
    ) -> Result<RecordingSummary> {
        if let Some(log) = self.own() {
            let bar = progress::bytes(Some(log.bytes()), &self.title);
            let summary =
                OwnReader::new(log.clone()).in_parts(want, new, deliver, |bytes| bar.set_position(bytes));
            bar.finish_and_clear();
            return summary;
        }
        let recording = self.open()?;
        let (is_of_link, seen) = (recording.format.is_of_link(), recording.progress.clone());
        let bar = progress::bytes(seen.total(), &self.title);
        let (mut part, mut items) = (new(), 0);
        let summary = recording.read(want, &mut |at, item| {
            let begins = match item {
                // A frame's observations stay with it.
                Item::Observation(..) => !is_of_link,
                Item::Frame(_) | Item::Row(_) | Item::Gap(_) => true,
                Item::Text(_) | Item::Parameter(_) => false,
                _ => return Ok(()),
            };
            let is_full = items >= PART_ITEMS || part.held_bytes() >= PART_BYTES;
            if begins && (is_full || matches!(item, Item::Gap(_))) {
                items = 0;
                bar.set_position(seen.taken());
                deliver.part(mem::replace(&mut part, new()))?;
            }
            items += u32::from(begins);
            match item {
                Item::Gap(gap) => deliver.gap(gap),
                item => {
                    part.item(at, item);
                    Ok(())
                }
            }
        })?;
        deliver.part(part)?;
        bar.finish_and_clear();
        Ok(summary)
    }
}

/// A vehicle was chosen in an autopilot's log.
pub(super) fn of_one_vehicle(title: &str) -> anyhow::Error {
    usage(format!(
        "--system is for a recording of several vehicles; {title} is an autopilot's own log, which is of one"
    ))
}

fn detected(input: &mut Input, name: &str) -> Result<Detected> {
    let start = input.peek(LOOK_BYTES).with_context(|| format!("{name}: cannot be read"))?;
    if let Some(what) = hint(&start) {
        bail!("{name}: {what}");
    }
    if let Some(format) = detect(&start) {
        return Ok(format);
    }
    if let Some(words) = input.progress().damage().filter(|_| start.is_empty()) {
        bail!("{name}: {words}");
    }
    if start.is_empty() {
        bail!("{name}: is empty; copy it again");
    }
    bail!("{name}: is neither a log of HUMS, a card or its image, nor {KNOWN}");
}

/// A recording, open at its beginning.
pub struct Recording {
    /// Its format.
    pub format: Format,
    /// Progress of reading.
    pub progress: Progress,
    name: String,
    system: Option<u8>,
    reader: Box<dyn Reader>,
}

impl Recording {
    /// A recording by content; `name` is for messages.
    pub fn new(mut input: Input, name: &str) -> Result<Self> {
        Self::of(detected(&mut input, name)?, input, name)
    }

    fn of(format: Detected, input: Input, name: &str) -> Result<Self> {
        let progress = input.progress();
        let reader: Box<dyn Reader> = match format {
            Detected::Tlog => Box::new(TlogReader::new(input)),
            Detected::Raw => Box::new(RawReader::new(input, RAW_BAUD)),
            Detected::DataFlash(form) => dataflash::open(input, form).with_context(|| name.to_owned())?,
            Detected::Ulog => ulog::open(input).with_context(|| name.to_owned())?,
        };
        Ok(Self { format: format.format(), progress, name: name.to_owned(), system: None, reader })
    }

    /// Reads until the end, or until `take` returns [`Stop`].
    pub fn read(mut self, want: Needs<'_>, take: &mut ItemSink<'_>) -> Result<RecordingSummary> {
        let want = Needs { system: self.system, ..want };
        let (mut last, mut is_takers, mut seen) = (Instant::ZERO, false, Seen::default());
        let mut follow = |at: Instant, item: Item<'_>| {
            last = last.max(at);
            seen.item(at, &item);
            let taken = take(at, item);
            is_takers |= taken.is_err();
            taken
        };
        let mut summary = match self.reader.read(want, &mut follow) {
            Err(error) if error.is::<Stop>() => return Ok(RecordingSummary::default()),
            Err(error) if is_takers => return Err(error),
            result => result.with_context(|| self.name.clone())?,
        };
        if let Some(words) = self.progress.damage() {
            let gap = Gap::new(Some(last), Cause::Damaged, words).at(self.progress.taken());
            seen.item(last, &Item::Gap(&gap));
            match take(last, Item::Gap(&gap)) {
                Err(error) if !error.is::<Stop>() => return Err(error),
                _ => {}
            }
        }
        let Seen { span, gaps, losses } = seen;
        (summary.span, summary.gaps, summary.losses) = (span, gaps, losses);
        Ok(summary)
    }
}

#[derive(Default)]
struct Seen {
    span: Option<(Instant, Instant)>,
    gaps: u64,
    losses: u64,
}

impl Seen {
    fn item(&mut self, at: Instant, item: &Item<'_>) {
        match item {
            Item::Frame(_) | Item::Row(_) | Item::Observation(..) => {
                let (first, last) = self.span.unwrap_or((at, at));
                self.span = Some((first, last.max(at)));
            }
            Item::Gap(gap) => {
                self.gaps += u64::from(gap.cause.is_damage());
                self.losses += u64::from(gap.cause == Cause::Lost);
            }
            _ => {}
        }
    }
}

#[cfg(test)]
pub(super) mod tests;
