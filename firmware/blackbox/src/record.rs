//! The monitor's own records: who recorded what, with which parameters, what it found, counted and lost.
//!
//! Stored form: `kind u8, version u8`, then the fields in the order below, little endian; a text is its length (u8)
//! and its UTF-8 bytes. A later version may only append fields, so a reader of version n reads n + 1; a kind that it
//! does not know is given out as `Record::Unknown` and stays decodable.

use core::fmt;

use hums_core::health::{Finding, Level, Subsystem};
use hums_core::time::Instant;

use crate::bytes::{Fields, Sink};

/// The longest stored record, kind and version included. A longer one is refused (`TooLong`).
pub const RECORD_BYTES_MAX: usize = 512;

/// The longest text (a message, a note) in a record; longer ones are cut at a character's border.
pub const TEXT_BYTES_MAX: usize = 200;

/// The longest name (a version, a parameter, a place in the source) in a record; longer ones are cut likewise.
pub const NAME_BYTES_MAX: usize = 96;

// The longest records: a boot and a fault.
const _: () = assert!(2 + 4 * (1 + NAME_BYTES_MAX) + 4 + 12 + 4 <= RECORD_BYTES_MAX);
const _: () = assert!(2 + 1 + 2 * (1 + NAME_BYTES_MAX) + 12 * 4 + 1 + TEXT_BYTES_MAX <= RECORD_BYTES_MAX);

/// Entries of a usage record at most: its count, kind, version and entries fit `RECORD_BYTES_MAX`.
pub const USAGE_ENTRIES_MAX: usize = 50;

/// One record of the monitor itself. The numbers of the kinds are stored and never change meaning.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Record<'a> {
    /// Kind 1: the monitor started.
    Boot(Boot<'a>),
    /// Kind 2: the vehicle that is recorded, as far as it said.
    Vehicle(Vehicle),
    /// Kind 3: a parameter's value.
    Parameter(Parameter<'a>),
    /// Kind 4: the two clocks at one moment; the reader back-dates the session with it.
    Clock(Clock),
    /// Kind 5: a check changed its level.
    Finding(FindingRecord<'a>),
    /// Kind 6: usage counters.
    Usage(Usage<'a>),
    /// Kind 7: something was lost.
    Loss(Loss),
    /// Kind 8: the recorder's statistics so far.
    Stats(Stats),
    /// Kind 9: how the last boot ended.
    Fault(Fault<'a>),
    /// Kind 10: a mark in time, for instance a moment to look at later.
    Event(Event<'a>),
    /// Kind 11: free text.
    Note(Note<'a>),
    /// A kind that this reader does not know.
    Unknown {
        /// The stored kind.
        kind: u8,
        /// The stored version.
        version: u8,
        /// What follows.
        bytes: &'a [u8],
    },
}

/// The monitor started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Boot<'a> {
    /// The product's version, for instance `0.1.0`.
    pub version: &'a str,
    /// The commit it was built from.
    pub git: &'a str,
    /// The board's name.
    pub board: &'a str,
    /// The reset cause register, or 0.
    pub reset: u32,
    /// The name of the cause.
    pub reset_name: &'a str,
    /// The device's unique id.
    pub uid: [u8; 12],
    /// Boots so far.
    pub boots: u32,
}

/// The vehicle that is recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Vehicle {
    /// MAVLink system id.
    pub system: u8,
    /// MAVLink component id.
    pub component: u8,
    /// `MAV_AUTOPILOT`.
    pub autopilot: u8,
    /// `MAV_TYPE`.
    pub vehicle_type: u8,
    /// `AUTOPILOT_VERSION.flight_sw_version`, 0 where it has not said.
    pub firmware: u32,
    /// `AUTOPILOT_VERSION.uid`, 0 where it has not said.
    pub uid: u64,
}

/// A parameter's value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parameter<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its value; integers are exact up to 2^53.
    pub value: f64,
    /// `false`: part of the table as it stood at the start; `true`: it was changed just now.
    pub changed: bool,
    /// Who changed it: MAVLink system and component id; 0, 0 for the monitor itself.
    pub by: (u8, u8),
}

/// The two clocks at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Clock {
    /// The monitor's clock.
    pub boot: Instant,
    /// UTC at that moment, microseconds since 1970.
    pub utc_micros: u64,
    /// Where UTC came from: 0 unknown, 1 `SYSTEM_TIME`, 2 the recording's own times, 3 GNSS.
    pub source: u8,
}

impl Clock {
    /// UTC at the monitor's power-on, microseconds since 1970.
    pub const fn epoch_micros(&self) -> u64 {
        self.utc_micros.saturating_sub(self.boot.as_micros())
    }
}

/// A check changed its level: `hums_core::health::Finding` with texts of any lifetime.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FindingRecord<'a> {
    /// When, after the debounce.
    pub at: Instant,
    /// The part of the vehicle.
    pub subsystem: Subsystem,
    /// The check's stable name.
    pub check: &'a str,
    /// Which one, where there are several.
    pub instance: u8,
    /// The new level.
    pub level: Level,
    /// The level before.
    pub previous: Level,
    /// The value that decided, in `unit`.
    pub value: f32,
    /// The limit that it crossed, in `unit`.
    pub limit: f32,
    /// The unit of both.
    pub unit: &'a str,
}

impl From<&Finding> for FindingRecord<'static> {
    fn from(finding: &Finding) -> Self {
        Self {
            at: finding.at,
            subsystem: finding.subsystem,
            check: finding.check,
            instance: finding.instance,
            level: finding.level,
            previous: finding.previous,
            value: finding.value,
            limit: finding.limit,
            unit: finding.unit,
        }
    }
}

