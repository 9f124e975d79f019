//! The destination of a log's files.

use std::path::{Path, PathBuf};

use crate::files::{appended, says_directory};

use super::context::Formats;

/// The destination of a log's files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Destination {
    /// The one file goes to standard output.
    Standard,
    /// The one file has this name.
    File(PathBuf),
    /// Single files have this name with an extension; tables are in directories of this name.
    Named(PathBuf),
}

impl Destination {
    /// By the rule in `hums decode --help`; `name` is the log's.
    pub fn new(output: &Path, name: &str, logs: usize, formats: Formats) -> Self {
        if logs == 1 && formats.is_single_file() && !says_directory(output) {
            return Self::File(output.to_owned());
        }
        Self::Named(output.join(name))
    }

    /// The path of the single file with this extension; `None` is standard output.
    pub fn path(&self, extension: &str) -> Option<PathBuf> {
        match self {
            Self::Standard => None,
            Self::File(path) => Some(path.clone()),
            Self::Named(name) => Some(appended(name, extension)),
        }
    }

    /// The directory of the CSV tables; `None` for a single file.
    pub fn tables(&self) -> Option<PathBuf> {
        match self {
            Self::Standard | Self::File(_) => None,
            Self::Named(name) => Some(name.clone()),
        }
    }

    /// The directory of the reference system's tables; `None` for a single file.
    pub fn thesis(&self) -> Option<PathBuf> {
        self.tables().map(|name| appended(&name, "thesis"))
    }
}
