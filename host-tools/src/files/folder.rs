//! A folder of output files that belong together: a session's tables. It is made beside its place and takes its name
//! when all of it is there, so that there are the old tables, the new ones, or none, and never some of both.
//!
//! Its [stamp](super::stamp) says what it was made of and which files are ours. A folder that is there is compared with
//! what would be written, file by file; with `--replace` it is [kept](super::aside) as a whole, and the new one takes its
//! name.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context as _, Result, bail};

use super::aside::replace;
use super::inputs::Inputs;
use super::part::{begin, lock_folder_of, rename_new, sync_folder_of};
use super::paths::{cannot_write, make_parent, settle, target_of};
use super::stamp::{STAMP, Stamp};
use super::there::{Likeness, There, likeness};
use crate::outcome::Differs;

/// Files that are synced at once: each waits for the disk, and nearly all of it together.
const SYNCS_AT_ONCE: usize = 8;

/// A folder that is written.
#[derive(Debug)]
pub struct Folder {
    /// As the user named it.
    path: PathBuf,
    made_of: String,
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
    /// Whether it takes the place of another one, which is kept.
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
        let is_free = Self::is_free(path);
        if !is_free {
            check(path)?;
        }
        let replaces = inputs.may_replace(path);
        if replaces && !is_free && is_around_us(&target) {
            bail!(
                "{}: is the folder in which this runs, and would be moved away from under it; nothing was replaced; run it from \
                 another folder",
                path.display()
            );
        }
        let to = if is_free || replaces { To::Part(Part::begin(path, target, replaces)?) } else { To::There };
        let (path, made_of) = (path.to_owned(), made_of.to_owned());
        Ok(Self { path, made_of, files: Mutex::default(), to })
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
    pub fn finish(mut self) -> Result<()> {
        let files = std::mem::take(self.files.get_mut().unwrap_or_else(PoisonError::into_inner));
        match &mut self.to {
            To::There => is_all_there(&self.path, &files),
            To::Part(part) => {
                let made_of = std::mem::take(&mut self.made_of);
                let stamp = Stamp { made_of, files: files.into_keys().collect() };
                let placed = part.finish(&self.path, &stamp);
                part.drop_unplaced(&stamp.files);
                placed
            }
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if let To::Part(part) = &mut self.to {
            part.drop_unplaced(self.files.get_mut().unwrap_or_else(PoisonError::into_inner).keys());
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
        let (part, stamp) = begin(&target, path, |part| {
            fs::create_dir(part)?;
            File::options().write(true).create_new(true).open(part.join(STAMP))
        })?;
        Ok(Self { path: part, target, replaces, stamp: Some(stamp) })
    }

    fn finish(&mut self, path: &Path, stamp: &Stamp) -> Result<()> {
        if let Some(file) = &self.stamp {
            settle(stamp.write(file), path)?;
        }
        sync_all(&self.path).with_context(|| cannot_write(path))?;
        // An open file keeps Windows from renaming its folder.
        self.stamp = None;
        let _ending = lock_folder_of(&self.target);
        // Again: somebody may have put something there meanwhile.
        let placed = if Folder::is_free(&self.target) {
            // No system renames over an empty folder and over nothing else.
            let _ = fs::remove_dir(&self.target);
            rename_new(&self.path, &self.target)
        } else if !self.replaces {
            return Err(Differs::new(path).into());
        } else if is_equal(&self.target, &self.path, stamp).unwrap_or(false) {
            return Ok(());
        } else {
            replace(&self.path, &self.target)
        };
        settle(placed, path)?;
        sync_folder_of(&self.target);
        self.path = PathBuf::new();
        Ok(())
    }

    /// Removes what this run has made of it, where it has not become the folder.
    fn drop_unplaced<'a>(&mut self, files: impl IntoIterator<Item = &'a String>) {
        let path = std::mem::take(&mut self.path);
        if !path.as_os_str().is_empty() {
            let _ending = lock_folder_of(&self.target);
            self.stamp = None;
            remove_made(&path, files);
        }
    }
}

/// Removes these files of a part, its stamp and itself. What somebody else put there stays, and what cannot be removed is in
/// nobody's way.
fn remove_made<'a>(part: &Path, files: impl IntoIterator<Item = &'a String>) {
    for name in files.into_iter().map(String::as_str).chain([STAMP]) {
        let _ = fs::remove_file(part.join(name));
    }
    let _ = fs::remove_dir(part);
}

/// Whether the tables in the folder that is `there` are those of the `new` one, and all of them.
fn is_equal(there: &Path, new: &Path, stamp: &Stamp) -> io::Result<bool> {
    if Stamp::of(there).is_none_or(|there| there.files != stamp.files) {
        return Ok(false);
    }
    for name in &stamp.files {
        if likeness(&there.join(name), &new.join(name))? != Likeness::Equal {
            return Ok(false);
        }
    }
    Ok(true)
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

/// Whether this program runs in a folder, or in one within it: relative paths lead elsewhere once that was renamed.
fn is_around_us(folder: &Path) -> bool {
    let ours = std::env::current_dir().and_then(fs::canonicalize);
    ours.is_ok_and(|ours| fs::canonicalize(folder).is_ok_and(|folder| ours.starts_with(folder)))
}

/// Refuses what is no folder of tables.
fn check(path: &Path) -> Result<()> {
    let shown = path.display();
    if path.is_file() {
        bail!("{shown}: is a file, and a directory is needed there; name another output");
    }
    if Stamp::of(path).is_none() {
        bail!("{shown}: is there already and was not made by this command; name another output with -o");
    }
    Ok(())
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
        // This thread is one of them: the system may give no other.
        let others = 1..SYNCS_AT_ONCE.min(paths.len());
        let thread = |_| std::thread::Builder::new().spawn_scoped(scope, sync).ok();
        let threads: Vec<_> = others.map_while(thread).collect();
        let mut synced = sync();
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
