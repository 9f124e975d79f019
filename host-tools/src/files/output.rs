//! One output file.

use std::fs::{self, File, Metadata};
use std::io::{self, BufWriter, Seek as _, SeekFrom, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use super::aside::{kept_as, replace, set_aside};
use super::descriptor::{
    Opened, check_standard_output, descriptor, is_standard_output, means_standard_output,
};
use super::identity::{check_only_name, is_seekable};
use super::inputs::Inputs;
use super::part::{
    begin, free_part, is_written, lock_folder_of, open_in_place, rename_new, sync_folder_of, unlock_to_read,
};
use super::paths::{begun_of, cannot_write, settle, target_of};
use super::there::{Likeness, There, likeness};
use crate::outcome::{Differs, usage};
use crate::output::Stdout;

/// Room for a group's lines of a busy message.
const BUFFER_BYTES: usize = 16 * 1024;

/// A file that is written. It has its name from [`Output::finish`] on; until then, and after a kill, a full disk or an
/// error, there is the old file of this name or none.
///
/// A file that is there and has a byte in it stays: what is written is compared with it, and the first byte that differs is
/// an error ([`Differs`]). Where the user says `--replace`, the new one takes its name, and it is kept, unless it is the
/// beginning of the new one. What is no regular file (a FIFO, `/dev/null`) and what somebody opened for us (`-`,
/// `/dev/stdout`, `/dev/fd/3`) is written as it is.
///
/// What is made of a live source cannot be made again: it has its name from the beginning, and each write is in the file at
/// once. So what came before a kill is there, and every command sees it.
#[derive(Debug)]
pub struct Output {
    to: BufWriter<To>,
    /// As the user named it.
    path: PathBuf,
    part: Option<Part>,
}

/// Where the bytes go.
#[derive(Debug)]
enum To {
    File(File),
    There(There),
    Standard(Stdout),
}

/// What becomes the file when it is whole.
#[derive(Debug)]
struct Part {
    /// Empty until it is begun.
    path: PathBuf,
    /// Without links: a link to the file stays a link.
    target: PathBuf,
    /// What becomes of another file that has this name in the end.
    taken: Taken,
    /// An earlier run may have begun it: it stays when it is dropped.
    resumed: bool,
}

/// What becomes of a file with other content under an output's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Taken {
    /// It stays, and the output is refused.
    Stays,
    /// The same, unless it is the beginning of the output: nothing of that is lost.
    Completed,
    /// It is kept under another name.
    Kept,
}

/// What an output may find at its place.
enum Place {
    /// Nothing, an empty file, or a file that may be replaced.
    Free(Part),
    /// A file with something in it, which stays.
    Taken(Part),
    /// No regular file.
    Stream,
}

impl Output {
    /// Begins a file, which is none of the inputs. Its folder must be there.
    pub fn create(path: &Path, inputs: &Inputs) -> Result<Self> {
        if means_standard_output(path) {
            return Self::standard(path);
        }
        match Part::of(path, inputs)? {
            Place::Free(_) if inputs.is_live() => Self::record(path),
            Place::Free(part) => Self::begin(path, part),
            Place::Taken(_) if inputs.is_live() => Err(Differs::at_all(path).into()),
            Place::Taken(_) => {
                let there =
                    There::open(path, 0).with_context(|| format!("{}: cannot be read", path.display()));
                Ok(Self::new(To::There(there?), path, None))
            }
            Place::Stream => Self::direct(path),
        }
    }

    /// Refuses a file that is there with something in it: for what a run makes beside changing something else, where
    /// comparing would come too late.
    pub fn check_new(path: &Path, inputs: &Inputs) -> Result<()> {
        if means_standard_output(path) {
            return check_standard_output();
        }
        match Part::of(path, inputs)? {
            Place::Taken(_) => Err(Differs::at_all(path).into()),
            Place::Free(_) | Place::Stream => Ok(()),
        }
    }

    /// Refuses a file with something in it where a run makes none, and an earlier one would be taken for its own; with
    /// `--replace` it may be [kept](Self::keep).
    pub fn check_none(path: &Path, inputs: &Inputs) -> Result<()> {
        match Part::of(path, inputs)? {
            Place::Taken(_) => Err(Differs::new(path).into()),
            Place::Free(_) | Place::Stream => Ok(()),
        }
    }

