//! The one stream that every recording is read as, whatever its format: times and the items recorded at them.
//!
//! A format is one file (or folder) beside this one with a [`Reader`]; a command takes [`Item`]s and knows no format.
//! A reader streams: its memory does not grow with its input, and nothing in an input may panic it.
//!
//! **Times** count from the beginning of the recording's own clock and never fall ([`super::timeline`] sees to that; a
//! clock that falls is an [`Item::Restart`]). UTC of time zero is an [`Item::Epoch`] as soon as it is known, and again
//! when it is known better.
//!
//! **Damage** is walked over and reported as an [`Item::Gap`] with its place and its reason. An error means that
//! the input cannot be read at all.

use std::collections::BTreeSet;
use std::sync::Arc;

use anyhow::Result;
use hums_blackbox::Record;
use hums_core::cause::Alert;
use hums_core::clock::Instant;
use hums_core::observation::{Observation, Source};
use hums_link::Frame;

use crate::ending::Ending;

/// The component that an autopilot is: `MAV_COMP_ID_AUTOPILOT1`.
pub const AUTOPILOT: u8 = 1;

/// An item of a recording.
#[derive(Clone, Copy, Debug)]
pub enum Item<'a> {
    /// UTC at time zero, microseconds since 1970.
    Epoch(u64),
    /// A MAVLink frame as received. Its contents follow as items of their own.
    Frame(&'a Frame<'a>),
    /// A report of a vehicle, in SI units.
    Observation(Source, &'a Observation),
    /// A parameter of the autopilot.
    Parameter(Parameter<'a>),
    /// A whole text: long ones are put together. The time is the first part's, so it may be a second back.
    Text(Text<'a>),
    /// The flight mode, at each report of it.
    Mode(Mode<'a>),
    /// An event that has a number.
    Event(Event<'a>),
    /// A fact about the vehicle or the recording.
    Fact(Fact<'a>),
    /// One message of a format other than MAVLink, with its own names and units.
    Row(Row<'a>),
    /// A record of the monitor's own: only logs of HUMS have them.
    Record(&'a Record<'a>),
    /// Something is missing or damaged here.
    Gap(&'a Gap),
    /// The recording's clock began again: another power-on of the recorder. Time goes on from its last value.
    Restart,
    /// Another recording was joined on here: the recorder's clock and the autopilot's changed together. Its
    /// clock begins again, as with [`Item::Restart`], and all earlier state is void.
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
    /// `MAV_SEVERITY`: 0 is an emergency, 7 is for debugging.
    pub severity: u8,
    /// Words of the world, never markup.
    pub words: &'a str,
    /// The alert in the text: an [`Observation::Alert`] of its own, which the monitor takes.
    pub alert: Option<Alert>,
}

/// A flight mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode<'a> {
    /// The autopilot's own number.
    pub number: u32,
    /// Its name, if known.
    pub name: Option<&'a str>,
}

/// An event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event<'a> {
    /// Who.
    pub source: Source,
    /// Its number: `PX4`'s event id; of `ArduPilot`'s `EV` the number, of its `ERR` subsystem times 256 plus code.
    pub number: u32,
    /// `MAV_SEVERITY`.
    pub severity: u8,
    /// Its name or meaning; empty if unknown.
    pub words: &'a str,
    /// The alert in it: as in a [`Text`].
    pub alert: Option<Alert>,
}

/// A fact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fact<'a> {
    /// The subject.
    pub about: About,
    /// Words of the world.
    pub words: &'a str,
}

/// The subject of a fact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum About {
    /// The autopilot's firmware with its version: `ArduCopter V4.6.0 (3fc7011a)`.
    Firmware,
    /// The autopilot's hardware: `PX4_FMU_V5`.
    Hardware,
    /// The airframe: `QUAD/X`.
    Frame,
    /// The recorder: program or device.
    Recorder,
    /// Names of the autopilot's unresolved failsafes, with `, ` between; empty without any. It holds from
    /// here on.
    Failsafes,
    /// An emergency that happens here, in which the autopilot stops the motors at once, by its name.
    Emergency,
    /// A fault after which the autopilot's processor restarted, from its own log: a sentence.
    ProcessorFault,
    /// The source of the arming state, if the recording does not report it: a sentence. Empty if it does.
    Arming,
    /// Parts of the recording that cannot be checked for damage: a sentence.
    Unchecked,
    /// Harmless bytes before the first frame: a sentence.
    Beginning,
}

/// The columns of the rows of one name. In one recording a name has one table for ever: a definition that changes its
/// columns gets a name of its own (`ATT_2`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Table {
    /// Its name, safe in a file's name: letters, digits, `_`, `-`.
    pub name: String,
    /// Its columns.
    pub columns: Vec<Column>,
}

impl Table {
    /// The name of a recording's next table, or of a table's next column: the first of `name`, `name_2` and
    /// so on that is free.
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

/// One column. An array is a column for each element: `q[0]`, `q[1]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// The unit of the values here, after multipliers; empty if unknown.
    pub unit: String,
    /// The type of its values.
    pub kind: Kind,
}

/// The columns of a table that is being made. Their names differ: a label that comes twice in a recording gets a number.
#[derive(Debug, Default)]
pub struct Columns {
    columns: Vec<Column>,
    taken: BTreeSet<String>,
}

impl Columns {
    /// Adds a column.
    pub fn push(&mut self, name: &str, unit: &str, kind: Kind) {
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
pub enum Kind {
    /// [`Value::Unsigned`]
    Unsigned,
    /// [`Value::Signed`]
    Signed,
    /// [`Value::Single`]
    Single,
    /// [`Value::Double`]
    Double,
    /// [`Value::Flag`]
    Flag,
    /// [`Value::Text`]
    Text,
    /// [`Value::Bytes`]
    Bytes,
}

/// One row, with one value for each column of its table. The value is of its column's kind or [`Value::Unknown`]; or
/// [`Value::Text`], if a text log has a text in place of a number.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    /// Its table. The same table is the same `Arc`.
    pub table: &'a Arc<Table>,
    /// Its values.
    pub values: &'a [Value<'a>],
}

/// One value of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value<'a> {
    /// Not there.
    Unknown,
    /// An unsigned integer.
    Unsigned(u64),
    /// An integer.
    Signed(i64),
    /// A number of single precision.
    Single(f32),
    /// A number of double precision.
    Double(f64),
    /// Yes or no.
    Flag(bool),
    /// Words.
    Text(&'a str),
    /// Bytes that are not text: part of a file's content. Their column is of [`Kind::Bytes`].
    Bytes(&'a [u8]),
}

impl Value<'_> {
    /// As a number, if it is one.
    pub fn number(self) -> Option<f64> {
        Some(match self {
            Self::Unsigned(value) => value as f64,
            Self::Signed(value) => value as f64,
            Self::Single(value) => f64::from(value),
            Self::Double(value) => value,
            Self::Flag(value) => f64::from(u8::from(value)),
            Self::Unknown | Self::Text(_) | Self::Bytes(_) => return None,
        })
    }
}

/// Something is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gap {
    /// The last time before it, if any.
    pub from: Option<Instant>,
    /// The first time after it, if known.
    pub to: Option<Instant>,
    /// Why.
    pub cause: Cause,
    /// Place in the file (uncompressed), in bytes from its beginning.
    pub place: Option<u64>,
    /// Number of unreadable bytes.
    pub bytes: u64,
    /// The data found there, as the end of a sentence: `a length of 3 bytes for FMT`.
    pub words: String,
    /// The gap as in a HUMS log, with counts of sectors and frames.
    pub own: Option<hums_blackbox::Gap>,
}

impl Gap {
    /// A gap after this time, without an end, a place or a size.
    pub const fn new(from: Option<Instant>, cause: Cause, words: String) -> Self {
        Self { from, to: None, cause, place: None, bytes: 0, words, own: None }
    }

    /// The data from this time and place on are damaged; no byte of them is passed over.
    pub const fn damaged(at: Instant, place: u64, words: String) -> Self {
        Self::new(Some(at), Cause::Damaged, words).at(place)
    }

    /// The same gap at this place.
    #[must_use]
    pub const fn at(mut self, place: u64) -> Self {
        self.place = Some(place);
        self
    }

    /// Whether it is only noise: bytes that are not part of a frame.
    pub fn is_noise(&self) -> bool {
        self.cause == Cause::Lost && self.bytes > 0
    }

    /// In the form of our logs, without place and words.
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

/// Why something is missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// The file is damaged here.
    Damaged,
    /// The file ends in the middle of something.
    Cut,
    /// The recorder lost something while it recorded, by its own record.
    Lost,
    /// The recorder left it out on purpose.
    NotKept,
    /// A silence in the air, after which the vehicle was not seen to fly on: the end of the flight is
    /// unknown.
    Silent,
    /// No message of the recording, or of a part of it, has a time: the data have no order.
    NoTimes,
}

impl Cause {
    /// Whether the recording has less than it should: exit code 3. A message cut off by the end is what a
    /// power-off leaves.
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

/// The needs of a command. A reader may leave out unwanted data, and should if that saves time: unwanted
/// messages are skipped by their length. Items without a switch here are always handed on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Want<'a> {
    /// [`Item::Frame`]
    pub frames: bool,
    /// [`Item::Observation`]
    pub observations: bool,
    /// [`Item::Row`]: the wanted tables.
    pub rows: Rows<'a>,
    /// The only wanted vehicle in a recording of a link, by system id: messages of other autopilots are left
    /// out.
    pub system: Option<u8>,
}

impl Want<'_> {
    /// Whether this source is left out: it is another vehicle's autopilot.
    pub fn leaves_out(&self, source: Source) -> bool {
        source.component == AUTOPILOT && self.system.is_some_and(|system| system != source.system)
    }
}

