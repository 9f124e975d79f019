//! The outputs of a decoding, for people and as JSON.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Serialize;

use crate::plural::{count, noun};

/// Output of `hums decode --json`.
#[derive(Debug, Default, Serialize)]
pub struct MadeJson {
    /// Decoded logs.
    pub logs: Vec<LogJson>,
}

/// A log, and its outputs.
#[derive(Debug, Serialize)]
pub struct LogJson {
    /// Its name.
    pub name: String,
    /// `whole`, `repaired` (nothing is lost), `not_proved`, or `lacks` for a log with losses or damage.
    pub state: &'static str,
    /// No loss, no damage, a proved end, and all requested outputs.
    pub whole: bool,
    /// Its files and folders.
    pub files: Vec<OutputFile>,
}

/// A file, or a folder of tables.
#[derive(Debug, Serialize)]
pub struct OutputFile {
    /// A file, or a folder of tables.
    path: PathBuf,
    /// Name of a format (`docs/decode.md`), or `gaps` (beside a tlog).
    format: &'static str,
    /// Those that apply: `frames`, `records`, `rows`, `tables`, `objects`, `points`, `seconds`, `bytes`, `messages`,
    /// `parameters`, `places`, `findings`, `subtitles`.
    counts: BTreeMap<String, u64>,
    #[serde(skip)]
    words: String,
    /// The files, if they are in several folders.
    #[serde(skip)]
    files: Vec<PathBuf>,
}

impl OutputFile {
    /// With these counts.
    pub fn of(path: PathBuf, format: &'static str, counts: &[(u64, &str)]) -> Self {
        let words: Vec<String> = counts.iter().map(|(number, thing)| count(*number, thing)).collect();
        let counts = counts.iter().map(|(number, thing)| (noun(2, thing), *number)).collect();
        Self { path, format, counts, words: words.join(", "), files: Vec::new() }
    }

    /// With this description.
    pub fn with_words(path: PathBuf, format: &'static str, words: String) -> Self {
        Self { path, format, counts: BTreeMap::new(), words, files: Vec::new() }
    }

    /// With these files in several folders.
    #[must_use]
    pub fn with_files(self, files: Vec<PathBuf>) -> Self {
        Self { files, ..self }
    }

    /// Its files and folders.
    pub fn files(&self) -> &[PathBuf] {
        if self.files.is_empty() { std::slice::from_ref(&self.path) } else { &self.files }
    }

    /// The made files as a line for people.
    pub fn line(&self) -> String {
        format!("{}: {}", self.path.display(), self.words)
    }
}