    /// Keeps such a file under another name.
    pub fn keep(path: &Path, inputs: &Inputs) -> Result<()> {
        let Place::Free(part) = Part::of(path, inputs)? else { return Ok(()) };
        settle(part.keep_there(), path)
    }

    /// Goes on with what an earlier run has left of a file, and says how many bytes that is. Dropped before its end it
    /// stays for the next one, unless nothing is in it. In the end it completes a file that is its beginning, and replaces no other. Only for regular files.
    pub fn resume(path: &Path) -> Result<(Self, u64)> {
        let target = target_of(path)?;
        if let Ok(about) = fs::metadata(path) {
            check(path, &about)?;
            if !about.is_file() || descriptor(path).is_some() {
                bail!("{}: is no regular file, and what was begun cannot go on in it", path.display());
            }
        }
        let part = Part { path: begun_of(&target)?, target, taken: Taken::Completed, resumed: true };
        if fs::symlink_metadata(&part.path).is_ok_and(|about| !about.is_file()) {
            bail!("{}: is no file of ours, and stands where one is begun; move it away", part.path.display());
        }
        let _beginning = lock_folder_of(&part.target);
        let file = open_to_go_on(&part.path, path)?;
        let about = file.metadata().with_context(|| cannot_write(path))?;
        check_only_name(&file, &part.path)?;
        Ok((Self::at_once(file, path, Some(part)), about.len()))
    }

    /// Begins anew what [`Output::resume`] gave. What an earlier run has left is kept under the path that is given back.
    pub fn set_aside(&mut self) -> Result<PathBuf> {
        let Some(part) = self.part.take() else { bail!("{}", cannot_write(&self.path)) };
        let aside = settle(set_aside(&part.path, &part.target), &self.path)?;
        let file = open_to_go_on(&part.path, &self.path)?;
        *self = Self::at_once(file, &self.path, Some(part));
        Ok(aside)
    }

    fn new(to: To, path: &Path, part: Option<Part>) -> Self {
        Self { to: BufWriter::with_capacity(BUFFER_BYTES, to), path: path.to_owned(), part }
    }

    /// A file into which each write goes at once.
    fn at_once(file: File, path: &Path, part: Option<Part>) -> Self {
        Self { to: BufWriter::with_capacity(0, To::File(file)), path: path.to_owned(), part }
    }

    /// What has its name from the beginning. Nothing is there, or an empty file.
    fn record(path: &Path) -> Result<Self> {
        let file = open_to_go_on(path, path)?;
        if file.metadata().with_context(|| cannot_write(path))?.len() > 0 {
            return Err(Differs::at_all(path).into());
        }
        Ok(Self::at_once(file, path, None))
    }

    fn begin(path: &Path, mut part: Part) -> Result<Self> {
        let _beginning = lock_folder_of(&part.target);
        let make = |part: &Path| File::options().write(true).create_new(true).open(part);
        let (begun, file) = begin(&part.target, path, make)?;
        part.path = begun;
        Ok(Self::new(To::File(file), path, Some(part)))
    }

    fn standard(path: &Path) -> Result<Self> {
        check_standard_output()?;
        // The results that the command prints are not to stand in what it makes.
        crate::output::leave_standard_output();
        Ok(Self::new(To::Standard(Stdout::new()), path, None))
    }

    /// What is no regular file is written as it is. Appending does no harm where it leads to a regular file after all.
    fn direct(path: &Path) -> Result<Self> {
        let opened = descriptor(path).and_then(Opened::of);
        opened
            .map_or(Ok(()), |opened| opened.check_empty())
            .map_err(|why| usage(format!("{}: {why}", path.display())))?;
        if is_pipe(path) {
            note!("{}: is a pipe, into which is written once something reads it", path.display());
        }
        let file = File::options().append(true).open(path).with_context(|| cannot_write(path))?;
        // The results that the command prints are not to stand in what it makes.
        if is_standard_output(&file) {
            crate::output::leave_standard_output();
        }
        Ok(Self::new(To::File(file), path, None))
    }

    /// The file's path, as the user named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where the bytes are until the file is whole.
    pub fn part(&self) -> &Path {
        self.part.as_ref().map_or(&self.path, |part| &part.path)
    }

