//! The request, and the context common to all parts of a log's decoding.

use std::sync::Arc;

use super::checked::Checked;
use super::findings::Findings;
use super::fleet::Fleet;
use super::format::{self, Files, Format, GroupEncoder, Way};
use super::formats::influx::Tags;
use super::identity::{Identity, RecordingContent};
use super::native::NativeTables;
use super::selection::Selection;
use crate::files::Inputs;
use crate::source::epochs::Epochs;

/// The requested formats, each once.
#[derive(Clone, Debug, Default)]
pub struct Formats {
    formats: Vec<&'static Format>,
    /// Each flight has files of its own.
    pub split: bool,
}

impl Formats {
    /// The formats of `asked`, in the order of the table.
    pub fn new(asked: &[&'static Format], split: bool) -> Self {
        let is_asked = |format: &&Format| asked.iter().any(|asked| asked.about.name == format.about.name);
        Self { formats: super::formats::FORMATS.iter().filter(is_asked).collect(), split }
    }

    /// The formats that a log without MAVLink frames can have.
    #[must_use]
    pub fn without_frames(&self) -> Self {
        let formats = self.formats.iter().copied().filter(|format| !format.about.is_of_frames);
        Self { formats: formats.collect(), split: self.split }
    }

    /// Their descriptions.
    pub fn about(&self) -> impl Iterator<Item = &'static format::FormatDetails> {
        self.formats.iter().map(|format| &format.about)
    }

    /// The formats that are made in parts.
    pub fn ways(&self) -> impl Iterator<Item = (&'static format::FormatDetails, &'static Way)> {
        self.formats.iter().map(|format| (&format.about, &format.way))
    }

    /// An empty part of each.
    pub fn parts(&self) -> Vec<Box<dyn GroupEncoder>> {
        let ways = self.formats.iter().map(|format| &format.way);
        ways.filter_map(|way| if let Way::Parts { part, .. } = way { Some(part()) } else { None }).collect()
    }

    /// Whether any of them has a place for records.
    pub fn has_records(&self) -> bool {
        self.about().any(|about| about.has_records)
    }

    /// Whether any of them has texts and parameters of any recording.
    pub fn has_words(&self) -> bool {
        self.about().any(|about| about.has_words)
    }

    /// Whether there is none.
    pub const fn is_empty(&self) -> bool {
        self.formats.is_empty()
    }

    /// Whether a log becomes exactly one file.
    pub fn is_single_file(&self) -> bool {
        let mut about = self.about();
        let is_single = about.next().is_some_and(|about| matches!(about.files, Files::One(_)));
        is_single && about.next().is_none() && !self.split
    }
}

/// Context common to all parts of one log's decoding.
#[derive(Debug, Default)]
pub struct Context {
    /// The formats to write.
    pub formats: Formats,
    /// UTC by the clock of each part; for a HUMS log, at the power-on.
    pub epochs: Epochs,
    /// The wanted part of it.
    pub selection: Selection,
    /// Vehicle and date, if a format needs them.
    pub identity: Identity,
    /// The content of the recording, if a format needs the identity.
    pub about: Option<RecordingContent>,
    /// The tables of all sessions in the output's folder.
    pub(crate) fleet: Option<Arc<Fleet>>,
    /// The same for the line protocol.
    pub tags: Tags,
    /// The session, for the stamps of its folders.
    pub session: String,
    /// Seconds from the log's beginning to the video's.
    pub offset_s: f64,
    /// Files that must not be overwritten.
    pub inputs: Arc<Inputs>,
    /// This program's findings, if the recorder ran no checks and an earlier reading made them.
    pub checked: Option<Checked>,
    /// The findings that go into a tlog as texts.
    pub findings: Option<Findings>,
    /// It is judged while it is read.
    pub judges: bool,
    /// The tables of an autopilot's own log.
    pub tables: NativeTables,
}
