//! What `--replace` replaces is kept: it is renamed into the folder `hums-kept` beside it, and nothing is removed.
//!
//! There it keeps its name, under a number: `x.tlog` becomes `hums-kept/1/x.tlog`, the next one of this name
//! `hums-kept/2/x.tlog`. The numbers only grow, so that what one run replaces lies together. In a folder of its own it is not
//! read as a second recording, and its ending still says what it is.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use anyhow::Result;

use super::part::{fill_part, rename_new, sync_folder_of};
use super::paths::KEPT;

/// Keeps what lies at `from` as an earlier `target`, and gives its new path. Nothing is ever written over.
pub fn set_aside(from: &Path, target: &Path) -> io::Result<PathBuf> {
    let name = target.file_name().ok_or(io::ErrorKind::InvalidInput)?;
    let kept = target.with_file_name(KEPT);
    let mut number = newest(&kept).unwrap_or(1);
    if let Some(about) = fs::symlink_metadata(&kept).ok().filter(|about| !about.is_dir()) {
        return Err(io::Error::other(format!(
            "what is replaced is kept in a folder {}, and that is a {}; nothing was replaced: move it away or rename it",
            kept.display(),
            if about.is_symlink() { "link" } else { "file" }
        )));
    }
    loop {
        let folder = kept.join(number.to_string());
        let aside = folder.join(name);
        match make_folder(&folder).and_then(|()| rename_new(from, &aside)) {
            // Of this name something is kept there, or it is no folder.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                let none =
                    || io::Error::other(format!("{}: no number is left in it; move it away", kept.display()));
                number = number.checked_add(1).ok_or_else(none)?;
            }
            Err(error) => {
                remove_empty(&aside);
                return Err(error);
            }
            Ok(()) => {
                sync_folder_of(&aside);
                return Ok(aside);
            }
        }
    }
}

/// Makes a folder with those above it, unless it is there; [`io::ErrorKind::AlreadyExists`] where something else is, also a link.
fn make_folder(folder: &Path) -> io::Result<()> {
    match fs::symlink_metadata(folder) {
        Ok(about) if about.is_dir() => Ok(()),
        Ok(_) => Err(io::ErrorKind::AlreadyExists.into()),
        Err(_) => fs::create_dir_all(folder),
    }
}

/// The part takes the name of what lies at `target`, which is kept. Where it cannot, that has its name again.
pub(super) fn replace(part: &Path, target: &Path) -> io::Result<()> {
    let aside = set_aside(target, target)?;
    if let Err(error) = rename_new(part, target) {
        return Err(match rename_new(&aside, target) {
            Ok(()) => {
                remove_empty(&aside);
                error
            }
            Err(_) => io::Error::new(error.kind(), format!("{error}; {}", kept_as(&aside))),
        });
    }
    note!("{}: {}", target.display(), kept_as(&aside));
    Ok(())
}

/// Makes a file that is updated in place anew: `fill` fills it, and when it is whole it takes the name of the old one, which is
/// kept or goes. Gives it, locked, for reading and writing.
pub fn remake_in_place(target: &Path, keep: bool, fill: impl FnOnce(&File) -> Result<()>) -> Result<File> {
    fill_part(target, fill, |part| if keep { replace(part, target) } else { fs::rename(part, target) })
}

/// What is said of it.
pub(super) fn kept_as(aside: &Path) -> String {
    format!("what was there is kept as {}", aside.display())
}

/// The highest number that is there.
fn newest(kept: &Path) -> Option<u64> {
    let entries = fs::read_dir(kept).ok()?;
    entries.flatten().filter_map(|entry| entry.file_name().to_str()?.parse().ok()).max()
}

/// Removes the folders in which nothing came to lie.
fn remove_empty(aside: &Path) {
    for folder in aside.ancestors().skip(1).take(2) {
        // One with something in it stays.
        let _ = fs::remove_dir(folder);
    }
}
