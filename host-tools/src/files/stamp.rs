//! The file `.hums` of a folder of tables: what they were made of, and which files are ours.
//!
//! ```text
//! hums session s1a2b3c4d sectors 00112233445566778899aabbccddeeff
//! files 2
//! has 10414 entries, 0 gaps
//! ATTITUDE.csv
//! HEARTBEAT.csv
//! ```

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::Path;

use super::amount::Amount;

/// The name of the file.
pub(super) const STAMP: &str = ".hums";
/// A stamp is a line and some hundred names.
const BYTES_MAX: u64 = 4 << 20;

/// What a stamp says.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Stamp {
    /// What the tables were made of, a line.
    pub(super) made_of: String,
    /// How much of it is in them; none where nobody told, as earlier versions did not.
    pub(super) amount: Option<Amount>,
    /// The names of the files that were made; none while the folder is being made, or where the stamp is cut off.
    pub(super) files: BTreeSet<String>,
}

impl Stamp {
    /// That of a folder, if it has one.
    pub(super) fn of(folder: &Path) -> Option<Self> {
        let path = folder.join(STAMP);
        fs::symlink_metadata(&path).ok().filter(|about| about.is_file() && about.len() <= BYTES_MAX)?;
        let text = fs::read_to_string(path).ok()?;
        let mut lines = text.lines();
        let made_of = lines.next().unwrap_or_default().to_owned();
        let count: Option<usize> = lines.next().and_then(|line| line.strip_prefix("files ")?.parse().ok());
        let mut lines = lines.peekable();
        let amount = lines.peek().and_then(|line| Amount::parse(line.strip_prefix("has ")?));
        let mut files: BTreeSet<String> =
            lines.skip(usize::from(amount.is_some())).map(str::to_owned).collect();
        if count != Some(files.len()) || !text.ends_with('\n') {
            files.clear();
        }
        Some(Self { made_of, amount, files })
    }

    /// Writes it.
    pub(super) fn write(&self, mut file: &File) -> io::Result<()> {
        let mut text = format!("{}\nfiles {}\n", self.made_of, self.files.len());
        let amount = self.amount.map(|amount| format!("has {amount}"));
        for line in amount.iter().chain(&self.files) {
            text.push_str(line);
            text.push('\n');
        }
        file.write_all(text.as_bytes())
    }

    /// Whether a file of this name is ours.
    pub(super) fn has(&self, name: &str) -> bool {
        name == STAMP || self.files.contains(name)
    }
}

/// The first entry of a folder that is not ours.
pub(super) fn foreign(folder: &Path, is_ours: impl Fn(&str) -> bool) -> io::Result<Option<String>> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if !is_ours(&name) || !entry.file_type()?.is_file() {
            return Ok(Some(name));
        }
    }
    Ok(None)
}
