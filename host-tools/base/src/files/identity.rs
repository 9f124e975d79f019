//! Which file a path means, whatever its spelling: links, hard links, `./` and `..` come out alike.

use std::fs::{self, Metadata};
use std::io;
use std::path::{Component, Path, PathBuf};

/// A file's identity.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FileId {
    /// A file that exists.
    Existing(Node),
    /// A place without a file yet: its folder without links, and its name.
    Place(PathBuf),
}

/// Device and inode; on Windows the volume's serial number and the file's index in it.
type Node = (u64, u64);

#[cfg(unix)]
fn node(path: &Path) -> io::Result<Node> {
    use std::os::unix::fs::MetadataExt as _;
    fs::metadata(path).map(|about| (about.dev(), about.ino()))
}

/// A browser's files have no links: a path is one file.
#[cfg(target_family = "wasm")]
fn node(path: &Path) -> io::Result<Node> {
    use std::hash::{DefaultHasher, Hash as _, Hasher as _};
    fs::metadata(path)?;
    let mut hasher = DefaultHasher::new();
    path.components()
        .filter(|part| !matches!(part, Component::RootDir | Component::CurDir))
        .for_each(|part| part.hash(&mut hasher));
    Ok((0, hasher.finish()))
}

#[cfg(windows)]
fn node(path: &Path) -> io::Result<Node> {
    let about = winapi_util::file::information(winapi_util::Handle::from_path_any(path)?)?;
    Ok((about.volume_serial_number(), about.file_index()))
}

impl FileId {
    /// The identity of a path's file. Links are followed, also to a file that does not exist yet. `..` behind a
    /// missing folder leads back to its future parent, and a slash behind a file's name is ignored.
    pub fn of(path: &Path) -> io::Result<Self> {
        match node(path) {
            Ok(node) => Ok(Self::Existing(node)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => match folded(path) {
                Some(path) => Self::of(&path),
                None => Ok(Self::Place(place(path)?)),
            },
            Err(error) => {
                match without_slash(path).filter(|_| error.kind() == io::ErrorKind::NotADirectory) {
                    Some(path) => Self::of(&path),
                    None => Err(error),
                }
            }
        }
    }
}

/// A path without the slash at its end; `None` where there is none.
fn without_slash(path: &Path) -> Option<PathBuf> {
    let without: PathBuf = path.components().collect();
    (without.as_os_str() != path.as_os_str()).then_some(without)
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

/// A path whose last part is not a link, and whose folder is without links. The folder must be there.
fn place(path: &Path) -> io::Result<PathBuf> {
    let path = without_links(path)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_name().ok_or(io::ErrorKind::InvalidInput)?;
    // A folder that is made later has no links in it.
    Ok(folder.canonicalize().or_else(|_| std::path::absolute(folder))?.join(name))
}

/// Links in a row that are followed: as many as Linux follows.
const LINKS_MAX: usize = 40;

/// The target of a chain of links, even if it does not exist yet.
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

/// The target of one link.
fn linked(path: &Path) -> io::Result<PathBuf> {
    let to = fs::read_link(path)?;
    Ok(path.parent().unwrap_or(Path::new("")).join(to))
}

/// Whether it can be read from any place, and has an end: a file, or a raw device such as a card reader's.
pub fn is_seekable(about: &Metadata) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        about.is_file() || about.file_type().is_block_device()
    }
    #[cfg(not(unix))]
    about.is_file()
}
