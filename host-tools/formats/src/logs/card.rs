//! A card's logs: by its file system, or by searching every block.

use std::borrow::Borrow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::Path;

use anyhow::{Context as _, Result, bail};
use hums_blackbox::Header;
use hums_blackbox::parity::Parity;
use hums_recorder::layout::{Layout, LayoutError};

use super::fat::{CardFile, Extent, ReadAt as _, Volume, Walk};
use super::found::{FoundLogs, Image, belong};
use super::places::{BLOCK_BYTES, Log, Piece};
use super::scan::{Files, Scan, scan};
use crate::card::{ReadOnlyImage, length};

pub(super) fn whole_file(path: &Path) -> Result<Log> {
    let length = File::open(path).and_then(|file| length(&file));
    let length = length.with_context(|| format!("{}: cannot be read", path.display()))?;
    let stem = path.file_stem().map_or_else(|| "log".into(), |stem| stem.to_string_lossy().into_owned());
    let piece = Piece { path: path.to_owned(), extents: vec![Extent { start: 0, length }] };
    Ok(Log { name: stem, files: vec![path.display().to_string()], pieces: vec![piece], ..Log::default() })
}

fn layout(device: &ReadOnlyImage<impl Borrow<File>>) -> Result<Layout, LayoutError<io::Error>> {
    Layout::read(device).or_else(|error| Layout::volume(device).map_err(|_| error))
}

/// Whether the file system of a card can be read there.
pub fn is_card(path: &Path) -> Result<bool> {
    Ok(layout(&ReadOnlyImage::new(File::open(path)?)?).is_ok())
}

/// The logs by the card's file system; none without one.
pub fn on_card(path: &Path) -> Vec<Log> {
    Card::of(path).map_or_else(Vec::new, |card| card.logs)
}

/// Facts from a card's file system.
#[derive(Clone, Debug)]
pub struct Card {
    /// Known logs.
    pub logs: Vec<Log>,
    /// Main damage.
    pub damage: Option<String>,
    /// Free bytes.
    pub free: u64,
    /// Total bytes.
    pub all: u64,
}

impl Card {
    /// `None` if unreadable.
    pub fn of(path: &Path) -> Option<Self> {
        let file = File::open(path).ok()?;
        let layout = layout(&ReadOnlyImage::new(&file).ok()?).ok()?;
        let walk = Volume::new(&file, layout).and_then(Volume::walk).ok()?;
        let (all, clusters) = (layout.data_bytes(), u64::from(layout.clusters));
        Some(Self {
            logs: sessions_of(path, &walk.files),
            damage: walk.damage.into_iter().next(),
            free: all / clusters.max(1) * walk.free_clusters,
            all,
        })
    }
}

pub(super) fn image(path: &Path, salvage: bool, found: &mut FoundLogs) -> Result<()> {
    let context = || format!("{}: cannot be read", path.display());
    let file = File::open(path).with_context(context)?;
    let device = ReadOnlyImage::new(&file).with_context(context)?;
    let mut about = Image { path: path.to_owned(), ..Image::default() };
    let mut files = Vec::new();
    match layout(&device) {
        Ok(layout) => {
            let walk = Volume::new(&file, layout).and_then(Volume::walk).with_context(context)?;
            files = by_file_system(path, walk, &mut about)?;
        }
        Err(error) => {
            let cut = cut_short(&file, &device).with_context(context)?;
            about.damage.push(cut.unwrap_or_else(|| error.to_string()));
        }
    }
    // A damaged file system lists files incompletely: every block is searched instead. A sound one is still
    // read by its files.
    let known = if about.damage.is_empty() { sessions_of(path, &files) } else { Vec::new() };
    if !known.is_empty() {
        for name in files.iter().filter(|file| file.name.is_none()).map(|file| &file.path) {
            found.remark(format!(
                "{}: {name} begins as a log and has not the name of a segment: it is read as a log of its own",
                path.display()
            ));
        }
        found.add(known.iter().cloned());
    }
    if salvage || known.is_empty() {
        let length = length(&file).with_context(context)?;
        found.add(by_blocks(path, length, &known, &mut about)?);
    }
    found.images.push(about);
    Ok(())
}

