//! Names of output files, and what is said of one that cannot be written.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use sha2::{Digest as _, Sha256};

use super::descriptor::descriptor;
use super::ends::short;
use super::identity::{FileId, folded, without_links};
use crate::outcome::usage;

/// How the name of a file or a folder ends that is not whole yet.
pub(super) const PART: &str = ".hums-part";
/// The folder of what was replaced.
pub(super) const KEPT: &str = "hums-kept";

/// Why readers of a folder pass over what has this name, as the end of a sentence: it is not whole, or was replaced.
pub fn why_unread(path: &Path) -> Option<&'static str> {
    let name = path.file_name()?.to_string_lossy();
    if name.ends_with(PART) {
        return Some(
            "has the name of what a run of hums has not ended, and is passed over; to read it, rename it",
        );
    }
    (name == KEPT)
        .then_some("keeps what --replace has replaced, and is passed over; to read it, name what is in it")
}

/// Names of a part that are tried.
pub(super) const PARTS_MAX: u32 = 100;
/// A longer name is a hash in the name of its part: file systems take 255 bytes.
const NAME_BYTES_MAX: usize = 200;

/// The part of a target, beside it: the `number`-th name, from 1 on.
pub(super) fn part_of(target: &Path, number: u32) -> Result<PathBuf> {
    beside(target, "", number)
}

/// What `hums pull` has begun of a target, beside it: to be gone on with, so no other command takes it for its own.
pub(super) fn begun_of(target: &Path) -> Result<PathBuf> {
    beside(target, ".pull", 1)
}

/// The path that is written where this one is named: without links, so that a link stays one. What a link in `/proc` says
/// (`/proc/PID/fd/3`) may be another file than the one it leads to: that one was deleted, or has its name elsewhere.
pub(super) fn target_of(path: &Path) -> Result<PathBuf> {
    let target = without_links(path).with_context(|| cannot_write(path))?;
    if leads_to(path, &target) {
        return Ok(target);
    }
    Err(usage(format!(
        "{}: is a link to something that has not the name it says, {}: it was deleted, or is another process's; nothing was \
         written; name the output by its own path",
        path.display(),
        target.display()
    )))
}

/// Whether what a path leads to is what lies at `target`, which is [`without_links`] of it. What nothing is at yet may be made
/// there, and what is neither a file nor a folder is written as it is.
fn leads_to(path: &Path, target: &Path) -> bool {
    let Ok(about) = fs::metadata(path) else { return true };
    let is_ours = descriptor(path).is_some() && !about.is_dir();
    let is_kept = about.is_file() || about.is_dir();
    is_ours || !is_kept || FileId::of(path).ok() == FileId::of(target).ok()
}

fn beside(target: &Path, what: &str, number: u32) -> Result<PathBuf> {
    let Some(name) = target.file_name() else {
        bail!("{}: is no name of a file", target.display());
    };
    let mut part = std::ffi::OsString::from(".");
    if name.len() <= NAME_BYTES_MAX {
        part.push(name);
    } else {
        part.push(format!("{:08x}", short(Sha256::new().chain_update(name.as_encoded_bytes()))));
    }
    part.push(what);
    if number > 1 {
        part.push(format!(".{number}"));
    }
    part.push(PART);
    Ok(target.with_file_name(part))
}

/// Makes a directory, unless it is there.
pub fn make_directory(dir: &Path) -> Result<()> {
    check_directory(dir)?;
    fs::create_dir_all(dir).with_context(|| format!("{}: cannot be made", dir.display()))
}

/// Refuses a directory that cannot be one: it, or what it is to lie in, is a file, or a device such as `/dev/null`.
fn check_directory(dir: &Path) -> Result<()> {
    // Without a slash at its end, with which a file is not found.
    let dir: PathBuf = dir.components().collect();
    // Nor where it is spelled through a folder that would be made on the way.
    let dir = folded(&dir).unwrap_or(dir);
    let there = dir.ancestors().find_map(|folder| Some((folder, fs::metadata(folder).ok()?)));
    match there.filter(|(_, about)| !about.is_dir()) {
        Some((file, about)) => {
            let what = if about.is_file() { "a file" } else { "no directory" };
            bail!("{}: is {what}, and a directory is needed there; name another output", file.display())
        }
        None => Ok(()),
    }
}

/// Refuses a path whose directory, or any directory above it, is a file.
pub fn check_parent(path: &Path) -> Result<()> {
    path.parent().map_or(Ok(()), check_directory)
}

/// Makes the directory that a file is to lie in, unless it is there.
pub fn make_parent(path: &Path) -> Result<()> {
    match path.parent().filter(|dir| !dir.as_os_str().is_empty()) {
        Some(dir) => make_directory(dir),
        None => Ok(()),
    }
}

/// Says that a file cannot be written, and names its folder where that is missing.
pub fn cannot_write(path: &Path) -> String {
    // A folder that is being made is there under the name of its part.
    let is_there = |folder: &Path| {
        folder.exists()
            || (1..=PARTS_MAX).any(|number| part_of(folder, number).is_ok_and(|part| part.exists()))
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty() && !is_there(folder));
    let why = folder.map_or_else(String::new, |folder| format!("; there is no folder {}", folder.display()));
    format!("{}: cannot be written{why}", path.display())
}

/// An error in terms of the file.
pub fn settle<T>(result: io::Result<T>, path: &Path) -> Result<T> {
    result.with_context(|| cannot_write(path))
}

/// Whether an output is named as a directory: it is one, or its name ends like one.
pub fn says_directory(output: &Path) -> bool {
    output.is_dir() || output.as_os_str().to_string_lossy().ends_with(['/', '\\'])
}

/// A path inside `dir` for a log's name, which may have directories of its own.
pub fn inside(dir: &Path, name: &str) -> PathBuf {
    name.split('/')
        .filter(|part| !matches!(*part, "" | "." | ".."))
        .fold(dir.to_owned(), |path, part| path.join(part))
}

/// A path with an extension. Appended, not replaced: a log's own name may have a dot in it.
pub fn appended(name: &Path, extension: &str) -> PathBuf {
    let mut name = name.to_owned().into_os_string();
    name.push(format!(".{extension}"));
    PathBuf::from(name)
}
