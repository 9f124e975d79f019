//! The stream that every recording is read as.
//!
//! A [`Reader`]'s memory does not grow with its input, and no input panics it.
//!
//! **Times** count from the recording clock's beginning and never fall ([`super::timeline`]); a clock that falls is an
//! [`Item::Restart`]. UTC of time zero is an [`Item::Epoch`], again when known better.
//!
//! **Damage** is an [`Item::Gap`] with place and reason. An error means an unreadable input.

use std::collections::BTreeSet;
use std::sync::Arc;

use anyhow::Result;
use hums_blackbox::Record;
use hums_core::cause::Alert;
use hums_core::clock::Instant;
use hums_core::observation::{Observation, Source};
use hums_dialect::Kind;
use hums_link::Frame;

use crate::ending::Ending;
use crate::mavlink::values::Scalar;

/// The component that an autopilot is: `MAV_COMP_ID_AUTOPILOT1`.
pub const AUTOPILOT: u8 = 1;

/// An item of a recording.
#[derive(Clone, Copy, Debug)]
pub enum Item<'a> {
    /// UTC at time zero, microseconds since 1970.
    Epoch(u64),
    /// As received; its contents follow.
    Frame(&'a Frame<'a>),
    /// SI units.
    Observation(Source, &'a Observation),
    /// A parameter of the autopilot.
    Parameter(Parameter<'a>),
    /// Long texts are whole; the time is the first part's, perhaps a second back.
    Text(Text<'a>),
    /// The flight mode, at each report of it.
    Mode(Mode<'a>),
    /// Numbered.
    Event(Event<'a>),
    /// A fact about the vehicle or the recording.
    Fact(Fact<'a>),
    /// A message of another format, with its own names and units.
    Row(Row<'a>),
    /// The monitor's own, only in HUMS logs.
    Record(&'a Record<'a>),
    /// Missing or damaged.
    Gap(&'a Gap),
    /// Another power-on of the recorder. Time goes on from its last value.
    Restart,
    /// Another recording follows: recorder's and autopilot's clock changed together. As [`Item::Restart`], with all state void.
    Joint,
}

/// A parameter and its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its value.
    pub value: f64,
}

/// A text from a component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Text<'a> {
    /// Who.
    pub source: Source,
    /// `MAV_SEVERITY`: 0 emergency, 7 debugging.
    pub severity: u8,
    /// Untrusted, never markup.
    pub words: &'a str,
    /// Its alert, also an [`Observation::Alert`], which the monitor takes.
    pub alert: Option<Alert>,
}

/// A flight mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode<'a> {
    /// The autopilot's number.
    pub number: u32,
    /// Its name, if known.
    pub name: Option<&'a str>,
}

/// An event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event<'a> {
    /// Who.
    pub source: Source,
    /// `PX4`'s event id; `ArduPilot`'s `EV`, or `ERR` subsystem times 256 plus code.
    pub number: u32,
    /// `MAV_SEVERITY`.
    pub severity: u8,
    /// Empty if unknown.
    pub words: &'a str,
    /// The alert in it: as in a [`Text`].
    pub alert: Option<Alert>,
}

/// A fact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fact<'a> {
    /// The subject.
    pub about: FactKind,
    /// Untrusted.
    pub words: &'a str,
}

/// The subject of a fact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FactKind {
    /// `ArduCopter V4.6.0 (3fc7011a)`.
    Firmware,
    /// The autopilot's hardware: `PX4_FMU_V5`.
    Hardware,
    /// The airframe: `QUAD/X`.
    Frame,
    /// The recorder: program or device.
    Recorder,
    /// Unresolved failsafes with `, ` between; empty without any.
    Failsafes,
    /// A named emergency: the motors stop at once.
    Emergency,
    /// A restart after a fault, as a sentence.
    ProcessorFault,
    /// A sentence: the arming state's source, if not reported.
    Arming,
    /// A sentence: cannot be checked for damage.
    Unchecked,
    /// A sentence: harmless bytes before the first frame.
    Beginning,
}

/// Columns of one name's rows. A name has one table for ever; changed columns get `ATT_2`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Table {
    /// Safe in a file's name: letters, digits, `_`, `-`.
    pub name: String,
    /// Its columns.
    pub columns: Vec<Column>,
}

impl Table {
    /// The first free one of `name`, `name_2` and so on.
    pub fn free_name(taken: &mut BTreeSet<String>, name: &str) -> String {
        let mut free = name.to_owned();
        let mut number = 2_u32;
        while !taken.insert(free.clone()) {
            free = format!("{name}_{number}");
            number += 1;
        }
        free
    }
}

