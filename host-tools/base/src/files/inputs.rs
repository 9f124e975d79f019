//! A command's inputs, which no output may be, and whether its outputs may replace existing files.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::Result;

use super::identity::FileId;
use crate::endpoint::Endpoint;
use crate::outcome::usage;

/// The inputs of a command, and its other files that must not be overwritten.
#[derive(Clone, Debug, Default)]
pub struct Inputs {
    files: BTreeMap<FileId, String>,
    /// `--force`; none if the command has no such flag.
    force: Option<bool>,
    /// One of them is live: its output cannot be repeated.
    live: bool,
}

impl Inputs {
    /// The inputs of a command that reads no file.
    pub fn none() -> Self {
        Self::default()
    }

    /// Inputs from files and folders.
    pub fn of<P: AsRef<Path>>(paths: impl IntoIterator<Item = P>) -> Self {
        let mut inputs = Self::none();
        paths.into_iter().for_each(|path| inputs.add(path.as_ref()));
        inputs
    }

    /// The same for a command whose outputs may replace files with `--force`.
    #[must_use]
    pub fn forcing(mut self, force: bool) -> Self {
        self.force = Some(force);
        self
    }

    /// Whether outputs may replace files.
    pub fn may_replace(&self) -> bool {
        self.force == Some(true)
    }

    /// Whether the command has a flag with which they may.
    pub const fn can_replace(&self) -> bool {
        self.force.is_some()
    }

    /// Adds a file. An unreadable one is ignored: the reader reports it. Folders are ignored too (their files are
    /// added one by one), and devices such as `/dev/null`, which may be read and written.
    pub fn add(&mut self, path: &Path) {
        let Ok(id) = FileId::of(path) else { return };
        if fs::metadata(path).is_ok_and(|about| !about.is_file()) {
            return;
        }
        self.files.insert(id, path.display().to_string());
    }

    pub(super) const fn is_live(&self) -> bool {
        self.live
    }

    /// Adds the file of an endpoint.
    pub fn add_endpoint(&mut self, endpoint: &Endpoint) {
        self.live |= endpoint.is_live();
        if let Endpoint::File(path) = endpoint {
            self.add(path);
        }
    }

    /// Refuses an output that is an input.
    pub fn refuse(&self, output: &Path) -> Result<()> {
        let shown = output.display();
        let Ok(id) = FileId::of(output) else { return Ok(()) };
        let Some(input) = self.files.get(&id) else { return Ok(()) };
        let which =
            if *input == shown.to_string() { String::new() } else { format!(", the same file as {input}") };
        Err(usage(format!(
            "{shown}: is an input of this command{which}, and stays as it is; name another output"
        )))
    }
}
