//! Finds recordings: files, folders, cards and images.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::mem;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, anyhow, bail};

use super::format::{Detected, KNOWN, begins_recording, detect, format_of, hint, is_recording, start_of};
use super::recording::{LogPlace, of_one_vehicle};
use crate::archive::GZIP;
use crate::files::{FileId, Inputs, why_unread};
use crate::logs::find::{Image, REMARKS_MAX, check_seekable};
use crate::logs::naming::{make_unique, name_after};
use crate::logs::sessions::{Sessions, copy_words, first_session};
use crate::logs::{self, Content, segment_name};
use crate::outcome::{Usage, usage};
use crate::plural::count;
use crate::printable;

/// Deeper directories are not walked.
const DEPTH_MAX: usize = 16;
/// Recordings of one folder: each takes some hundred bytes.
const WALKED_MAX: usize = 10_000;

/// Named files.
const PASSED_OVER_MAX: usize = 20;

/// Result of a search.
#[derive(Debug, Default)]
pub struct FoundRecordings {
    /// Recordings in named order, a folder's by name.
    pub places: Vec<LogPlace>,
    /// Facts from the file systems of cards and images.
    pub images: Vec<Image>,
    /// Remarks, as sentences.
    pub remarks: Vec<String>,
    /// Logs beyond the limit, or files named like a recording without one.
    pub is_cut: bool,
    /// Inputs without a recording, each with its error.
    pub failed: Vec<(PathBuf, anyhow::Error)>,
    seen: BTreeSet<FileId>,
}

impl FoundRecordings {
    /// Damage of a card, or left-out logs: exit code 3.
    pub fn is_lossy(&self) -> bool {
        self.is_cut || self.images.iter().any(|image| !image.damage.is_empty())
    }

    /// HUMS sessions of a path.
    fn add_own(&mut self, path: &Path, own: logs::FoundLogs) {
        self.is_cut |= own.is_cut();
        self.images.extend(own.images);
        self.remarks.extend(own.remarks);
        // A raw device is named like a file.
        let single = own.logs.len() == 1 && !path.is_dir();
        for log in own.logs {
            let name = match log.files.first() {
                // Segments named one by one.
                Some(file) if path.is_file() && segment_name(path).is_some() => file.clone(),
                _ if single => path.display().to_string(),
                _ => format!("{}:{}", path.display(), log.name),
            };
            self.places.push(LogPlace::log(name, log));
        }
    }

