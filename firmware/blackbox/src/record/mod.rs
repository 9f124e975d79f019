//! The monitor's own records: recorder, vehicle, parameters, findings, counters and losses.
//!
//! Stored form (`stored`): a head, then numbers of 4 bytes, numbers of 2 bytes, and bytes, each in the order of the
//! fields and little endian. A text is its length (u8) and its UTF-8 bytes. A later version may only append to each
//! of the three, so a reader of version n reads n + 1. An unknown kind becomes `Record::Unknown`, and the log stays
//! decodable.

mod boot;
mod finding;
mod loss;
mod mark;
mod protection;
mod stored;
mod usage;
mod vehicle;
mod wear;

use core::fmt;

pub use crate::limits::{NAME_BYTES_MAX, RECORD_BYTES_MAX, TEXT_BYTES_MAX};
pub use boot::{Boot, Fault, LastSession, PreviousEnd};
pub use finding::{Event, FindingRecord, Note};
pub use loss::{Loss, LossKind, Stats};
pub use mark::{Mark, MarkReason};
pub use protection::Protection;
pub use usage::{LIFETIME_ENTRIES_MAX, Lifetime, Moment, USAGE_ENTRIES_MAX, Usage};
pub use vehicle::{Clock, Parameter, Vehicle};
pub use wear::{Component, Exceedance, RecordReason};

use stored::{Field, Fields, Sink};
pub(crate) use stored::{HEAD_BYTES, Shape};

// The longest records: a boot and a fault.
const _: () = assert!(HEAD_BYTES + 7 * 4 + 4 * (1 + NAME_BYTES_MAX) + 13 <= RECORD_BYTES_MAX);
const _: () =
    assert!(HEAD_BYTES + 12 * 4 + 1 + 2 * (1 + NAME_BYTES_MAX) + 1 + TEXT_BYTES_MAX <= RECORD_BYTES_MAX);

