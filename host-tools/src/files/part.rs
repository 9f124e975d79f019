//! What is not whole yet: a file or a folder beside its target, `.NAME.hums-part`, renamed when it is whole.
//!
//! Whoever writes one holds a lock on it, which a second run sees. What is not locked has the name by chance, or was left by
//! a run that was killed. Nothing tells these apart, so it stays, and the run takes `.NAME.2.hums-part`.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use super::paths::{PARTS_MAX, cannot_write, part_of, target_of};
use super::stamp::STAMP;

/// Takes the lock, which its owner keeps for as long as the file is open; whoever writes already is told of.
pub(super) fn lock(file: &File, target: &Path) -> Result<()> {
    match file.try_lock() {
        // On a file system without locks nothing tells two runs apart.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(()),
        Err(TryLockError::WouldBlock) => bail!(is_written(target)),
    }
}

/// What is said where another run has the lock.
pub(super) fn is_written(target: &Path) -> String {
    format!(
        "{}: another run of hums is writing it; wait for its end, or name another output",
        target.display()
    )
}

/// Lets this run read a part of its own by its name: on Windows a lock keeps everybody from that but who holds it.
pub(super) fn unlock_to_read(part: &File) {
    if !cfg!(unix) {
        // Where it had none, there is nothing to release.
        let _ = part.unlock();
    }
}

/// Keeps other runs from beginning or ending anything in the folder of a target, for as long as it is held: a free name is
/// found, and the new part made and locked, in one go. None where the system does not lock folders.
pub(super) fn lock_folder_of(target: &Path) -> Option<File> {
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = File::open(folder).ok()?;
    folder.lock().ok().map(|()| folder)
}

/// Opens a file that is updated in place, and keeps other runs from doing the same for as long as it is open: two that write
/// one card or one store would leave neither's. [`io::ErrorKind::ResourceBusy`] while another run has it. Everybody may
/// read it meanwhile.
pub fn open_in_place(options: &mut OpenOptions, path: &Path) -> io::Result<File> {
    let busy = || {
        io::Error::new(
            io::ErrorKind::ResourceBusy,
            "another run of hums is using it; wait for its end, or name another file",
        )
    };
    #[cfg(windows)]
    {
        use std::os::windows::fs::OpenOptionsExt as _;
        const SHARE_READ_AND_DELETE: u32 = 1 | 4;
        const SHARING_VIOLATION: i32 = 32;
        let opened = options.share_mode(SHARE_READ_AND_DELETE).open(path);
        opened.map_err(|error| if error.raw_os_error() == Some(SHARING_VIOLATION) { busy() } else { error })
    }
    #[cfg(not(windows))]
    {
        let file = options.open(path)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Err(busy()),
            // On a file system without locks nothing tells two runs apart.
            Ok(()) | Err(TryLockError::Error(_)) => Ok(file),
        }
    }
}

/// Makes a file that has its name only once `fill` has filled it, and gives it, locked, for reading and writing. A run
/// that is killed before leaves nothing of this name.
pub fn make_in_place(path: &Path, fill: impl FnOnce(&File) -> Result<()>) -> Result<File> {
    let target = target_of(path)?;
    fill_part(&target, fill, |part| rename_new(part, &target))
}

/// The same, where `place` gives the part its name.
pub(super) fn fill_part(
    target: &Path,
    fill: impl FnOnce(&File) -> Result<()>,
    place: impl FnOnce(&Path) -> io::Result<()>,
) -> Result<File> {
    let beginning = lock_folder_of(target);
    let (part, file) = begin(target, target, |part| {
        open_in_place(File::options().read(true).write(true).create_new(true), part)
    })?;
    drop(beginning);
    let made = fill(&file).and_then(|()| place(&part).with_context(|| cannot_write(target)));
    unlock_to_read(&file);
    if made.is_err() {
        // Where it cannot be removed, it is in nobody's way.
        let _ = std::fs::remove_file(&part);
    }
    made.map(|()| file)
}

/// Begins a part under the first name that nothing has: `make` makes it, which fails where something has its name. It is locked.
/// The caller holds the lock of the folder ([`lock_folder_of`]).
pub(super) fn begin(
    target: &Path,
    path: &Path,
    make: impl Fn(&Path) -> io::Result<File>,
) -> Result<(PathBuf, File)> {
    let mut part = free_part(target, path)?;
    // Where no folder is locked, another run may be quicker.
    let mut made = make(&part);
    while made.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::AlreadyExists) {
        part = free_part(target, path)?;
        made = make(&part);
    }
    let file = made.with_context(|| cannot_write(path))?;
    if let Err(error) = lock(&file, path) {
        drop(file);
        remove_begun(&part);
        return Err(error);
    }
    Ok((part, file))
}

/// Removes what has just been begun: a file, or a folder with nothing but its stamp in it. Where it cannot be removed, it is
/// in nobody's way.
fn remove_begun(part: &Path) {
    if std::fs::remove_file(part).is_err() {
        let _ = std::fs::remove_file(part.join(STAMP));
        let _ = std::fs::remove_dir(part);
    }
}

/// Keeps a second run away from the folder of this file, which is made where it is missing, for as long as it is open.
pub fn take_turn(path: &Path) -> Result<File> {
    let file = File::options().append(true).create(true).open(path).with_context(|| cannot_write(path))?;
    lock(&file, path.parent().unwrap_or(path))?;
    Ok(file)
}

/// The first name of a part that nothing has. An error where another run is writing one.
pub(super) fn free_part(target: &Path, path: &Path) -> Result<PathBuf> {
    for number in 1..=PARTS_MAX {
        let part = part_of(target, number)?;
        // What cannot be looked at cannot be made either, which says why.
        let Ok(about) = std::fs::symlink_metadata(&part) else { return Ok(part) };
        let locked =
            if about.is_dir() { Some(part.join(STAMP)) } else { about.is_file().then(|| part.clone()) };
        if let Some(Ok(file)) = locked.map(File::open) {
            lock(&file, path)?;
        }
        note!(
            "{}: was left by a run that was killed, or has the name of such a file; it stays: remove it if nobody needs it",
            part.display()
        );
    }
    bail!("{}: {PARTS_MAX} killed runs have left parts of it (.NAME.hums-part); remove them", path.display())
}

/// Renames a file to a name that nothing has; [`io::ErrorKind::AlreadyExists`] where something has it.
#[cfg(target_os = "linux")]
pub(super) fn rename_new(from: &Path, to: &Path) -> io::Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    use rustix::io::Errno;
    match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
        // A file system that cannot do that in one step.
        Err(Errno::INVAL | Errno::NOSYS) => rename_if_free(from, to),
        done => Ok(done?),
    }
}

#[cfg(not(target_os = "linux"))]
pub(super) fn rename_new(from: &Path, to: &Path) -> io::Result<()> {
    rename_if_free(from, to)
}

/// The same in two steps.
fn rename_if_free(from: &Path, to: &Path) -> io::Result<()> {
    if std::fs::symlink_metadata(to).is_ok() {
        return Err(io::ErrorKind::AlreadyExists.into());
    }
    std::fs::rename(from, to)
}

/// Makes a rename outlive a power loss of this PC, where the file system can do that.
pub(super) fn sync_folder_of(path: &Path) {
    if cfg!(unix) {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // Without it the file is the old one or the new one all the same.
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
    }
}
