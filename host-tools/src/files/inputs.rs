//! What a command reads, which no output may be, and whether its outputs may replace what is there.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use anyhow::Result;

use super::descriptor::{Opened, STANDARD_INPUT};
use super::identity::FileId;
use crate::endpoint::Endpoint;
use crate::outcome::usage;

/// The inputs of a command, and what else of it must not be written over.
#[derive(Clone, Debug, Default)]
pub struct Inputs {
    files: BTreeMap<FileId, String>,
    /// What an earlier run of the same command made, named as an input.
    compared: BTreeSet<FileId>,
    /// `--replace`
    replace: bool,
    /// One of them comes live: what is made of it cannot be made again.
    live: bool,
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

    /// The same where the command line says whether outputs may replace what is there with other content.
    #[must_use]
    pub fn replacing(mut self, replace: bool) -> Self {
        self.replace = replace;
        self
    }

    /// An input that is not read, because the command made it earlier and makes it again: it is compared with what is
    /// made now, and never replaced.
    pub fn compare_only(&mut self, path: &Path) {
        if let Ok(id) = FileId::of(path) {
            self.files.remove(&id);
            self.compared.insert(id);
        }
    }

    /// Whether what is at `path` may be replaced with other content.
    pub(super) fn may_replace(&self, path: &Path) -> bool {
        self.replace && FileId::of(path).is_ok_and(|id| !self.compared.contains(&id))
    }

    /// Adds a file. One that cannot be looked at is none: whoever opens it says so. A folder is none either (what is
    /// read of it is named file by file), and a device such as `/dev/null` may be read and written.
    pub fn add(&mut self, path: &Path) {
        let Ok(id) = FileId::of(path) else { return };
        if fs::metadata(path).is_ok_and(|about| !about.is_file()) {
            return;
        }
        self.files.insert(id, path.display().to_string());
    }

    /// Whether one of them comes live.
    pub(super) const fn is_live(&self) -> bool {
        self.live
    }

    /// Adds what an endpoint reads.
    pub fn add_endpoint(&mut self, endpoint: &Endpoint) {
        self.live |= endpoint.is_live();
        match endpoint {
            Endpoint::File(path) => self.add(path),
            Endpoint::Standard => {
                if let Some(id) = Opened::of(STANDARD_INPUT).and_then(|input| input.id()) {
                    self.files.insert(id, "standard input".to_owned());
                }
            }
            _ => {}
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