macro_rules! records {
    ($($(#[$doc:meta])+ $kind:literal $name:ident($type:ty),)+) => {
        /// One record; numbers of kinds never change meaning.
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[non_exhaustive]
        pub enum Record<'a> {
            $($(#[$doc])+ $name($type),)+
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

        impl<'a> Record<'a> {
            /// Returns its length.
            pub fn store(&self, out: &mut [u8; RECORD_BYTES_MAX]) -> Result<usize, TooLong> {
                let mut sink = Sink::new(out);
                match self {
                    $(Self::$name(record) => sink.record($kind, record),)+
                    Self::Unknown { kind, version, bytes } => {
                        sink.bytes(&[*kind, *version]).bytes(bytes);
                    }
                }
                sink.len().ok_or(TooLong)
            }

            /// Missing bytes read as zeros and empty texts; an unknown record is `Unknown`.
            pub fn read(stored: &'a [u8]) -> Self {
                let (Shape { kind, version, .. }, mut fields) = Fields::new(stored);
                let known = match kind {
                    $($kind => Field::read(&mut fields).map(Self::$name),)+
                    _ => None,
                };
                let bytes = stored.get(2..).unwrap_or_default();
                known.unwrap_or(Self::Unknown { kind, version, bytes })
            }
        }
    };
}

records! {
    /// The monitor started.
    1 Boot(Boot<'a>),
    /// The recorded vehicle, as far as known.
    2 Vehicle(Vehicle),
    /// A parameter's value.
    3 Parameter(Parameter<'a>),
    /// The two clocks at one moment; the reader back-dates the session with it.
    4 Clock(Clock),
    /// A check changed its level.
    5 Finding(FindingRecord<'a>),
    /// Usage counters.
    6 Usage(Usage<'a>),
    /// Something was lost.
    7 Loss(Loss),
    /// The recorder's statistics so far.
    8 Stats(Stats),
    /// How the last boot ended.
    9 Fault(Fault<'a>),
    /// A mark in time, for instance a moment to look at later.
    10 Event(Event<'a>),
    /// Free text.
    11 Note(Note<'a>),
    /// The airframe's life.
    12 Lifetime(Lifetime<'a>),
    /// Limits of one check that were crossed.
    13 Exceedance(Exceedance<'a>),
    /// A part that wears.
    14 Component(Component<'a>),
    /// A step of the protective action; 15 and 16 are retired.
    17 Protection(Protection),
    /// The log is whole up to here.
    18 Mark(Mark),
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

#[cfg(test)]
mod tests {
    use hums_core::clock::Instant;
    use hums_core::component::{ComponentFigures, ComponentKind, Status};
    use hums_core::health::exceedance::Crossings;
    use hums_core::health::{Level, Subsystem};
    use hums_core::protect::{Action, Stage};
    use hums_dialect::crc;

    use super::*;

    fn reads_back(record: Record<'_>, sum: u16) {
        let mut stored = [0; RECORD_BYTES_MAX];
        let len = record.store(&mut stored).expect("fits");
        assert_eq!(Record::read(&stored[..len]), record);
        assert_eq!(
            crc::update(crc::START, &stored[..len]),
            sum,
            "the stored bytes of {record:?} have changed"
        );
        for cut in 0..len {
            let _ = Record::read(&stored[..cut]);
        }
    }

    const AT: Instant = Instant::from_micros(1_234_567);
    const ENTRIES: [(u8, f32); 5] = [(1, 12.25), (2, f32::MAX), (3, 0.0), (255, 1.0), (0, -1.0)];

    #[test]
    fn who_recorded_whom_and_what_was_found_read_back() {
        let at = AT;
        reads_back(
            Record::Boot(Boot {
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
            }),
            0x688d,
        );
        reads_back(Record::Mark(Mark { why: MarkReason::Landed, sector: 70_000, frames: u32::MAX }), 0xce9c);
        reads_back(
            Record::Vehicle(Vehicle {
                system: 1,
                component: 1,
                autopilot: 12,
                vehicle_type: 2,
                firmware: 0x0401_0203,
                uid: u64::MAX,
            }),
            0xe007,
        );
        reads_back(
            Record::Parameter(Parameter { name: "REC_MODE", value: -1.5, changed: true, by: (255, 190) }),
            0xfe21,
        );
        reads_back(Record::Clock(Clock { boot: at, utc_micros: 1_700_000_000_000_000, source: 1 }), 0x1066);
        reads_back(
            Record::Finding(FindingRecord {
                at,
                subsystem: Subsystem::Power,
                check: "batt_remaining",
                instance: 1,
                level: Level::Warning,
                previous: Level::Ok,
                value: 19.5,
                limit: 20.0,
                unit: "%",
            }),
            0x59bd,
        );
    }

    #[test]
    fn what_was_counted_lost_and_worn_reads_back() {
        let (at, entries) = (AT, ENTRIES);
        reads_back(Record::Usage(Usage::new(Moment::End, &entries)), 0x5341);
        reads_back(
            Record::Loss(Loss { what: LossKind::QueueFull, count: 3, from: Instant::ZERO, to: at }),
            0x7651,
        );
        reads_back(Record::Stats(Stats { frames_in: 1, gs_bytes: 12, ..Stats::default() }), 0x8014);
        reads_back(Record::Stats(Stats { frames_in: 1, cpu_permille: 20, ..Stats::default() }), 0x74dc);
        let registers = core::array::from_fn(|index| index as u32);
        reads_back(
            Record::Fault(Fault { kind: 1, task: "storage", place: "card.rs:7", registers, message: "x" }),
            0xb7c8,
        );
        reads_back(Record::Event(Event { number: 5, text: "look" }), 0xa398);
        reads_back(Record::Note(Note { severity: 6, text: "grüß" }), 0x279c);
        let life = hums_core::lifetime::Lifetime { boots: 7, sessions: 5, ..Default::default() };
        reads_back(Record::Lifetime(Lifetime::new(Moment::Start, &life, &entries)), 0x11e1);
        let crossings =
            |peak| Crossings { warnings: 3, criticals: 1, warning_tenths: 99, critical_tenths: 12, peak };
        reads_back(
            Record::Exceedance(Exceedance {
                moment: Moment::End,
                check: "vibration",
                instance: 2,
                unit: "m/s2",
                session: crossings(61.5),
                lifetime: crossings(70.25),
            }),
            0xca4b,
        );
        reads_back(
            Record::Component(Component {
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
            }),
            0x5616,
        );
        let (action, stage) = (Action::Land, Stage::Answered);
        reads_back(Record::Protection(Protection { action, stage, detail: 4, command: 21 }), 0x1a6d);
        reads_back(Record::Unknown { kind: 200, version: 3, bytes: &[1, 2, 3] }, 0x5fe5);
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
