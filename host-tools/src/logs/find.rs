//! Finds the logs in a file, a card image or a directory, by what is in them.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use hums_blackbox::{Header, NotASector};
use hums_recorder::LogName;
use hums_recorder::layout::Layout;

use super::fat::{CardFile, Extent, Volume};
use super::places::{BLOCK_BYTES, Blocks, Log, Piece};
use crate::card::ReadOnlyImage;
use crate::files::is_part;
use crate::mavlink::frame::{Peek, peek};

/// Directories deeper than this are not walked: a loop of links would never end.
const DEPTH_MAX: usize = 16;
/// A session whose sectors a scan found in more runs than this is told by its first ones: memory stays bounded.
const RUNS_MAX: usize = 4_000_000;
/// How far into a file to look for a first sector before calling it no log.
const LOOK_BLOCKS: usize = 2048;

/// What was found.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// The logs, oldest session first.
    pub logs: Vec<Log>,
    /// What the file systems of the images say of themselves, one for each image.
    pub images: Vec<Image>,
    /// What was passed over, as sentences.
    pub remarks: Vec<String>,
}

/// A card image's file system.
#[derive(Clone, Debug)]
pub struct Image {
    /// The file.
    pub path: PathBuf,
    /// What does not hold, as sentences; empty where everything does.
    pub damage: Vec<String>,
    /// Clusters that belong to no file.
    pub lost_clusters: u64,
    /// The logs were found by looking at every block, because the file system could not tell.
    pub scanned: bool,
}

/// What a file is, by its content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Sectors of a log.
    Log,
    /// A card: a partition table, or blocks to be looked through.
    Image,
    /// A log of a newer format version.
    Newer(u8),
    /// A ground station's log or raw MAVLink: to be recorded first.
    Mavlink,
    /// Nothing in it.
    Empty,
    /// Anything else.
    Other,
}

/// Finds all logs in `inputs`; with `salvage` by looking at every block of an image, whatever its file system says.
pub fn find(inputs: &[PathBuf], salvage: bool) -> Result<Found> {
    let mut found = Found::default();
    for input in inputs {
        let before = found.logs.len();
        let about = fs::metadata(input).with_context(|| format!("{}: cannot be read", input.display()))?;
        if about.is_dir() {
            directory(input, salvage, &mut found)?;
        } else {
            named_file(input, salvage, &mut found)?;
        }
        if found.logs.len() == before && !found.images.iter().any(|image| &image.path == input) {
            bail!("{}: no log of HUMS is in there", input.display());
        }
        if inputs.len() > 1 {
            let stem =
                input.file_stem().or(input.file_name()).map_or("input".into(), |stem| stem.to_string_lossy());
            for log in found.logs.iter_mut().skip(before) {
                if log.name != stem {
                    log.name = format!("{stem}/{}", log.name);
                }
            }
        }
    }
    make_names_unique(&mut found.logs);
    Ok(found)
}

/// A file that the user named: it must be something.
fn named_file(path: &Path, salvage: bool, found: &mut Found) -> Result<()> {
    match look(path)? {
        Content::Log => found.logs.push(whole_file(path)?),
        Content::Image => image(path, salvage, found)?,
        Content::Empty => bail!("{}: is empty", path.display()),
        Content::Newer(version) => bail!(
            "{}: is a log of format version {version}, which this program is too old for; take a newer hums",
            path.display()
        ),
        Content::Mavlink => bail!(
            "{}: is a recording of MAVLink, not a log of HUMS; `hums pack` makes it one, `hums sim` records it",
            path.display()
        ),
        Content::Other => {
            bail!("{}: is neither a log of HUMS nor an image of an SD card (MBR + FAT32)", path.display())
        }
    }
    Ok(())
}

/// What a file is.
pub fn look(path: &Path) -> Result<Content> {
    let context = || format!("{}: cannot be read", path.display());
    let mut file = File::open(path).with_context(context)?;
    let mut start = Vec::new();
    file.by_ref().take(BLOCK_BYTES as u64).read_to_end(&mut start).with_context(context)?;
    if start.first_chunk().is_some_and(|block| Header::read(block).is_ok()) {
        // Nearly every log: its first block tells.
        return Ok(Content::Log);
    }
    let rest = ((LOOK_BLOCKS - 1) * BLOCK_BYTES) as u64;
    file.by_ref().take(rest).read_to_end(&mut start).with_context(context)?;
    if start.is_empty() {
        return Ok(Content::Empty);
    }
    let mut newer = None;
    let mut log_blocks = 0_usize;
    let mut other_blocks = 0_usize;
    for block in start.chunks(BLOCK_BYTES) {
        let mut whole = [0; BLOCK_BYTES];
        whole.iter_mut().zip(block).for_each(|(to, from)| *to = *from);
        match Header::read(&whole) {
            Ok(_) => log_blocks += 1,
            Err(NotASector::OtherVersion(version)) => newer = Some(version),
            Err(NotASector::Empty | NotASector::Damaged) => {}
            Err(NotASector::Foreign) => other_blocks += 1,
        }
        // A partition table stands before everything; a log has a sector early.
        if log_blocks > 0 {
            break;
        }
    }
    let signed = start.get(510..512) == Some(&[0x55, 0xaa]);
    let large = start.len() == LOOK_BLOCKS * BLOCK_BYTES;
    let frame_at = |at: usize| start.get(at..).is_some_and(|rest| matches!(peek(rest), Peek::Frame(_)));
    Ok(match (log_blocks, newer) {
        _ if signed && other_blocks > 0 => Content::Image,
        (1.., _) => Content::Log,
        (0, Some(version)) => Content::Newer(version),
        _ if frame_at(0) || frame_at(8) => Content::Mavlink,
        // A card whose first blocks are gone: only looking at all of it tells.
        _ if large => Content::Image,
        _ => Content::Other,
    })
}