/// When a usage snapshot was taken. The numbers are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Moment {
    /// At the start of the session.
    Start = 0,
    /// While running.
    #[default]
    Periodic = 1,
    /// At the end of a flight or of the session.
    End = 2,
}

/// The value of a usage counter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UsageValue {
    /// A quantity, in the counter's unit.
    Real(f64),
    /// A count.
    Count(u64),
}

/// Usage counters at one moment: up to `USAGE_ENTRIES_MAX`, more are cut off.
#[derive(Clone, Copy, Debug)]
pub struct Usage<'a> {
    /// When it was taken.
    pub moment: Moment,
    entries: UsageEntries<'a>,
}

#[derive(Clone, Copy, Debug)]
enum UsageEntries<'a> {
    List(&'a [(u8, UsageValue)]),
    /// As stored: number u8, type u8 (0 real, 1 count), value u64.
    Stored(&'a [u8]),
}

const USAGE_ENTRY_BYTES: usize = 10;
const _: () = assert!(4 + USAGE_ENTRIES_MAX * USAGE_ENTRY_BYTES <= RECORD_BYTES_MAX);

impl<'a> Usage<'a> {
    /// A snapshot to be written: counter numbers with their values.
    pub const fn new(moment: Moment, entries: &'a [(u8, UsageValue)]) -> Self {
        Self { moment, entries: UsageEntries::List(entries) }
    }

    /// Counter numbers with their values.
    pub fn iter(&self) -> impl Iterator<Item = (u8, UsageValue)> + 'a {
        let (list, stored) = match self.entries {
            UsageEntries::List(list) => (list, &[][..]),
            UsageEntries::Stored(stored) => (&[][..], stored),
        };
        let stored = stored.chunks_exact(USAGE_ENTRY_BYTES).map(|entry| {
            let mut fields = Fields::new(entry);
            let (number, real, bits) = (fields.u8(), fields.u8() == 0, fields.u64());
            (number, if real { UsageValue::Real(f64::from_bits(bits)) } else { UsageValue::Count(bits) })
        });
        list.iter().copied().chain(stored).take(USAGE_ENTRIES_MAX)
    }
}

impl PartialEq for Usage<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.moment == other.moment && self.iter().eq(other.iter())
    }
}

/// What was lost. The numbers are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Lost {
    /// Bytes that the UART received while nobody fetched them.
    #[default]
    UartOverrun = 0,
    /// Bytes that are no frame.
    NotFrames = 1,
    /// Frames that were cut or damaged.
    DamagedFrames = 2,
    /// Frames for which the queue had no room.
    QueueFull = 3,
    /// Sectors that could not be written.
    Card = 4,
    /// Records for which there was no room.
    Records = 5,
    /// A cause that this reader does not know.
    Other = 255,
}

impl Lost {
    /// The name that reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::UartOverrun => "uart_overrun",
            Self::NotFrames => "bytes_not_frames",
            Self::DamagedFrames => "damaged_frames",
            Self::QueueFull => "queue_full",
            Self::Card => "card",
            Self::Records => "records",
            Self::Other => "other",
        }
    }

    const fn from_number(number: u8) -> Self {
        match number {
            0 => Self::UartOverrun,
            1 => Self::NotFrames,
            2 => Self::DamagedFrames,
            3 => Self::QueueFull,
            4 => Self::Card,
            5 => Self::Records,
            _ => Self::Other,
        }
    }
}

