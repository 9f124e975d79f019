//! Names of output files, and the errors of those that cannot be written.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

/// How the name of a file or a folder ends that is not whole yet.
pub(super) const PART: &str = ".hums-part";
/// Why readers of a folder pass over a file of this name, as the end of a sentence.
pub fn why_unread(path: &Path) -> Option<&'static str> {
    path.file_name()?.to_string_lossy().ends_with(PART).then_some(
        "has the name of what a run of hums has not ended, and is passed over; to read it, rename it",
    )
}

/// Whether a path means standard output.
pub fn means_standard_output(path: &Path) -> bool {
    ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"].iter().any(|name| path == Path::new(name))
}

pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// As much of a target's name as its part has: file systems take 255 bytes.
const NAME_CHARS_MAX: usize = 50;

pub(super) fn part_prefix(target: &Path) -> io::Result<String> {
    let name = target.file_name().ok_or(io::ErrorKind::InvalidInput)?.to_string_lossy();
    Ok(format!(".{}.", name.chars().take(NAME_CHARS_MAX).collect::<String>()))
}

/// Begins a file beside its target, under a name of its own. It is removed unless it is given its name.
pub fn begin<R>(
    target: &Path,
    open: impl FnMut(&Path) -> io::Result<R>,
) -> io::Result<tempfile::NamedTempFile<R>> {
    tempfile::Builder::new().prefix(&part_prefix(target)?).suffix(PART).make_in(folder_of(target), open)
}

/// The part of a target that `hums box pull` has begun, beside it: a later call goes on with it.
pub(super) fn begun_of(target: &Path) -> Result<PathBuf> {
    let Some(name) = target.file_name() else {
        bail!("{}: is no name of a file", target.display());
    };
    let mut part = std::ffi::OsString::from(".");
    part.push(name);
    part.push(".pull");
    part.push(PART);
    Ok(target.with_file_name(part))
}

/// Makes a directory, unless it is there.
pub fn make_directory(dir: &Path) -> Result<()> {
    check_directory(dir)?;
    fs::create_dir_all(dir).with_context(|| format!("{}: cannot be made", dir.display()))
}

fn check_directory(dir: &Path) -> Result<()> {
    // Without a slash at its end, with which a file is not found.
    let dir: PathBuf = dir.components().collect();
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

/// Says that a file cannot be written.
pub fn cannot_write(path: &Path) -> String {
    format!("{}: cannot be written", path.display())
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
