//! The monitor's own records: recorder, vehicle, parameters, findings, counters and losses.
//!
//! Stored form (`stored`): a head, then numbers of 4 bytes, numbers of 2 bytes, and bytes, each in the order of the
//! fields and little endian. A text is its length (u8) and its UTF-8 bytes. A later version may only append to each
//! of the three, so a reader of version n reads n + 1. An unknown kind becomes `Record::Unknown`, and the log stays
//! decodable.

mod boot;
mod finding;
mod keep;
mod loss;
mod mark;
mod snapshot;
mod stored;
mod usage;
mod vehicle;
mod wear;

use core::fmt;

pub use crate::limits::{NAME_BYTES_MAX, RECORD_BYTES_MAX, TEXT_BYTES_MAX};
pub use boot::{Boot, Fault, LastSession, PreviousEnd};
pub use finding::{Event, FindingRecord, Note};
pub use keep::Keep;
pub use loss::{Loss, LossKind, Stats};
pub use mark::{Mark, MarkReason};
pub use snapshot::{Protection, Snapshot, SnapshotValues};
pub use usage::{LIFETIME_ENTRIES_MAX, Lifetime, Moment, USAGE_ENTRIES_MAX, Usage};
pub use vehicle::{Clock, Parameter, Vehicle};
pub use wear::{Component, Exceedance, RecordReason};

use stored::{Fields, Sink};
pub(crate) use stored::{HEAD_BYTES, Shape};

// The longest records: a boot and a fault.
const _: () = assert!(HEAD_BYTES + 7 * 4 + 4 * (1 + NAME_BYTES_MAX) + 13 <= RECORD_BYTES_MAX);
const _: () =
    assert!(HEAD_BYTES + 12 * 4 + 1 + 2 * (1 + NAME_BYTES_MAX) + 1 + TEXT_BYTES_MAX <= RECORD_BYTES_MAX);

