//! Which file a path means, whatever its spelling: links, hard links, `./` and `..` come out alike.

use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use anyhow::Result;

use crate::outcome::usage;

/// A file's identity.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FileId {
    /// A file that exists.
    Existing(Node),
    /// A place where there is no file yet: its folder without links, and its name.
    Place(PathBuf),
}

/// Device and inode.
#[cfg(unix)]
type Node = (u64, u64);

/// The path without links. Two hard links of one file differ by it: Windows has a file index, which the standard
/// library does not give yet.
#[cfg(not(unix))]
type Node = PathBuf;

#[cfg(unix)]
fn node(path: &Path) -> io::Result<Node> {
    fs::metadata(path).map(|about| node_of(&about))
}

#[cfg(unix)]
fn node_of(about: &fs::Metadata) -> Node {
    use std::os::unix::fs::MetadataExt as _;
    (about.dev(), about.ino())
}

#[cfg(not(unix))]
fn node(path: &Path) -> io::Result<Node> {
    path.canonicalize()
}

impl FileId {
    /// The identity of what `path` means. Links are followed, also one to a file that is not there yet. `..` behind a folder
    /// that is not there leads back to where that folder would be made.
    pub fn of(path: &Path) -> io::Result<Self> {
        match node(path) {
            Ok(node) => Ok(Self::Existing(node)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => match folded(path) {
                Some(path) => Self::of(&path),
                None => Ok(Self::Place(place(path)?)),
            },
            Err(error) => Err(error),
        }
    }

    /// The file that standard input is, where it is one.
    pub fn of_standard_input() -> Option<Self> {
        standard(io::stdin())
    }

    /// The file that standard output is, where it is one.
    pub fn of_standard_output() -> Option<Self> {
        standard(io::stdout())
    }

    /// The file that standard error is, where it is one.
    fn of_standard_error() -> Option<Self> {
        standard(io::stderr())
    }
}

/// The word of a command line, or standard input, that is the file to which this stream leads. A word that means standard
/// output itself (`-o /dev/stdout`) is none.
fn named(stream: &FileId, words: &[OsString]) -> Option<String> {
    let values = words.iter().filter_map(|word| {
        let word = word.to_str()?;
        Some([Some(word), word.split_once('=').map(|(_, value)| value)])
    });
    let is_it = |word: &&str| {
        let path = Path::new(*word);
        !means_standard_output(path) && FileId::of(path).is_ok_and(|id| id == *stream)
    };
    let word = values.flatten().flatten().find(is_it).map(str::to_owned);
    let is_input = || FileId::of_standard_input().is_some_and(|id| id == *stream);
    word.or_else(|| is_input().then(|| "standard input".to_owned()))
}

/// Refuses a standard output that leads into a file which the command line names: `hums check a.tlog >> a.tlog`, also through a
/// link, as standard input or as `--key`. Inputs that lie in a folder are refused once they are known ([`super::Inputs`]).
pub fn check_standard_output_is_not_named(words: &[OsString]) -> Result<()> {
    match FileId::of_standard_output().and_then(|stream| named(&stream, words)) {
        Some(word) => Err(usage(format!(
            "standard output: goes into {word}, which this command line names; nothing was written; send it elsewhere"
        ))),
        None => Ok(()),
    }
}

/// Whether standard error leads into such a file: then nothing may be said there.
pub fn is_standard_error_named(words: &[OsString]) -> bool {
    FileId::of_standard_error().is_some_and(|stream| named(&stream, words).is_some())
}

#[cfg(unix)]
fn standard(stream: impl std::os::fd::AsFd) -> Option<FileId> {
    let about = about(stream).filter(fs::Metadata::is_file)?;
    Some(FileId::Existing(node_of(&about)))
}

/// What is known of a stream that is open.
#[cfg(unix)]
fn about(stream: impl std::os::fd::AsFd) -> Option<fs::Metadata> {
    fs::File::from(stream.as_fd().try_clone_to_owned().ok()?).metadata().ok()
}

#[cfg(not(unix))]
fn standard<T>(_: T) -> Option<FileId> {
    None
}

/// Whether an open file, pipe or terminal is what standard output is.
#[cfg(unix)]
pub(super) fn is_standard_output(file: &fs::File) -> bool {
    about(io::stdout()).zip(about(file)).is_some_and(|(output, file)| node_of(&output) == node_of(&file))
}

#[cfg(not(unix))]
pub(super) fn is_standard_output(_: &fs::File) -> bool {
    false
}

/// A path without the `missing/..` in it; `None` where there is none.
pub(super) fn folded(path: &Path) -> Option<PathBuf> {
    let (mut kept, mut is_folded) = (PathBuf::new(), false);
    for part in path.components() {
        let is_missing = part == Component::ParentDir
            && matches!(kept.components().next_back(), Some(Component::Normal(_)))
            && fs::symlink_metadata(&kept).is_err();
        if is_missing {
            kept.pop();
        } else {
            kept.push(part);
        }
        is_folded |= is_missing;
    }
    is_folded.then_some(kept)
}

/// A path whose last part is no link, and whose folder is without links. The folder must be there.
fn place(path: &Path) -> io::Result<PathBuf> {
    let path = without_links(path)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_name().ok_or(io::ErrorKind::InvalidInput)?;
    // A folder that is made later has no links in it.
    Ok(folder.canonicalize().or_else(|_| std::path::absolute(folder))?.join(name))
}

/// Links in a row that are followed: as many as Linux follows.
const LINKS_MAX: usize = 40;

/// What a link leads to, through as many links as there are, also where nothing is there yet.
pub(super) fn without_links(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..LINKS_MAX {
        if !path.is_symlink() {
            return Ok(path);
        }
        path = linked(&path)?;
    }
    Err(io::Error::other("too many links"))
}

/// Whether what a path leads to is what lies at `target`, which is [`without_links`] of it. What nothing is at yet may be made
/// there, and what is neither a file nor a folder is written as it is.
pub(super) fn leads_to(path: &Path, target: &Path) -> bool {
    let Ok(about) = fs::metadata(path) else { return true };
    let is_ours = descriptor(path).is_some() && !about.is_dir();
    let is_kept = about.is_file() || about.is_dir();
    is_ours || !is_kept || node(path).ok() == node(target).ok()
}

/// Where one link leads to.
fn linked(path: &Path) -> io::Result<PathBuf> {
    let to = fs::read_link(path)?;
    Ok(path.parent().unwrap_or(Path::new("")).join(to))
}

/// The number of what this process has open, where a path means that, as `/dev/stdout` and `/dev/fd/3` do: what the shell
/// opened, also where that is a regular file. What is only spelled through `/proc` is none: `/proc/self/cwd/FILE` is a file.
pub(super) fn descriptor(path: &Path) -> Option<u32> {
    let mut path = path.to_owned();
    for _ in 0..LINKS_MAX {
        if path.parent().is_some_and(is_own_descriptors) {
            return path.file_name()?.to_str()?.parse().ok();
        }
        path = linked(&path).ok()?;
    }
    None
}

/// The descriptor of standard output.
const STANDARD_OUTPUT: u32 = 1;

/// Whether a path means standard output: `-` does, and `/dev/stdout`.
pub fn means_standard_output(path: &Path) -> bool {
    path == Path::new("-") || descriptor(path) == Some(STANDARD_OUTPUT)
}

/// Refuses to write to a file that is open and has bytes where it would be written: somebody opened it without emptying
/// it (`1<>FILE`), and it is not ours to overwrite. What is open to append is appended to.
pub(super) fn refuse_overwriting(number: u32) -> Result<()> {
    // Only Linux tells; elsewhere no path means a descriptor.
    let place = PathBuf::from(format!("/proc/self/fd/{number}"));
    let about = fs::metadata(&place).ok().filter(fs::Metadata::is_file);
    let open = fs::read_to_string(format!("/proc/self/fdinfo/{number}")).ok();
    let Some((about, open)) = about.zip(open) else { return Ok(()) };
    let field = |name: &str| open.lines().find_map(|line| line.strip_prefix(name)).map(str::trim);
    let at = field("pos:").and_then(|at| at.parse().ok()).unwrap_or(0_u64);
    let flags = field("flags:").and_then(|flags| u32::from_str_radix(flags, 8).ok()).unwrap_or(0);
    if appends(flags) || at >= about.len() {
        return Ok(());
    }
    let which =
        if number == STANDARD_OUTPUT { "standard output".to_owned() } else { format!("descriptor {number}") };
    let file = fs::read_link(&place).unwrap_or(place);
    Err(usage(format!(
        "{which}: goes into {}, which has something in it where it would be written; nothing was written; open it with > \
         or >>",
        file.display()
    )))
}

/// Refuses a standard output that is closed: what is made would be gone, without an error. Rust opens `/dev/null` in its place
/// for reading and writing, which `>/dev/null` does not.
pub fn check_standard_output_is_open() -> Result<()> {
    let same = |one: &Path, other: &Path| {
        FileId::of(one).ok().zip(FileId::of(other).ok()).is_some_and(|(a, b)| a == b)
    };
    let open = fs::read_to_string(format!("/proc/self/fdinfo/{STANDARD_OUTPUT}")).unwrap_or_default();
    let flags = open.lines().find_map(|line| line.strip_prefix("flags:")).map(str::trim);
    let is_both = flags.is_some_and(|flags| flags.ends_with('2'));
    if is_both && same(Path::new("/dev/null"), &Path::new("/proc/self/fd").join(STANDARD_OUTPUT.to_string()))
    {
        return Err(usage("standard output: is closed; nothing was written; name a file"));
    }
    Ok(())
}

/// Refuses a standard output that would be written over what is there.
pub fn check_standard_output() -> Result<()> {
    refuse_overwriting(STANDARD_OUTPUT)
}

/// Whether what is open with these flags is written at its end.
#[cfg(unix)]
fn appends(flags: u32) -> bool {
    flags & rustix::fs::OFlags::APPEND.bits() != 0
}

#[cfg(not(unix))]
const fn appends(_: u32) -> bool {
    true
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
