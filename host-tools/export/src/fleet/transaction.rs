//! Changes of a fleet's files that happen as a whole, also if the program or the computer stops at any step.
//!
//! 1. The new files are written in a hidden folder, named by the places that they will have, and go to the disk.
//! 2. The folder gets the list of the files that they replace. It is renamed: from here on the change counts.
//! 3. The replaced files are removed, and the new ones are moved to their places.
//!
//! The next program does the rest of step 3 ([`recover`]). One program at a time changes a fleet: it holds a lock.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::mem;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context as _, Result, bail};
use tempfile::TempDir;

use super::{names, shard};
use crate::files::{check_parent, settle};
use crate::logs::in_order::in_order;
use crate::storage::is_inside;

/// The folder of this program in a fleet's folder. Readers of tables ignore names with a dot.
pub(crate) const OWN: &str = ".hums-fleet";
pub(crate) const STORAGE: &str = "storage";
const COMMIT: &str = "commit-";
pub(crate) const PART: &str = ".hums-part";
const FILES: &str = "files";
const LOCK: &str = "lock";
const REPLACED: &str = "replaced";
const COMPACTED: &str = "compacted";

/// The name of a new file in its hidden folder.
fn name_of(place: &str) -> String {
    place.replace('/', ",")
}

fn places_in(files: &Path) -> io::Result<Vec<String>> {
    let places = fs::read_dir(files)?.map(|entry| Ok(entry?.file_name().to_string_lossy().replace(',', "/")));
    let mut places = places.collect::<io::Result<Vec<_>>>()?;
    places.sort_unstable();
    Ok(places)
}

#[cfg(test)]
pub(crate) mod stop {
    use std::cell::Cell;
    use std::io;

    thread_local! {
        /// Steps until the stop.
        static LEFT: Cell<Option<u32>> = const { Cell::new(None) };
    }

    pub(crate) fn after(steps: Option<u32>) {
        LEFT.set(steps);
    }

    pub(super) fn step() -> io::Result<()> {
        match LEFT.get() {
            Some(0) => Err(io::Error::other("stopped")),
            left => {
                LEFT.set(left.map(|left| left - 1));
                Ok(())
            }
        }
    }
}

#[cfg(not(test))]
mod stop {
    #[expect(clippy::unnecessary_wraps, reason = "the test's steps fail")]
    pub(super) fn step() -> std::io::Result<()> {
        Ok(())
    }
}

