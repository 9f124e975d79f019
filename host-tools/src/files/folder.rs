//! A folder of output files that belong together: a session's tables. It is made beside its place and takes its name
//! when all of it is there, so that there are the old tables, the new ones, or none, and never some of both.
//!
//! A file `.hums` in it (its stamp) says what it was made of. Only a folder of the same stamp is replaced, and only
//! where nothing lies in it but files that this program makes.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context as _, Result, bail};

use super::identity::without_links;
use super::inputs::Inputs;
use super::part::{is_written, lock, part_of, sync_folder_of};
use super::paths::{cannot_write, make_parent, settle};

/// The name of the stamp's file.
const STAMP: &str = ".hums";
/// What a folder may hold besides.
const EXTENSIONS: [&str; 2] = ["csv", "parquet"];
/// Files that are synced at once: each waits for the disk, and nearly all of it together.
const SYNCS_AT_ONCE: usize = 8;

/// What a place holds already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Held {
    /// Nothing.
    Nothing,
    /// What an earlier run made of the same.
    TheSame,
    /// Something else.
    Other,
}

/// A folder that is written.
#[derive(Debug)]
pub struct Folder {
    /// As the user named it.
    path: PathBuf,
    /// Without links.
    target: PathBuf,
    part: PathBuf,
    stamp: String,
    /// Holds the lock.
    lock: Option<File>,
}

impl Folder {
    /// Begins a folder, which replaces one of the same stamp only.
    pub fn create(path: &Path, inputs: &Inputs, stamp: &str) -> Result<Self> {
        inputs.refuse(path)?;
        make_parent(path)?;
        let target = without_links(path).with_context(|| cannot_write(path))?;
        may_be_replaced(path, stamp)?;
        let part = part_of(&target)?;
        if part.exists() {
            is_written(&part.join(STAMP), path)?;
            remove_ours(&part).with_context(|| cannot_write(&part))?;
        }
        restore(&target)?;
        fs::create_dir(&part).with_context(|| cannot_write(path))?;
        let mut folder = Self { path: path.to_owned(), target, part, stamp: stamp.to_owned(), lock: None };
        let file = File::options().write(true).create_new(true).open(folder.part.join(STAMP));
        let mut file = file.with_context(|| cannot_write(path))?;
        lock(&file, path)?;
        settle(writeln!(file, "{stamp}"), path)?;
        folder.lock = Some(file);
        Ok(folder)
    }

    /// What is at a place, for something of this stamp.
    pub fn held(path: &Path, stamp: &str) -> Held {
        match stamp_of(path) {
            Some(held) if held == stamp => Held::TheSame,
            None if is_free(path) => Held::Nothing,
            _ => Held::Other,
        }
    }

    /// Removes a folder that this program made, whatever it was made of. One with other files in it stays.
    pub fn remove(path: &Path) -> Result<()> {
        if stamp_of(path).is_none() {
            bail!("{}: was not made by hums and is not removed", path.display());
        }
        remove_ours(path).with_context(|| format!("{}: cannot be removed", path.display()))
    }

    /// The folder's path, as the user named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A new file in it.
    pub fn file(&self, name: &str) -> Result<File> {
        let file = File::options().write(true).create_new(true).open(self.part.join(name));
        file.with_context(|| cannot_write(&self.path.join(name)))
    }

    /// A file in it, to go on with at its end.
    pub fn file_again(&self, name: &str) -> Result<File> {
        let file = File::options().append(true).open(self.part.join(name));
        file.with_context(|| cannot_write(&self.path.join(name)))
    }

    /// All files are there and closed: the folder takes its name.
    pub fn finish(mut self) -> Result<()> {
        let done = sync_all(&self.part)
            .with_context(|| cannot_write(&self.path))
            // Again: somebody may have put something there meanwhile.
            .and_then(|()| may_be_replaced(&self.path, &self.stamp))
            .and_then(|()| {
                // An open file keeps Windows from renaming its folder.
                self.lock = None;
                put_in_place(&self.part, &self.target, exchange).with_context(|| cannot_write(&self.path))
            });
        if done.is_ok() {
            sync_folder_of(&self.target);
            self.part = PathBuf::new();
        }
        done
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if !self.part.as_os_str().is_empty() {
            // Where it cannot be removed, the next run does.
            let _ = remove_ours(&self.part);
        }
    }
}

/// The stamp of a folder.
fn stamp_of(folder: &Path) -> Option<String> {
    /// A stamp is a short line.
    const BYTES_MAX: u64 = 4096;
    let path = folder.join(STAMP);
    fs::symlink_metadata(&path).ok().filter(|about| about.is_file() && about.len() <= BYTES_MAX)?;
    Some(fs::read_to_string(path).ok()?.trim_end().to_owned())
}

/// Whether nothing is there, or an empty folder.
fn is_free(path: &Path) -> bool {
    match fs::read_dir(path) {
        Ok(mut entries) => entries.next().is_none(),
        Err(error) => error.kind() == io::ErrorKind::NotFound,
    }
}

/// Says why a folder may not be replaced, and what to do.
fn may_be_replaced(path: &Path, stamp: &str) -> Result<()> {
    let shown = path.display();
    if path.is_file() {
        bail!("{shown}: is a file, and a directory is needed there; name another output");
    }
    match Folder::held(path, stamp) {
        Held::Nothing => Ok(()),
        Held::Other if stamp_of(path).is_some() => {
            bail!(
                "{shown}: has what was made of another recording, and nothing is mixed; name another output with -o, \
                 or remove that folder"
            )
        }
        Held::Other => {
            bail!("{shown}: is there already and was not made by this command; name another output with -o")
        }
        Held::TheSame => match foreign(path).with_context(|| cannot_write(path))? {
            Some(name) => bail!(
                "{shown}: has {name}, which hums did not make, and is not replaced; move that file, or name another \
                 output with -o"
            ),
            None => Ok(()),
        },
    }
}

/// The first entry of a folder that is none of ours.
fn foreign(folder: &Path) -> io::Result<Option<String>> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let ours =
            name == STAMP || EXTENSIONS.iter().any(|extension| name.ends_with(&format!(".{extension}")));
        if !ours || !entry.file_type()?.is_file() {
            return Ok(Some(name));
        }
    }
    Ok(None)
}

/// Removes a folder that has our files only.
pub(super) fn remove_ours(folder: &Path) -> io::Result<()> {
    if folder.is_symlink() {
        return fs::remove_file(folder);
    }
    if let Some(name) = foreign(folder)? {
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
    if is_free(target) {
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
pub fn buffered(file: File) -> BufWriter<File> {
    const BUFFER_BYTES: usize = 16 * 1024;
    BufWriter::with_capacity(BUFFER_BYTES, file)
}