    /// Whether it goes into a pipe or a device, or into what somebody opened for us: nothing has a place beside it.
    pub fn is_stream(&self) -> bool {
        matches!(self.to.get_ref(), To::Standard(_))
            || matches!(self.to.get_ref(), To::File(_)) && self.part.is_none()
    }

    /// Nothing more is written: where a file is compared, it must be at its end. [`Output::finish`] then has only to give the
    /// name.
    pub fn end(&mut self) -> Result<()> {
        let ended = self.to.flush().and_then(|()| match self.to.get_mut() {
            To::There(there) => there.end(),
            To::File(_) | To::Standard(_) => Ok(()),
        });
        settle(ended, &self.path)
    }

    /// Whether something with other content lies at its place, which it replaces. All of it is written.
    pub fn replaces(&self) -> Result<bool> {
        let (Some(part), To::File(file)) = (&self.part, self.to.get_ref()) else { return Ok(false) };
        unlock_to_read(file);
        Ok(part.taken == Taken::Kept && part.is_other()?)
    }

    /// Keeps what it replaces before it gets its name: for what must not have its name beside what belongs to that.
    pub fn make_way(&self) -> Result<()> {
        let (Some(part), To::File(file)) = (&self.part, self.to.get_ref()) else { return Ok(()) };
        let Some(about) = fs::metadata(&part.target).ok().filter(|_| part.taken == Taken::Kept) else {
            return Ok(());
        };
        settle(file.set_permissions(about.permissions()).and_then(|()| part.keep_there()), &self.path)
    }

    /// Throws away what was written, or what an earlier run has left: the file begins anew.
    pub fn begin_anew(&mut self) -> Result<()> {
        let emptied = self.to.flush().and_then(|()| match self.to.get_mut() {
            To::File(file) => file.set_len(0).and_then(|()| file.rewind()),
            To::There(_) | To::Standard(_) => Ok(()),
        });
        settle(emptied, &self.path)
    }

    /// The file is whole: from here on it has its name. Nothing can be written after that.
    pub fn finish(&mut self) -> Result<()> {
        self.end()?;
        let To::File(file) = self.to.get_mut() else { return Ok(()) };
        let Some(part) = self.part.take() else {
            let is_file = file.metadata().is_ok_and(|about| about.is_file());
            return settle(if is_file { file.sync_all() } else { Ok(()) }, &self.path);
        };
        let placed = file.sync_all().and_then(|()| part.place(file));
        if let Err(error) = placed {
            part.abandon();
            return settle(Err(error), &self.path);
        }
        sync_folder_of(&part.target);
        Ok(())
    }
}

/// A file that other commands make, under the name of a part: a card on which a demo records. It gets its own name once it is
/// whole, by the rules of [`Output`].
#[derive(Debug)]
pub struct Begun(Part);

impl Begun {
    /// Finds a name for the part that nothing has. The file is none of the inputs.
    pub fn of(path: &Path, inputs: &Inputs) -> Result<Self> {
        match Part::of(path, inputs)? {
            Place::Free(mut part) | Place::Taken(mut part) => {
                part.path = free_part(&part.target, path)?;
                Ok(Self(part))
            }
            Place::Stream => bail!("{}: is no regular file; name another output", path.display()),
        }
    }

    /// Where it is made.
    pub fn path(&self) -> &Path {
        &self.0.path
    }

    /// Refuses what lies at its place with other content, where that stays.
    pub fn check(&self) -> Result<()> {
        let Part { target, taken, .. } = &self.0;
        if self.0.is_other()? && *taken != Taken::Kept { Err(Differs::new(target).into()) } else { Ok(()) }
    }

    /// It is whole.
    pub fn finish(self) -> Result<()> {
        let Part { path, target, .. } = &self.0;
        let placed = File::open(path).and_then(|file| file.sync_all().and_then(|()| self.0.place(&file)));
        settle(placed, target)?;
        sync_folder_of(target);
        Ok(())
    }
}

impl Drop for Begun {
    /// What has become the file has this name no more.
    fn drop(&mut self) {
        self.0.abandon();
    }
}