    fn drop_repeats(&mut self, before: usize) {
        // A second path is a second name.
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

    /// One of so many inputs. `segments` are those named one by one, which are read together.
    fn add_input(
        &mut self,
        input: &Path,
        of: usize,
        segments: &mut Vec<PathBuf>,
        salvage: bool,
    ) -> Result<()> {
        if input == Path::new("-") {
            if self.places.iter().any(LogPlace::is_standard) {
                return Err(usage("-: standard input is named twice, and can be read once only"));
            }
            self.places.push(LogPlace::standard());
            return Ok(());
        }
        let about = fs::metadata(input).with_context(|| format!("{}: cannot be read", input.display()))?;
        let before = self.places.len();
        check_seekable(input, &about)?;
        // As the shell names it.
        if let Some(why) = why_unread(input).filter(|_| about.is_dir() && of > 1) {
            self.remarks.push(format!("{}: {why}", input.display()));
            return Ok(());
        }
        if about.is_dir() {
            let own = logs::find::find_in(input, salvage)?;
            let mut walk = Walk::of(input, &own)?;
            self.add_own(input, own);
            self.places.append(&mut walk.places);
            self.is_cut |= walk.left_out > 0;
            self.remarks.extend(walk.left_out_words(input));
            self.is_cut |= walk.unknown > 0;
            self.remarks.append(&mut walk.remarks);
            if self.places.len() == before {
                let passed_over = walk.hinted.iter();
                let remarks: Vec<String> =
                    self.remarks.iter().chain(passed_over).map(|remark| format!("\n  {remark}")).collect();
                bail!("{}: no log and no recording is in there{}", input.display(), remarks.concat());
            }
            self.remarks.extend(walk.passed_over_words(input));
        } else if is_own(input)? {
            // As in a folder.
            let together =
                if segment_name(input).is_none() { vec![input.to_owned()] } else { mem::take(segments) };
            if together.is_empty() {
                return Ok(());
            }
            let own = logs::find(&together, salvage).map_err(|error| not_known(input, error))?;
            self.add_own(input, own);
        } else {
            self.places.push(LogPlace::file(input));
        }
        self.drop_repeats(before);
        if of > 1 && segment_name(input).is_none() {
            let own = self.places.iter_mut().skip(before).filter(|place| place.own().is_some());
            name_after(input, own.map(|place| &mut place.name));
        }
        Ok(())
    }

    /// Recordings of equal bytes: a flight counts once. The same for `hums decode`, which names outputs by these bytes.
    fn drop_copies(&mut self) {
        let mut by_length: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
        for (index, path) in self.places.iter().enumerate().filter_map(|(n, place)| Some((n, place.path()?)))
        {
            by_length.entry(unpacked_length(path).unwrap_or_default()).or_default().push(index);
        }
        let mut copies: BTreeMap<usize, usize> = BTreeMap::new();
        for alike in by_length.into_values().filter(|alike| alike.len() > 1) {
            let mut known: BTreeMap<[u8; 16], usize> = BTreeMap::new();
            for index in alike {
                // An unreadable file is reported when it is read.
                let Some(Ok(bytes)) = self.places.get(index).map(LogPlace::fingerprint) else { continue };
                let first = *known.entry(bytes).or_insert(index);
                if first != index {
                    copies.insert(index, first);
                }
            }
        }
        let title = |index: usize| self.places.get(index).map_or("", |place| place.title.as_str());
        let words = |(copy, of): (&usize, &usize)| format!("{}: {}", title(*copy), copy_words(title(*of)));
        let remarks: Vec<String> = copies.iter().map(words).take(REMARKS_MAX).collect();
        self.remarks.extend(remarks);
        let mut index = 0..;
        self.places.retain(|_| index.next().is_none_or(|index| !copies.contains_key(&index)));
    }

    /// Made by `hums decode` from another input: a flight counts once.
    fn drop_made(&mut self) {
        let made_of = |stem: &str, other: &LogPlace| match other.own() {
            Some(log) => first_session(log).is_some_and(|session| stem.contains(&format!("-s{session:08x}"))),
            None => other
                .path()
                .and_then(|path| stem.strip_prefix(path.file_name()?.to_str()?))
                .is_some_and(|rest| rest.starts_with("-r")),
        };
        let original = |place: &LogPlace| {
            let stem = place.path()?.file_name()?.to_str()?.strip_suffix(".tlog")?;
            let original = self.places.iter().find(|other| made_of(stem, other))?;
            Some(format!(
                "{}: was made of {}, which is read, and is passed over",
                place.title, original.title
            ))
        };
        let remarks: Vec<_> = self.places.iter().map(original).collect();
        let mut made = remarks.iter();
        self.places.retain(|_| made.next().is_some_and(Option::is_none));
        self.remarks.extend(remarks.into_iter().flatten().take(REMARKS_MAX));
    }

    /// Reads only the vehicle with this system id.
    pub fn of_system(mut self, system: Option<u8>) -> Result<Self> {
        if let Some(own) = self.places.iter().find(|place| system.is_some() && place.own().is_some()) {
            return Err(usage(format!(
                "--system is for a recording of several vehicles; {} is a log of HUMS, which is of the one that was judged on board",
                own.title
            )));
        }
        let files = self.places.iter().filter(|_| system.is_some()).filter_map(LogPlace::path);
        for path in files {
            if format_of(&start_of(path)).is_some_and(|format| !format.is_of_link()) {
                return Err(of_one_vehicle(&path.display().to_string()));
            }
        }
        self.places.iter_mut().for_each(|place| place.system = system);
        Ok(self)
    }

    /// A session by name, number, or the title that `hums check` gives it.
    pub fn session(&self, name: &str) -> Result<usize> {
        let number = |name: &str| name.parse::<u32>().ok();
        let is_it = |place: &LogPlace| {
            place.name == name
                || place.title == name
                || number(name).is_some_and(|wanted| number(&place.name) == Some(wanted))
        };
        self.places.iter().position(is_it).ok_or_else(|| {
            let names: Vec<&str> = self.places.iter().map(|place| place.name.as_str()).collect();
            usage(format!("--session {name}: there is no such session; there is {}", names.join(", ")))
        })
    }

    /// Prints the remarks.
    pub fn tell(&self) {
        for remark in &self.remarks {
            note!("{remark}");
        }
        for image in self.images.iter().filter(|image| !image.damage.is_empty()) {
            note!("{}: {}", image.path.display(), image.damage.join("; "));
        }
    }

    /// `None` without a request.
    pub fn name_of(&self, asked: Option<&str>) -> Result<Option<String>> {
        let index = asked.map(|name| self.session(name)).transpose()?;
        Ok(index.and_then(|index| self.places.get(index)).map(|place| place.name.clone()))
    }

    /// The given inputs with all files that are read, which no output may replace.
    pub fn with_inputs(&self, given: &[PathBuf]) -> Inputs {
        Inputs::of(given.iter().map(PathBuf::as_path).chain(self.paths()))
    }

    /// All files.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        let pieces = self.places.iter().filter_map(LogPlace::own).flat_map(|log| &log.pieces);
        let files = self.places.iter().filter_map(LogPlace::path);
        pieces.map(|piece| piece.path.as_path()).chain(files)
    }
}