fn whole_file(path: &Path) -> Result<Log> {
    let length = fs::metadata(path).with_context(|| format!("{}: cannot be read", path.display()))?.len();
    let stem = path.file_stem().map_or_else(|| "log".into(), |stem| stem.to_string_lossy().into_owned());
    let piece = Piece { path: path.to_owned(), extents: vec![Extent { start: 0, length }] };
    Ok(Log { name: stem, files: vec![path.display().to_string()], pieces: vec![piece], session: None })
}

/// Walks a directory: segments of one session in one directory are one log.
fn directory(root: &Path, salvage: bool, found: &mut Found) -> Result<()> {
    let mut waiting = vec![(root.to_owned(), 0)];
    while let Some((dir, depth)) = waiting.pop() {
        let context = || format!("{}: cannot be read", dir.display());
        let mut paths = fs::read_dir(&dir)
            .with_context(context)?
            .map(|entry| entry.map(|entry| entry.path()))
            .collect::<std::io::Result<Vec<_>>>()
            .with_context(context)?;
        paths.sort();
        let mut sessions: BTreeMap<u32, Vec<(LogName, PathBuf)>> = BTreeMap::new();
        // What a run of this program has not made whole is nobody's log.
        for path in paths.into_iter().filter(|path| !is_part(path)) {
            if path.is_dir() {
                if depth < DEPTH_MAX {
                    waiting.push((path, depth + 1));
                }
            } else if let Some(name) = segment_name(&path).filter(|_| matches!(look(&path), Ok(Content::Log)))
            {
                sessions.entry(name.session).or_default().push((name, path));
            } else if let Err(error) = directory_file(&path, salvage, found) {
                found.remarks.push(format!("{error:#}"));
            }
        }
        let prefix = dir.strip_prefix(root).unwrap_or(Path::new("")).to_string_lossy().into_owned();
        for (session, mut segments) in sessions {
            segments.sort();
            let name =
                if prefix.is_empty() { format!("{session:05}") } else { format!("{prefix}/{session:05}") };
            let mut log = Log { name, files: Vec::new(), pieces: Vec::new(), session: None };
            for (_, path) in segments {
                let segment = whole_file(&path)?;
                log.files.extend(segment.files);
                log.pieces.extend(segment.pieces);
            }
            found.logs.push(log);
        }
    }
    Ok(())
}

/// A file that happens to lie in a directory: what is not ours is passed over.
fn directory_file(path: &Path, salvage: bool, found: &mut Found) -> Result<()> {
    match look(path)? {
        Content::Log => found.logs.push(whole_file(path)?),
        Content::Image if is_card(path)? => {
            let before = found.logs.len();
            image(path, salvage, found)?;
            let stem = path.file_stem().map_or("card".into(), |stem| stem.to_string_lossy());
            for log in found.logs.iter_mut().skip(before) {
                log.name = format!("{stem}/{}", log.name);
            }
        }
        Content::Newer(version) => {
            found
                .remarks
                .push(format!("{}: format version {version} is newer than this program", path.display()));
        }
        _ => {}
    }
    Ok(())
}

fn is_card(path: &Path) -> Result<bool> {
    let device = ReadOnlyImage::new(File::open(path)?)?;
    Ok(Layout::read(&device).is_ok())
}

/// `00042_07.HUM` in any case of letters.
fn segment_name(path: &Path) -> Option<LogName> {
    let name = path.file_name()?.to_str()?.to_ascii_uppercase();
    let (base, extension) = name.split_once('.')?;
    LogName::from_short(base.as_bytes(), extension.as_bytes())
}

/// The logs that a card's file system knows; none where it has none. No block is searched for more.
pub fn on_card(path: &Path) -> Vec<Log> {
    let read = || -> Result<Vec<Log>> {
        let file = File::open(path)?;
        let layout = Layout::read(&ReadOnlyImage::new(file.try_clone()?)?).ok().context("no file system")?;
        Ok(sessions_of(path, &Volume::new(&file, layout)?.walk()?.files))
    };
    read().unwrap_or_default()
}