/// One record; numbers of kinds never change meaning.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Record<'a> {
    /// Kind 1: the monitor started.
    Boot(Boot<'a>),
    /// Kind 2: the recorded vehicle, as far as known.
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
    /// Kind 12: the airframe's life.
    Lifetime(Lifetime<'a>),
    /// Kind 13: limits of one check that were crossed.
    Exceedance(Exceedance<'a>),
    /// Kind 14: a part that wears.
    Component(Component<'a>),
    /// Kind 15: the stored part of the session.
    Keep(Keep),
    /// Kind 16: half of a snapshot around a critical finding.
    Snapshot(Snapshot<'a>),
    /// Kind 17: a step of the protective action.
    Protection(Protection),
    /// Kind 18: the log is whole up to here.
    Mark(Mark),
    /// Unknown to this reader.
    Unknown {
        /// The stored kind.
        kind: u8,
        /// The stored version.
        version: u8,
        /// The rest of the head, numbers, bytes.
        bytes: &'a [u8],
    },
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
    /// Returns its length.
    pub fn store(&self, out: &mut [u8; RECORD_BYTES_MAX]) -> Result<usize, TooLong> {
        let mut sink = Sink::new(out);
        match self {
            Self::Boot(boot) => boot.store(&mut sink),
            Self::Vehicle(vehicle) => vehicle.store(&mut sink),
            Self::Parameter(parameter) => parameter.store(&mut sink),
            Self::Clock(clock) => clock.store(&mut sink),
            Self::Finding(finding) => finding.store(&mut sink),
            Self::Usage(usage) => usage.store(&mut sink),
            Self::Loss(loss) => loss.store(&mut sink),
            Self::Stats(stats) => stats.store(&mut sink),
            Self::Fault(fault) => fault.store(&mut sink),
            Self::Event(event) => event.store(&mut sink),
            Self::Note(note) => note.store(&mut sink),
            Self::Lifetime(lifetime) => lifetime.store(&mut sink),
            Self::Exceedance(exceedance) => exceedance.store(&mut sink),
            Self::Component(component) => component.store(&mut sink),
            Self::Keep(keep) => keep.store(&mut sink),
            Self::Snapshot(snapshot) => snapshot.store(&mut sink),
            Self::Protection(protection) => protection.store(&mut sink),
            Self::Mark(mark) => mark.store(&mut sink),
            Self::Unknown { kind, version, bytes } => {
                sink.bytes(&[*kind, *version]).bytes(bytes);
            }
        }
        sink.len().ok_or(TooLong)
    }

    /// Missing bytes read as zeros and empty texts; an unknown record is `Unknown`.
    pub fn read(stored: &'a [u8]) -> Self {
        let (Shape { kind, version, .. }, mut fields) = Fields::new(stored);
        let fields = &mut fields;
        let unknown = Self::Unknown { kind, version, bytes: stored.get(2..).unwrap_or_default() };
        match kind {
            1 => Self::Boot(Boot::read(fields)),
            2 => Self::Vehicle(Vehicle::read(fields)),
            3 => Self::Parameter(Parameter::read(fields)),
            4 => Self::Clock(Clock::read(fields)),
            5 => FindingRecord::read(fields).map_or(unknown, Self::Finding),
            6 => Self::Usage(Usage::read(fields)),
            7 => Self::Loss(Loss::read(fields)),
            8 => Self::Stats(Stats::read(fields)),
            9 => Self::Fault(Fault::read(fields)),
            10 => Self::Event(Event::read(fields)),
            11 => Self::Note(Note::read(fields)),
            12 => Self::Lifetime(Lifetime::read(fields)),
            13 => Self::Exceedance(Exceedance::read(fields)),
            14 => Self::Component(Component::read(fields)),
            15 => Self::Keep(Keep::read(fields)),
            16 => Snapshot::read(fields).map_or(unknown, Self::Snapshot),
            17 => Protection::read(fields).map_or(unknown, Self::Protection),
            18 => Mark::read(fields).map_or(unknown, Self::Mark),
            _ => unknown,
        }
    }
}

#[cfg(test)]
mod tests {
    use hums_core::clock::Instant;
    use hums_core::component::{ComponentFigures, ComponentKind, Status};
    use hums_core::health::exceedance::Crossings;
    use hums_core::health::{Level, Subsystem};
    use hums_core::protect::{Action, Stage};

    use super::*;

    fn reads_back(record: Record<'_>) {
        let mut stored = [0; RECORD_BYTES_MAX];
        let len = record.store(&mut stored).expect("fits");
        assert_eq!(Record::read(&stored[..len]), record);
        for cut in 0..len {
            let _ = Record::read(&stored[..cut]);
        }
    }

    const AT: Instant = Instant::from_micros(1_234_567);
    const ENTRIES: [(u8, f32); 5] = [(1, 12.25), (2, f32::MAX), (3, 0.0), (255, 1.0), (0, -1.0)];

    #[test]
    fn who_recorded_whom_and_what_was_found_read_back() {
        let at = AT;
        reads_back(Record::Boot(Boot {
            version: "0.1.0",
            git: "abcdef",
            board: "f405",
            reset: 7,
            reset_name: "pin",
            uid: *b"123456789012",
            boots: 99,
            before: LastSession {
                found: PreviousEnd::Frames,
                number: 7,
                session: 0xfeed,
                sectors: 99,
                frames: 12_345,
                check: 0xfedc_ba98,
            },
        }));
        reads_back(Record::Mark(Mark { why: MarkReason::Landed, sector: 70_000, frames: u32::MAX }));
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
    }

    #[test]
    fn what_was_counted_lost_and_worn_reads_back() {
        let (at, entries) = (AT, ENTRIES);
        reads_back(Record::Usage(Usage::new(Moment::End, &entries)));
        reads_back(Record::Loss(Loss { what: LossKind::QueueFull, count: 3, from: Instant::ZERO, to: at }));
        reads_back(Record::Stats(Stats { frames_in: 1, gs_bytes: 12, ..Stats::default() }));
        reads_back(Record::Stats(Stats { frames_in: 1, cpu_permille: 20, ..Stats::default() }));
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
        let life = hums_core::lifetime::Lifetime { boots: 7, sessions: 5, ..Default::default() };
        reads_back(Record::Lifetime(Lifetime::new(Moment::Start, &life, &entries)));
        let crossings =
            |peak| Crossings { warnings: 3, criticals: 1, warning_tenths: 99, critical_tenths: 12, peak };
        reads_back(Record::Exceedance(Exceedance {
            moment: Moment::End,
            check: "vibration",
            instance: 2,
            unit: "m/s2",
            session: crossings(61.5),
            lifetime: crossings(70.25),
        }));
        reads_back(Record::Component(Component {
            why: RecordReason::Replaced,
            place: 7,
            kind: ComponentKind::Propeller,
            number: 4,
            status: Status::Red,
            replaced: 3,
            name: "prop 4",
            serial: "SN 1",
            figures: ComponentFigures { flight_s: 3_600.5, flights: 12.0, ..ComponentFigures::default() },
            used_percent: 101.0,
            by: (255, 190),
            new_serial: "SN 2",
        }));
        reads_back(Record::Keep(Keep { all: true, from: 70_000, seconds: 30 }));
        let (action, stage) = (Action::Land, Stage::Answered);
        reads_back(Record::Protection(Protection { action, stage, detail: 4, command: 21 }));
        reads_back(Record::Unknown { kind: 200, version: 3, bytes: &[1, 2, 3] });
    }

    #[test]
    fn a_later_version_with_more_fields_reads_as_far_as_it_is_known() {
        let stored = [10, 2, 0, 0, 5, 1, b'a', 0xee, 0xee];
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
