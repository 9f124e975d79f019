//! Recordings: what they are, by their content, and where they are.

use std::collections::BTreeMap;
use std::fs::{self, DirEntry};
use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use hums_core::time::Instant;

use super::input::{Input, Progress};
use super::item::{Cause, Gap, Item, Reader, Stop, Summary, Take, Want};
use super::mavlink::{RawReader, TlogReader};
use super::own::OwnReader;
use super::sniff::{Kind, sniff_bytes};
use super::{dataflash, ulog};
use crate::logs::find::Image;
use crate::logs::{self, Content, Log};

/// The line rate at which bytes without recorded times are taken to have come, in baud: the rate of a telemetry port.
pub const RAW_BAUD: u32 = 115_200;
/// How much of a file tells what it is.
const LOOK_BYTES: usize = 64 * 1024;
/// Directories deeper than this are not walked.
const DEPTH_MAX: usize = 16;

/// What a recording is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Format {
    /// A log of HUMS, from a file, a card or a card's image.
    Hums,
    /// A ground station's log.
    Tlog,
    /// The bytes of a port.
    Raw,
    /// ArduPilot's onboard log, binary or as text.
    DataFlash,
    /// PX4's onboard log.
    Ulog,
}

impl Format {
    /// The name that JSON and tables use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hums => "hums",
            Self::Tlog => "tlog",
            Self::Raw => "raw",
            Self::DataFlash => "dataflash",
            Self::Ulog => "ulog",
        }
    }

    /// What it is, for people.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Hums => "log of HUMS",
            Self::Tlog => "ground station's log (tlog)",
            Self::Raw => "raw MAVLink",
            Self::DataFlash => "ArduPilot log (DataFlash)",
            Self::Ulog => "PX4 log (ULog)",
        }
    }

    /// Whether it holds what came over a link, as a ground station or a recorder on a port heard it; otherwise the
    /// autopilot wrote it itself.
    pub const fn is_of_link(self) -> bool {
        matches!(self, Self::Hums | Self::Tlog | Self::Raw)
    }
}

/// A recording that was found, not yet open.
#[derive(Clone, Debug)]
pub struct Place {
    /// Where it is, for people: its path, or path and session.
    pub title: String,
    /// A name for files made of it, unique within one call: the file's own, or a session's as `hums info` gives it.
    pub name: String,
    source: From,
}

#[derive(Clone, Debug)]
enum From {
    /// Standard input: read once.
    Standard,
    File(PathBuf),
    Log(Box<Log>),
}

impl Place {
    /// Standard input.
    pub fn standard() -> Self {
        Self { title: "standard input".to_owned(), name: "standard_input".to_owned(), source: From::Standard }
    }

    /// A file that is no log of ours.
    pub fn file(path: &Path) -> Self {
        let name = path.file_name().map_or_else(|| "recording".into(), |name| name.to_string_lossy());
        Self {
            title: path.display().to_string(),
            name: name.into_owned(),
            source: From::File(path.to_owned()),
        }
    }

    /// A session of a log of ours.
    pub fn log(title: String, log: Log) -> Self {
        Self { title, name: log.name.clone(), source: From::Log(Box::new(log)) }
    }

    /// The log of ours that it is, if it is one.
    pub fn own(&self) -> Option<&Log> {
        match &self.source {
            From::Log(log) => Some(log),
            _ => None,
        }
    }

    /// Its file, where it is one of its own.
    pub fn path(&self) -> Option<&Path> {
        match &self.source {
            From::File(path) => Some(path),
            From::Standard | From::Log(_) => None,
        }
    }

    /// Whether it can be read but once.
    pub const fn is_standard(&self) -> bool {
        matches!(self.source, From::Standard)
    }

    /// The bytes that it takes, as far as that is known.
    pub fn bytes(&self) -> u64 {
        match &self.source {
            From::Standard => 0,
            From::File(path) => fs::metadata(path).map_or(0, |about| about.len()),
            From::Log(log) => log.bytes(),
        }
    }

