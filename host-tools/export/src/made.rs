//! The outputs of a decoding, for people and as JSON.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::plural::{count, noun};

/// Output of `hums decode --json`.
#[derive(Debug, Default, Serialize)]
pub struct MadeJson {
    /// By log.
    pub logs: Vec<LogJson>,
}

/// A log, and its outputs.
#[derive(Debug, Serialize)]
pub struct LogJson {
    /// Its name.
    pub name: String,
    /// The log is complete, undamaged and proved, and all requested outputs are there.
    pub whole: bool,
    /// Its files and folders.
    pub files: Vec<OutputFile>,
}

/// A file, or a folder of tables.
#[derive(Debug, Serialize)]
pub struct OutputFile {
    path: PathBuf,
    /// The name of a format, or `gaps`.
    format: &'static str,
    /// Counts of its content: `frames`, `records`, `rows`, `tables`, `objects` and so on.
    counts: BTreeMap<String, u64>,
    #[serde(skip)]
    words: String,
}

impl OutputFile {
    /// With these counts.
    pub fn of(path: PathBuf, format: &'static str, counts: &[(u64, &str)]) -> Self {
        let words: Vec<String> = counts.iter().map(|(number, thing)| count(*number, thing)).collect();
        let counts = counts.iter().map(|(number, thing)| (noun(2, thing), *number)).collect();
        Self { path, format, counts, words: words.join(", ") }
    }

    /// With this description.
    pub fn with_words(path: PathBuf, format: &'static str, words: String) -> Self {
        Self { path, format, counts: BTreeMap::new(), words }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// For people.
    pub fn line(&self) -> String {
        format!("{}: {}", self.path.display(), self.words)
    }
}
