//! A folder of output files that belong together: a session's tables. It is made beside its place and takes its name
//! when all of it is there, so that there are the old tables, the new ones, or none, and never some of both.
//!
//! Its [stamp](super::stamp) says what it was made of and which files are ours. A folder that is there is compared with
//! what would be written, file by file; only with `--replace` is it replaced, and only where nothing lies in it but
//! what its stamp names.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context as _, Result, bail};

use super::amount::{Amount, Content};
use super::inputs::Inputs;
use super::part::{free_part, lock, lock_folder_of, sync_folder_of};
use super::paths::{cannot_write, make_parent, settle, target_of};
use super::stamp::{STAMP, Stamp, foreign};
use super::there::There;
use crate::outcome::Differs;

/// What a folder may hold that is not ended.
const EXTENSIONS: [&str; 2] = ["csv", "parquet"];
/// Files that are synced at once: each waits for the disk, and nearly all of it together.
const SYNCS_AT_ONCE: usize = 8;

/// A folder that is written.
#[derive(Debug)]
pub struct Folder {
    /// As the user named it.
    path: PathBuf,
    made_of: String,
    /// How much of it is in the files.
    amount: Option<Amount>,
    /// The files so far, and how many bytes each has.
    files: Mutex<BTreeMap<String, Arc<AtomicU64>>>,
    to: To,
}

#[derive(Debug)]
enum To {
    Part(Part),
    /// The one that is there is compared.
    There,
}

/// What becomes the folder when it is whole.
#[derive(Debug)]
struct Part {
    path: PathBuf,
    /// Without links.
    target: PathBuf,
    /// Whether it takes the place of another one.
    replaces: bool,
    /// The stamp's file, which holds the lock.
    stamp: Option<File>,
}

/// A file of the folder: written, or compared with the one that is there.
#[derive(Debug)]
pub struct FolderFile {
    to: FileTo,
    bytes: Arc<AtomicU64>,
}

#[derive(Debug)]
enum FileTo {
    File(File),
    There(There),
}

impl Folder {
    /// Begins a folder. `made_of` is a line for its stamp.
    pub fn create(path: &Path, inputs: &Inputs, made_of: &str) -> Result<Self> {
        inputs.refuse(path)?;
        make_parent(path)?;
        let target = target_of(path)?;
        let _beginning = lock_folder_of(&target);
        restore(&target)?;
        let to = if Self::is_free(path) {
            To::Part(Part::begin(path, target, false)?)
        } else if may_be_replaced(path, inputs)? {
            To::Part(Part::begin(path, target, true)?)
        } else {
            To::There
        };
        let (path, made_of) = (path.to_owned(), made_of.to_owned());
        Ok(Self { path, made_of, amount: None, files: Mutex::default(), to })
    }

    /// Whether nothing is there, or an empty folder.
    pub fn is_free(path: &Path) -> bool {
        match fs::read_dir(path) {
            Ok(mut entries) => entries.next().is_none(),
            // Below a file, or where nobody may look, nothing of this name is known to be there: making it says why.
            Err(error) => error.kind() == io::ErrorKind::NotFound || fs::symlink_metadata(path).is_err(),
        }
    }

    /// What the tables in a folder were made of, where they are ours.
    pub fn made_of(path: &Path) -> Option<String> {
        Stamp::of(path).map(|stamp| stamp.made_of)
    }

    /// The folder's path, as the user named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How much of its log is in it, before it gets its name: it takes the place of no folder that has more.
    pub fn set_amount(&mut self, amount: Amount) {
        self.amount = Some(amount);
    }

    /// A new file in it.
    pub fn file(&self, name: &str) -> Result<FolderFile> {
        let bytes = Arc::default();
        self.files.lock().unwrap_or_else(PoisonError::into_inner).insert(name.to_owned(), Arc::clone(&bytes));
        let to = match &self.to {
            To::Part(part) => {
                let file = File::options().write(true).create_new(true).open(part.path.join(name));
                FileTo::File(file.with_context(|| cannot_write(&self.path.join(name)))?)
            }
            To::There => FileTo::There(self.there(name, 0)?),
        };
        Ok(FolderFile { to, bytes })
    }

    /// A file in it, to go on with at its end.
    pub fn file_again(&self, name: &str) -> Result<FolderFile> {
        let files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes = files.get(name).map(Arc::clone).unwrap_or_default();
        let to = match &self.to {
            To::Part(part) => {
                let file = File::options().append(true).open(part.path.join(name));
                FileTo::File(file.with_context(|| cannot_write(&self.path.join(name)))?)
            }
            To::There => FileTo::There(self.there(name, bytes.load(Ordering::Relaxed))?),
        };
        Ok(FolderFile { to, bytes })
    }

