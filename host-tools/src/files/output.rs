//! One output file.

use std::fs::{self, File, Metadata, Permissions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use super::amount::{Amount, Content};
use super::identity::{
    check_standard_output, check_standard_output_is_open, descriptor, is_standard_output,
    means_standard_output, refuse_overwriting,
};
use super::inputs::Inputs;
use super::kind::{Found, Kind, Origin};
use super::part::{free_part, lock, lock_folder_of, rename_new, sync_folder_of};
use super::paths::{aside_of, begun_of, cannot_write, settle, target_of};
use super::there::{Likeness, There, likeness};
use crate::outcome::{Differs, usage};
use crate::output::Stdout;

/// Room for a group's lines of a busy message.
const BUFFER_BYTES: usize = 16 * 1024;

/// A file that is written. It has its name from [`Output::finish`] on; until then, and after a kill, a full disk or an
/// error, there is the old file of this name or none.
///
/// A file that is there and has a byte in it is never replaced by other content, unless the user says so: what is
/// written is compared with it, and the first byte that differs is an error ([`Differs`]). What is no regular file (a
/// FIFO, `/dev/null`) and what somebody opened for us (`-`, `/dev/stdout`, `/dev/fd/3`) is written as it is.
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
    /// Of the file that it replaces; none where it replaces nothing.
    permissions: Option<Permissions>,
    /// It may replace a file that is its own beginning: nothing of that is lost.
    replaces_beginning: bool,
    /// What is in the file that it replaces; none where that may become less.
    there: Option<Content>,
    /// How much is in it.
    amount: Option<Amount>,
    /// An earlier run may have begun it: it stays when it is dropped.
    resumed: bool,
}

/// What an output may find at its place.
enum Place {
    /// Nothing, or a file that it may replace.
    Free(Part),
    /// A file with something in it.
    Taken,
    /// No regular file.
    Stream,
}

impl Output {
    /// Begins a file, which is none of the inputs. Its folder must be there. `kind` is what the command makes, `of` the log
    /// that it makes it of, where that has a name.
    pub fn create(path: &Path, inputs: &Inputs, kind: &Kind, of: Option<&str>) -> Result<Self> {
        if means_standard_output(path) {
            return Self::standard(path, inputs);
        }
        match Part::of(path, inputs, kind, of)? {
            Place::Free(_) if inputs.is_live() => Self::record(path),
            Place::Free(part) => Self::begin(path, part),
            Place::Taken if inputs.is_live() => Err(Differs::new(path).into()),
            Place::Taken => {
                let there =
                    There::open(path, 0).with_context(|| format!("{}: cannot be read", path.display()));
                Ok(Self::new(To::There(there?), path, None))
            }
            Place::Stream => Self::direct(path),
        }
    }

    /// Refuses a file that is there with something in it: for what a run makes beside changing something else, where
    /// comparing would come too late.
    pub fn check_new(path: &Path, inputs: &Inputs, kind: &Kind) -> Result<()> {
        if means_standard_output(path) {
            return inputs.refuse_standard_output();
        }
        match Part::of(path, inputs, kind, None)? {
            Place::Taken if matches!(kind.origin, Origin::Unknown) => Err(Differs::original(path).into()),
            Place::Taken => Err(Differs::new(path).into()),
            Place::Free(part) if part.replaces_beginning => Err(Differs::original(path).into()),
            Place::Free(_) | Place::Stream => Ok(()),
        }
    }

    /// Refuses a place where anything but such a file lies, or nothing: for what is written only later, and only perhaps.
    pub fn check_place(path: &Path, inputs: &Inputs, kind: &Kind) -> Result<()> {
        inputs.refuse(path)?;
        let about = match fs::metadata(path) {
            Ok(about) => about,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(error).with_context(|| cannot_write(path)),
        };
        check(path, &about)?;
        let is_kind = || -> io::Result<bool> { Ok(!matches!(kind.found(path, None)?, Found::Other)) };
        if about.is_file() && (about.len() == 0 || is_kind().with_context(|| cannot_write(path))?) {
            return Ok(());
        }
        bail!(
            "{}: is there already, and is not {}, which goes there; move it away, or name another output",
            path.display(),
            kind.words
        )
    }

