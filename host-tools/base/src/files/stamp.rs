//! The file `.hums` of a folder of tables: which session they are of, and which files are ours.
//!
//! ```text
//! hums session s1a2b3c4d
//! files 2
//! ATTITUDE.csv
//! HEARTBEAT.csv
//! ```

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::Path;

pub(super) const STAMP: &str = ".hums";
/// A stamp is a line and some hundred names.
const BYTES_MAX: u64 = 4 << 20;

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Stamp {
    pub(super) session: String,
    /// Files that were made; none while the folder is being made, or where the stamp is cut off.
    pub(super) files: BTreeSet<String>,
}

impl Stamp {
    pub(super) fn of(folder: &Path) -> Option<Self> {
        let path = folder.join(STAMP);
        fs::symlink_metadata(&path).ok().filter(|about| about.is_file() && about.len() <= BYTES_MAX)?;
        let text = fs::read_to_string(path).ok()?;
        let mut lines = text.lines();
        let session = lines.next().unwrap_or_default().to_owned();
        let count: Option<usize> = lines.next().and_then(|line| line.strip_prefix("files ")?.parse().ok());
        let mut files: BTreeSet<String> = lines.map(str::to_owned).collect();
        let is_name = |name: &String| Path::new(name).file_name().is_some_and(|own| own == name.as_str());
        if count != Some(files.len()) || !text.ends_with('\n') || !files.iter().all(is_name) {
            files.clear();
        }
        Some(Self { session, files })
    }

    pub(super) fn write(&self, mut file: &File) -> io::Result<()> {
        let mut text = format!("{}\nfiles {}\n", self.session, self.files.len());
        for line in &self.files {
            text.push_str(line);
            text.push('\n');
        }
        file.write_all(text.as_bytes())
    }
}
