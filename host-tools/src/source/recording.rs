//! Recordings: what they are, by their content, and where they are.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
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
use crate::archive;
use crate::files::{FileId, is_part};
use crate::logs::find::{Image, REMARKS_MAX, check_seekable};
use crate::logs::sessions::Sessions;
use crate::logs::{self, Content, Log};
use crate::outcome::usage;
use crate::plural::count;
use crate::printable;

/// The line rate at which bytes without recorded times are taken to have come, in baud: the rate of a telemetry port.
pub const RAW_BAUD: u32 = 115_200;
/// How much of a file tells what it is.
const LOOK_BYTES: usize = 64 * 1024;
/// Directories deeper than this are not walked.
const DEPTH_MAX: usize = 16;
/// Recordings of one folder, and folders of one folder, that are kept: each takes some hundred bytes.
const WALKED_MAX: usize = 10_000;

/// Files that are passed over and named.
const PASSED_OVER_MAX: usize = 20;

/// What is read besides logs of ours, for messages: the end of a sentence.
const KNOWN: &str = "a recording that this program knows: a tlog, raw MAVLink, an ArduPilot log (.bin, .log), a PX4 log (.ulg), \
                     each also as .gz";

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

    /// What it is, for people, in a sentence: `a PX4 log (ULog)`.
    pub fn with_article(self) -> String {
        match self {
            Self::Raw => self.words().to_owned(),
            Self::DataFlash => format!("an {}", self.words()),
            Self::Hums | Self::Tlog | Self::Ulog => format!("a {}", self.words()),
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
                Ok(Recording {
                    format: Format::Hums,
                    progress,
                    name: self.title.clone(),
                    reader: Box::new(reader),
                })
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
    name: String,
    reader: Box<dyn Reader>,
}

impl Recording {
    /// What `input` is, by its content; `name` is for messages.
    pub fn new(mut input: Input, name: &str) -> Result<Self> {
        let context = || format!("{name}: cannot be read");
        let start = input.peek(LOOK_BYTES).with_context(context)?;
        if let Some(what) = hint(&start) {
            bail!("{name}: {what}");
        }
        let Some(format) = detect(&start) else {
            if start.is_empty() {
                bail!("{name}: is empty");
            }
            bail!("{name}: is neither a log of HUMS, a card or its image, nor {KNOWN}");
        };
        let progress = input.progress();
        let reader: Box<dyn Reader> = match format {
            Detected::Tlog => Box::new(TlogReader::new(input)),
            Detected::Raw => Box::new(RawReader::new(input, RAW_BAUD)),
            Detected::DataFlash(form) => dataflash::open(input, form).with_context(|| name.to_owned())?,
            Detected::Ulog => ulog::open(input).with_context(|| name.to_owned())?,
        };
        Ok(Self { format: format.format(), progress, name: name.to_owned(), reader })
    }

    /// Reads it from its beginning to its end, or until `take` says [`Stop`].
    pub fn read(mut self, want: Want<'_>, take: &mut Take<'_>) -> Result<Summary> {
        let (mut last, mut is_takers) = (Instant::ZERO, false);
        let mut follow = |at: Instant, item: Item<'_>| {
            last = last.max(at);
            let taken = take(at, item);
            is_takers |= taken.is_err();
            taken
        };
        let summary = match self.reader.read(want, &mut follow) {
            Err(error) if error.is::<Stop>() => return Ok(Summary::default()),
            Err(error) if is_takers => return Err(error),
            result => result.with_context(|| self.name.clone())?,
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
    if hint(start).is_some() {
        // A log that lies in an archive as it is would be read from its middle.
        return None;
    }
    if ulog::detect(start) {
        return Some(Detected::Ulog);
    }
    if let Some(form) = dataflash::begins(start) {
        return Some(Detected::DataFlash(form));
    }
    // Before DataFlash's weaker signs. In 64 KiB of anything else a frame of version 1 whose checksum holds is rare, and
    // happens.
    let (kind, frames) = sniff_bytes(start);
    if dataflash::is_headless(start, frames) {
        return Some(Detected::DataFlash(dataflash::Form::Binary));
    }
    match kind {
        Kind::Tlog if frames > 0 => Some(Detected::Tlog),
        Kind::Raw if frames > 0 => Some(Detected::Raw),
        _ => dataflash::detect(start).map(Detected::DataFlash),
    }
}

/// What is known of a file that is not read, by its first bytes as they are after unpacking, and what to do with it.
fn hint(start: &[u8]) -> Option<&'static str> {
    const TWICE: &str = "is compressed twice with gzip; unpack it once (gzip -dk)";
    archive::hint(start).or_else(|| start.starts_with(&archive::GZIP).then_some(TWICE))
}

/// What a file that begins with these bytes (64 KiB, or all of it) is, where it is a recording and none of our own logs.
pub fn format_of(start: &[u8]) -> Option<Format> {
    detect(start).map(Detected::format)
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
    /// There were more logs or recordings than are kept, or files with the name of one that hold none.
    pub is_cut: bool,
    /// Files of the inputs so far, by device and number.
    seen: BTreeSet<FileId>,
}

impl Found {
    /// Whether a card's file system is damaged, or logs were left out: exit code 3.
    pub fn is_lossy(&self) -> bool {
        self.is_cut || self.images.iter().any(|image| !image.damage.is_empty())
    }

    /// Adds the sessions of our own in a path.
    fn add_own(&mut self, path: &Path, own: logs::Found) {
        self.is_cut |= own.is_cut();
        self.images.extend(own.images);
        self.remarks.extend(own.remarks);
        let single = own.logs.len() == 1 && path.is_file();
        for log in own.logs {
            let name =
                if single { path.display().to_string() } else { format!("{}:{}", path.display(), log.name) };
            self.places.push(Place::log(name, log));
        }
    }

    /// Drops what was added since there were `before` places and lies in files of earlier inputs.
    fn drop_repeats(&mut self, before: usize) {
        // The sessions of one card's image are in one file; a second path of that file is a second name of it.
        let mut inside: BTreeMap<FileId, PathBuf> = BTreeMap::new();
        for place in self.places.split_off(before) {
            let pieces =
                place.own().into_iter().flat_map(|log| &log.pieces).map(|piece| piece.path.as_path());
            let files: Vec<(FileId, PathBuf)> = pieces
                .chain(place.path())
                .filter_map(|path| Some((FileId::of(path).ok()?, path.to_owned())))
                .collect();
            let is_known = |(file, path): &(FileId, PathBuf)| {
                self.seen.contains(file) || inside.get(file).is_some_and(|known| known != path)
            };
            if !files.is_empty() && files.iter().all(is_known) {
                if self.remarks.len() < REMARKS_MAX {
                    self.remarks
                        .push(format!("{}: was named or found already; it is read once", place.title));
                }
            } else {
                self.places.push(place);
            }
            for (file, path) in files {
                inside.entry(file).or_insert(path);
            }
        }
        self.seen.extend(inside.into_keys());
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
            if found.places.iter().any(Place::is_standard) {
                return Err(usage("-: standard input is named twice, and can be read once only"));
            }
            found.places.push(Place::standard());
            continue;
        }
        let about = fs::metadata(input).with_context(|| format!("{}: cannot be read", input.display()))?;
        let before = found.places.len();
        check_seekable(input, &about)?;
        if about.is_dir() {
            let mut walk = Walk::default();
            walk.folder(input, 0)?;
            found.add_own(input, logs::find::find_in(input, salvage)?);
            found.places.extend(walk.paths.iter().map(|path| Place::file(path)));
            if walk.left_out > 0 {
                found.is_cut = true;
                found.remarks.push(format!(
                    "{}: recordings and folders beyond {WALKED_MAX} are left out ({} of them): name fewer folders at once",
                    input.display(),
                    walk.left_out
                ));
            }
            found.is_cut |= walk.unknown > 0;
            found.remarks.append(&mut walk.remarks);
            if found.places.len() == before {
                let passed_over = walk.hinted.iter();
                let remarks: Vec<String> =
                    found.remarks.iter().chain(passed_over).map(|remark| format!("\n  {remark}")).collect();
                bail!("{}: no log and no recording is in there{}", input.display(), remarks.concat());
            }
            // A card has other files beside its logs.
            if walk.others > 0 && found.places.iter().skip(before).all(|place| place.own().is_none()) {
                let files = count(walk.others, "file");
                let names: Vec<String> = walk.passed_over.iter().map(|name| format!("\n  {name}")).collect();
                let more = walk.others.saturating_sub(names.len() as u64);
                let more = if more > 0 { format!("\n  and {more} more") } else { String::new() };
                found.remarks.push(format!(
                    "{}: {files} passed over: no log of a known kind{}{more}",
                    input.display(),
                    names.concat()
                ));
            }
        } else if is_own(input)? {
            let own =
                logs::find(std::slice::from_ref(input), salvage).map_err(|error| not_known(input, error))?;
            found.add_own(input, own);
        } else {
            found.places.push(Place::file(input));
        }
        found.drop_repeats(before);
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

/// Which session each number of the cards holds.
pub fn sessions_of(places: &[Place]) -> Sessions {
    Sessions::of(places.iter().filter_map(|place| Some((place.name.as_str(), place.own()?))))
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

/// A large file of anything may be a card whose first blocks are gone. That nothing was found on it is no news to whoever named
/// something else by mistake.
fn not_known(path: &Path, error: anyhow::Error) -> anyhow::Error {
    if matches!(logs::find::look(path), Ok(Content::Image)) && !logs::is_card(path).unwrap_or(true) {
        return error.context(format!("{}: is no log of HUMS, and not {KNOWN}; as a card", path.display()));
    }
    error
}

fn is_recording(path: &Path) -> bool {
    detect(&start_of(path)).is_some()
}

/// The first bytes of a file; none where it cannot be read.
fn start_of(path: &Path) -> Vec<u8> {
    Input::open(path).ok().and_then(|mut input| input.peek(LOOK_BYTES).ok()).unwrap_or_default()
}

/// The files of a folder, and of those in it, that are recordings other than our own logs. Links are not followed, and
/// pipes, sockets and devices are not opened.
#[derive(Default)]
struct Walk {
    paths: Vec<PathBuf>,
    /// Recordings and folders for which there was no room.
    left_out: u64,
    /// Files that are no recording: the logs of ours among them.
    others: u64,
    /// The first of them, by their names in the folder.
    passed_over: Vec<String>,
    /// The first of them that are archives and the like, as sentences that say what to do.
    hinted: Vec<String>,
    /// Files with the name of a recording that hold none, and the first of them as sentences.
    unknown: u64,
    remarks: Vec<String>,
}

impl Walk {
    /// What is neither a recording nor a folder is forgotten at once: there may be millions of files.
    fn folder(&mut self, dir: &Path, depth: usize) -> Result<()> {
        let context = || format!("{}: cannot be read", dir.display());
        let mut inside: Vec<(PathBuf, bool)> = Vec::new();
        for entry in fs::read_dir(dir).with_context(context)? {
            let entry = entry.with_context(context)?;
            let (path, kind) = (entry.path(), entry.file_type().with_context(context)?);
            if is_part(&path) {
                // What a run of this program has not made whole is nobody's recording.
                continue;
            }
            let start = if kind.is_file() { start_of(&path) } else { Vec::new() };
            let wanted = if kind.is_dir() { depth < DEPTH_MAX } else { detect(&start).is_some() };
            if !wanted {
                self.others += u64::from(kind.is_file());
                if kind.is_file() && self.passed_over.len() < PASSED_OVER_MAX {
                    let what = hint(&start).map_or_else(String::new, |what| format!(": {what}"));
                    let words = format!("{}{what}", printable::path(&path));
                    if !what.is_empty() {
                        self.hinted.push(words.clone());
                    }
                    self.passed_over.push(words);
                }
                if kind.is_file() && hint(&start).is_none() && is_named_as_recording(&path) {
                    self.unknown += 1;
                    if self.remarks.len() < REMARKS_MAX {
                        self.remarks
                            .push(format!("{}: has the name of a recording and holds none", path.display()));
                    }
                }
                continue;
            }
            if self.paths.len() + inside.len() < WALKED_MAX {
                inside.push((path, kind.is_dir()));
            } else {
                self.left_out += 1;
            }
        }
        inside.sort();
        for (path, is_folder) in inside {
            if is_folder {
                self.folder(&path, depth + 1)?;
            } else {
                self.paths.push(path);
            }
        }
        Ok(())
    }
}

/// Whether its name ends as those of recordings do that nothing else has, `.gz` or not. `.log` is the name of too much.
fn is_named_as_recording(path: &Path) -> bool {
    let name =
        path.file_name().map_or_else(Default::default, |name| name.to_string_lossy().to_ascii_lowercase());
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    [".tlog", ".ulg", ".bin"].iter().any(|ending| name.ends_with(ending))
}

#[cfg(test)]
mod tests {
    use hums_blackbox::{SECTOR_BYTES, Sector};

    use super::*;

    #[test]
    fn a_folder_with_more_logs_than_are_kept_is_a_finding_with_losses() {
        let dir = tempfile::tempdir().expect("a folder");
        let write = |count: u32| {
            for session in 0..count {
                let mut bytes = [0; SECTOR_BYTES];
                bytes[..2].copy_from_slice(&[0x48, 0xb1]);
                let mut sector = Sector::from_bytes(bytes);
                sector.seal(session);
                fs::write(dir.path().join(format!("{session}.hum")), sector.bytes()).expect("room");
            }
        };
        let found = || find(&[dir.path().to_owned()], false).expect("logs");
        write(2);
        assert_eq!((found().places.len(), found().is_lossy()), (2, false));
        write(10_002);
        let found = found();
        assert_eq!((found.places.len(), found.is_lossy()), (10_000, true));
        assert!(found.remarks.iter().any(|remark| remark.contains("too many files")), "{:?}", found.remarks);
    }

    /// A log of ArduPilot that defines one message and has many of it.
    fn dataflash() -> (Vec<u8>, Vec<u8>) {
        let mut fmt = [&[0xa3, 0x95, 128, 150, 13][..], b"ATT\0Qc"].concat();
        fmt.resize(3 + 2 + 4 + 16, 0);
        fmt.extend(b"TimeUS,Roll");
        fmt.resize(89, 0);
        let message = |time: u64| [&[0xa3, 0x95, 150][..], &time.to_le_bytes(), &[1, 0]].concat();
        (fmt, (0..200_u64).flat_map(|second| message(second * 1_000_000)).collect())
    }

    #[test]
    fn an_archive_of_any_size_is_refused_with_what_to_do_and_named_in_its_folder() {
        let (fmt, messages) = dataflash();
        let log = [&[0xa3, 0x95, 128, 128, 89][..], b"FMT\0BBnNZ", &[0; 75], &fmt, &messages].concat();
        let mut tar = vec![0; 512];
        tar[257..262].copy_from_slice(b"ustar");
        tar.extend(&log);
        let zip = [b"PK\x03\x04 stored", &log[..]].concat();
        let utf_16: Vec<u8> = b"\xff\xfe".iter().copied().chain([b'F', 0].repeat(10)).collect();
        let twice = [&archive::GZIP[..], &[0; 100]].concat();
        assert_eq!(hint(&twice).map(|what| what.contains("twice")), Some(true));
        for (start, what) in [(tar, "tar"), (zip, "ZIP"), (utf_16, "UTF-16")] {
            for bytes in [0, 2 << 20] {
                let dir = tempfile::tempdir().expect("a folder");
                let path = dir.path().join("file");
                let mut all = start.clone();
                all.resize(all.len() + bytes, 7);
                fs::write(&path, &all).expect("room");
                let found = find(std::slice::from_ref(&path), false).expect("one place");
                let Err(error) = found.places[0].open() else { panic!("{what} is read") };
                assert!(error.to_string().contains(what), "{error}");
                let error = find(&[dir.path().to_owned()], false).expect_err("no recording").to_string();
                assert!(error.contains("unpack") || error.contains("iconv"), "{error}");
            }
        }
    }

    #[test]
    fn a_file_with_two_names_in_a_folder_is_read_once() {
        let dir = tempfile::tempdir().expect("a folder");
        let (fmt, messages) = dataflash();
        fs::write(dir.path().join("a.bin"), [fmt, messages].concat()).expect("room");
        fs::hard_link(dir.path().join("a.bin"), dir.path().join("b.bin")).expect("a second name");
        let found = find(&[dir.path().to_owned()], false).expect("a log");
        assert_eq!(found.places.len(), 1);
        assert!(found.remarks.iter().any(|remark| remark.contains("read once")), "{:?}", found.remarks);
    }

    #[test]
    fn an_autopilots_log_without_its_beginning_is_one_that_is_damaged() {
        use crate::mavlink::frame::tests::HEARTBEAT;
        let (_, messages) = dataflash();
        assert_eq!(format_of(&messages), Some(Format::DataFlash));
        // By chance.
        assert_eq!(format_of(&[&messages[..], &HEARTBEAT].concat()), Some(Format::DataFlash));
        let mut gaps = Vec::new();
        let recording = Recording::new(Input::new(io::Cursor::new(messages)).expect("memory"), "cut.bin");
        let summary = recording.expect("a log").read(Want::default(), &mut |_, item| {
            if let Item::Gap(gap) = item {
                gaps.push((gap.cause, gap.place));
            }
            Ok(())
        });
        assert!(summary.is_ok());
        assert_eq!(gaps, [(Cause::Cut, Some(0))]);
        // A port over which such a log is downloaded is a port.
        assert_eq!(format_of(&[&HEARTBEAT[..], &[0xa3, 0x95, 1]].concat().repeat(50)), Some(Format::Raw));
    }

    #[test]
    fn a_frame_that_is_one_by_chance_makes_no_mavlink_of_an_autopilots_log() {
        use crate::mavlink::frame::tests::HEARTBEAT;
        let binary = [&[0xa3, 0x95, 128, 128, 89][..], b"FMT\0BBnNZ", &HEARTBEAT].concat();
        let text = [b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n", &HEARTBEAT[..]].concat();
        for start in [binary, text] {
            assert_eq!(format_of(&start), Some(Format::DataFlash));
        }
        assert_eq!(format_of(&HEARTBEAT.repeat(3)), Some(Format::Raw));
    }
}