/// Files, folders, cards, images, `-`. Named inputs must be recordings; others in a folder are passed over.
pub fn find(inputs: &[PathBuf], salvage: bool) -> Result<FoundRecordings> {
    let mut found = find_each(inputs, salvage)?;
    let Some((_, error)) = found.failed.pop() else { return Ok(found) };
    bail!("{error:#}; instead of `*` name the folder: what is no recording is passed over in it")
}

/// As [`find`], but one of several inputs without a recording keeps no other from being read.
pub fn find_each(inputs: &[PathBuf], salvage: bool) -> Result<FoundRecordings> {
    let mut found = FoundRecordings::default();
    let is_segment = |input: &&PathBuf| segment_name(input).is_some() && is_own(input).unwrap_or(false);
    let mut segments: Vec<PathBuf> = inputs.iter().filter(is_segment).cloned().collect();
    for input in inputs {
        match found.add_input(input, inputs.len(), &mut segments, salvage) {
            Err(error) if inputs.len() > 1 && !error.is::<Usage>() => {
                found.failed.push((input.clone(), error));
            }
            added => added?,
        }
    }
    found.drop_made();
    found.drop_copies();
    make_unique(found.places.iter_mut().map(|place| &mut place.name));
    Ok(found)
}

/// Other contents of a folder, as sentences. Also whether a file is named like a recording and holds none.
pub fn besides(folder: &Path, own: &logs::FoundLogs) -> Result<(Vec<String>, bool)> {
    let walk = Walk::of(folder, own)?;
    let recordings = walk.places.len();
    let not_judged = (recordings > 0).then(|| {
        format!(
            "{}: {} of other kinds passed over: `hums check` judges them",
            folder.display(),
            count(recordings as u64, "recording")
        )
    });
    let mut words = walk.remarks.clone();
    words.extend(not_judged);
    words.extend(walk.left_out_words(folder));
    words.extend(walk.passed_over_words(folder));
    Ok((words, walk.unknown > 0))
}

/// The session of each number on the cards.
pub fn sessions_of(places: &[LogPlace]) -> Sessions {
    Sessions::of(places.iter().filter_map(|place| Some((place.name.as_str(), place.own()?))))
}

fn is_own(path: &Path) -> Result<bool> {
    const START_BYTES: usize = 512;
    // Shown by its first bytes, without a search.
    if start_of_bytes(path, START_BYTES).is_some_and(|start| begins_recording(&start)) {
        return Ok(false);
    }
    Ok(match logs::find::look(path)? {
        Content::Log | Content::Unread(_) => true,
        // Perhaps a card without a partition table.
        Content::Image => !is_recording(path),
        Content::Mavlink | Content::Empty | Content::Other => false,
    })
}