/// Something was lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Loss {
    /// What and why.
    pub what: Lost,
    /// How many bytes, frames, sectors or records.
    pub count: u64,
    /// The first one.
    pub from: Instant,
    /// The last one.
    pub to: Instant,
}

/// The recorder's statistics since power-on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stats {
    /// Frames received.
    pub frames_in: u64,
    /// Frames encoded.
    pub frames_logged: u64,
    /// Frames lost.
    pub frames_lost: u64,
    /// Bytes received.
    pub bytes_in: u64,
    /// Bytes that were no frame.
    pub bytes_not_frames: u64,
    /// Bytes of the sectors made.
    pub bytes_logged: u64,
    /// Blocks written to the card, file system included.
    pub blocks_written: u64,
    /// The fullest the sector queue was, bytes.
    pub queue_bytes_max: u64,
    /// What the sector queue holds, bytes.
    pub queue_bytes_capacity: u64,
    /// The longest the card took for one call, milliseconds.
    pub sd_stall_ms_max: u64,
    /// Frames sent to the ground station.
    pub gs_frames: u64,
    /// Bytes sent to the ground station.
    pub gs_bytes: u64,
}

/// How the last boot ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fault<'a> {
    /// 0 unknown, 1 panic, 2 hard fault, 3 watchdog.
    pub kind: u8,
    /// The task that ran.
    pub task: &'a str,
    /// File and line, or the function.
    pub place: &'a str,
    /// r0-r3, r12, lr, pc, xpsr, then CFSR, HFSR, MMFAR, BFAR.
    pub registers: [u32; 12],
    /// What the panic said.
    pub message: &'a str,
}

/// A mark in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Event<'a> {
    /// Which event: 0 other, 1 armed, 2 disarmed, 3 take-off, 4 landing, 5 snapshot asked for, 6 card in, 7 card out.
    pub number: u8,
    /// More, where there is more to say.
    pub text: &'a str,
}

/// Free text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Note<'a> {
    /// `MAV_SEVERITY`: 0 emergency to 7 debug.
    pub severity: u8,
    /// The text.
    pub text: &'a str,
}

/// The record is longer than `RECORD_BYTES_MAX`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLong;

impl fmt::Display for TooLong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a record may have {RECORD_BYTES_MAX} bytes at most")
    }
}

impl core::error::Error for TooLong {}

impl<'a> Record<'a> {
    /// Writes the stored form; gives its length.
    pub fn store(&self, out: &mut [u8; RECORD_BYTES_MAX]) -> Result<usize, TooLong> {
        let mut sink = Sink::new(out);
        match self {
            Self::Boot(boot) => sink
                .head(1)
                .name(boot.version)
                .name(boot.git)
                .name(boot.board)
                .u32(boot.reset)
                .name(boot.reset_name)
                .bytes(&boot.uid)
                .u32(boot.boots),
            Self::Vehicle(vehicle) => sink
                .head(2)
                .u8(vehicle.system)
                .u8(vehicle.component)
                .u8(vehicle.autopilot)
                .u8(vehicle.vehicle_type)
                .u32(vehicle.firmware)
                .u64(vehicle.uid),
            Self::Parameter(parameter) => sink
                .head(3)
                .name(parameter.name)
                .u64(parameter.value.to_bits())
                .u8(u8::from(parameter.changed))
                .u8(parameter.by.0)
                .u8(parameter.by.1),
            Self::Clock(clock) => {
                sink.head(4).u64(clock.boot.as_micros()).u64(clock.utc_micros).u8(clock.source)
            }
            Self::Finding(finding) => store_finding(finding, &mut sink),
            Self::Usage(usage) => store_usage(usage, &mut sink),
            Self::Loss(loss) => sink
                .head(7)
                .u8(loss.what as u8)
                .u64(loss.count)
                .u64(loss.from.as_micros())
                .u64(loss.to.as_micros()),
            Self::Stats(stats) => {
                sink.head(8);
                stats.numbers().iter().fold(&mut sink, |sink, &number| sink.u64(number))
            }
            Self::Fault(fault) => {
                sink.head(9).u8(fault.kind).name(fault.task).name(fault.place);
                fault.registers.iter().fold(&mut sink, |sink, &register| sink.u32(register));
                sink.text(fault.message)
            }
            Self::Event(event) => sink.head(10).u8(event.number).text(event.text),
            Self::Note(note) => sink.head(11).u8(note.severity).text(note.text),
            Self::Unknown { kind, version, bytes } => sink.u8(*kind).u8(*version).bytes(bytes),
        };
        sink.len().ok_or(TooLong)
    }

