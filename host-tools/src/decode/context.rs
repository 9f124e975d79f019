//! The request, and the context common to all parts of a log's decoding.

use super::checked::Checked;
use super::findings::Findings;
use super::identity::Identity;
use super::influx::Tags;
use super::native::Tables;
use super::selection::Selection;
use crate::cli::Format;
use crate::files::Inputs;
use crate::source::epochs::Epochs;

/// The requested formats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(clippy::struct_excessive_bools, reason = "any set of formats can be asked for")]
pub struct Formats {
    /// A ground station's log.
    pub tlog: bool,
    /// Tables.
    pub csv: bool,
    /// Objects.
    pub jsonl: bool,
    /// Line protocol.
    pub influx: bool,
    /// Columns.
    pub parquet: bool,
    /// The reference system's tables.
    pub thesis: bool,
    /// Each flight has files of its own.
    pub split: bool,
}

impl Formats {
    /// These.
    pub fn new(formats: &[Format], split: bool) -> Self {
        let has = |format| formats.contains(&format);
        Self {
            tlog: has(Format::Tlog),
            csv: has(Format::Csv),
            jsonl: has(Format::Jsonl),
            influx: has(Format::Influx),
            parquet: has(Format::Parquet),
            thesis: has(Format::Thesis),
            split,
        }
    }

    /// Whether any of them has a place for records.
    pub fn has_records(self) -> bool {
        self.csv || self.jsonl || self.influx || self.parquet
    }

    /// Whether a log becomes exactly one file.
    pub fn is_single_file(self) -> bool {
        let single = u8::from(self.tlog) + u8::from(self.jsonl) + u8::from(self.influx);
        single == 1 && !self.csv && !self.parquet && !self.thesis && !self.split
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
    /// The same for the line protocol.
    pub tags: Tags,
    /// The session, for the stamps of its folders.
    pub session: String,
    /// Files that must not be overwritten.
    pub inputs: Inputs,
    /// This program's findings, if the recorder ran no checks and an earlier reading made them.
    pub checked: Option<Checked>,
    /// The findings that go into a tlog as texts.
    pub findings: Option<Findings>,
    /// It is judged while it is read.
    pub judges: bool,
    /// The tables of an autopilot's own log.
    pub tables: Tables,
}
