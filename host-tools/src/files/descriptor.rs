//! What this process has open, where a shell or a path means it by its number: `>> FILE`, `/dev/stdout`, `/dev/fd/3`.

use std::fs::{self, File, Metadata};
use std::path::{Path, PathBuf};

use anyhow::Result;

use super::identity::{FileId, LINKS_MAX, is_seekable, linked};
use crate::outcome::usage;

/// Where the system shows what this process has open.
const OWN: &str = if cfg!(target_os = "linux") { "/proc/self/fd" } else { "/dev/fd" };

/// The number of standard input.
pub const STANDARD_INPUT: u32 = 0;
/// The number of standard output.
pub const STANDARD_OUTPUT: u32 = 1;
/// The number of standard error.
pub const STANDARD_ERROR: u32 = 2;

/// The number of what this process has open, where a path means that, as `/dev/stdout` and `/dev/fd/3` do: what the shell
/// opened, also where that is a regular file. What is only spelled through `/proc` is none: `/proc/self/cwd/FILE` is a file.
pub fn descriptor(path: &Path) -> Option<u32> {
    let mut path = path.to_owned();
    for _ in 0..LINKS_MAX {
        if path.parent().is_some_and(is_own_descriptors) {
            return path.file_name()?.to_str()?.parse().ok();
        }
        path = linked(&path).ok()?;
    }
    None
}

/// Whether a folder is the one of this process's descriptors: `/proc/PID/fd`, or a thread's, `/proc/PID/task/TID/fd`.
fn is_own_descriptors(folder: &Path) -> bool {
    let Ok(folder) = folder.canonicalize() else { return false };
    let own = PathBuf::from(format!("/proc/{}", std::process::id()));
    folder.strip_prefix(own).is_ok_and(|rest| {
        let parts: Vec<_> = rest.iter().filter_map(|part| part.to_str()).collect();
        matches!(parts[..], ["fd"] | ["task", _, "fd"])
    })
}

/// Whether a path means standard output: `-` does, and `/dev/stdout`.
pub fn means_standard_output(path: &Path) -> bool {
    path == Path::new("-") || descriptor(path) == Some(STANDARD_OUTPUT)
}

/// A regular file, or a disk or a card, that somebody opened for this process.
#[derive(Debug)]
pub struct Opened {
    number: u32,
    about: Metadata,
}

impl Opened {
    /// What is open under this number, where that is such a file and the system shows it.
    pub fn of(number: u32) -> Option<Self> {
        let about = fs::metadata(shown_at(number)).ok().filter(is_seekable)?;
        Some(Self { number, about })
    }

    /// Which file it is.
    pub fn id(&self) -> Option<FileId> {
        FileId::of(&self.content()).ok()
    }

    /// Its name, as far as the system knows one.
    pub fn path(&self) -> PathBuf {
        fs::read_link(self.content()).unwrap_or_else(|_| self.content())
    }

    /// Where it can be read, whatever became of its name.
    pub fn content(&self) -> PathBuf {
        shown_at(self.number)
    }

    /// Whether nothing is in it.
    pub fn is_empty(&self) -> bool {
        self.about.len() == 0
    }

    /// Refuses one that has bytes where it would be written (`1<>FILE`): they are not ours to overwrite. What is open to append
    /// is written at its end, which a disk has not.
    pub fn check(&self) -> Result<(), String> {
        if !self.about.is_file() {
            return Err(format!(
                "goes into {}, which is a disk or a card; nothing was written; send it into a file",
                self.path().display()
            ));
        }
        let open = fs::read_to_string(format!("/proc/self/fdinfo/{}", self.number)).unwrap_or_default();
        let field = |name: &str| open.lines().find_map(|line| line.strip_prefix(name)).map(str::trim);
        let flags = field("flags:").and_then(|flags| u32::from_str_radix(flags, 8).ok());
        // Where the system does not tell, it was opened as shells open a file.
        let at: u64 = field("pos:").and_then(|at| at.parse().ok()).unwrap_or(u64::MAX);
        if flags.is_some_and(appends) || at >= self.about.len() {
            return Ok(());
        }
        Err(format!(
            "goes into {}, which has something in it where it would be written; nothing was written; open it with > or >>",
            self.path().display()
        ))
    }

    /// Refuses one that has anything in it, for what a command makes: a second log behind a first one is not read, and a second
    /// table would be read as a part of the first.
    pub fn check_empty(&self) -> Result<(), String> {
        self.check()?;
        if self.is_empty() {
            return Ok(());
        }
        Err(format!(
            "goes into {}, which has something in it, behind which nothing is made; nothing was written; name a new file",
            self.path().display()
        ))
    }
}

fn shown_at(number: u32) -> PathBuf {
    Path::new(OWN).join(number.to_string())
}

/// Whether what is open with these flags is written at its end.
#[cfg(target_os = "linux")]
fn appends(flags: u32) -> bool {
    flags & rustix::fs::OFlags::APPEND.bits() != 0
}

#[cfg(not(target_os = "linux"))]
const fn appends(_: u32) -> bool {
    true
}

/// Whether an open file, pipe or terminal is what standard output is.
#[cfg(unix)]
pub(super) fn is_standard_output(file: &File) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let about = fs::metadata(shown_at(STANDARD_OUTPUT)).ok().zip(file.metadata().ok());
    about.is_some_and(|(output, file)| (output.dev(), output.ino()) == (file.dev(), file.ino()))
}

#[cfg(not(unix))]
pub(super) fn is_standard_output(_: &File) -> bool {
    false
}

/// Refuses a standard output on which nothing can be made. One that is closed: what is made would be gone, without an error. Rust
/// opens `/dev/null` in its place for reading and writing, which `>/dev/null` does not. And a file with something in it.
pub fn check_standard_output() -> Result<()> {
    let same = |one: &Path, other: &Path| {
        FileId::of(one).ok().zip(FileId::of(other).ok()).is_some_and(|(a, b)| a == b)
    };
    let open = fs::read_to_string(format!("/proc/self/fdinfo/{STANDARD_OUTPUT}")).unwrap_or_default();
    let flags = open.lines().find_map(|line| line.strip_prefix("flags:")).map(str::trim);
    let is_both = flags.is_some_and(|flags| flags.ends_with('2'));
    if is_both && same(Path::new("/dev/null"), &shown_at(STANDARD_OUTPUT)) {
        return Err(usage("standard output: is closed; nothing was written; name a file"));
    }
    Opened::of(STANDARD_OUTPUT)
        .map_or(Ok(()), |opened| opened.check_empty())
        .map_err(|why| usage(format!("standard output: {why}")))
}
