//! The logs in a file and on a card: by its file system, or where that does not tell, by looking at every block.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use anyhow::{Context as _, Result, bail};
use hums_blackbox::Header;
use hums_recorder::layout::Layout;

use super::fat::{CardFile, Extent, Volume};
use super::found::{Found, Image, belong};
use super::places::{Log, Piece};
use super::scan::{Scan, scan};
use crate::card::{ReadOnlyImage, length};

/// A file that is a log, or a segment of one.
pub(super) fn whole_file(path: &Path) -> Result<Log> {
    let length = File::open(path).and_then(|file| length(&file));
    let length = length.with_context(|| format!("{}: cannot be read", path.display()))?;
    let stem = path.file_stem().map_or_else(|| "log".into(), |stem| stem.to_string_lossy().into_owned());
    let piece = Piece { path: path.to_owned(), extents: vec![Extent { start: 0, length }] };
    Ok(Log { name: stem, files: vec![path.display().to_string()], pieces: vec![piece], session: None })
}

/// Whether the file system of a card can be read there.
pub fn is_card(path: &Path) -> Result<bool> {
    let device = ReadOnlyImage::new(File::open(path)?)?;
    Ok(Layout::read(&device).is_ok())
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
pub(super) fn image(path: &Path, salvage: bool, found: &mut Found) -> Result<()> {
    let context = || format!("{}: cannot be read", path.display());
    let file = File::open(path).with_context(context)?;
    let device = ReadOnlyImage::new(file.try_clone().with_context(context)?).with_context(context)?;
    let mut about = Image { path: path.to_owned(), damage: Vec::new(), lost_clusters: 0, scanned: false };
    let (before, more) = (found.logs.len(), found.logs_more);
    match Layout::read(&device) {
        Ok(layout) => {
            let walk = Volume::new(&file, layout).and_then(Volume::walk).with_context(context)?;
            about.damage = walk.damage;
            about.lost_clusters = walk.lost_clusters;
            if about.damage.is_empty() && has_sector(path, walk.lost)? {
                let clusters = belong(walk.lost_clusters);
                about.damage.push(format!(
                    "{clusters}, with sectors of logs in them: an entry of a directory is lost"
                ));
            }
            // Older logs are deleted to make room; the newest one is what a card is read for.
            let newest = walk.files.iter().map(|file| file.name.session).max();
            if let (Some(newest), Some((deleted, place))) = (newest, walk.deleted)
                && deleted.session > newest % 10_000
                && has_sector(path, vec![place])?
            {
                about.damage.push(format!(
                    "session {:05}, which is newer than all that are there, was deleted",
                    newest / 10_000 * 10_000 + deleted.session
                ));
            }
            found.add(sessions_of(path, &walk.files));
        }
        Err(error) => about.damage.push(error.to_string()),
    }
    let knows_none = about.damage.is_empty() && found.logs.len() == before;
    // A file system that is damaged tells of some files only, and of none surely: every block is looked at instead.
    if salvage || found.logs.len() == before || !about.damage.is_empty() {
        found.logs.truncate(before);
        found.logs_more = more;
        let Scan { logs, left_out } = scan(path, length(&file).with_context(context)?)?;
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
        about.scanned = !logs.is_empty();
        if about.scanned && knows_none {
            about.damage.push("its file system knows of no log, and sectors of logs are there".to_owned());
        }
        found.add(logs);
    }
    found.images.push(about);
    Ok(())
}

/// Whether there is a sector of a log here.
fn has_sector(path: &Path, extents: Vec<Extent>) -> Result<bool> {
    let lost = Log {
        name: String::new(),
        files: Vec::new(),
        pieces: vec![Piece { path: path.to_owned(), extents }],
        session: None,
    };
    let mut blocks = lost.blocks();
    while let Some(block) = blocks.next_block()? {
        if Header::read(&block).is_ok() {
            return Ok(true);
        }
    }
    Ok(false)
}

fn sessions_of(path: &Path, files: &[CardFile]) -> Vec<Log> {
    let mut sessions: BTreeMap<u32, Vec<&CardFile>> = BTreeMap::new();
    for file in files {
        sessions.entry(file.name.session).or_default().push(file);
    }
    let log = |(session, mut segments): (u32, Vec<&CardFile>)| {
        segments.sort_by_key(|file| file.name);
        let files = segments.iter().map(|file| file.path.clone()).collect();
        let piece = |file: &&CardFile| Piece { path: path.to_owned(), extents: file.extents.clone() };
        let pieces = segments.iter().map(piece).collect();
        Log { name: format!("{session:05}"), files, pieces, session: None }
    };
    sessions.into_iter().map(log).collect()
}