/// An array has a column for each element: `q[0]`, `q[1]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// Unit after multipliers; empty if unknown.
    pub unit: String,
    /// Type of the values.
    pub kind: ColumnType,
}

/// Columns in the making, with different names.
#[derive(Debug, Default)]
pub struct Columns {
    columns: Vec<Column>,
    taken: BTreeSet<String>,
}

impl Columns {
    /// Adds a column.
    pub fn push(&mut self, name: &str, unit: &str, kind: ColumnType) {
        let name = Table::free_name(&mut self.taken, name);
        self.columns.push(Column { name, unit: unit.to_owned(), kind });
    }

    /// All of them, in order.
    pub fn finish(self) -> Vec<Column> {
        self.columns
    }
}

/// The type of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnType {
    /// [`Scalar::Unsigned`]
    Unsigned,
    /// [`Scalar::Signed`]
    Signed,
    /// [`Scalar::Single`]
    Single,
    /// [`Scalar::Double`]
    Double,
    /// [`CellValue::Flag`]
    Flag,
    /// [`CellValue::Text`]
    Text,
    /// [`CellValue::Bytes`]
    Bytes,
}

impl ColumnType {
    /// Of numbers.
    pub const fn of(kind: Kind) -> Self {
        match kind {
            Kind::U8 | Kind::U16 | Kind::U32 | Kind::U64 | Kind::Char => Self::Unsigned,
            Kind::I8 | Kind::I16 | Kind::I32 | Kind::I64 => Self::Signed,
            Kind::F32 => Self::Single,
            Kind::F64 => Self::Double,
        }
    }
}

/// A value for each column, of its kind or [`CellValue::Unknown`]; a text log may have [`CellValue::Text`] instead.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    /// The same table is the same `Arc`.
    pub table: &'a Arc<Table>,
    /// Its values.
    pub values: &'a [CellValue<'a>],
}

/// One value of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CellValue<'a> {
    /// Not there.
    Unknown,
    /// A number.
    Number(Scalar),
    /// Yes or no.
    Flag(bool),
    /// Words.
    Text(&'a str),
    /// A file's content ([`ColumnType::Bytes`]).
    Bytes(&'a [u8]),
}

impl CellValue<'_> {
    /// As a number, if it is one.
    pub fn number(self) -> Option<f64> {
        Some(match self {
            Self::Number(number) => number.as_f64(),
            Self::Flag(value) => f64::from(u8::from(value)),
            Self::Unknown | Self::Text(_) | Self::Bytes(_) => return None,
        })
    }
}

/// Something is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gap {
    /// Time before it.
    pub from: Option<Instant>,
    /// Time after it.
    pub to: Option<Instant>,
    /// Why.
    pub cause: Cause,
    /// Bytes from the uncompressed file's beginning.
    pub place: Option<u64>,
    /// Unreadable bytes.
    pub bytes: u64,
    /// The end of a sentence: `a length of 3 bytes for FMT`.
    pub words: String,
    /// The gap as in a HUMS log, with sectors and frames.
    pub own: Option<hums_blackbox::Gap>,
}

impl Gap {
    /// Open, without place and size.
    pub const fn new(from: Option<Instant>, cause: Cause, words: String) -> Self {
        Self { from, to: None, cause, place: None, bytes: 0, words, own: None }
    }

    /// Damaged from here on; no byte is passed over.
    pub const fn damaged(at: Instant, place: u64, words: String) -> Self {
        Self::new(Some(at), Cause::Damaged, words).at(place)
    }

    /// The same gap at this place.
    #[must_use]
    pub const fn at(mut self, place: u64) -> Self {
        self.place = Some(place);
        self
    }

    /// Noise: only bytes outside frames.
    pub fn is_noise(&self) -> bool {
        self.cause == Cause::Lost && self.bytes > 0
    }

    /// Our logs' form, without place and words.
    pub fn to_own(&self) -> hums_blackbox::Gap {
        if let Some(own) = self.own {
            return own;
        }
        let cause = match self.cause {
            Cause::Damaged | Cause::Cut | Cause::NoTimes => hums_blackbox::Cause::Damaged,
            Cause::Lost | Cause::Silent => hums_blackbox::Cause::Missing,
            Cause::NotKept => hums_blackbox::Cause::Disarmed,
        };
        hums_blackbox::Gap {
            from: self.from,
            to: self.to,
            cause,
            sectors_lost: 0,
            sectors_skipped: 0,
            frames: None,
        }
    }
}

