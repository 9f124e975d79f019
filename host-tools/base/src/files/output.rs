//! One output file.

use std::fs::{self, File};
use std::io::{self, BufWriter, Seek as _, SeekFrom, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use tempfile::TempPath;

use super::identity::{is_seekable, without_links};
use super::in_place::open_in_place;
use super::inputs::Inputs;
use super::paths::{begin, begun_of, cannot_write, folder_of, means_standard_output, settle};
use crate::outcome::{exists, usage};
use crate::output::Stdout;

/// Room for a group's lines of a busy message.
const BUFFER_BYTES: usize = 16 * 1024;

/// A file that is written by the rules of this [module](super). An output from a live source has its final name from
/// the beginning. Each write is in the file at once: the source cannot be read again.
#[derive(Debug)]
pub struct Output {
    to: BufWriter<To>,
    /// As the user named it.
    path: PathBuf,
    part: Part,
}

#[derive(Debug)]
enum To {
    File(File),
    Standard(Stdout),
}

#[derive(Debug)]
enum Part {
    None,
    /// The file takes this name; it is removed if it does not come to that.
    Temporary {
        from: TempPath,
        to: PathBuf,
        replaces: bool,
    },
    /// The same of a file that a later run may go on with.
    Begun {
        from: PathBuf,
        to: PathBuf,
    },
}

impl Output {
    /// Creates a file, which must not be one of the inputs. Its folder must be there.
    pub fn create(path: &Path, inputs: &Inputs) -> Result<Self> {
        if means_standard_output(path) {
            // The results that the command prints are not to stand in the output.
            crate::output::leave_standard_output();
            return Ok(Self::new(To::Standard(Stdout::default()), path, Part::None));
        }
        Self::check(path, inputs)?;
        let context = || cannot_write(path);
        if fs::metadata(path).is_ok_and(|about| !about.is_file()) {
            let file = File::options().append(true).open(path).with_context(context)?;
            return Ok(Self::new(To::File(file), path, Part::None));
        }
        // A link to a file stays a link.
        let to = without_links(path);
        if !folder_of(&to).is_dir() {
            bail!("{}; there is no folder {}", cannot_write(path), folder_of(&to).display());
        }
        if inputs.is_live() {
            let file = File::create(&to).with_context(context)?;
            return Ok(Self::at_once(file, path, Part::None));
        }
        let begun = begin(&to, |part| File::options().write(true).create_new(true).open(part));
        let (file, from) = begun.with_context(context)?.into_parts();
        let part = Part::Temporary { from, to, replaces: inputs.may_replace() };
        Ok(Self::new(To::File(file), path, part))
    }

    /// Refuses an output that is an input, is not a file, or exists, unless it may be replaced.
    pub fn check(path: &Path, inputs: &Inputs) -> Result<()> {
        if means_standard_output(path) {
            return Ok(());
        }
        inputs.refuse(path)?;
        let shown = path.display();
        let about = match fs::metadata(path) {
            Ok(about) => about,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(error).with_context(|| cannot_write(path)),
        };
        if about.is_dir() {
            return Err(usage(format!("{shown}: is a directory, and a file is to be written; name a file")));
        }
        if !about.is_file() {
            let is_disk = is_seekable(&about);
            let why =
                || usage(format!("{shown}: is a disk or a card, and hums writes files only; name a file"));
            return if is_disk { Err(why()) } else { Ok(()) };
        }
        if !inputs.may_replace() {
            return Err(exists(path, inputs.can_replace()));
        }
        if about.permissions().readonly() {
            bail!("{shown}: is read-only; make it writable or name another output");
        }
        Ok(())
    }

    /// Goes on with the bytes that an earlier run has left of a file. Dropped before its end it stays for the next one. In the
    /// end it replaces a file of its name, whose bytes the caller has compared.
    pub fn resume(path: &Path) -> Result<Self> {
        let to = without_links(path);
        let from = begun_of(&to)?;
        // Windows does not allow cutting a file that is open to append. One run at a time has it, so its end is where
        // this run left it.
        let mut options = File::options();
        options.read(true).write(true).create(true).truncate(false);
        let mut file = open_in_place(&mut options, &from).with_context(|| cannot_write(path))?;
        settle(file.seek(SeekFrom::End(0)), path)?;
        Ok(Self::at_once(file, path, Part::Begun { from, to }))
    }

    fn new(to: To, path: &Path, part: Part) -> Self {
        Self { to: BufWriter::with_capacity(BUFFER_BYTES, to), path: path.to_owned(), part }
    }

    fn at_once(file: File, path: &Path, part: Part) -> Self {
        Self { to: BufWriter::with_capacity(0, To::File(file)), path: path.to_owned(), part }
    }

    /// The file's path, as the user named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The path of the bytes until the file is complete.
    pub fn part(&self) -> &Path {
        match &self.part {
            Part::None => &self.path,
            Part::Temporary { from, .. } => from,
            Part::Begun { from, .. } => from,
        }
    }

    /// Whether it goes into a pipe, a device or standard output: nothing has a place beside it.
    pub fn is_stream(&self) -> bool {
        matches!(self.part, Part::None)
    }

    /// Discards all bytes.
    pub fn begin_anew(&mut self) -> Result<()> {
        let emptied = self.to.flush().and_then(|()| match self.to.get_mut() {
            To::File(file) => file.set_len(0).and_then(|()| file.rewind()),
            To::Standard(_) => Ok(()),
        });
        settle(emptied, &self.path)
    }

    /// The file is whole: from here on it has its name. Nothing can be written after that.
    pub fn finish(&mut self) -> Result<()> {
        let flushed = self.to.flush().and_then(|()| match self.to.get_mut() {
            // A pipe cannot be synced.
            To::File(file) if file.metadata().is_ok_and(|about| about.is_file()) => file.sync_all(),
            _ => Ok(()),
        });
        settle(flushed, &self.path)?;
        let placed = match std::mem::replace(&mut self.part, Part::None) {
            Part::None => Ok(()),
            Part::Temporary { from, to, replaces: true } => from.persist(to).map_err(io::Error::from),
            Part::Temporary { from, to, .. } => match from.persist_noclobber(to) {
                Err(error) if error.error.kind() == io::ErrorKind::AlreadyExists => {
                    return Err(exists(&self.path, true));
                }
                placed => placed.map_err(io::Error::from),
            },
            Part::Begun { from, to } => fs::rename(from, to),
        };
        settle(placed, &self.path)
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        if let Part::Begun { from, .. } = &self.part
            && from.metadata().is_ok_and(|about| about.len() == 0)
        {
            // A leftover that cannot be removed does no harm.
            let _ = fs::remove_file(from);
        }
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.to.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

impl Write for To {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.write(bytes),
            Self::Standard(out) => out.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) => file.flush(),
            Self::Standard(out) => out.flush(),
        }
    }
}
