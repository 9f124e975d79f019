//! Walks a folder for logs and images of cards. Links are followed, but each file and folder is read once. Pipes, sockets,
//! devices and dead links are passed over with a remark: opening a pipe may block.

use std::collections::BTreeSet;
use std::fs::{self, DirEntry, FileType};
use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use super::card::{image, is_card, whole_file};
use super::found::{FoundLogs, LOGS_MAX};
use super::look::{Content, look};
use super::naming::{SegmentName, is_part, segment_name, segment_or_part};
use super::places::Log;
use crate::files::{FileId, why_unread};

const DEPTH_MAX: usize = 16;
/// Folders that wait.
const WAITING_MAX: usize = 10_000;
const SEGMENTS_MAX: usize = 8 * LOGS_MAX;

const IMAGES: [&str; 3] = [".img", ".dd", ".iso"];
/// Endings of their compressed forms.
const PACKED: [&str; 5] = [".gz", ".xz", ".zst", ".bz2", ".zip"];

#[derive(Default)]
struct Entries {
    /// Whether each is whole or a part.
    segments: Vec<(bool, SegmentName, PathBuf)>,
    /// Logs and images.
    files: Vec<PathBuf>,
    folders: Vec<PathBuf>,
}

/// Segments of one session are one log.
pub(super) fn directory(root: &Path, salvage: bool, found: &mut FoundLogs) -> Result<()> {
    let (mut waiting, mut walked) = (vec![(root.to_owned(), 0)], WalkedFolders::default());
    while let Some((dir, depth)) = waiting.pop() {
        if !walked.is_new(&dir) {
            continue;
        }
        let Entries { mut segments, mut files, mut folders } = match entries(&dir, found) {
            Err(error) if depth > 0 => {
                found.leave_out(format!("{error:#}"));
                continue;
            }
            entries => entries?,
        };
        files.sort();
        folders.sort();
        for path in files {
            if is_new(&path, found)
                && let Err(error) = file(&path, salvage, found)
            {
                found.leave_out(format!("{error:#}"));
            }
        }
        for folder in folders {
            if depth < DEPTH_MAX && waiting.len() < WAITING_MAX {
                waiting.push((folder, depth + 1));
            } else {
                found.leave_out(format!(
                    "{}: is not looked into: too deep, or too many folders",
                    folder.display()
                ));
            }
        }
        segments.sort();
        let mut read = Vec::new();
        for (is_whole, name, path) in segments {
            if is_new(&path, found) {
                match whole_file(&path) {
                    Ok(log) => read.push((is_whole, name, log)),
                    Err(error) => found.leave_out(format!("{error:#}")),
                }
            }
        }
        let prefix = dir.strip_prefix(root).unwrap_or(Path::new("")).to_string_lossy();
        found.add(sessions(read, &if prefix.is_empty() { String::new() } else { format!("{prefix}/") }));
    }
    Ok(())
}

fn is_new(path: &Path, found: &mut FoundLogs) -> bool {
    let is_known = found.is_known(path);
    if is_known {
        found.remark(format!("{}: is the same file as another one; it is read once", path.display()));
    }
    !is_known
}

/// The segments of a folder, in order; whether each is whole or a part.
pub(super) type Segments = Vec<(bool, SegmentName, Log)>;

/// The log of each session, whose segments are together. Parts are a log by themselves, named after the first.
pub(super) fn sessions(segments: Segments, prefix: &str) -> Vec<Log> {
    let (mut logs, mut before) = (Vec::<Log>::new(), None);
    for (is_whole, segment, mut log) in segments {
        if is_whole {
            log.name = format!("{prefix}{}", segment.log());
        }
        let session = Some((is_whole, segment.first()));
        let is_same = before == session;
        before = session;
        match logs.last_mut().filter(|_| is_same) {
            Some(last) => {
                last.files.append(&mut log.files);
                last.pieces.append(&mut log.pieces);
            }
            None => logs.push(log),
        }
    }
    logs
}

/// Folders that were walked, by their identity: links may lead to one twice.
#[derive(Default)]
pub struct WalkedFolders(BTreeSet<FileId>);

impl WalkedFolders {
    /// Whether a folder was not walked before.
    pub fn is_new(&mut self, dir: &Path) -> bool {
        FileId::of(dir).map_or(true, |id| self.0.insert(id))
    }
}

/// The kind of an entry, also of a link's target; a dead link stays a link.
pub fn kind_of(entry: &DirEntry) -> io::Result<FileType> {
    let kind = entry.file_type()?;
    let target = kind.is_symlink().then(|| fs::metadata(entry.path()).ok()).flatten();
    Ok(target.map_or(kind, |target| target.file_type()))
}

