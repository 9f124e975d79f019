//! The file that a path leads to, whatever its spelling: links, hard links, `./` and `..` give one identity.

use std::fs::Metadata;
use std::io;
use std::path::{Path, PathBuf};

/// The identity of a file that exists: device and inode; on Windows the volume's serial number and the file's index in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FileId(u64, u64);

impl FileId {
    /// The identity of the file that `path` leads to.
    #[cfg(unix)]
    pub fn of(path: &Path) -> io::Result<Self> {
        use std::os::unix::fs::MetadataExt as _;
        path.metadata().map(|about| Self(about.dev(), about.ino()))
    }

    /// The identity of the file that `path` leads to. A browser's files have no links: a path is one file.
    #[cfg(target_family = "wasm")]
    pub fn of(path: &Path) -> io::Result<Self> {
        use std::hash::{DefaultHasher, Hash as _, Hasher as _};
        use std::path::Component;
        path.metadata()?;
        let mut hasher = DefaultHasher::new();
        path.components()
            .filter(|part| !matches!(part, Component::RootDir | Component::CurDir))
            .for_each(|part| part.hash(&mut hasher));
        Ok(Self(0, hasher.finish()))
    }

    /// The identity of the file that `path` leads to.
    #[cfg(windows)]
    pub fn of(path: &Path) -> io::Result<Self> {
        let about = winapi_util::file::information(winapi_util::Handle::from_path_any(path)?)?;
        Ok(Self(about.volume_serial_number(), about.file_index()))
    }
}

pub(super) fn without_links(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
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
