//! Facts from a log's own records.

use hums_blackbox::Record;
use hums_blackbox::record::{LastSession, MarkReason, PreviousEnd};
use hums_core::clock::Instant;

use crate::loss::lost;

const ARMED: u8 = 1;
/// Number of the event.
pub const TAKE_OFF: u8 = 3;
/// Number of the event.
pub const LANDING: u8 = 4;
pub(super) const CARD_OUT: u8 = 7;
pub(super) const REFUSED: &str = "card_errors";
/// Event: started in the air.
pub const RESUMED: u8 = 14;

/// Note at a packed log's beginning.
pub const PACKED: &str = "packed on a PC by hums decode --format hum";

/// Facts from a part of a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(clippy::struct_excessive_bools, reason = "facts that have nothing to do with each other")]
pub struct Marks {
    /// End marks.
    pub count: u64,
    /// End marks with another count of frames.
    pub wrong: u64,
    /// The last one.
    pub last: Option<(Instant, MarkReason)>,
    /// Arming or take-off after the last mark.
    pub moved: Option<Instant>,
    /// The last take-off or landing is a take-off. A flight's counts are stored at the landing.
    pub took_off: Option<bool>,
    /// Lost frames and records, by the recorder.
    pub lost: u64,
    /// The log before, by the last boot record.
    pub before: Option<LastSession>,
    /// Packed on a PC.
    pub packed: bool,
    /// Recorded by a box.
    pub has_boot: bool,
    /// The card refused blocks.
    pub refused: bool,
    /// Missing or unusable for a while.
    pub card_out: bool,
}

impl Marks {
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
                    Some(boot.before).filter(|before| before.found != PreviousEnd::Unknown).or(self.before);
            }
            _ => {}
        }
    }

    /// An empty file may exist then.
    pub const fn has_card_trouble(&self) -> bool {
        self.refused || self.card_out
    }

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