    /// Goes on with what an earlier run has left of a file, and says how many bytes that is. Dropped before its end it
    /// stays for the next one. In the end it replaces a file that is its beginning, and no other. Only for regular files.
    pub fn resume(path: &Path) -> Result<(Self, u64)> {
        let target = target_of(path)?;
        if let Ok(about) = fs::metadata(path) {
            check(path, &about)?;
            if !about.is_file() || descriptor(path).is_some() {
                bail!("{}: is no regular file, and what was begun cannot go on in it", path.display());
            }
        }
        let part = Part {
            path: begun_of(&target)?,
            target,
            permissions: None,
            replaces_beginning: true,
            there: None,
            amount: None,
            resumed: true,
        };
        if fs::symlink_metadata(&part.path).is_ok_and(|about| !about.is_file()) {
            bail!("{}: is no file of ours, and stands where one is begun; move it away", part.path.display());
        }
        let file = open_to_go_on(&part.path, path)?;
        let bytes = file.metadata().with_context(|| cannot_write(path))?.len();
        Ok((Self::at_once(file, path, Some(part)), bytes))
    }

    /// Begins anew what [`Output::resume`] gave. What an earlier run has left stays under the name that is given back.
    pub fn set_aside(&mut self) -> Result<PathBuf> {
        let Some(part) = self.part.take() else { bail!("{}", cannot_write(&self.path)) };
        let mut number = 1;
        let aside = loop {
            let aside = aside_of(&part.target, number)?;
            match rename_new(&part.path, &aside) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => number += 1,
                renamed => break settle(renamed, &self.path).map(|()| aside)?,
            }
        };
        let file = open_to_go_on(&part.path, &self.path)?;
        *self = Self::at_once(file, &self.path, Some(part));
        Ok(aside)
    }

    /// Removes a file that an earlier run made, and that is no input.
    pub fn remove(path: &Path, inputs: &Inputs) -> Result<()> {
        inputs.refuse(path)?;
        fs::remove_file(path).with_context(|| format!("{}: cannot be removed", path.display()))
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
            return Err(Differs::new(path).into());
        }
        Ok(Self::at_once(file, path, None))
    }

    fn begin(path: &Path, mut part: Part) -> Result<Self> {
        let _beginning = lock_folder_of(&part.target);
        part.path = free_part(&part.target, path)?;
        let file = File::options().write(true).create_new(true).open(&part.path);
        let file = file.with_context(|| cannot_write(path))?;
        lock(&file, path)?;
        Ok(Self::new(To::File(file), path, Some(part)))
    }

    fn standard(path: &Path, inputs: &Inputs) -> Result<Self> {
        inputs.refuse_standard_output()?;
        check_standard_output()?;
        check_standard_output_is_open()?;
        // The results that the command prints are not to stand in what it makes.
        crate::output::leave_standard_output();
        Ok(Self::new(To::Standard(Stdout::new()), path, None))
    }

    /// What is no regular file is written as it is. Appending does no harm where it leads to a regular file after all.
    fn direct(path: &Path) -> Result<Self> {
        descriptor(path).map_or(Ok(()), refuse_overwriting)?;
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

    /// How much of its log is in it, before it gets its name: it takes the place of no file that has more.
    pub fn set_amount(&mut self, amount: Amount) {
        if let Some(part) = &mut self.part {
            part.amount = Some(amount);
        }
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

    /// Throws away what was written, or what an earlier run has left: the file begins anew.
    pub fn begin_anew(&mut self) -> Result<()> {
        let emptied = self.to.flush().and_then(|()| match self.to.get_ref() {
            To::File(file) => file.set_len(0),
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

/// A part that an earlier run may have begun, to be gone on with.
fn open_to_go_on(part: &Path, path: &Path) -> Result<File> {
    let file = File::options().read(true).append(true).create(true).open(part);
    let file = file.with_context(|| cannot_write(path))?;
    lock(&file, path)?;
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
    fn of(path: &Path, inputs: &Inputs, kind: &Kind, of: Option<&str>) -> Result<Place> {
        inputs.refuse(path)?;
        let target = target_of(path)?;
        let part = |target: PathBuf, permissions, replaces_beginning, there| -> Result<Place> {
            let (path, amount, resumed) = (PathBuf::new(), None, false);
            Ok(Place::Free(Self { path, target, permissions, replaces_beginning, there, amount, resumed }))
        };
        let mut there = None;
        let about = match fs::metadata(path) {
            Ok(about) => about,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return part(target, None, false, None),
            Err(error) => return Err(error).with_context(|| cannot_write(path)),
        };
        check(path, &about)?;
        if !about.is_file() || descriptor(path).is_some() {
            return Ok(Place::Stream);
        }
        if about.len() > 0 {
            if !inputs.may_replace(path) {
                return Ok(Place::Taken);
            }
            // By what a link leads to: the link may have another file's name.
            match check_kind(path, &target, kind, of)? {
                Found::Same(amount) => there = Some(Content { amount, bytes: about.len() }),
                Found::Kind | Found::Other => return part(target, None, true, None),
            }
            // A table beside a file is shorter where that has become whole.
            there = there.filter(|_| !matches!(kind.origin, Origin::Ours));
        }
        if about.permissions().readonly() {
            bail!("{}: is read-only; make it writable or name another output", path.display());
        }
        part(target, Some(about.permissions()), false, there)
    }

    /// Gives it its name.
    fn place(&self, file: &File) -> io::Result<()> {
        if let Some(permissions) = &self.permissions {
            if let Some(there) = self.there {
                // Somebody may have written to it meanwhile.
                let there = Content { bytes: fs::metadata(&self.target)?.len(), ..there };
                let new = Content { amount: self.amount, bytes: file.metadata()?.len() };
                if let Err(less) = new.check_replaces(there, &self.target) {
                    return match likeness(&self.target, &self.path)? {
                        Likeness::Equal => fs::remove_file(&self.path),
                        Likeness::Beginning | Likeness::Other => Err(io::Error::other(less)),
                    };
                }
            }
            file.set_permissions(permissions.clone())?;
            return fs::rename(&self.path, &self.target);
        }
        match rename_new(&self.path, &self.target) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            done => return done,
        }
        // Somebody has put something there meanwhile; or an earlier run has, what is gone on with.
        let permissions = fs::metadata(&self.target)?.permissions();
        match likeness(&self.target, &self.path)? {
            Likeness::Equal => fs::remove_file(&self.path),
            Likeness::Beginning if self.replaces_beginning => {
                file.set_permissions(permissions)?;
                fs::rename(&self.path, &self.target)
            }
            _ if self.replaces_beginning && !self.resumed => {
                Err(io::Error::other(Differs::original(&self.target)))
            }
            _ => Err(io::Error::other(Differs::new(&self.target))),
        }
    }

    fn abandon(&self) {
        if !self.resumed {
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
    if is_block_device(about) {
        return Err(usage(format!("{shown}: is a disk or a card, and hums writes files only; name a file")));
    }
    Ok(())
}

/// What is replaced is of the kind that the command makes: a slip of the finger is not enough to lose a card's image.
fn check_kind(path: &Path, target: &Path, kind: &Kind, of: Option<&str>) -> Result<Found> {
    let found = kind.found(target, of).with_context(|| format!("{}: cannot be read", path.display()))?;
    if !matches!(found, Found::Other) {
        return Ok(found);
    }
    bail!(
        "{}: is there already, and is not {}, so --replace does not replace it; name another output, or move it away",
        path.display(),
        kind.words
    )
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