/// The right to change a fleet's files, until it is dropped.
pub(crate) struct Lock(#[expect(dead_code, reason = "holds the lock")] File);

/// Waits for other programs, and completes the change of one that ended.
pub(crate) fn lock(root: &Path) -> Result<Lock> {
    let own = root.join(OWN);
    refuse_copy(&own)?;
    settle(fs::create_dir_all(&own), &own)?;
    let path = own.join(LOCK);
    let file = settle(File::options().create(true).truncate(false).write(true).open(&path), &path)?;
    match file.lock() {
        // Without locks of the file system, two runs cannot be distinguished.
        Err(error) if error.kind() != io::ErrorKind::Unsupported => {
            return Err(error).with_context(|| format!("{}: cannot be locked", path.display()));
        }
        _ => {}
    }
    let lock = Lock(file);
    for name in names(&own)? {
        let folder = own.join(&name);
        // A program that runs holds the lock of its folder.
        let is_left = || File::open(folder.join(LOCK)).is_ok_and(|lock| lock.try_lock().is_ok());
        if is_begun(&name) {
            note!("{}: a change that an earlier run began is completed", root.display());
            settle(apply(root, &folder), root)?;
        } else if name.starts_with(COMMIT) || name.ends_with(PART) && is_left() {
            note!("{}: of a run that did not end; removed", folder.display());
            settle(fs::remove_dir_all(&folder), &folder)?;
        }
    }
    Ok(lock)
}

/// The index of tables in object storage is there.
fn refuse_copy(own: &Path) -> Result<()> {
    if own.join(STORAGE).exists() {
        bail!(
            "{}: its tables are a copy of object storage; decode there, or into another folder",
            own.display()
        );
    }
    Ok(())
}

/// Completes a begun change. Tables that were copied from object storage are an error.
pub(crate) fn recover(root: &Path) -> Result<()> {
    refuse_copy(&root.join(OWN))?;
    let is_begun = names(&root.join(OWN))?.iter().any(|name| is_begun(name));
    if is_begun { lock(root).map(|_| ()) } else { Ok(()) }
}

/// Whether the change in a folder of this name counts and is not complete.
fn is_begun(name: &str) -> bool {
    name.starts_with(COMMIT) && !name.ends_with(PART)
}

/// File systems with a journal write one entry for all files that wait.
const SYNCS_AT_ONCE: usize = 8;
/// Files of a change that wait: systems limit a program's open files.
const OPEN_MAX: usize = 48;

/// A change that does not count yet. Dropped, it leaves nothing.
#[derive(Debug)]
pub(crate) struct Transaction {
    root: PathBuf,
    /// Complete, and not on the disk yet.
    ended: Mutex<Vec<File>>,
    part: TempDir,
    /// Of the folder, until the change counts.
    held: File,
}

/// A change with all of its new files on the disk.
pub(crate) struct SyncedChange {
    root: PathBuf,
    part: TempDir,
    held: File,
    places: Vec<String>,
}

impl Transaction {
    pub(crate) fn begin(root: &Path) -> Result<Self> {
        let own = root.join(OWN);
        let part = fs::create_dir_all(&own)
            .and_then(|()| tempfile::Builder::new().prefix(".").suffix(PART).tempdir_in(&own))
            .and_then(|part| fs::create_dir(part.path().join(FILES)).map(|()| part));
        let part = settle(part, root)?;
        // The lock is held before it has its name, so no other program removes the folder.
        let new = part.path().join("new");
        let held = settle(File::create_new(&new), root)?;
        // On a file system without locks the folder gets no lock file, and no program removes the folder.
        if held.lock().is_ok() {
            settle(fs::rename(new, part.path().join(LOCK)), root)?;
        }
        Ok(Self { root: root.to_owned(), ended: Mutex::default(), part, held })
    }

    pub(crate) fn path(&self, place: &str) -> PathBuf {
        self.part.path().join(FILES).join(name_of(place))
    }

    pub(crate) fn places(&self) -> Result<Vec<String>> {
        settle(places_in(&self.part.path().join(FILES)), &self.root)
    }

    /// A change that counts must have its complete files after a power cut.
    pub(crate) fn end_file(&self, file: File) -> Result<()> {
        let mut ended = self.ended.lock().unwrap_or_else(PoisonError::into_inner);
        ended.push(file);
        if ended.len() < OPEN_MAX { Ok(()) } else { self.sync_files(mem::take(&mut ended)) }
    }

    fn sync_files(&self, files: Vec<File>) -> Result<()> {
        let mut files = files.into_iter();
        // It closes each file too.
        let sync = |file: File| file.sync_all();
        in_order(SYNCS_AT_ONCE, OPEN_MAX, || Ok(files.next()), sync, |synced| settle(synced, &self.root))
    }

    /// All ended files are on the disk after it. Other changes may be made meanwhile.
    pub(crate) fn sync(self) -> Result<SyncedChange> {
        let files = mem::take(&mut *self.ended.lock().unwrap_or_else(PoisonError::into_inner));
        self.sync_files(files)?;
        let places = self.places()?;
        Ok(SyncedChange { root: self.root, part: self.part, held: self.held, places })
    }
}

impl SyncedChange {
    /// The change counts from here on, and is carried out. `replaced` are the places of files that go, `compacted` the
    /// sessions that are in a file of several. Returns the paths of the new files.
    pub(crate) fn commit(
        self,
        _: &Lock,
        replaced: &BTreeSet<String>,
        compacted: &[String],
    ) -> Result<Vec<PathBuf>> {
        let Self { root, part, held, places } = self;
        let places: Vec<PathBuf> = places.iter().map(|place| root.join(place)).collect();
        // A change that counts must be possible.
        for place in &places {
            check_parent(place)?;
            if place.is_dir() {
                bail!("{}: is a directory, and a file is needed there; move it away", place.display());
            }
        }
        // Some systems rename no folder with an open file.
        drop(held);
        let committed = Self::count(&root, part, replaced, compacted);
        settle(committed.and_then(|folder| apply(&root, &folder)), &root)?;
        Ok(places)
    }

    fn count(
        root: &Path,
        part: TempDir,
        replaced: &BTreeSet<String>,
        compacted: &[String],
    ) -> io::Result<PathBuf> {
        // A new file of the same place replaces the old one by its move.
        let files = part.path().join(FILES);
        let replaced: Vec<&String> =
            replaced.iter().filter(|place| !files.join(name_of(place)).exists()).collect();
        let lines = |lines: &mut dyn Iterator<Item = &String>| {
            lines.fold(String::new(), |text, line| text + line + "\n")
        };
        for (name, text) in
            [(REPLACED, lines(&mut replaced.iter().copied())), (COMPACTED, lines(&mut compacted.iter()))]
        {
            stop::step()?;
            let mut file = File::create(part.path().join(name))?;
            file.write_all(text.as_bytes())?;
            file.sync_all()?;
        }
        let unique = part.path().file_name().unwrap_or_default().to_string_lossy();
        let unique = unique.trim_matches('.').trim_end_matches(PART);
        let folder = root.join(OWN).join(format!("{COMMIT}{unique}"));
        stop::step()?;
        fs::rename(part.path(), &folder)?;
        // It has its name, under which nothing removes it.
        let _ = part.keep();
        Ok(folder)
    }
}

/// Applies a change; each of its steps may have been done before.
fn apply(root: &Path, folder: &Path) -> io::Result<()> {
    let files = folder.join(FILES);
    let replaced = fs::read_to_string(folder.join(REPLACED))?;
    if let Some(place) = replaced.lines().find(|place| !is_inside(place)) {
        return Err(io::Error::other(format!(
            "{}: wants to remove {place}, which is outside of the tables; if it is not your own, delete this folder",
            folder.display()
        )));
    }
    for place in replaced.lines() {
        stop::step()?;
        match fs::remove_file(root.join(place)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    for place in places_in(&files)? {
        stop::step()?;
        let (from, to) = (files.join(name_of(&place)), root.join(&place));
        match fs::rename(&from, &to) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                to.parent().map_or(Ok(()), fs::create_dir_all)?;
                fs::rename(from, to)?;
            }
            moved => moved?,
        }
    }
    // A session twice in the index is harmless.
    for session in fs::read_to_string(folder.join(COMPACTED))?.lines() {
        let index = root.join(OWN).join(COMPACTED);
        fs::create_dir_all(&index)?;
        let mut index = File::options().create(true).append(true).open(index.join(shard(session)))?;
        writeln!(index, "{session}")?;
    }
    stop::step()?;
    // Without its lists it could not be carried out again.
    let done = folder.with_extension("hums-part");
    fs::rename(folder, &done)?;
    stop::step()?;
    fs::remove_dir_all(done)
}
