//! Files that are updated in place: a simulated card and a simulated board's flash.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::Path;

use anyhow::{Context as _, Result};

use super::paths::{begin, cannot_write};

/// Opens a file that is updated in place, and locks it against other runs: two writers of one card or one store would destroy
/// it. [`io::ErrorKind::ResourceBusy`] while another run has it.
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
        use std::fs::TryLockError;
        let file = options.open(path)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Err(busy()),
            // Without locks of the file system, two runs cannot be distinguished.
            Ok(()) | Err(TryLockError::Error(_)) => Ok(file),
        }
    }
}

/// Makes a file that has its name only once `fill` has filled it, and gives it for reading and writing, locked. If `replaces`,
/// it takes the place of another one.
pub fn make_in_place(path: &Path, replaces: bool, fill: impl FnOnce(&File) -> Result<()>) -> Result<File> {
    let made =
        begin(path, |part| open_in_place(File::options().read(true).write(true).create_new(true), part));
    let made = made.with_context(|| cannot_write(path))?;
    fill(made.as_file())?;
    let placed = if replaces { made.persist(path) } else { made.persist_noclobber(path) };
    placed.with_context(|| cannot_write(path))
}