/// Its first bytes as stored; `None` if unreadable.
fn start_of_bytes(content: &Path, bytes: usize) -> Option<Vec<u8>> {
    let mut start = Vec::new();
    fs::File::open(content).and_then(|file| file.take(bytes as u64).read_to_end(&mut start)).ok()?;
    Some(start)
}

/// Bytes of a recording, modulo 2^32 for a compressed one (RFC 1952, ISIZE of its last member).
fn unpacked_length(path: &Path) -> Result<u64> {
    let mut file = fs::File::open(path)?;
    let length = file.metadata()?.len();
    if start_of_bytes(path, GZIP.len()).is_none_or(|start| start != GZIP) {
        return Ok(length % (1 << 32));
    }
    let mut isize = [0; 4];
    file.seek(SeekFrom::End(-4))?;
    file.read_exact(&mut isize)?;
    Ok(u32::from_le_bytes(isize).into())
}

/// Names an input that is another kind of recording.
pub fn not_ours(inputs: &[PathBuf], error: anyhow::Error) -> anyhow::Error {
    let is_ours = |input: &Path| input.is_dir() || is_own(input).unwrap_or(false);
    // The search failed on the first one.
    let first = inputs.iter().find(|input| !is_ours(input));
    match first.and_then(|input| Some((input, format_of(&start_of(input))?))) {
        Some((input, format)) if !format.is_of_link() => anyhow!(
            "{}: is {}, not a log of HUMS; `hums check` judges it",
            input.display(),
            format.with_article()
        ),
        Some((input, _)) => anyhow!(
            "{}: is a recording of MAVLink, not a log of HUMS; `hums check` judges it, `hums decode --format hum` makes it one",
            input.display()
        ),
        None => error,
    }
}

/// A large file, perhaps a card without its first blocks, perhaps a wrong name: the error mentions both.
fn not_known(path: &Path, error: anyhow::Error) -> anyhow::Error {
    if matches!(logs::find::look(path), Ok(Content::Image)) && !logs::is_card(path).unwrap_or(true) {
        return error.context(format!("{}: is no log of HUMS, and not {KNOWN}; as a card", path.display()));
    }
    error
}

/// A folder's recordings other than HUMS logs. Links lead to each folder once; pipes, sockets and devices are not opened.
#[derive(Default)]
struct Walk {
    places: Vec<LogPlace>,
    walked: logs::WalkedFolders,
    /// No room.
    left_out: u64,
    /// HUMS logs and cards.
    ours: BTreeSet<PathBuf>,
    others: u64,
    passed_over: Vec<String>,
    /// Archives and the like, with advice.
    hinted: Vec<String>,
    /// Named like a recording, and none; the first as sentences.
    unknown: u64,
    remarks: Vec<String>,
}

impl Walk {
    fn of(folder: &Path, own: &logs::FoundLogs) -> Result<Self> {
        let mut walk = Self { ours: own.paths().map(Path::to_owned).collect(), ..Self::default() };
        walk.folder(folder, 0)?;
        Ok(walk)
    }

    fn left_out_words(&self, folder: &Path) -> Option<String> {
        (self.left_out > 0).then(|| {
            format!(
                "{}: recordings and folders beyond {WALKED_MAX} are left out ({} of them): name fewer folders at once",
                folder.display(),
                self.left_out
            )
        })
    }

    fn passed_over_words(&self, folder: &Path) -> Option<String> {
        let names: Vec<String> = self.passed_over.iter().map(|name| format!("\n  {name}")).collect();
        let more = self.others.saturating_sub(names.len() as u64);
        let more = if more > 0 { format!("\n  and {more} more") } else { String::new() };
        (self.others > 0).then(|| {
            let files = count(self.others, "file");
            format!(
                "{}: {files} passed over: no log of a known kind{}{more}",
                folder.display(),
                names.concat()
            )
        })
    }