    /// The file of this name in the folder that is there, from a byte on.
    fn there(&self, name: &str, at: u64) -> Result<There> {
        let path = self.path.join(name);
        match There::open(&path, at) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Err(Differs::new(&self.path).into()),
            opened => opened.with_context(|| format!("{}: cannot be read", path.display())),
        }
    }

    /// All files are there and closed: the folder takes its name.
    pub fn finish(self) -> Result<()> {
        let files = self.files.into_inner().unwrap_or_else(PoisonError::into_inner);
        match self.to {
            To::There => is_all_there(&self.path, &files),
            To::Part(mut part) => {
                let (made_of, amount) = (self.made_of, self.amount);
                let stamp = Stamp { made_of, amount, files: files.into_keys().collect() };
                part.finish(&self.path, &stamp)
            }
        }
    }
}

/// Whether the folder that is there has these files with so many bytes, whose content was compared, and no others of ours.
fn is_all_there(path: &Path, files: &BTreeMap<String, Arc<AtomicU64>>) -> Result<()> {
    let stamp = Stamp::of(path).unwrap_or_default();
    let is_whole = |(name, bytes): (&String, &Arc<AtomicU64>)| {
        fs::metadata(path.join(name)).is_ok_and(|about| about.len() == bytes.load(Ordering::Relaxed))
    };
    if stamp.files.iter().eq(files.keys()) && files.iter().all(is_whole) {
        return Ok(());
    }
    Err(Differs::new(path).into())
}

impl Part {
    fn begin(path: &Path, target: PathBuf, replaces: bool) -> Result<Self> {
        let part = free_part(&target, path)?;
        fs::create_dir(&part).with_context(|| cannot_write(path))?;
        let mut part = Self { path: part, target, replaces, stamp: None };
        let stamp = File::options().write(true).create_new(true).open(part.path.join(STAMP));
        let stamp = stamp.with_context(|| cannot_write(path))?;
        lock(&stamp, path)?;
        part.stamp = Some(stamp);
        Ok(part)
    }

    fn finish(&mut self, path: &Path, stamp: &Stamp) -> Result<()> {
        if let Some(file) = &self.stamp {
            settle(stamp.write(file), path)?;
        }
        sync_all(&self.path).with_context(|| cannot_write(path))?;
        // Again: somebody may have put something there meanwhile.
        if self.replaces {
            check_ours(path)?;
            let content = |folder: &Path, stamp: &Stamp| {
                let length = |name| fs::metadata(folder.join(name)).map_or(0, |about| about.len());
                Content { amount: stamp.amount, bytes: stamp.files.iter().map(length).sum() }
            };
            let there = content(path, &Stamp::of(path).unwrap_or_default());
            content(&self.path, stamp).check_replaces(there, path)?;
        } else if !Folder::is_free(path) {
            return Err(Differs::new(path).into());
        }
        // An open file keeps Windows from renaming its folder.
        self.stamp = None;
        let _ending = lock_folder_of(&self.target);
        put_in_place(&self.path, &self.target, exchange).with_context(|| cannot_write(path))?;
        sync_folder_of(&self.target);
        self.path = PathBuf::new();
        Ok(())
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        if !self.path.as_os_str().is_empty() {
            let _ending = lock_folder_of(&self.target);
            // Where it cannot be removed, it is in nobody's way.
            let _ = remove_part(&self.path);
        }
    }
}

impl Write for FolderFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = match &mut self.to {
            FileTo::File(file) => file.write(bytes)?,
            FileTo::There(there) => there.compare(bytes).map(|()| bytes.len())?,
        };
        self.bytes.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.to {
            FileTo::File(file) => file.flush(),
            FileTo::There(_) => Ok(()),
        }
    }
}

/// Whether what is there may be replaced; otherwise it may be compared. An error where it is neither.
fn may_be_replaced(path: &Path, inputs: &Inputs) -> Result<bool> {
    let shown = path.display();
    if path.is_file() {
        bail!("{shown}: is a file, and a directory is needed there; name another output");
    }
    if Stamp::of(path).is_none() {
        bail!("{shown}: is there already and was not made by this command; name another output with -o");
    }
    if !inputs.may_replace(path) {
        return Ok(false);
    }
    check_ours(path)?;
    Ok(true)
}