/// Which rows are wanted.
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

/// Callback for each item with its time. An error of it ends the reading and is handed on; [`Stop`] is not a
/// failure.
pub type Take<'a> = dyn FnMut(Instant, Item<'_>) -> Result<()> + 'a;

/// Hands on a text or an event, after its alert if observations are wanted.
pub fn hand_said(at: Instant, item: Item<'_>, want_observations: bool, take: &mut Take<'_>) -> Result<()> {
    if let Item::Text(Text { source, alert: Some(alert), .. })
    | Item::Event(Event { source, alert: Some(alert), .. }) = item
        && want_observations
    {
        take(at, Item::Observation(source, &Observation::Alert(alert)))?;
    }
    take(at, item)
}

/// The error of a [`Take`] that has had enough.
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
    /// Its MAVLink id, and whether the checksum matches the recorder's definition; `None` in an autopilot's
    /// own log.
    pub id: Option<(u32, bool)>,
    /// Its name.
    pub name: String,
    /// Number and size.
    pub amount: Amount,
}

/// Totals of a reading.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Messages by name, unwanted ones too: in order of their ids, or of their names without ids.
    pub messages: Vec<MessageCount>,
    /// Messages of further ids, beyond the limit of ids counted one by one.
    pub other_messages: Amount,
    /// Invalid frames in entries of a HUMS log.
    pub not_frames: u64,
    /// The first and the last time of the frames, rows and observations that were handed on.
    pub span: Option<(Instant, Instant)>,
    /// Gaps that are damage.
    pub gaps: u64,
    /// Losses reported by the recorder.
    pub losses: u64,
    /// The evidence of its end, for a HUMS log.
    pub ending: Option<Ending>,
}

/// Reads one recording, once.
pub trait Reader: Send {
    /// Reads it from its beginning to its end.
    fn read(&mut self, want: Want<'_>, take: &mut Take<'_>) -> Result<Summary>;
}