    /// Dropped at once: there may be millions of others.
    fn folder(&mut self, dir: &Path, depth: usize) -> Result<()> {
        if !self.walked.is_new(dir) {
            return Ok(());
        }
        let context = || format!("{}: cannot be read", dir.display());
        let mut inside: Vec<(PathBuf, Option<Detected>)> = Vec::new();
        for entry in fs::read_dir(dir).with_context(context)? {
            let entry = entry.with_context(context)?;
            let (path, kind) = (entry.path(), logs::kind_of(&entry).with_context(context)?);
            // Reported with HUMS logs.
            if why_unread(&path).is_some() || self.ours.contains(&path) {
                continue;
            }
            let start = if kind.is_file() { start_of(&path) } else { Vec::new() };
            let format = detect(&start);
            let wanted = if kind.is_dir() { depth < DEPTH_MAX } else { format.is_some() };
            if kind.is_file() && !wanted && logs::is_named_as_log(&path) {
                continue;
            }
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
                // Unreadable files are reported.
                let is_read = || fs::File::open(&path).is_ok();
                if kind.is_file() && hint(&start).is_none() && is_named_as_recording(&path) && is_read() {
                    self.unknown += 1;
                    if self.remarks.len() < REMARKS_MAX {
                        self.remarks
                            .push(format!("{}: has the name of a recording and holds none", path.display()));
                    }
                }
                continue;
            }
            if self.places.len() + inside.len() < WALKED_MAX {
                inside.push((path, format));
            } else {
                self.left_out += 1;
            }
        }
        inside.sort_by(|(path, _), (other, _)| path.cmp(other));
        for (path, format) in inside {
            match format {
                Some(format) => self.places.push(LogPlace::detected(&path, format)),
                // Reported with HUMS logs.
                None => drop(self.folder(&path, depth + 1)),
            }
        }
        Ok(())
    }
}

/// Only a recording's ending, `.gz` or not; `.log` is too common.
fn is_named_as_recording(path: &Path) -> bool {
    let name =
        path.file_name().map_or_else(Default::default, |name| name.to_string_lossy().to_ascii_lowercase());
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    [".tlog", ".ulg", ".bin"].iter().any(|ending| name.ends_with(ending))
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use hums_blackbox::{SECTOR_BYTES, Sector};

    use super::*;
    use crate::source::recording::tests::dataflash;

    #[test]
    fn a_folder_with_more_logs_than_are_kept_is_a_finding_with_losses() {
        let dir = tempfile::tempdir().expect("a folder");
        let write = |count: u32| {
            for session in 0..count {
                let mut bytes = [0; SECTOR_BYTES];
                bytes[..2].copy_from_slice(&[0x48, 0xb3]);
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

    #[test]
    fn an_archive_of_any_size_is_refused_with_what_to_do_and_named_in_its_folder() {
        let (fmt, messages) = dataflash();
        let log = [&[0xa3, 0x95, 128, 128, 89][..], b"FMT\0BBnNZ", &[0; 75], &fmt, &messages].concat();
        let mut tar = vec![0; 512];
        tar[257..262].copy_from_slice(b"ustar");
        tar.extend(&log);
        let zip = [b"PK\x03\x04 stored", &log[..]].concat();
        let utf_16: Vec<u8> = b"\xff\xfe".iter().copied().chain([b'F', 0].repeat(10)).collect();
        let twice = [&GZIP[..], &[0; 100]].concat();
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
                assert!(error.contains("unpack") || error.contains("UTF-8"), "{error}");
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
        fs::copy(dir.path().join("a.bin"), dir.path().join("c.bin")).expect("a copy");
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gzip.write_all(&fs::read(dir.path().join("a.bin")).expect("there")).expect("packed");
        fs::write(dir.path().join("d.bin.gz"), gzip.finish().expect("packed")).expect("room");
        let found = find(&[dir.path().to_owned()], false).expect("a log");
        assert_eq!(found.places.len(), 1);
        let copies = found.remarks.iter().filter(|remark| remark.contains("is a copy of")).count();
        assert_eq!(copies, 2, "{:?}", found.remarks);
    }
}