/// Refuses a folder with files in it that we did not make.
fn check_ours(path: &Path) -> Result<()> {
    let stamp = Stamp::of(path).unwrap_or_default();
    match foreign(path, |name| stamp.has(name)).with_context(|| cannot_write(path))? {
        Some(name) => bail!(
            "{}: has {name}, which hums did not make, and is not replaced; move that file, or name another output \
             with -o",
            path.display()
        ),
        None => Ok(()),
    }
}

/// Removes a folder that has our files only.
fn remove_ours(folder: &Path) -> io::Result<()> {
    let stamp = Stamp::of(folder).unwrap_or_default();
    remove(folder, |name| stamp.has(name))
}

/// Removes what this run has made and not ended: its stamp may name no file yet.
fn remove_part(folder: &Path) -> io::Result<()> {
    let stamp = Stamp::of(folder).filter(|stamp| !stamp.files.is_empty());
    let is_table = |name: &str| EXTENSIONS.iter().any(|extension| name.ends_with(&format!(".{extension}")));
    remove(folder, |name| stamp.as_ref().map_or(name == STAMP || is_table(name), |stamp| stamp.has(name)))
}

/// Removes a folder in which all is ours.
fn remove(folder: &Path, is_ours: impl Fn(&str) -> bool) -> io::Result<()> {
    if let Some(name) = foreign(folder, is_ours)? {
        return Err(io::Error::other(format!("{name} in it was not made by hums")));
    }
    for entry in fs::read_dir(folder)? {
        fs::remove_file(entry?.path())?;
    }
    fs::remove_dir(folder)
}

/// Where the old folder is for the moment in which two renames put the new one in its place.
pub(super) fn old_of(target: &Path) -> PathBuf {
    let mut name = std::ffi::OsString::from(".");
    name.push(target.file_name().unwrap_or_default());
    name.push(".hums-old");
    target.with_file_name(name)
}

/// A run that was killed between two renames has left the old folder under another name.
fn restore(target: &Path) -> Result<()> {
    let old = old_of(target);
    if !old.is_dir() {
        return Ok(());
    }
    if target.exists() { remove_ours(&old) } else { fs::rename(&old, target) }
        .with_context(|| cannot_write(&old))
}

/// The part becomes the target, and what was there goes: in one step where `exchange` can, otherwise by two renames.
pub(super) fn put_in_place(
    part: &Path,
    target: &Path,
    exchange: impl Fn(&Path, &Path) -> bool,
) -> io::Result<()> {
    if Folder::is_free(target) {
        // Windows does not rename over an empty folder.
        let _ = fs::remove_dir(target);
        return fs::rename(part, target);
    }
    if exchange(part, target) {
        return remove_ours(part);
    }
    let old = old_of(target);
    fs::rename(target, &old)?;
    fs::rename(part, target)?;
    remove_ours(&old)
}

/// Swaps two folders in one step, where the system can do that.
#[cfg(target_os = "linux")]
fn exchange(one: &Path, other: &Path) -> bool {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    renameat_with(CWD, one, CWD, other, RenameFlags::EXCHANGE).is_ok()
}

#[cfg(not(target_os = "linux"))]
fn exchange(_: &Path, _: &Path) -> bool {
    false
}

/// Brings all files of a folder to the disk.
fn sync_all(folder: &Path) -> io::Result<()> {
    let paths: Vec<PathBuf> =
        fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.path())).collect::<io::Result<_>>()?;
    let next = AtomicUsize::new(0);
    let sync = || -> io::Result<()> {
        while let Some(path) = paths.get(next.fetch_add(1, Ordering::Relaxed)) {
            File::options().append(true).open(path)?.sync_all()?;
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..SYNCS_AT_ONCE.min(paths.len())).map(|_| scope.spawn(sync)).collect();
        let mut synced = Ok(());
        for thread in threads {
            synced = synced.and(thread.join().unwrap_or_else(|_| Err(io::Error::other("a thread failed"))));
        }
        synced
    })?;
    sync_folder_of(&folder.join(STAMP));
    Ok(())
}

/// A file of a folder with room for a group's lines of a busy message; there may be some hundred of these.
pub fn buffered(table: FolderFile) -> BufWriter<FolderFile> {
    const BUFFER_BYTES: usize = 16 * 1024;
    BufWriter::with_capacity(BUFFER_BYTES, table)
}