fn by_file_system(path: &Path, walk: Walk, about: &mut Image) -> Result<Vec<CardFile>> {
    about.damage = walk.damage;
    about.lost_clusters = walk.lost_clusters;
    if about.damage.is_empty() && has_part_of_log(path, walk.lost)? {
        let clusters = belong(walk.lost_clusters);
        about
            .damage
            .push(format!("{clusters}, with sectors of logs in them: an entry of a directory is lost"));
    }
    about.deleted_logs = walk.deleted_logs;
    Ok(walk.files)
}

fn by_blocks(path: &Path, length: u64, known: &[Log], about: &mut Image) -> Result<Vec<Log>> {
    let knows_none = known.is_empty() && about.damage.is_empty();
    let Scan { logs, left_out } = scan(path, length, &Files::of(known))?;
    if left_out > 0 {
        about.damage.push(format!(
            "{left_out} sectors of small or scattered sessions are left out: there are too many of them"
        ));
    }
    if logs.is_empty() && !about.damage.is_empty() {
        bail!(
            "{}: {}; and no block of it is a sector of a HUMS log",
            path.display(),
            about.damage.join("; ")
        );
    }
    about.searched = true;
    about.scanned = known.is_empty() && !logs.is_empty();
    if about.scanned && knows_none {
        about.damage.push("its file system knows of no log, and sectors of logs are there".to_owned());
    }
    Ok(logs)
}

/// The image ends before its partition: cut short, not damaged.
fn cut_short(file: &File, device: &ReadOnlyImage<&File>) -> io::Result<Option<String>> {
    let mut entry = [0; BLOCK_BYTES];
    let has = length(file)?;
    // Type, first block and blocks, behind the code.
    file.read_at(0, &mut entry)?;
    let word = |at: usize| entry.get(at..at + 4).and_then(|word| word.first_chunk().copied());
    let [start, blocks] = [446 + 8, 446 + 12].map(|at| word(at).map_or(0, u32::from_le_bytes));
    let wanted = (u64::from(start) + u64::from(blocks)) * BLOCK_BYTES as u64;
    let is_volume = matches!(Layout::read(device), Err(LayoutError::BadVolume(_)));
    Ok((is_volume && blocks > 0 && has < wanted).then(|| {
        format!("the image is cut short: it has {has} bytes, and its partition ends at byte {wanted}")
    }))
}

fn has_part_of_log(path: &Path, extents: Vec<Extent>) -> Result<bool> {
    let lost = Log { pieces: vec![Piece { path: path.to_owned(), extents }], ..Log::default() };
    let mut blocks = lost.blocks();
    while let Some(block) = blocks.next_block()? {
        if Header::read(block).is_ok() || Parity::read(block).is_some() {
            return Ok(true);
        }
    }
    Ok(false)
}

fn sessions_of(path: &Path, files: &[CardFile]) -> Vec<Log> {
    let mut sessions: BTreeMap<u32, Vec<&CardFile>> = BTreeMap::new();
    for (name, file) in files.iter().filter_map(|file| Some((file.name?, file))) {
        sessions.entry(name.session).or_default().push(file);
    }
    let log = |name: String, segments: &[&CardFile]| {
        let files = segments.iter().map(|file| file.path.clone()).collect();
        let piece = |file: &&CardFile| Piece { path: path.to_owned(), extents: file.extents.clone() };
        Log { name, files, pieces: segments.iter().map(piece).collect(), ..Log::default() }
    };
    let session = |(session, mut segments): (u32, Vec<&CardFile>)| {
        segments.sort_by_key(|file| file.name);
        log(format!("{session:05}"), &segments)
    };
    let renamed = files.iter().filter(|file| file.name.is_none());
    let renamed = renamed.map(|file| log(file.path.replace(['/', '.'], "_"), &[file]));
    sessions.into_iter().map(session).chain(renamed).collect()
}
