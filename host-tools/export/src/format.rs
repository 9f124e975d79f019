//! An output format is one file in [`crate::formats`], and a line in the table there.

use std::any::Any;
use std::fmt;
use std::fs::File;
use std::io::{BufWriter, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use hums_blackbox::Gap;
use hums_core::clock::Instant;
use hums_link::Frame;

use crate::args::Decode;
use crate::context::Context;
use crate::files::{Output, make_parent, settle};
use crate::made::OutputFile;
use crate::mavlink::values::Payload;
use crate::outcome::Outcome;
use crate::row::Row;
use crate::source::told::Finding;
use crate::story::Story;

/// Files of a log in a format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Files {
    /// One, with this extension.
    One(&'static str),
    /// A folder of tables, with this extension if it has one; the files' own extension.
    Tables(Option<&'static str>, &'static str),
    /// A folder for each table, by date and bucket; the files' own extension.
    Fleet(&'static str),
}

/// A format, for help, documentation, and the reading of a log.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "independent properties, each a line in a format's file")]
pub struct FormatDetails {
    /// Its name on the command line.
    pub name: &'static str,
    /// Its content and the programs that read it.
    pub help: &'static str,
    /// Its files.
    pub files: Files,
    /// The contents of a log that it cannot hold; empty without any.
    pub omits: &'static str,
    /// It has a place for records, findings and an autopilot's own messages.
    pub has_records: bool,
    /// It is MAVLink frames only.
    pub is_of_frames: bool,
    /// It is made of observations, too.
    pub has_observations: bool,
    /// It has texts and parameters of any recording, besides messages.
    pub has_words: bool,
    /// Vehicle, date and findings must be known before the first byte.
    pub needs_identity: bool,
}

impl FormatDetails {
    /// A format of frames and rows, not a recording.
    pub const fn new(name: &'static str, help: &'static str, files: Files) -> Self {
        Self {
            name,
            help,
            files,
            omits: "",
            has_records: true,
            is_of_frames: false,
            has_observations: false,
            has_words: false,
            needs_identity: false,
        }
    }

    /// The extension of its files.
    pub const fn extension(&self) -> &'static str {
        match self.files {
            Files::One(extension) | Files::Tables(_, extension) | Files::Fleet(extension) => extension,
        }
    }
}

/// A frame, and its time.
#[derive(Clone, Copy, Debug)]
pub struct Entry<'a> {
    /// Since power-on.
    pub at: Instant,
    /// Microseconds since 1970, if known.
    pub utc_us: Option<u64>,
    /// The frame.
    pub frame: &'a Frame<'a>,
    /// Its values, if its definition is ours.
    pub known: Option<&'a Payload>,
}

/// The entries of a group, encoded. Several threads make several parts at once.
pub trait GroupEncoder: Any + Send {
    /// Adds a frame.
    fn frame(&mut self, _context: &Context, _entry: &Entry<'_>) {}

    /// Adds a row: of the monitor's own, or of an autopilot's log.
    fn row(&mut self, _context: &Context, _at: Instant, _row: &Row) {}

    /// Adds a finding, of which [`GroupEncoder::row`] gets a row too.
    fn finding(&mut self, _context: &Context, _finding: &Finding) {}

    /// Bytes of memory that it holds, roughly.
    fn held_bytes(&self) -> usize;
}

impl GroupEncoder for () {
    fn held_bytes(&self) -> usize {
        0
    }
}

/// Totals of a log.
#[derive(Clone, Debug, Default)]
pub struct Totals {
    /// Frames.
    pub frames: u64,
    /// Records and rows.
    pub records: u64,
    /// The vehicle's name.
    pub vehicle: String,
}

impl Totals {
    /// The description of a folder of tables.
    pub fn of_tables(self, path: PathBuf, format: &'static str, tables: usize) -> OutputFile {
        let tables = (tables as u64, "table");
        match self.frames {
            0 => OutputFile::of(path, format, &[tables, (self.records, "row")]),
            frames => OutputFile::of(path, format, &[tables, (frames, "frame"), (self.records, "record")]),
        }
    }
}

/// The finished outputs of a format.
#[derive(Debug, Default)]
pub struct Finished {
    /// Each file with its content.
    pub made: Vec<OutputFile>,
    /// Omitted data, as sentences.
    pub remarks: Vec<String>,
}

impl From<OutputFile> for Finished {
    fn from(file: OutputFile) -> Self {
        Self { made: vec![file], remarks: Vec::new() }
    }
}

/// The open files of a log in one format.
pub trait Writer: Sized + 'static {
    /// Its description.
    const ABOUT: FormatDetails;
    /// Its encoder.
    type Encoder: GroupEncoder + Default;

    /// Opens the file or folder; `-` is standard output.
    fn open(context: &Context, path: &Path) -> Result<Self>;