/// The logs on a card: by its file system, or where that does not tell, by looking at every block.
fn image(path: &Path, salvage: bool, found: &mut Found) -> Result<()> {
    let context = || format!("{}: cannot be read", path.display());
    let file = File::open(path).with_context(context)?;
    let device = ReadOnlyImage::new(file.try_clone().with_context(context)?).with_context(context)?;
    let mut about = Image { path: path.to_owned(), damage: Vec::new(), lost_clusters: 0, scanned: false };
    let before = found.logs.len();
    match Layout::read(&device) {
        Ok(layout) => {
            let walk = Volume::new(&file, layout).and_then(Volume::walk).with_context(context)?;
            about.damage = walk.damage;
            about.lost_clusters = walk.lost_clusters;
            found.logs.extend(sessions_of(path, &walk.files));
        }
        Err(error) => about.damage.push(error.to_string()),
    }
    // A file system that is damaged tells of some files only, and of none surely: every block is looked at instead.
    if salvage || found.logs.len() == before || !about.damage.is_empty() {
        found.logs.truncate(before);
        let logs = scan(path, file.metadata().with_context(context)?.len())?;
        if logs.is_empty() && !about.damage.is_empty() {
            bail!(
                "{}: {}; and no block of it is a sector of a HUMS log",
                path.display(),
                about.damage.join("; ")
            );
        }
        about.scanned = !logs.is_empty();
        found.logs.extend(logs);
    }
    found.images.push(about);
    Ok(())
}

fn sessions_of(path: &Path, files: &[CardFile]) -> Vec<Log> {
    let mut sessions: BTreeMap<u32, Vec<&CardFile>> = BTreeMap::new();
    for file in files {
        sessions.entry(file.name.session).or_default().push(file);
    }
    let log = |(session, mut segments): (u32, Vec<&CardFile>)| {
        segments.sort_by_key(|file| file.name);
        let extents = segments.iter().flat_map(|file| file.extents.iter().copied()).collect();
        let files = segments.iter().map(|file| file.path.clone()).collect();
        let pieces = vec![Piece { path: path.to_owned(), extents }];
        Log { name: format!("{session:05}"), files, pieces, session: None }
    };
    sessions.into_iter().map(log).collect()
}

/// Sectors that follow each other, in place and in number; damaged ones between them are theirs.
#[derive(Clone, Copy, Debug)]
struct Run {
    number: u32,
    start: u64,
    blocks: u64,
}

impl Run {
    /// Whether a sector of this number at this place continues it, with at most a group between that is none.
    fn goes_on(&self, number: u32, at: u64) -> bool {
        let blocks = at.checked_sub(self.start).map(|bytes| bytes / BLOCK_BYTES as u64);
        let numbers = number.checked_sub(self.number).map(u64::from);
        let group = hums_blackbox::GROUP_SECTORS as u64;
        blocks == numbers
            && blocks.is_some_and(|blocks| (self.blocks..=self.blocks + group).contains(&blocks))
    }
}

/// Looks at every block of a card for sectors, and puts those of each session in order.
fn scan(path: &Path, length: u64) -> Result<Vec<Log>> {
    let everything = Piece { path: path.to_owned(), extents: vec![Extent { start: 0, length }] };
    let all = Log { name: String::new(), files: Vec::new(), pieces: vec![everything], session: None };
    let mut blocks: Blocks<'_> = all.blocks();
    let mut sessions: BTreeMap<u32, Vec<Run>> = BTreeMap::new();
    let (mut at, mut runs) = (0_u64, 0_usize);
    while let Some(block) = blocks.next_block()? {
        if let Ok(header) = Header::read(&block) {
            let session = sessions.entry(header.session).or_default();
            match session.last_mut() {
                Some(run) if run.goes_on(header.number, at) => {
                    run.blocks = u64::from(header.number - run.number) + 1;
                }
                _ if runs < RUNS_MAX => {
                    session.push(Run { number: header.number, start: at, blocks: 1 });
                    runs += 1;
                }
                _ => {}
            }
        }
        at += BLOCK_BYTES as u64;
    }
    let log = |(session, mut runs): (u32, Vec<Run>)| {
        runs.sort_by_key(|run| (run.number, run.start));
        let extent = |run: &Run| Extent { start: run.start, length: run.blocks * BLOCK_BYTES as u64 };
        let piece = Piece { path: path.to_owned(), extents: runs.iter().map(extent).collect() };
        let files = vec![path.display().to_string()];
        Log { name: format!("session-{session:08x}"), files, pieces: vec![piece], session: Some(session) }
    };
    Ok(sessions.into_iter().map(log).collect())
}

/// Two cards both have a session 1: the later ones get a number.
fn make_names_unique(logs: &mut [Log]) {
    let mut seen: BTreeMap<String, u32> = BTreeMap::new();
    for log in logs {
        let count = seen.entry(log.name.clone()).or_default();
        *count += 1;
        if *count > 1 {
            log.name = format!("{}-{count}", log.name);
        }
    }
}