    /// Reads the stored form. What is cut short reads as zeros and empty texts; what it does not know, as `Unknown`.
    pub fn read(stored: &'a [u8]) -> Self {
        let mut fields = Fields::new(stored);
        let (kind, version) = (fields.u8(), fields.u8());
        let record = match kind {
            1 => Some(Self::Boot(Boot {
                version: fields.text(),
                git: fields.text(),
                board: fields.text(),
                reset: fields.u32(),
                reset_name: fields.text(),
                uid: fields.array(),
                boots: fields.u32(),
            })),
            2 => Some(Self::Vehicle(Vehicle {
                system: fields.u8(),
                component: fields.u8(),
                autopilot: fields.u8(),
                vehicle_type: fields.u8(),
                firmware: fields.u32(),
                uid: fields.u64(),
            })),
            3 => Some(Self::Parameter(Parameter {
                name: fields.text(),
                value: f64::from_bits(fields.u64()),
                changed: fields.u8() != 0,
                by: (fields.u8(), fields.u8()),
            })),
            4 => Some(Self::Clock(Clock {
                boot: fields.instant(),
                utc_micros: fields.u64(),
                source: fields.u8(),
            })),
            5 => read_finding(&mut fields),
            6 => Some(Self::Usage(read_usage(&mut fields))),
            7 => Some(Self::Loss(Loss {
                what: Lost::from_number(fields.u8()),
                count: fields.u64(),
                from: fields.instant(),
                to: fields.instant(),
            })),
            8 => Some(Self::Stats(Stats::from_numbers(core::array::from_fn(|_| fields.u64())))),
            9 => Some(Self::Fault(Fault {
                kind: fields.u8(),
                task: fields.text(),
                place: fields.text(),
                registers: core::array::from_fn(|_| fields.u32()),
                message: fields.text(),
            })),
            10 => Some(Self::Event(Event { number: fields.u8(), text: fields.text() })),
            11 => Some(Self::Note(Note { severity: fields.u8(), text: fields.text() })),
            _ => None,
        };
        record.unwrap_or(Self::Unknown { kind, version, bytes: stored.get(2..).unwrap_or_default() })
    }
}

fn store_finding<'s, 'b>(finding: &FindingRecord<'_>, sink: &'s mut Sink<'b>) -> &'s mut Sink<'b> {
    sink.head(5)
        .u64(finding.at.as_micros())
        .u8(finding.subsystem as u8)
        .name(finding.check)
        .u8(finding.instance)
        .u8(finding.level as u8)
        .u8(finding.previous as u8)
        .u32(finding.value.to_bits())
        .u32(finding.limit.to_bits())
        .name(finding.unit)
}

/// `None` where its subsystem or a level is one that this reader does not know.
fn read_finding<'a>(fields: &mut Fields<'a>) -> Option<Record<'a>> {
    Some(Record::Finding(FindingRecord {
        at: fields.instant(),
        subsystem: Subsystem::from_number(fields.u8())?,
        check: fields.text(),
        instance: fields.u8(),
        level: Level::from_number(fields.u8())?,
        previous: Level::from_number(fields.u8())?,
        value: f32::from_bits(fields.u32()),
        limit: f32::from_bits(fields.u32()),
        unit: fields.text(),
    }))
}

fn store_usage<'s, 'b>(usage: &Usage<'_>, sink: &'s mut Sink<'b>) -> &'s mut Sink<'b> {
    sink.head(6).u8(usage.moment as u8).u8(usage.iter().count() as u8);
    usage.iter().fold(sink, |sink, (number, value)| {
        let (count, bits) = match value {
            UsageValue::Real(real) => (false, real.to_bits()),
            UsageValue::Count(count) => (true, count),
        };
        sink.u8(number).u8(u8::from(count)).u64(bits)
    })
}

fn read_usage<'a>(fields: &mut Fields<'a>) -> Usage<'a> {
    let moment = match fields.u8() {
        0 => Moment::Start,
        2 => Moment::End,
        _ => Moment::Periodic,
    };
    let count = usize::from(fields.u8());
    Usage { moment, entries: UsageEntries::Stored(fields.bytes(count * USAGE_ENTRY_BYTES)) }
}