    /// Takes the next part, and the ordered content if the format asks for it.
    fn part(&mut self, context: &Context, part: Self::Encoder, story: &Story) -> Result<()>;

    /// Data are missing here. Formats with a place for records get a row of the gap too.
    fn gap(&mut self, _context: &Context, _gap: &Gap) -> Result<()> {
        Ok(())
    }

    /// Whether it has written no content of its own besides frames and records.
    fn is_empty(&self) -> bool {
        true
    }

    /// The log is complete: the files get their names.
    fn finish(self, context: &Context, totals: Totals) -> Result<Finished>;
}

/// A [`Writer`] of any format.
pub trait AnyWriter {
    /// As [`Writer::part`].
    fn part(&mut self, context: &Context, part: Box<dyn GroupEncoder>, story: &Story) -> Result<()>;
    /// As [`Writer::gap`].
    fn gap(&mut self, context: &Context, gap: &Gap) -> Result<()>;
    /// As [`Writer::is_empty`].
    fn is_empty(&self) -> bool;
    /// As [`Writer::finish`].
    fn finish(self: Box<Self>, context: &Context, totals: Totals) -> Result<Finished>;
}

impl<W: Writer> AnyWriter for W {
    fn part(&mut self, context: &Context, part: Box<dyn GroupEncoder>, story: &Story) -> Result<()> {
        let part: Box<dyn Any> = part;
        match part.downcast::<W::Encoder>() {
            Ok(part) => Writer::part(self, context, *part, story),
            Err(_) => bail!("{}: a part of another format", W::ABOUT.name),
        }
    }

    fn gap(&mut self, context: &Context, gap: &Gap) -> Result<()> {
        Writer::gap(self, context, gap)
    }

    fn is_empty(&self) -> bool {
        Writer::is_empty(self)
    }

    fn finish(self: Box<Self>, context: &Context, totals: Totals) -> Result<Finished> {
        Writer::finish(*self, context, totals)
    }
}

/// A line of the table of formats.
pub struct Format {
    /// Its description.
    pub about: FormatDetails,
    /// Its functions.
    pub way: Way,
}

/// The way from a log to a format's files.
pub enum Way {
    /// In parts, side by side with other formats.
    Parts {
        /// Makes an empty part.
        part: fn() -> Box<dyn GroupEncoder>,
        /// As [`Writer::open`].
        open: fn(&Context, &Path) -> Result<Box<dyn AnyWriter>>,
    },
    /// Written alone, from all bytes of one recording.
    Alone(fn(&Decode) -> Result<Outcome>),
}

impl Format {
    /// The format of this writer.
    pub const fn of<W: Writer>() -> Self {
        let part = || -> Box<dyn GroupEncoder> { Box::new(W::Encoder::default()) };
        let open = |context: &Context, path: &Path| -> Result<Box<dyn AnyWriter>> {
            Ok(Box::new(W::open(context, path)?))
        };
        Self { about: W::ABOUT, way: Way::Parts { part, open } }
    }
}

impl fmt::Debug for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.about.name)
    }
}

/// A single file, open.
pub struct SingleFile(Output);

impl SingleFile {
    /// Opens it.
    pub fn open(context: &Context, path: &Path) -> Result<Self> {
        context.inputs.refuse(path)?;
        make_parent(path)?;
        Ok(Self(Output::create(path, &context.inputs)?))
    }

    /// Adds bytes.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        settle(self.0.write_all(bytes), self.0.path())
    }

    /// Its path; `None` if it is not a file.
    pub fn path(&self) -> Option<&Path> {
        (!self.0.is_stream()).then(|| self.0.path())
    }

    /// It is complete and gets its name, which is returned.
    pub fn finish(mut self) -> Result<PathBuf> {
        self.0.finish()?;
        Ok(self.0.path().to_owned())
    }
}

/// Content that comes after a beginning that is known last: a temporary file.
pub struct Spool(BufWriter<File>);

impl Spool {
    /// An empty one.
    pub fn new() -> Result<Self> {
        Ok(Self(BufWriter::new(tempfile::tempfile().context(NO_SPOOL)?)))
    }

    /// Adds bytes.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.0.write_all(bytes).context(NO_SPOOL)
    }

    /// Adds all of it to a file.
    pub fn copy(self, to: &mut SingleFile) -> Result<()> {
        let mut file = self.0.into_inner().context(NO_SPOOL)?;
        file.seek(SeekFrom::Start(0)).context(NO_SPOOL)?;
        let mut buffer = vec![0; 1 << 16];
        loop {
            match file.read(&mut buffer).context(NO_SPOOL)? {
                0 => return Ok(()),
                bytes => to.write(buffer.get(..bytes).unwrap_or_default())?,
            }
        }
    }
}

const NO_SPOOL: &str = "a temporary file cannot be written; TMPDIR names another folder for it";
