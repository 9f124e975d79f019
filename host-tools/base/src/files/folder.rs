//! A folder of output files that belong together: a session's tables. It is made beside its place and renamed when
//! complete. So the old tables, the new ones, or none are there, and never some of both.
//!
//! Its [stamp](super::stamp) names its session and our files: `--force` replaces only a folder of the same session
//! without foreign files.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context as _, Result, bail};
use tempfile::TempDir;

use super::identity::without_links;
use super::inputs::Inputs;
use super::paths::{PART, cannot_write, folder_of, make_parent, part_prefix, settle};
use super::stamp::{STAMP, Stamp};
use crate::outcome::exists;

/// A file of the folder.
pub type FolderFile = File;

/// A folder that is written.
#[derive(Debug)]
pub struct Folder {
    /// As the user named it.
    path: PathBuf,
    /// Without links.
    target: PathBuf,
    /// Its path until it is complete.
    part: TempDir,
    session: String,
    files: Mutex<BTreeSet<String>>,
}

impl Folder {
    /// Begins a folder with a session's files.
    pub fn create(path: &Path, inputs: &Inputs, session: &str) -> Result<Self> {
        inputs.refuse(path)?;
        make_parent(path)?;
        if !Self::is_free(path) {
            check(path, session)?;
            if !inputs.may_replace() {
                return Err(exists(path, inputs.can_replace()));
            }
        }
        let context = || cannot_write(path);
        let target = without_links(path);
        let prefix = part_prefix(&target).with_context(context)?;
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(PART);
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
        let part = builder.tempdir_in(folder_of(&target)).with_context(context)?;
        let (path, session) = (path.to_owned(), session.to_owned());
        Ok(Self { path, target, part, session, files: Mutex::default() })
    }

    fn is_free(path: &Path) -> bool {
        match fs::read_dir(path) {
            Ok(mut entries) => entries.next().is_none(),
            // Below a file, or without permission, no file of this name is known: creating it gives the reason.
            Err(error) => error.kind() == io::ErrorKind::NotFound || fs::symlink_metadata(path).is_err(),
        }
    }

    /// The folder's path, as the user named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A new file in it.
    pub fn file(&self, name: &str) -> Result<FolderFile> {
        self.files.lock().unwrap_or_else(PoisonError::into_inner).insert(name.to_owned());
        let file = File::options().write(true).create_new(true).open(self.part.path().join(name));
        file.with_context(|| cannot_write(&self.path.join(name)))
    }

    /// A file in it, to go on with at its end.
    pub fn file_again(&self, name: &str) -> Result<FolderFile> {
        let file = File::options().append(true).open(self.part.path().join(name));
        file.with_context(|| cannot_write(&self.path.join(name)))
    }

    /// All files are there and closed: the folder takes its name.
    pub fn finish(self) -> Result<()> {
        let Self { path, target, part, session, files } = self;
        let stamp = Stamp { session, files: files.into_inner().unwrap_or_else(PoisonError::into_inner) };
        let placed =
            File::create(part.path().join(STAMP)).and_then(|file| stamp.write(&file)).and_then(|()| {
                if let Some(old) = Stamp::of(&target) {
                    old.files.iter().map(String::as_str).chain([STAMP]).try_for_each(|name| {
                        let removed = fs::remove_file(target.join(name));
                        removed.or_else(|error| {
                            if error.kind() == io::ErrorKind::NotFound { Ok(()) } else { Err(error) }
                        })
                    })?;
                }
                if target.is_dir() {
                    // A folder with new files of others stays.
                    fs::remove_dir(&target)?;
                }
                fs::rename(part.path(), &target)
            });
        settle(placed, &path)?;
        // It has its name, under which nothing removes it.
        let _ = part.keep();
        Ok(())
    }
}

fn check(path: &Path, session: &str) -> Result<()> {
    let shown = path.display();
    if path.is_file() {
        bail!("{shown}: is a file, and a directory is needed there; name another output");
    }
    let Some(stamp) = Stamp::of(path) else {
        bail!("{shown}: exists and was not made by this command; name another output with -o");
    };
    if stamp.session != session {
        bail!(
            "{shown}: holds the files of another session, {}; name another output, or move it away",
            stamp.session
        );
    }
    let is_other = |name: &std::ffi::OsStr| {
        name != STAMP && name.to_str().is_none_or(|name| !stamp.files.contains(name))
    };
    let mut entries = settle(fs::read_dir(path), path)?.filter_map(io::Result::ok);
    match entries.find(|entry| is_other(&entry.file_name())) {
        Some(other) => bail!(
            "{}: was not made by this command, and would be lost; name another output, or move it away",
            other.path().display()
        ),
        None => Ok(()),
    }
}

/// A file of a folder with room for a group's lines of a busy message; there may be some hundred of these.
pub fn buffered(table: FolderFile) -> BufWriter<FolderFile> {
    const BUFFER_BYTES: usize = 16 * 1024;
    BufWriter::with_capacity(BUFFER_BYTES, table)
}
