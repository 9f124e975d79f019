//! One output file.

use std::fs::{self, File, Metadata, Permissions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use super::identity::without_links;
use super::inputs::Inputs;
use super::part::{lock, part_of, remove_stale, sync_folder_of};
use super::paths::{cannot_write, settle};
use crate::outcome::usage;

/// Room for a group's lines of a busy message.
const BUFFER_BYTES: usize = 16 * 1024;

/// A file that is written. It has its name from [`Output::finish`] on; until then, and after a kill, a full disk or an
/// error, there is the old file of this name or none. What is no regular file (a FIFO, `/dev/null`, `/dev/stdout`) is
/// written as it is.
#[derive(Debug)]
pub struct Output {
    file: BufWriter<File>,
    /// As the user named it.
    path: PathBuf,
    part: Option<Part>,
}

/// What becomes the file when it is whole.
#[derive(Debug)]
struct Part {
    path: PathBuf,
    /// Without links: a link to the file stays a link.
    target: PathBuf,
    /// Of the file that it replaces.
    permissions: Option<Permissions>,
    /// Whether it stays when it is dropped before it is whole.
    stays: bool,
}

impl Output {
    /// Begins a file, which is none of the inputs. Its folder must be there.
    pub fn create(path: &Path, inputs: &Inputs) -> Result<Self> {
        let Some(part) = Part::of(path, inputs)? else { return Self::direct(path) };
        remove_stale(&part.path, path)?;
        let file = File::options().write(true).create_new(true).open(&part.path);
        Self::begin(file.with_context(|| cannot_write(path))?, path, part)
    }

    /// Goes on with what an earlier run has left of a file, and says how many bytes that is. Dropped before its end it
    /// stays for the next one. Only for regular files.
    pub fn resume(path: &Path, inputs: &Inputs) -> Result<(Self, u64)> {
        let Some(mut part) = Part::of(path, inputs)? else {
            bail!("{}: is no regular file, and what was begun cannot go on in it", path.display());
        };
        part.stays = true;
        if part.path.is_symlink() {
            fs::remove_file(&part.path).with_context(|| cannot_write(path))?;
        }
        let file = File::options().read(true).append(true).create(true).open(&part.path);
        let file = file.with_context(|| cannot_write(path))?;
        let bytes = file.metadata().with_context(|| cannot_write(path))?.len();
        Ok((Self::begin(file, path, part)?, bytes))
    }

    /// Removes a file that an earlier run made, and that is no input.
    pub fn remove(path: &Path, inputs: &Inputs) -> Result<()> {
        inputs.refuse(path)?;
        fs::remove_file(path).with_context(|| format!("{}: cannot be removed", path.display()))
    }

    fn begin(file: File, path: &Path, part: Part) -> Result<Self> {
        lock(&file, path)?;
        let file = BufWriter::with_capacity(BUFFER_BYTES, file);
        Ok(Self { file, path: path.to_owned(), part: Some(part) })
    }

    /// What is no regular file is written as it is. Appending does no harm where it leads to a regular file after all.
    fn direct(path: &Path) -> Result<Self> {
        let file = File::options().append(true).open(path).with_context(|| cannot_write(path))?;
        Ok(Self { file: BufWriter::with_capacity(BUFFER_BYTES, file), path: path.to_owned(), part: None })
    }

    /// The file's path, as the user named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where the bytes are until the file is whole.
    pub fn part(&self) -> &Path {
        self.part.as_ref().map_or(&self.path, |part| &part.path)
    }

    /// Throws away what was written, or what an earlier run has left: the file begins anew.
    pub fn begin_anew(&mut self) -> Result<()> {
        settle(self.file.flush().and_then(|()| self.file.get_ref().set_len(0)), &self.path)
    }

    /// The file is whole: from here on it has its name. Nothing can be written after that.
    pub fn finish(&mut self) -> Result<()> {
        settle(self.file.flush(), &self.path)?;
        let Some(part) = self.part.take() else { return Ok(()) };
        let rename = || {
            if let Some(permissions) = part.permissions.clone() {
                self.file.get_ref().set_permissions(permissions)?;
            }
            self.file.get_ref().sync_all()?;
            fs::rename(&part.path, &part.target)
        };
        if let Err(error) = rename() {
            part.abandon();
            return Err(error).with_context(|| cannot_write(&self.path));
        }
        sync_folder_of(&part.target);
        Ok(())
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        if let Some(part) = self.part.take() {
            part.abandon();
        }
    }
}

impl Part {
    /// The part of a file that is to be written; `None` where it is no regular file.
    fn of(path: &Path, inputs: &Inputs) -> Result<Option<Self>> {
        inputs.refuse(path)?;
        let target = without_links(path).with_context(|| cannot_write(path))?;
        let about = match fs::metadata(path) {
            Ok(about) => Some(about),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(error).with_context(|| cannot_write(path)),
        };
        if let Some(about) = &about {
            check(path, about)?;
            if !about.is_file() || is_stream(path) {
                return Ok(None);
            }
        }
        let permissions = about.map(|about| about.permissions());
        Ok(Some(Self { path: part_of(&target)?, target, permissions, stays: false }))
    }

    fn abandon(self) {
        if !self.stays {
            // Where it cannot be removed either, the next run does.
            let _ = fs::remove_file(self.path);
        }
    }
}

/// What is there already may be written over, or written to.
fn check(path: &Path, about: &Metadata) -> Result<()> {
    let shown = path.display();
    if about.is_dir() {
        return Err(usage(format!("{shown}: is a directory, and a file is to be written; name a file")));
    }
    if is_block_device(about) {
        return Err(usage(format!("{shown}: is a disk or a card, and hums writes files only; name a file")));
    }
    if about.is_file() && about.permissions().readonly() {
        bail!("{shown}: is read-only; make it writable or name another output");
    }
    Ok(())
}

/// `/dev/stdout` and its like are what the shell opened, also where that is a regular file.
fn is_stream(path: &Path) -> bool {
    cfg!(unix)
        && ["/dev/stdout", "/dev/stderr", "/dev/fd", "/proc"].iter().any(|stream| path.starts_with(stream))
}

#[cfg(unix)]
fn is_block_device(about: &Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt as _;
    about.file_type().is_block_device()
}

#[cfg(not(unix))]
fn is_block_device(_: &Metadata) -> bool {
    false
}
