//! What a command reads: no output may be one of these.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Result;

use super::identity::{FileId, without_links};
use crate::endpoint::Endpoint;
use crate::outcome::usage;

/// The inputs of a command, and what else of it must not be written over.
#[derive(Clone, Debug, Default)]
pub struct Inputs {
    files: BTreeMap<FileId, String>,
    folders: BTreeMap<FileId, PathBuf>,
}

impl Inputs {
    /// None: of a command that reads no file.
    pub fn none() -> Self {
        Self::default()
    }

    /// These files and folders.
    pub fn of<P: AsRef<Path>>(paths: impl IntoIterator<Item = P>) -> Self {
        let mut inputs = Self::none();
        paths.into_iter().for_each(|path| inputs.add(path.as_ref()));
        inputs
    }

    /// The same without the input folders: for outputs that the command names itself, after the session that is in them.
    /// An earlier run's may be replaced, wherever they lie.
    pub fn without_folders(&self) -> Self {
        Self { files: self.files.clone(), folders: BTreeMap::new() }
    }

    /// Adds a file or a folder. One that cannot be looked at is none: whoever opens it says so.
    pub fn add(&mut self, path: &Path) {
        let Ok(id) = FileId::of(path) else { return };
        match fs::metadata(path) {
            Ok(about) if about.is_dir() => {
                self.folders.insert(id, path.to_owned());
            }
            // A device such as /dev/null may be read and written.
            Ok(about) if !about.is_file() => {}
            _ => {
                self.files.insert(id, path.display().to_string());
            }
        }
    }

    /// Adds what an endpoint reads, where that is a file.
    pub fn add_endpoint(&mut self, endpoint: &Endpoint) {
        match endpoint {
            Endpoint::File(path) => self.add(path),
            Endpoint::Standard => {
                if let Some(id) = FileId::of_standard_input() {
                    self.files.insert(id, "standard input".to_owned());
                }
            }
            _ => {}
        }
    }

    /// Refuses an output that is an input, and one that would replace a file inside an input folder.
    pub fn refuse(&self, output: &Path) -> Result<()> {
        let shown = output.display();
        let Ok(id) = FileId::of(output) else { return Ok(()) };
        if let Some(input) = self.files.get(&id) {
            let which = if *input == shown.to_string() {
                String::new()
            } else {
                format!(", the same file as {input}")
            };
            return Err(usage(format!(
                "{shown}: is an input of this command{which}; nothing was written; name another output"
            )));
        }
        if output.is_file()
            && let Some(folder) = self.folder_around(output)
        {
            return Err(usage(format!(
                "{shown}: is there already, and lies in the input folder {}, in which nothing is replaced; name \
                 another output",
                folder.display()
            )));
        }
        Ok(())
    }

    /// Refuses standard output where it leads into an input.
    pub fn refuse_standard_output(&self) -> Result<()> {
        match FileId::of_standard_output().and_then(|id| self.files.get(&id)) {
            Some(input) => {
                Err(usage(format!("standard output: goes into {input}, an input of this command")))
            }
            None => Ok(()),
        }
    }

    /// The input folder that a path lies in, if any.
    pub fn folder_around(&self, path: &Path) -> Option<&PathBuf> {
        if self.folders.is_empty() {
            return None;
        }
        let path = without_links(path).ok()?;
        let path = path.canonicalize().or_else(|_| std::path::absolute(&path)).ok()?;
        path.ancestors().skip(1).find_map(|folder| self.folders.get(&FileId::of(folder).ok()?))
    }
}