/// A part that an earlier run may have begun, to be gone on with.
fn open_to_go_on(part: &Path, path: &Path) -> Result<File> {
    // Windows lets nobody cut a file that is open to append; one run at a time has it, so its end is where this run left it.
    let mut options = File::options();
    options.read(true).write(true).create(true).truncate(false);
    let opened = open_in_place(&mut options, part);
    if opened.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::ResourceBusy) {
        bail!(is_written(path));
    }
    let mut file = opened.with_context(|| cannot_write(path))?;
    file.seek(SeekFrom::End(0)).with_context(|| cannot_write(path))?;
    Ok(file)
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
            Self::There(there) => there.compare(bytes).map(|()| bytes.len()),
            Self::Standard(out) => out.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) => file.flush(),
            Self::There(_) => Ok(()),
            Self::Standard(out) => out.flush(),
        }
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
    /// The part of a file that is to be written.
    fn of(path: &Path, inputs: &Inputs) -> Result<Place> {
        inputs.refuse(path)?;
        let target = target_of(path)?;
        let replaces = inputs.may_replace(path);
        let part = |or| {
            let taken = if replaces { Taken::Kept } else { or };
            Self { path: PathBuf::new(), target, taken, resumed: false }
        };
        let about = match fs::metadata(path) {
            Ok(about) => about,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return Ok(Place::Free(part(Taken::Stays)));
            }
            Err(error) => return Err(error).with_context(|| cannot_write(path)),
        };
        check(path, &about)?;
        if !about.is_file() || descriptor(path).is_some() {
            return Ok(Place::Stream);
        }
        if about.len() > 0 && !replaces {
            return Ok(Place::Taken(part(Taken::Stays)));
        }
        if about.permissions().readonly() {
            bail!("{}: is read-only; make it writable or name another output", path.display());
        }
        Ok(Place::Free(part(Taken::Completed)))
    }

    /// Whether something with other content lies at its place.
    fn is_other(&self) -> Result<bool> {
        let Self { path, target, .. } = self;
        let is_there = fs::metadata(target).is_ok_and(|about| about.len() > 0);
        Ok(is_there && settle(likeness(target, path), target)? != Likeness::Equal)
    }

    /// Keeps what lies at its place under another name.
    fn keep_there(&self) -> io::Result<()> {
        let _ending = lock_folder_of(&self.target);
        if fs::metadata(&self.target).is_ok_and(|about| about.len() > 0) {
            let aside = set_aside(&self.target, &self.target)?;
            note!("{}: {}", self.target.display(), kept_as(&aside));
        }
        Ok(())
    }

    /// Gives it its name.
    fn place(&self, file: &File) -> io::Result<()> {
        let _ending = lock_folder_of(&self.target);
        match rename_new(&self.path, &self.target) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            done => return done,
        }
        unlock_to_read(file);
        // What the user means to replace or to complete, or what somebody has put there meanwhile.
        let permissions = fs::metadata(&self.target)?.permissions();
        match likeness(&self.target, &self.path)? {
            Likeness::Equal => fs::remove_file(&self.path),
            Likeness::Beginning if self.taken >= Taken::Completed => {
                file.set_permissions(permissions)?;
                fs::rename(&self.path, &self.target)
            }
            _ if self.taken == Taken::Kept => {
                file.set_permissions(permissions)?;
                replace(&self.path, &self.target)
            }
            _ if self.resumed => Err(io::Error::other(Differs::at_all(&self.target))),
            _ => Err(io::Error::other(Differs::new(&self.target))),
        }
    }

    fn abandon(&self) {
        let _ending = lock_folder_of(&self.target);
        // In one with nothing in it nothing can be gone on with.
        let is_empty = || fs::symlink_metadata(&self.path).is_ok_and(|about| about.len() == 0);
        if !self.resumed || is_empty() {
            // Where it cannot be removed either, it is in nobody's way.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// What is there already may be written to.
fn check(path: &Path, about: &Metadata) -> Result<()> {
    let shown = path.display();
    if about.is_dir() {
        return Err(usage(format!("{shown}: is a directory, and a file is to be written; name a file")));
    }
    if is_seekable(about) && !about.is_file() {
        return Err(usage(format!("{shown}: is a disk or a card, and hums writes files only; name a file")));
    }
    Ok(())
}

/// A pipe with a name, whose other end may not be there yet.
#[cfg(unix)]
fn is_pipe(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt as _;
    descriptor(path).is_none() && fs::metadata(path).is_ok_and(|about| about.file_type().is_fifo())
}

#[cfg(not(unix))]
fn is_pipe(_: &Path) -> bool {
    false
}