    /// Opens it.
    pub fn open(&self) -> Result<Recording> {
        match &self.source {
            From::Standard => Recording::new(Input::new(io::stdin())?, &self.title),
            From::File(path) => Recording::new(Input::open(path)?, &self.title),
            From::Log(log) => {
                let reader = OwnReader::new(log.as_ref().clone());
                let progress = reader.progress();
                Ok(Recording { format: Format::Hums, progress, reader: Box::new(reader) })
            }
        }
    }
}

/// A recording, open at its beginning.
pub struct Recording {
    /// What it is.
    pub format: Format,
    /// How far it has been read.
    pub progress: Progress,
    reader: Box<dyn Reader>,
}

impl Recording {
    /// What `input` is, by its content; `name` is for messages.
    pub fn new(mut input: Input, name: &str) -> Result<Self> {
        let context = || format!("{name}: cannot be read");
        let start = input.peek(LOOK_BYTES).with_context(context)?;
        let Some(format) = detect(&start) else {
            if start.is_empty() {
                bail!("{name}: is empty");
            }
            bail!(
                "{name}: is neither a log of HUMS, a card or its image, nor a recording that this program knows: a tlog, raw \
                 MAVLink, an ArduPilot log (.bin, .log), a PX4 log (.ulg), each also as .gz"
            );
        };
        let progress = input.progress();
        let reader: Box<dyn Reader> = match format {
            Detected::Tlog => Box::new(TlogReader::new(input)),
            Detected::Raw => Box::new(RawReader::new(input, RAW_BAUD)),
            Detected::DataFlash(form) => dataflash::open(input, form).with_context(|| name.to_owned())?,
            Detected::Ulog => ulog::open(input).with_context(|| name.to_owned())?,
        };
        Ok(Self { format: format.format(), progress, reader })
    }

    /// Reads it from its beginning to its end, or until `take` says [`Stop`].
    pub fn read(mut self, want: Want<'_>, take: &mut Take<'_>) -> Result<Summary> {
        let mut last = Instant::ZERO;
        let mut follow = |at: Instant, item: Item<'_>| {
            last = last.max(at);
            take(at, item)
        };
        let summary = match self.reader.read(want, &mut follow) {
            Err(error) if error.is::<Stop>() => return Ok(Summary::default()),
            result => result?,
        };
        if let Some(words) = self.progress.damage() {
            let place = Some(self.progress.taken());
            let gap = Gap { from: Some(last), to: None, cause: Cause::Cut, place, bytes: 0, words };
            match take(last, Item::Gap(&gap)) {
                Err(error) if !error.is::<Stop>() => return Err(error),
                _ => {}
            }
        }
        Ok(summary)
    }
}

/// What some first bytes are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Detected {
    Tlog,
    Raw,
    DataFlash(dataflash::Form),
    Ulog,
}

impl Detected {
    const fn format(self) -> Format {
        match self {
            Self::Tlog => Format::Tlog,
            Self::Raw => Format::Raw,
            Self::DataFlash(_) => Format::DataFlash,
            Self::Ulog => Format::Ulog,
        }
    }
}

fn detect(start: &[u8]) -> Option<Detected> {
    if ulog::detect(start) {
        return Some(Detected::Ulog);
    }
    // Before DataFlash's weaker signs: a frame with a checksum that holds is no accident.
    match sniff_bytes(start) {
        (Kind::Tlog, true) => Some(Detected::Tlog),
        (Kind::Raw, true) => Some(Detected::Raw),
        _ => dataflash::detect(start).map(Detected::DataFlash),
    }
}

/// What was found.
#[derive(Debug, Default)]
pub struct Found {
    /// Recordings, in the order in which they were named, those of a folder by name.
    pub places: Vec<Place>,
    /// What the file systems of cards and images say of themselves.
    pub images: Vec<Image>,
    /// What was passed over, as sentences.
    pub remarks: Vec<String>,
}

impl Found {
    /// Whether a card's file system is damaged.
    pub fn damaged(&self) -> bool {
        self.images.iter().any(|image| !image.damage.is_empty())
    }

    /// Every file that any of it is in.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        let pieces = self.places.iter().filter_map(Place::own).flat_map(|log| &log.pieces);
        let files = self.places.iter().filter_map(Place::path);
        pieces.map(|piece| piece.path.as_path()).chain(files)
    }
}

