//! What demos made in a folder. The next one removes that and nothing else: the file `.hums-demo` names each file that
//! was made, with the SHA-256 of its content. A file that was changed since, or that no demo made, ends the next demo
//! before anything is removed.
//!
//! ```text
//! hums demo
//! 9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08 card.img
//! ```

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use crate::files::{Inputs, Output, digest, remove_if_empty, settle};
use crate::hex::hex;

/// The file that says what a demo made.
const MARK: &str = ".hums-demo";
/// Its first line.
const HEAD: &str = "hums demo\n";
/// What a demo makes in its folder, besides the mark: three files, and a folder with what is decoded.
pub(super) const CARD: &str = "card.img";
pub(super) const GROUND_STATION: &str = "ground-station.bin";
pub(super) const REPORT: &str = "report.html";
pub(super) const DECODED: &str = "decoded";

/// A demo's folder.
pub(super) struct Place<'a> {
    dir: &'a Path,
    inputs: &'a Inputs,
    /// What an earlier demo made and is still there, with its hash.
    earlier: BTreeMap<String, String>,
    /// What lies in the decoded folder and stays there.
    others: BTreeSet<PathBuf>,
    /// The mark so far.
    mark: String,
}

impl<'a> Place<'a> {
    /// Looks at what is there, and removes nothing. An error where anything is in the way.
    pub(super) fn look(dir: &'a Path, inputs: &'a Inputs) -> Result<Self> {
        let earlier = made(dir)?;
        check(dir, &earlier, inputs)?;
        Ok(Self { dir, inputs, earlier, others: BTreeSet::new(), mark: HEAD.to_owned() })
    }

    /// Removes what an earlier demo made. Nothing is removed where anything is in the way by now.
    pub(super) fn clear(&mut self) -> Result<()> {
        let earlier = std::mem::take(&mut self.earlier);
        check(self.dir, &earlier, self.inputs)?;
        let mut folders = BTreeSet::new();
        for name in earlier.keys() {
            let path = self.dir.join(name);
            if path.exists() {
                Output::remove(&path, self.inputs)?;
            }
            let inner = path.ancestors().skip(1).take_while(|folder| *folder != self.dir);
            folders.extend(inner.map(Path::to_owned));
        }
        // The inner ones first.
        folders.iter().rev().for_each(|folder| remove_if_empty(folder));
        let mark = self.dir.join(MARK);
        if mark.exists() {
            Output::remove(&mark, self.inputs)?;
        }
        self.others = files(&self.dir.join(DECODED))?;
        Ok(())
    }

    /// Writes down that this demo made the tables.
    pub(super) fn note_tables(&mut self) -> Result<()> {
        let tables = &files(&self.dir.join(DECODED))? - &self.others;
        let named: Vec<_> = tables
            .iter()
            .filter_map(|path| Some((path.strip_prefix(self.dir).ok()?.to_str()?, path.as_path())))
            .collect();
        self.note(&named)
    }

    /// Writes down that this demo makes these files, and where they are now: before they have their names.
    pub(super) fn note(&mut self, files: &[(&str, &Path)]) -> Result<()> {
        for (name, path) in files {
            let hash = hash(path)?;
            self.mark.extend([&hash, " ", name, "\n"]);
        }
        // What it said before is its beginning.
        let mut mark = Output::create(&self.dir.join(MARK), &self.inputs.clone().replacing(true))?;
        settle(mark.write_all(self.mark.as_bytes()), mark.path())?;
        mark.finish()
    }
}

/// What an earlier demo says that it made: the files' names in the folder, and their hashes.
fn made(dir: &Path) -> Result<BTreeMap<String, String>> {
    let mark = dir.join(MARK);
    let text = match fs::read_to_string(&mark) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(BTreeMap::new()),
        Err(error) => return Err(error).with_context(|| format!("{}: cannot be read", mark.display())),
    };
    let Some(text) = text.strip_prefix(HEAD) else {
        bail!("{}: is no mark of a demo; move it away, or name another directory with --dir", mark.display())
    };
    let is_inside =
        |name: &str| Path::new(name).components().all(|part| matches!(part, std::path::Component::Normal(_)));
    let entries = text.lines().filter_map(|line| line.split_once(' ')).filter(|(_, name)| is_inside(name));
    Ok(entries.map(|(hash, name)| (name.to_owned(), hash.to_owned())).collect())
}

/// Whether all that is in the way is what an earlier demo made, unchanged.
fn check(dir: &Path, made: &BTreeMap<String, String>, inputs: &Inputs) -> Result<()> {
    let refuse = |path: &Path, why: &str| -> Result<()> {
        bail!(
            "{}: {why}; nothing was removed: move it away, or name another directory with --dir",
            path.display()
        )
    };
    for name in [CARD, GROUND_STATION, REPORT] {
        let path = dir.join(name);
        if fs::symlink_metadata(&path).is_ok() && !made.contains_key(name) {
            return refuse(&path, "is there already, and no demo made it");
        }
    }
    let mut folders = BTreeSet::new();
    for (name, was) in made {
        let path = dir.join(name);
        let Ok(about) = fs::symlink_metadata(&path) else { continue };
        inputs.refuse(&path)?;
        if !about.is_file() || hash(&path)? != *was {
            return refuse(&path, "was changed since the demo made it");
        }
        folders.extend(path.parent().map(Path::to_owned));
    }
    // A folder of tables has to go whole.
    folders.remove(dir);
    folders.remove(&dir.join(DECODED));
    for path in folders.iter().map(|folder| files(folder)).collect::<Result<Vec<_>>>()?.iter().flatten() {
        let name = path.strip_prefix(dir).ok().and_then(Path::to_str);
        if name.is_none_or(|name| !made.contains_key(name)) {
            return refuse(path, "is among the demo's tables, and no demo made it");
        }
    }
    Ok(())
}

/// All files in a folder and below it; none where there is no such folder.
fn files(folder: &Path) -> Result<BTreeSet<PathBuf>> {
    let mut found = BTreeSet::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        let entries = match fs::read_dir(&folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            Err(error) => return Err(error).with_context(|| format!("{}: cannot be read", folder.display())),
        };
        for entry in entries {
            let entry = entry.with_context(|| format!("{}: cannot be read", folder.display()))?;
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                folders.push(entry.path());
            } else {
                found.insert(entry.path());
            }
        }
    }
    Ok(found)
}

/// The SHA-256 of a file, as hexadecimal digits.
fn hash(path: &Path) -> Result<String> {
    let digest = digest(path).with_context(|| format!("{}: cannot be read", path.display()))?;
    Ok(hex(&digest))
}