/// The cause of a gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// The file is damaged here.
    Damaged,
    /// The file ends in the middle of something.
    Cut,
    /// A loss by the recorder's own record.
    Lost,
    /// The recorder left it out on purpose.
    NotKept,
    /// Silence in the air; the flight's end is unknown.
    Silent,
    /// Data without times, in no order.
    NoTimes,
}

impl Cause {
    /// Less than there should be: exit code 3. A cut last message is what a power-off leaves.
    pub const fn is_damage(self) -> bool {
        matches!(self, Self::Damaged | Self::Silent | Self::NoTimes)
    }

    /// The name, for tables and JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Damaged => "damaged",
            Self::Cut => "cut",
            Self::Lost => "lost",
            Self::NotKept => "not_kept",
            Self::Silent => "silent",
            Self::NoTimes => "no_times",
        }
    }
}

/// A command's needs. A reader may leave out the rest to save time. Items without a switch are always handed on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Needs<'a> {
    /// [`Item::Frame`]
    pub frames: bool,
    /// [`Item::Observation`]
    pub observations: bool,
    /// Tables of [`Item::Row`].
    pub rows: Rows<'a>,
    /// System id of a link's only wanted vehicle.
    pub system: Option<u8>,
}

impl Needs<'_> {
    /// Another vehicle's autopilot.
    pub fn leaves_out(&self, source: Source) -> bool {
        source.component == AUTOPILOT && self.system.is_some_and(|system| system != source.system)
    }
}

/// Wanted rows.
#[derive(Clone, Copy, Debug, Default)]
pub enum Rows<'a> {
    /// None.
    #[default]
    None,
    /// Those of all tables.
    All,
    /// Those of tables with these names.
    Named(&'a [String]),
}

impl Rows<'_> {
    /// Whether the rows of this table are wanted.
    pub fn has(self, name: &str) -> bool {
        match self {
            Self::None => false,
            Self::All => true,
            Self::Named(names) => names.iter().any(|known| known == name),
        }
    }
}

/// An error ends the reading; [`Stop`] is not a failure.
pub type ItemSink<'a> = dyn FnMut(Instant, Item<'_>) -> Result<()> + 'a;

/// A text or event after its alert, if observations are wanted.
pub fn hand_said(at: Instant, item: Item<'_>, observes: bool, take: &mut ItemSink<'_>) -> Result<()> {
    if let Item::Text(Text { source, alert: Some(alert), .. })
    | Item::Event(Event { source, alert: Some(alert), .. }) = item
        && observes
    {
        take(at, Item::Observation(source, &Observation::Alert(alert)))?;
    }
    take(at, item)
}

/// A [`ItemSink`] has had enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stop;

impl std::fmt::Display for Stop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("nothing more is wanted")
    }
}

impl std::error::Error for Stop {}

/// Messages, and their bytes in the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Amount {
    /// Number of messages.
    pub count: u64,
    /// Their bytes.
    pub bytes: u64,
}

impl Amount {
    /// Adds more.
    pub fn add(&mut self, more: Self) {
        self.count += more.count;
        self.bytes += more.bytes;
    }
}

/// Messages of one name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MessageCount {
    /// MAVLink id, and whether the checksum matches; `None` in an autopilot's log.
    pub id: Option<(u32, bool)>,
    /// Its name.
    pub name: String,
    /// Number and size.
    pub amount: Amount,
}

/// Totals.
#[derive(Clone, Debug, Default)]
pub struct RecordingSummary {
    /// Unwanted ones too: by id, or by name without ids.
    pub messages: Vec<MessageCount>,
    /// Messages beyond the limit of ids.
    pub other_messages: Amount,
    /// Invalid frames in entries of a HUMS log.
    pub not_frames: u64,
    /// First and last handed-on time.
    pub span: Option<(Instant, Instant)>,
    /// Damage.
    pub gaps: u64,
    /// Losses reported by the recorder.
    pub losses: u64,
    /// The evidence of its end, for a HUMS log.
    pub ending: Option<Ending>,
}

/// Reads one recording.
pub trait Reader: Send {
    /// Reads it from its beginning to its end.
    fn read(&mut self, want: Needs<'_>, take: &mut ItemSink<'_>) -> Result<RecordingSummary>;
}
