//! The destination of a log's files.

use std::path::{Path, PathBuf};

use crate::context::Formats;
use crate::files::{appended, says_directory};
use crate::format::Files;

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
    pub fn new(output: &Path, name: &str, logs: usize, formats: &Formats) -> Self {
        if logs == 1 && formats.is_single_file() && !says_directory(output) {
            return Self::File(output.to_owned());
        }
        Self::Named(output.join(name))
    }

    /// The path of a format's file or folder; `None` is standard output, or the folder of a fleet.
    pub fn path(&self, files: Files) -> Option<PathBuf> {
        match (self, files) {
            (Self::Standard, _) | (_, Files::Fleet(_)) => None,
            (Self::File(path), _) => Some(path.clone()),
            (Self::Named(name), Files::One(extension) | Files::Tables(Some(extension), _)) => {
                Some(appended(name, extension))
            }
            (Self::Named(name), Files::Tables(None, _)) => Some(name.clone()),
        }
    }
}