fn entries(dir: &Path, found: &mut FoundLogs) -> Result<Entries> {
    let context = || format!("{}: cannot be read", dir.display());
    let mut entries = Entries::default();
    for entry in fs::read_dir(dir).with_context(context)? {
        let entry = entry.with_context(context)?;
        let (path, kind) = (entry.path(), kind_of(&entry).with_context(context)?);
        if let Some(why) = why_unread(&path) {
            found.pass_over(format!("{}: {why}", path.display()));
        } else if kind.is_dir() && entries.folders.len() < WAITING_MAX {
            entries.folders.push(path);
        } else if kind.is_file() {
            entries.file(path, found);
        } else {
            found.pass_over(passed_over(&path, kind));
        }
    }
    Ok(entries)
}

impl Entries {
    fn file(&mut self, path: PathBuf, found: &mut FoundLogs) {
        let shown = path.display();
        let content = look(&path);
        let is_log = matches!(content, Ok(Content::Log));
        match (content, segment_name(&path).or_else(|| segment_or_part(&path).filter(|_| is_log))) {
            (Err(error), _) => found.leave_out(format!("{error:#}")),
            (Ok(Content::Unread(unread)), _) => found.leave_out(format!("{shown}: {unread}")),
            // The report on a log says if the file holds none.
            (Ok(content), Some(_)) if content != Content::Log && path.extension().is_none() => {}
            (Ok(_), Some(name)) if self.segments.len() < SEGMENTS_MAX => {
                self.segments.push((!is_part(&path), name, path));
            }
            (Ok(_), Some(_)) => {
                found.leave_out(format!("{shown}: is left out: there are too many segments"));
            }
            (Ok(Content::Log | Content::Image), None) if self.files.len() < LOGS_MAX => self.files.push(path),
            (Ok(Content::Log | Content::Image), None) => {
                found.leave_out(format!("{shown}: is left out: there are too many files"));
            }
            (Ok(_), None) if is_named_as_log(&path) => found.leave_out(nothing_of_ours(&path)),
            (Ok(_), None) if is_named_as_card(&path) => found.leave_out(no_card(&path)),
            (Ok(_), None) => {}
        }
    }
}

/// Whether a file has the name of a log, compressed or not.
pub fn is_named_as_log(path: &Path) -> bool {
    is_named(path, &[".hum"])
}

/// A card's image by the name, compressed or not.
pub fn is_named_as_card(path: &Path) -> bool {
    is_named(path, &IMAGES)
}

fn is_named(path: &Path, endings: &[&str]) -> bool {
    let name = path.file_name().map_or_else(Default::default, |name| name.to_string_lossy().to_lowercase());
    let name = PACKED.iter().find_map(|packed| name.strip_suffix(packed)).unwrap_or(&name);
    endings.iter().any(|ending| name.ends_with(ending))
}

fn no_card(path: &Path) -> String {
    format!(
        "{}: has the name of a card's image, and none can be read there (one that is packed: unpack it)",
        path.display()
    )
}

fn nothing_of_ours(path: &Path) -> String {
    let name = path.file_name().map_or_else(Default::default, |name| name.to_string_lossy().to_lowercase());
    let what = if PACKED.iter().any(|packed| name.ends_with(packed)) {
        "of a compressed log, which is not read; unpack it"
    } else {
        "of a log and holds nothing of ours"
    };
    format!("{}: has the name {what}", path.display())
}

/// A remark for an entry that is not a file.
pub fn passed_over(path: &Path, kind: FileType) -> String {
    let what = if kind.is_symlink() {
        "a link to nothing"
    } else if kind.is_dir() {
        "one folder too many"
    } else {
        "a pipe, a socket or a device"
    };
    format!("{}: is {what}, and passed over", path.display())
}

fn file(path: &Path, salvage: bool, found: &mut FoundLogs) -> Result<()> {
    match look(path)? {
        Content::Log => found.log(whole_file(path)?),
        Content::Image => {
            let before = found.logs.len();
            match image(path, salvage, found) {
                // It may be a card without its first blocks.
                Err(_) if !is_named_as_card(path) && !is_card(path)? => return Ok(()),
                looked_at => looked_at?,
            }
            let stem = path.file_stem().map_or("card".into(), |stem| stem.to_string_lossy());
            for log in found.logs.iter_mut().skip(before) {
                log.name = format!("{stem}/{}", log.name);
            }
        }
        _ if is_named_as_log(path) => bail!(nothing_of_ours(path)),
        _ if is_named_as_card(path) => bail!(no_card(path)),
        _ => {}
    }
    Ok(())
}