impl Stats {
    /// In stored order.
    const fn numbers(&self) -> [u64; 12] {
        [
            self.frames_in,
            self.frames_logged,
            self.frames_lost,
            self.bytes_in,
            self.bytes_not_frames,
            self.bytes_logged,
            self.blocks_written,
            self.queue_bytes_max,
            self.queue_bytes_capacity,
            self.sd_stall_ms_max,
            self.gs_frames,
            self.gs_bytes,
        ]
    }

    const fn from_numbers(numbers: [u64; 12]) -> Self {
        let [
            frames_in,
            frames_logged,
            frames_lost,
            bytes_in,
            bytes_not_frames,
            bytes_logged,
            blocks_written,
            queue_bytes_max,
            queue_bytes_capacity,
            sd_stall_ms_max,
            gs_frames,
            gs_bytes,
        ] = numbers;
        Self {
            frames_in,
            frames_logged,
            frames_lost,
            bytes_in,
            bytes_not_frames,
            bytes_logged,
            blocks_written,
            queue_bytes_max,
            queue_bytes_capacity,
            sd_stall_ms_max,
            gs_frames,
            gs_bytes,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reads_back(record: Record<'_>) {
        let mut stored = [0; RECORD_BYTES_MAX];
        let len = record.store(&mut stored).expect("fits");
        assert_eq!(Record::read(&stored[..len]), record);
        for cut in 0..len {
            let _ = Record::read(&stored[..cut]);
        }
    }

    #[test]
    fn every_kind_reads_back() {
        let at = Instant::from_micros(1_234_567);
        reads_back(Record::Boot(Boot {
            version: "0.1.0",
            git: "abcdef",
            board: "f405",
            reset: 7,
            reset_name: "pin",
            uid: *b"123456789012",
            boots: 99,
        }));
        reads_back(Record::Vehicle(Vehicle {
            system: 1,
            component: 1,
            autopilot: 12,
            vehicle_type: 2,
            firmware: 0x0401_0203,
            uid: u64::MAX,
        }));
        reads_back(Record::Parameter(Parameter {
            name: "REC_MODE",
            value: -1.5,
            changed: true,
            by: (255, 190),
        }));
        reads_back(Record::Clock(Clock { boot: at, utc_micros: 1_700_000_000_000_000, source: 1 }));
        reads_back(Record::Finding(FindingRecord {
            at,
            subsystem: Subsystem::Power,
            check: "batt_remaining",
            instance: 1,
            level: Level::Warning,
            previous: Level::Ok,
            value: 19.5,
            limit: 20.0,
            unit: "%",
        }));
        let entries = [(1, UsageValue::Real(12.25)), (2, UsageValue::Count(u64::MAX))];
        reads_back(Record::Usage(Usage::new(Moment::End, &entries)));
        reads_back(Record::Loss(Loss { what: Lost::QueueFull, count: 3, from: Instant::ZERO, to: at }));
        reads_back(Record::Stats(Stats { frames_in: 1, gs_bytes: 12, ..Stats::default() }));
        let registers = core::array::from_fn(|index| index as u32);
        reads_back(Record::Fault(Fault {
            kind: 1,
            task: "storage",
            place: "card.rs:7",
            registers,
            message: "x",
        }));
        reads_back(Record::Event(Event { number: 5, text: "look" }));
        reads_back(Record::Note(Note { severity: 6, text: "grüß" }));
        reads_back(Record::Unknown { kind: 200, version: 3, bytes: &[1, 2, 3] });
    }

    #[test]
    fn a_later_version_with_more_fields_reads_as_far_as_it_is_known() {
        let stored = [10, 2, 5, 1, b'a', 0xee, 0xee];
        assert_eq!(Record::read(&stored), Record::Event(Event { number: 5, text: "a" }));
    }

    #[test]
    fn long_texts_are_cut_at_a_characters_border() {
        let long = "ä".repeat(300);
        let mut stored = [0; RECORD_BYTES_MAX];
        let len = Record::Note(Note { severity: 0, text: &long }).store(&mut stored).expect("fits");
        assert_eq!(Record::read(&stored[..len]), Record::Note(Note { severity: 0, text: &"ä".repeat(100) }));
        let fault = Fault { task: &long, place: &long, message: &long, ..Fault::default() };
        assert!(Record::Fault(fault).store(&mut stored).is_ok());
    }
}