/// Finds all recordings in `inputs`: files, folders, cards, images, `-`. What the user named must be a recording; what
/// lies in a folder and is none is passed over.
pub fn find(inputs: &[PathBuf], salvage: bool) -> Result<Found> {
    let mut found = Found::default();
    for input in inputs {
        if input == Path::new("-") {
            found.places.push(Place::standard());
            continue;
        }
        let about = fs::metadata(input).with_context(|| format!("{}: cannot be read", input.display()))?;
        let before = found.places.len();
        if about.is_dir() {
            if let Some(error) = own(input, salvage, &mut found).err().filter(|_| holds_own(input)) {
                return Err(error);
            }
            let mut paths = Vec::new();
            walk(input, 0, &mut paths)?;
            found.places.extend(paths.iter().map(|path| Place::file(path)));
            if found.places.len() == before {
                bail!("{}: no log and no recording is in there", input.display());
            }
        } else if is_own(input)? {
            own(input, salvage, &mut found)?;
        } else {
            found.places.push(Place::file(input));
        }
        if inputs.len() > 1 {
            name_after(input, found.places.iter_mut().skip(before).filter(|place| place.own().is_some()));
        }
    }
    make_names_unique(&mut found.places);
    Ok(found)
}

/// The sessions of one of several inputs get its name before theirs: each card has a session 1.
fn name_after<'a>(input: &Path, places: impl Iterator<Item = &'a mut Place>) {
    let stem = input.file_stem().or(input.file_name()).map_or("input".into(), |stem| stem.to_string_lossy());
    for place in places.filter(|place| place.name != stem) {
        place.name = format!("{stem}/{}", place.name);
    }
}

/// Names are those of files: the later ones of a name get a number.
fn make_names_unique(places: &mut [Place]) {
    let mut seen: BTreeMap<String, u32> = BTreeMap::new();
    for place in places {
        let count = seen.entry(place.name.clone()).or_default();
        *count += 1;
        if *count > 1 {
            place.name = format!("{}-{count}", place.name);
        }
    }
}

/// Whether a file is a log of ours or a card's image.
fn is_own(path: &Path) -> Result<bool> {
    Ok(match logs::find::look(path)? {
        Content::Log | Content::Newer(_) => true,
        // A large file of anything may be a card without a partition table: what is known to be something is none.
        Content::Image => !is_recording(path),
        Content::Mavlink | Content::Empty | Content::Other => false,
    })
}

fn is_recording(path: &Path) -> bool {
    let start = Input::open(path).ok().and_then(|mut input| input.peek(LOOK_BYTES).ok());
    start.is_some_and(|start| detect(&start).is_some())
}

fn holds_own(dir: &Path) -> bool {
    logs::find(std::slice::from_ref(&dir.to_owned()), false).is_ok()
}

/// Adds the sessions of our own in a path.
fn own(path: &Path, salvage: bool, found: &mut Found) -> Result<()> {
    let own = logs::find(std::slice::from_ref(&path.to_owned()), salvage)?;
    found.images.extend(own.images);
    found.remarks.extend(own.remarks);
    let single = own.logs.len() == 1 && path.is_file();
    for log in own.logs {
        let name =
            if single { path.display().to_string() } else { format!("{}:{}", path.display(), log.name) };
        found.places.push(Place::log(name, log));
    }
    Ok(())
}

/// The files of a folder, and of those in it, that are recordings other than our own logs. Links are not followed.
fn walk(dir: &Path, depth: usize, paths: &mut Vec<PathBuf>) -> Result<()> {
    let context = || format!("{}: cannot be read", dir.display());
    let entries = fs::read_dir(dir).with_context(context)?.collect::<io::Result<Vec<DirEntry>>>();
    let mut entries = entries.with_context(context)?;
    entries.sort_by_key(DirEntry::path);
    for entry in entries {
        let (path, kind) = (entry.path(), entry.file_type().with_context(context)?);
        if kind.is_dir() && depth < DEPTH_MAX {
            walk(&path, depth + 1, paths)?;
        } else if kind.is_file() && is_recording(&path) {
            paths.push(path);
        }
    }
    Ok(())
}
