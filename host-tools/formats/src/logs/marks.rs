//! Facts about a log from its own records. They are its end marks, movement after the last one, the
//! recorder's losses, and the end of the log before it on the card.

use hums_blackbox::Record;
use hums_blackbox::record::{Before, Found, Resting};
use hums_core::clock::Instant;

use crate::loss::lost;

/// The number of the event of arming.
const ARMED: u8 = 1;
/// The number of the event of a take-off.
pub const TAKE_OFF: u8 = 3;
/// The number of the event of a landing.
pub const LANDING: u8 = 4;
/// The number of the event for a missing or unusable card.
pub(super) const CARD_OUT: u8 = 7;
/// The check that finds that the card refused blocks.
pub(super) const REFUSED: &str = "card_errors";
/// The box was started in the air.
pub const RESUMED: u8 = 14;

/// The note that a packed log begins with.
pub const PACKED: &str = "packed on a PC by hums decode --format hum";

/// Facts about a log from the records of a part of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(clippy::struct_excessive_bools, reason = "facts that have nothing to do with each other")]
pub struct Marks {
    /// Number of end marks.
    pub count: u64,
    /// Number of end marks with a different count of frames.
    pub wrong: u64,
    /// The last one.
    pub last: Option<(Instant, Resting)>,
    /// The first time after it that the vehicle was armed or took off.
    pub moved: Option<Instant>,
    /// Whether the last take-off or landing is a take-off. The box stores its counts of a flight at the
    /// landing.
    pub took_off: Option<bool>,
    /// Frames and records that the recorder lost, by its own records.
    pub lost: u64,
    /// The log before on the card, as the last boot record found it.
    pub before: Option<Before>,
    /// No recorder made it: it was packed on a PC.
    pub packed: bool,
    /// A box recorded it: it has the record of its start.
    pub has_boot: bool,
    /// The card refused blocks: its recorder found that.
    pub refused: bool,
    /// The card was missing or unusable for a while.
    pub card_out: bool,
}

impl Marks {
    /// Takes the next record; `frames` of the session were read before it, modulo 2^32.
    pub(super) fn record(&mut self, at: Instant, record: &Record<'_>, frames: u32) {
        match record {
            Record::Mark(mark) => {
                self.count += 1;
                self.wrong += u64::from(mark.frames != frames);
                (self.last, self.moved) = (Some((at, mark.why)), None);
            }
            Record::Event(event) if matches!(event.number, ARMED | TAKE_OFF | RESUMED) => {
                self.moved = self.moved.or(Some(at));
                self.took_off = (event.number != ARMED).then_some(true).or(self.took_off);
            }
            Record::Event(event) if event.number == LANDING => self.took_off = Some(false),
            Record::Event(event) if event.number == CARD_OUT => self.card_out = true,
            Record::Finding(finding) => self.refused |= finding.check == REFUSED,
            Record::Loss(loss) => self.lost = self.lost.saturating_add(lost(loss)),
            Record::Note(note) => self.packed |= note.text == PACKED,
            Record::Boot(boot) => {
                self.has_boot = true;
                self.before =
                    Some(boot.before).filter(|before| before.found != Found::Unknown).or(self.before);
            }
            _ => {}
        }
    }

    /// Whether the records report that the card took no data for a while. Then an empty file may exist.
    pub const fn has_card_trouble(&self) -> bool {
        self.refused || self.card_out
    }

    /// Adds the facts from the next part.
    pub(super) fn add(&mut self, next: &Self) {
        self.count += next.count;
        self.wrong += next.wrong;
        self.lost = self.lost.saturating_add(next.lost);
        self.has_boot |= next.has_boot;
        self.refused |= next.refused;
        self.card_out |= next.card_out;
        self.packed |= next.packed;
        self.took_off = next.took_off.or(self.took_off);
        self.before = next.before.or(self.before);
        if next.last.is_some() {
            (self.last, self.moved) = (next.last, next.moved);
        } else {
            self.moved = self.moved.or(next.moved);
        }
    }
}
